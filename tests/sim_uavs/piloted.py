"""A simulated autopilot and the pilot of a platform, joined by the bytes that they exchange: no socket, no clock of its own."""

from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from agents.flight.pilot import Pilot
from dyknow import Sample
from navigation.vehicle import Command, GoToOrder, PositionReport, Report, VelocityReport
from proxies.mavlink.frames import Cutter
from proxies.mavlink.orders import OURSELVES, Errands, OrderOutcome, Target
from proxies.mavlink.reports import VehicleReports
from proxies.mavlink.requests import Requests
from sim_uavs.autopilot.autopilot import Autopilot
from sim_uavs.dynamics.faults import parse_fault
from sim_uavs.dynamics.settings import HomePlace, PersonaName, VehicleConfig

START_US = 1_700_000_000_000_000
HOME = HomePlace(58.0, 15.0, 50.0)
STEP_US = 20_000
NORTH_DEG = 1 / 111_194.9
ME = ("127.0.0.1", 14550)
TARGET = Target(1, 1)


class Piloted:
    """A vehicle that hovers at `height_m`, and the pilot that commands it.

    Attributes:
        sent: the messages of the pilot's orders, in order; requests are not among them.
        notes: what the pilot has told.
    """

    def __init__(
        self,
        persona: PersonaName = "ardupilot",
        *,
        height_m: float = 50.0,
        seed: int = 0,
        asks: bool = True,
        fence_m: float | None = None,
    ) -> None:
        self.now_us = START_US
        self.autopilot = Autopilot(
            VehicleConfig(1, HOME, persona, airborne_m=height_m, seed=seed, peers=(ME,)), START_US
        )
        self.flight, self.settings = self.autopilot.flight, self.autopilot.flight.settings
        if fence_m is not None:
            self.settings.fence_highest_m, self.settings.fence_on = fence_m, 1.0
        self.notes: list[str] = []
        self.pilot = Pilot(control=True, note=self.notes.append, clock=lambda: self.now_us)
        self.sent: list[Any] = []
        self._known, self._errands = VehicleReports(), Errands()
        self._requests = Requests() if asks else None
        self._asked_us = 0
        self._velocity: VelocityReport | None = None
        self._mav = mavlink.MAVLink(None, srcSystem=OURSELVES.system, srcComponent=OURSELVES.component)
        self._reader = mavlink.MAVLink(None)
        self._old = persona == "ardupilot-3.3"
        self.run(3.0)

    def run(self, seconds: float) -> None:
        """Let both live for so long."""
        end_us = self.now_us + round(seconds * 1e6)
        while self.now_us < end_us:
            self.now_us += STEP_US
            self._hear(self.autopilot.on_time(self.now_us))
            self._perform(self._errands.on_time(self.now_us))
            self.pilot.on_time(self.now_us)
            self._ask()

    def until(self, holds: Any, within_s: float = 60.0) -> float:
        """Run until that holds; after how many seconds."""
        since_us = self.now_us
        while not holds():
            assert self.now_us - since_us < within_s * 1e6, "it does not happen"
            self.run(STEP_US / 1e6)
        return (self.now_us - since_us) / 1e6

    def command(self, commands: list[Command]) -> None:
        for command in commands:
            self._perform(self._errands.on_command(command, self._known, TARGET, self.now_us))

    def inject(self, text: str, seconds: float | None = None) -> None:
        until_us = None if seconds is None else self.now_us + round(seconds * 1e6)
        self.autopilot.inject(parse_fault(text), self.now_us, until_us)

    def _hear(self, datagrams: list[tuple[Any, bytes]]) -> None:
        for _, data in datagrams:
            for frame in Cutter().cut(data):
                self._take(self._reader.decode(bytearray(frame.data)))

    def _take(self, message: Any) -> None:
        if message.get_type() == "COMMAND_ACK":
            if self._requests is not None:
                self._requests.on_ack(message)
            self._perform(self._errands.on_ack(message, self.now_us))
        for report in self._known.reports(message, self.now_us):
            self._report(report)

    def _report(self, report: Report) -> None:
        self.command(self.pilot.on_report(report, self.now_us))
        if isinstance(report, VelocityReport):
            self._velocity = report
        elif isinstance(report, PositionReport) and self._velocity is not None and report.altitude_m is not None:
            place = report.latitude_deg, report.longitude_deg, report.altitude_m
            moves = self._velocity.north_m_s, self._velocity.east_m_s, self._velocity.down_m_s
            self.command(self.pilot.on_estimate(Sample(self.now_us, self.now_us, (*place, *moves))))

    def _perform(self, outcome: OrderOutcome) -> None:
        for message in outcome.send:
            self.sent.append(message)
            self._send(message)
        for result in outcome.results:
            self._report(result)

    def _send(self, message: Any) -> None:
        data = message.pack(self._mav, force_mavlink1=self._old)
        self._hear(self.autopilot.on_bytes(bytes(data), ME, self.now_us))

    def _ask(self) -> None:
        if self._requests is None or self.now_us < self._asked_us or self._known.autopilot is None:
            return
        self._asked_us = self.now_us + 2_000_000
        is_positioned, is_homed = self._known.position is not None, self._known.home is not None
        untold = self._known.untold_parameters
        for message in self._requests.messages(TARGET, is_positioned=is_positioned, is_homed=is_homed, untold=untold):
            self._send(message)

    # -- what a test looks at ----------------------------------------------------------------------------------

    @property
    def height_m(self) -> float:
        return self.flight.body.height_m

    def goto(self, north_m: float, height_m: float = 50.0) -> None:
        """Order it to a point north of home."""
        order = GoToOrder(HOME.latitude_deg + north_m * NORTH_DEG, HOME.longitude_deg, HOME.altitude_m + height_m)
        self.command(self.pilot.order(order))

    def divert(self, height_m: float | None) -> None:
        self.command(self.pilot.divert(None if height_m is None else HOME.altitude_m + height_m))
