"""A vehicle on MAVLink as its platform sees it: reports are posted, orders are carried out.

Stamp, map, post: everything else is elsewhere (frames, units, clocks, orders). All of it happens in the port's thread,
but for `command`, which sends from the caller's thread and returns at once.
"""

import threading
import time
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dyknow.navigation.vehicle import (
    Command,
    CommandResult,
    FixReport,
    HomeReport,
    LinkReport,
    PositionReport,
    Report,
    StationReport,
)
from dyknow.proxies.mavlink.condition import VehicleCondition
from dyknow.proxies.mavlink.device_clock import DeviceClock
from dyknow.proxies.mavlink.lists.item_list import speaks_mavlink_2
from dyknow.proxies.mavlink.lists.vehicle_lists import VehicleLists
from dyknow.proxies.mavlink.orders import Errands, OrderOutcome
from dyknow.proxies.mavlink.port import TOO_MUCH_TRAFFIC, MavlinkPort
from dyknow.proxies.mavlink.reports import VehicleReports, device_us, flight_mode, is_autopilot, tells_time
from dyknow.proxies.mavlink.requests import Requests
from dyknow.proxies.mavlink.traffic import TRAFFIC_NAMES, TrafficHearing
from dyknow.proxies.mavlink.ways import Target

_ASK_AGAIN_US = 2_000_000
_AUTOPILOT = 1


