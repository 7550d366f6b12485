"""The feed against a vehicle that others can fly too: both personas, over UDP, mostly at a speed of ten."""

import queue
import statistics
import time
from itertools import pairwise
from typing import Self

import pytest

from dyknow.federation.members.clock import FederationClock
from dyknow.navigation import faults
from dyknow.navigation.fusion import PositionFilter
from dyknow.navigation.geodesy import LocalFrame
from dyknow.navigation.vehicle import (
    Arm,
    Command,
    CommandResult,
    GoToOrder,
    HoldOrder,
    HomeReport,
    LandOrder,
    Order,
    PositionReport,
    Report,
    ReturnHomeOrder,
    SetGuided,
    StatusReport,
    TakeOffOrder,
    TargetReport,
)
from dyknow.proxies.mavlink.feed import MavlinkFeed
from dyknow.sim_uavs.autopilot.server import AutopilotServer
from dyknow.sim_uavs.dynamics.faults import parse_fault
from dyknow.sim_uavs.dynamics.settings import HomePlace, VehicleConfig

pytestmark = pytest.mark.live
SPEED = 10.0
HOME = HomePlace(47.0, 8.0, 500.0)
FRAME = LocalFrame(*HOME)


class Flown:
    """A feed, its vehicle and a position filter, stepped by the test."""

    def __init__(self, persona: str, speed: float = SPEED, **config) -> None:
        self.clock = FederationClock(time.time_ns() // 1000, speed)
        self.box: queue.Queue[Report] = queue.Queue()
        self.feed = MavlinkFeed("udpin:127.0.0.1:0", 5, self.box.put, self.now_us, driven=True)
        peer = self.feed.port.address
        self.server = AutopilotServer(VehicleConfig(5, HOME, persona, peers=(peer,), **config), clock=self.clock)
        self.unit, self.samples, self.number = PositionFilter(100_000), [], 0

    def now_us(self) -> int:
        return self.clock.federation_us(time.time_ns() // 1000)

    def __enter__(self) -> Self:
        self.feed.start()
        self.server.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.feed.stop()
        self.server.stop()

    def until(self, holds, timeout_s: float = 20.0) -> Report | None:
        """Take reports in until one of them makes `holds` true."""
        ends_s = time.monotonic() + timeout_s
        while time.monotonic() < ends_s:
            try:
                report = self.box.get(timeout=0.02)
            except queue.Empty:
                report = None
            now_us = self.now_us()
            if report is not None:
                self.samples += self.unit.on_report(report, now_us)
            self.samples += self.unit.on_time(now_us)
            if holds(report):
                return report
        raise TimeoutError("it did not happen")

    def order(self, order: Order) -> CommandResult:
        self.number += 1
        self.feed.command(Command(self.number, order))
        return self.until(lambda r: isinstance(r, CommandResult) and r.number == self.number)

    def at(self) -> tuple[float, float, float]:
        return FRAME.to_ned(*self.samples[-1].value[:3])

    def reaches(self, north: float, east: float, up: float) -> None:
        target = (north, east, -up)
        self.until(lambda _: self.samples and all(abs(a - b) < 2 for a, b in zip(self.at(), target, strict=True)))


@pytest.mark.parametrize("persona", ["ardupilot", "px4"])
def test_the_feed_flies_a_vehicle_up_there_and_home(persona) -> None:
    with Flown(persona) as flown:
        home = flown.until(lambda r: isinstance(r, HomeReport))
        assert (home.latitude_deg, home.longitude_deg, home.altitude_m) == pytest.approx(HOME, abs=1e-3)
        flown.until(lambda _: flown.unit.health.state == "ok")
        assert flown.order(SetGuided()).accepted
        assert flown.order(Arm()).accepted
        assert flown.order(TakeOffOrder(15.0)).accepted
        flown.reaches(0, 0, 15)
        flown.until(lambda r: isinstance(r, StatusReport) and r.armed and bool(r.airborne) and r.guided)
        there = FRAME.from_ned(40.0, 10.0, -20.0)
        assert flown.order(GoToOrder(*there, 6.0)).accepted
        target = flown.until(lambda r: isinstance(r, TargetReport) and abs(r.altitude_m - there[2]) < 0.1)
        assert target.latitude_deg == pytest.approx(there[0], abs=1e-6)
        flown.reaches(40, 10, 20)
        assert flown.order(HoldOrder()).accepted
        assert flown.order(ReturnHomeOrder()).accepted
        flown.until(lambda r: isinstance(r, StatusReport) and r.airborne is False, timeout_s=30)
        assert not flown.unit.rejected[faults.TELEPORT]


def test_estimates_of_a_driven_vehicle_lie_on_the_grid_and_come_with_its_reports() -> None:
    with Flown("ardupilot", speed=2.0, airborne_m=20.0) as flown:
        flown.until(lambda _: len(flown.samples) > 60)
        tail = flown.samples[20:]
        assert all(s.valid_us % 100_000 == 0 for s in tail)
        assert statistics.median(b.valid_us - a.valid_us for a, b in pairwise(tail)) == 100_000
        assert statistics.median(s.available_us - s.valid_us for s in tail) < 45_000, "put out on arrival, not by timer"
        assert flown.order(LandOrder()).accepted


@pytest.mark.parametrize(
    ("fault", "reason"),
    [
        ("silence", faults.SILENT),
        ("gps-loss", faults.SILENT),
        ("frozen-position", faults.FROZEN),
        ("nan", faults.OUT_OF_RANGE),
        ("teleport=500", faults.TELEPORT),
    ],
)
def test_each_fault_is_seen_named_and_over_when_it_is_over(fault, reason) -> None:
    with Flown("ardupilot", airborne_m=20.0) as flown:
        flown.until(lambda _: len(flown.samples) > 20)
        assert flown.order(GoToOrder(*FRAME.from_ned(300.0, 0.0, -20.0), 5.0)).accepted
        flown.until(lambda _: flown.samples[-1].value[3] > 3.0)
        flown.server.inject(parse_fault(fault), 4_000_000)
        flown.until(lambda _: flown.unit.health[:2] == ("stale", reason))
        flown.until(lambda r: flown.unit.health.state == "ok" and isinstance(r, PositionReport))
        north = flown.at()[0]
        assert abs(flown.at()[1]) < 5
        assert 0 < north < 150, "it came back to where the vehicle is"
