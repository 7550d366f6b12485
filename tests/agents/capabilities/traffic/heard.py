"""Aircraft on straight lines, as a receiver hears them, for the fake world."""

from typing import NamedTuple

from dyknow.agents.effects import Reported
from dyknow.agents.monitoring.alarm_log import AlarmLog
from dyknow.navigation.heard_aircraft import HeardAircraft
from dyknow.navigation.vehicle import TrafficReport
from dyknow.reasoning import AlarmEvent
from tests.box import METRE_DEG, Box


class Straight(NamedTuple):
    """An aircraft: metres north and east of 58 N 15 E at the beginning, metres a second."""

    identity: str = "adsb-4ca123"
    north_m: float = 0.0
    east_m: float = 8000.0
    altitude_m: float = 120.0
    north_m_s: float = 0.0
    east_m_s: float = -60.0
    up_m_s: float = 0.0
    source: str = "adsb"
    error_m: float = 25.0

    def heard(self, begun_us: int, at_us: int) -> HeardAircraft:
        since_s = (at_us - begun_us) / 1e6
        return HeardAircraft(
            at_us, self.source, self.identity,
            58.0 + (self.north_m + self.north_m_s * since_s) * METRE_DEG,
            15.0 + (self.east_m + self.east_m_s * since_s) * METRE_DEG / 0.5299,
            self.altitude_m + self.up_m_s * since_s, self.error_m, "barometric",
            self.north_m_s, self.east_m_s, -self.up_m_s, kind="rotorcraft", callsign="LN-OKA",
        )  # fmt: skip


def hear(box: Box, unit: str, *aircraft: HeardAircraft, left_out: tuple[tuple[str, int], ...] = ()) -> None:
    """The vehicle of a platform reports aircraft."""
    box.happens(unit, Reported(box.now_us, TrafficReport(box.now_us, aircraft, left_out)))


def listen(box: Box, unit: str, seconds: float, *aircraft: Straight, begun_us: int, every_s: float = 1.0) -> None:
    """Time passes, and the vehicle hears them."""
    for _ in range(round(seconds / every_s)):
        at_us = box.clock.federation_us(box.now_us)
        hear(box, unit, *(each.heard(begun_us, at_us) for each in aircraft))
        box.run(every_s)


def alarms(box: Box, unit: str, monitor: str = "traffic-well-clear") -> list[AlarmEvent]:
    return [each for each in box.platform(unit).part(AlarmLog).events if each.monitor == monitor]