class MavlinkFeed:
    """Hears one vehicle.

    Args:
        endpoint: as `dyknow.proxies.mavlink.endpoints` reads it, or a `MavlinkPort` shared with other feeds.
        sysid: the vehicle's system id; None takes the first autopilot heard that no other feed has.
        post: takes a report; must not block. Reports of one message come in one go, velocity before position.
        now_us: federation time.
        compid: the autopilot's component id; None: 1, or that of the only component that says it is an autopilot.
        key: 32 bytes of MAVLink signing, for an endpoint given as text.
        driven: the vehicle's clock is federation time (simulated vehicles); see `DeviceClock`.
        requests: ask the vehicle for the messages that are fused; without it the feed only listens.
    """

    def __init__(
        self,
        endpoint: str | MavlinkPort,
        sysid: int | None,
        post: Callable[[Report], None],
        now_us: Callable[[], int],
        *,
        compid: int | None = None,
        key: bytes | None = None,
        driven: bool = False,
        requests: bool = True,
    ) -> None:
        self.port = endpoint if isinstance(endpoint, MavlinkPort) else MavlinkPort(endpoint, key=key)
        self.system, self.component = sysid, compid
        self.known = VehicleReports()
        self.clock = DeviceClock(driven=driven)
        self._post, self._now_us, self._requests = post, now_us, requests
        self._errands, self._lock = Errands(), threading.Lock()
        self._condition = VehicleCondition(self.port.hearing, sysid, compid)
        self._asking = Requests()
        self._lists, self._has_lists = VehicleLists(), False
        self._traffic, self._refused = TrafficHearing(), 0
        self._ask_us = 0
        self._reboots = 0
        self._clock_words = ""
        self._positioned = self._homed = False

    def start(self) -> None:
        self.port.attach(self)

    def stop(self) -> None:
        self.port.detach(self)

    def command(self, command: Command) -> None:
        """Carry out an order; its `CommandResult` is posted. Returns at once."""
        if self.system is None:
            self._post(CommandResult(self._now_us(), command.number, False, "no vehicle heard"))
            return
        with self._lock:
            target = self._target(self.system)
            outcome = self._errands.on_command(command, self.known, target, _wall_us())
        self._perform(outcome)

    def takes_positions(self, mode: int, kind: int) -> bool:
        """Whether the vehicle takes positions in a mode by its number; PX4 numbers a mode, and its kind within that."""
        known = self.known
        if known.autopilot is None or known.vehicle_type is None:
            return False
        is_px4 = known.autopilot == mavlink.MAV_AUTOPILOT_PX4 and mode < 1 << 16
        return flight_mode(known.autopilot, known.vehicle_type, mode << 16 | kind << 24 if is_px4 else mode)[1]

    def on_adopted(self, system: int, component: int) -> None:
        self.system, self.component = system, component

    def _target(self, system: int) -> Target:
        return Target(system, _AUTOPILOT if self.component is None else self.component)

    def on_message(self, message: Any) -> None:
        arrival_us = self._now_us()
        kind = message.get_type()
        if kind in TRAFFIC_NAMES:
            self._traffic.on_message(message, arrival_us)
            return
        if kind == "HEARTBEAT" and is_autopilot(message):
            self._has_lists = speaks_mavlink_2(message)
            self._on_heartbeat()
        elif kind == "SYSTEM_TIME":
            self.clock.on_system_time(message.time_unix_usec, message.time_boot_ms * 1000)
        elif kind == "GPS_RAW_INT":
            self._traffic.on_fix(message)
        elif kind == "COMMAND_ACK":
            if self._asking.on_ack(message):
                self._ask_us = _wall_us()
            with self._lock:
                outcome = self._errands.on_ack(message, _wall_us())
            self._perform(outcome)
        for report in self._lists.on_message(message, self.known, arrival_us):
            self._post(report)
        self._read_lists(_wall_us())
        valid_us = self.clock.valid_us(device_us(message), arrival_us, witness=tells_time(message))
        if self.clock.reboots != self._reboots:
            self._reboots = self.clock.reboots
            self.known.on_reboot()
            self._meet()
        if valid_us is None:
            return
        for report in self.known.reports(message, valid_us):
            self._note(report)
            self._post(report)

    def _note(self, report: Report) -> None:
        """Remember what has come: it needs no request."""
        if isinstance(report, PositionReport):
            self._positioned = True
            self._condition.on_position(_wall_us())
        elif isinstance(report, FixReport):
            self._condition.on_fix(has_fix=report.has_fix)
        elif isinstance(report, HomeReport):
            self._homed = True

    def on_tick(self, monotonic_us: int) -> None:
        with self._lock:
            outcome = self._errands.on_time(monotonic_us)
        self._perform(outcome)
        if self._requests and self._condition.is_heard and monotonic_us >= self._ask_us:
            self._ask(monotonic_us)
        self._read_lists(monotonic_us)
        news = self._condition.on_time(self.system, self.port, self.known, self._asking, monotonic_us)
        self._report_traffic(monotonic_us)
        if news is not None:
            self._post(LinkReport(self._now_us(), *news))
        if self.clock.words != self._clock_words:
            self._clock_words = self.clock.words
            words = self._clock_words or "its clock runs at 1.000 again"
            self._post(StationReport(self._now_us(), commands=False, text=f"system {self.system}: {words}"))

    def _report_traffic(self, monotonic_us: int) -> None:
        refused = self.port.counts[TOO_MUCH_TRAFFIC]
        if refused > self._refused:
            self._traffic.left_out["too many"] += refused - self._refused
            self._refused = refused
        report = self._traffic.report(self._now_us(), monotonic_us, self.known.position)
        if report is not None:
            self._post(report)

    def _on_heartbeat(self) -> None:
        if self._condition.on_heartbeat(_wall_us()):
            self._meet()

    def _meet(self) -> None:
        """The vehicle is new to us, or may have forgotten our requests."""
        self._positioned = self._homed = False
        self._asking.restart()
        self._lists.restart()
        self._ask_us = _wall_us()

    def _ask(self, monotonic_us: int) -> None:
        """Ask for messages when the vehicle is met or met again, and every two seconds for missing ones."""
        self._ask_us = monotonic_us + _ASK_AGAIN_US
        if self.system is None:
            return
        target = self._target(self.system)
        untold = self.known.untold_parameters
        asked = self._asking.messages(target, is_positioned=self._positioned, is_homed=self._homed, untold=untold)
        for message in asked:
            self.port.send(target.system, message)

    def _read_lists(self, monotonic_us: int) -> None:
        """Read on in its fence and its mission, and report what is wrong with them."""
        if not (self._requests and self._has_lists and self._condition.is_heard) or self.system is None:
            return
        for message in self._lists.due(self._target(self.system), monotonic_us):
            self.port.send(self.system, message)
        for problem in self._lists.take_problems():
            self._post(StationReport(self._now_us(), commands=False, text=f"system {self.system}: {problem}"))

    def _perform(self, outcome: OrderOutcome) -> None:
        for message in outcome.send:
            if self.system is not None:
                self.port.send(self.system, message)
        for result in outcome.results:
            self._post(result._replace(valid_us=self._now_us()))


def _wall_us() -> int:
    return time.monotonic_ns() // 1000
