"""A simulated autopilot and the edge of a platform that commands it, joined by the bytes that they exchange.

What `dyknow.proxies.mavlink.feed` does with a socket and a thread, without either: the vehicle of the simulated world
whose orders fare as those of a persona do. Its reports are stamped by their receiver. No clock of its own.
"""

from dataclasses import replace
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dyknow.navigation.vehicle import Command, HoldOrder, HomeReport, Order, Report
from dyknow.proxies.mavlink.frames import Cutter
from dyknow.proxies.mavlink.lists.vehicle_lists import VehicleLists
from dyknow.proxies.mavlink.orders import Errands, OrderOutcome
from dyknow.proxies.mavlink.reports import VehicleReports
from dyknow.proxies.mavlink.requests import Requests
from dyknow.proxies.mavlink.ways import OURSELVES, Target
from dyknow.sim_uavs.autopilot.autopilot import Autopilot, Sent
from dyknow.sim_uavs.autopilot.personas import PERSONAS
from dyknow.sim_uavs.dynamics.faults import SimulatedFault
from dyknow.sim_uavs.dynamics.flight import Flight, Mode
from dyknow.sim_uavs.dynamics.settings import VehicleConfig
from dyknow.sim_uavs.dynamics.vehicles import TrueState

POLL_US = 50_000
_ASK_AGAIN_US = 2_000_000
_PLATFORM = ("127.0.0.1", 14550)


class SentOrder(NamedTuple):
    """A message of `order`, when it was sent, in which mode the vehicle was then, and which mode it had reported last."""

    at_us: int
    message: Any
    mode: Mode
    told: str
    order: Order


class WiredVehicle:
    """One vehicle, from `now_us` on, heard and commanded over MAVLink.

    Args:
        phase_us: by how much its own 100 ms are behind those of the world.
        asks: whether the platform asks it for messages, its home and its fence.

    Attributes:
        sent: the messages of all orders; requests are not among them.
        deadline_us: when to come back.
    """

    def __init__(self, config: VehicleConfig, now_us: int, *, phase_us: int = 0, asks: bool = True) -> None:
        self._phase_us = phase_us
        self.autopilot = Autopilot(replace(config, peers=(_PLATFORM,)), now_us - phase_us)
        self.sent: list[SentOrder] = []
        self.deadline_us = now_us
        self._known, self._errands = VehicleReports(), Errands()
        self._requests, self._ask_us = Requests() if asks else None, 0
        self._target = Target(config.system_id, mavlink.MAV_COMP_ID_AUTOPILOT1)
        self._is_homed = False
        self.lists = VehicleLists()
        self._order: Order = HoldOrder()
        self._reports: list[Report] = []
        self._stamp_us = now_us
        self._sender = mavlink.MAVLink(None, srcSystem=OURSELVES.system, srcComponent=OURSELVES.component)
        self._reader = mavlink.MAVLink(None)
        self._is_mavlink_1 = PERSONAS[config.persona].is_mavlink_1

    @property
    def flight(self) -> Flight:
        return self.autopilot.flight

    def inject(self, fault: SimulatedFault, now_us: int, until_us: int | None = None) -> None:
        """Begin a fault, until `until_us` or for good."""
        self.autopilot.inject(fault, now_us - self._phase_us, None if until_us is None else until_us - self._phase_us)

    def truth(self, now_us: int) -> TrueState:
        """Fly up to `now_us`; where it is then."""
        return self.autopilot.truth(now_us - self._phase_us)._replace(at_us=now_us)

    def on_time(self, now_us: int, stamp_us: int) -> list[Report]:
        """Fly; what was heard meanwhile, as valid at `stamp_us`."""
        self.deadline_us, self._stamp_us = now_us + POLL_US, stamp_us
        self._hear(self.autopilot.on_time(now_us - self._phase_us), now_us)
        self._perform(self._errands.on_time(now_us), now_us)
        self._ask(now_us)
        self._read_lists(now_us)
        return self._heard()

    def on_command(self, command: Command, now_us: int, stamp_us: int) -> list[tuple[int, Report]]:
        """Send an order; what is heard at once, each with after how long. The answer may come later."""
        self._stamp_us, self._order = stamp_us, command.order
        self._perform(self._errands.on_command(command, self._known, self._target, now_us), now_us)
        return [(0, report) for report in self._heard()]

    def _heard(self) -> list[Report]:
        reports, self._reports = self._reports, []
        return reports

    def _hear(self, datagrams: Sent, now_us: int) -> None:
        for _, data in datagrams:
            for frame in Cutter().cut(data):
                self._take(self._reader.decode(bytearray(frame.data)), now_us)

    def _take(self, message: Any, now_us: int) -> None:
        if message.get_type() == "COMMAND_ACK":
            if self._requests is not None and self._requests.on_ack(message):
                self._ask_us = now_us
            self._perform(self._errands.on_ack(message, now_us), now_us)
        self._reports += self.lists.on_message(message, self._known, self._stamp_us)
        self._read_lists(now_us)
        for report in self._known.reports(message, self._stamp_us):
            self._is_homed |= isinstance(report, HomeReport)
            self._reports.append(report)

    def _perform(self, outcome: OrderOutcome, now_us: int) -> None:
        for message in outcome.send:
            self.sent.append(SentOrder(now_us, message, self.flight.mode, self._known.mode, self._order))
            self._send(message, now_us)
        self._reports += [result._replace(valid_us=self._stamp_us) for result in outcome.results]

    def _send(self, message: Any, now_us: int) -> None:
        data = bytes(message.pack(self._sender, force_mavlink1=self._is_mavlink_1))
        self._hear(self.autopilot.on_bytes(data, _PLATFORM, now_us - self._phase_us), now_us)

    def _read_lists(self, now_us: int) -> None:
        """Read on in its fence and its mission as the feed does."""
        if self._requests is not None and self._known.autopilot is not None and not self._is_mavlink_1:
            for message in self.lists.due(self._target, now_us):
                self._send(message, now_us)

    def _ask(self, now_us: int) -> None:
        """Ask for messages as the feed does: when the vehicle is met, and every two seconds for what does not come."""
        if self._requests is None or now_us < self._ask_us or self._known.autopilot is None:
            return
        self._ask_us = now_us + _ASK_AGAIN_US
        asked = self._requests.messages(
            self._target,
            is_positioned=self._known.position is not None,
            is_homed=self._is_homed,
            untold=self._known.untold_parameters,
        )
        for message in asked:
            self._send(message, now_us)
