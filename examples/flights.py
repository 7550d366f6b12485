"""Sources and a unit of uav0.kpl and uav1.kpl: two UAVs that fly past each other again and again, on one height.

A real one reads its receiver in a process of its own, `dyknow host flights.py --unit 0`, where it may wait for it.
"""

import math
from collections.abc import Iterator

from dyknow import source, value_unit
from dyknow.compunits import distance_xy

PERIOD_US = 100_000
LATITUDE_DEG, LONGITUDE_DEG = 58.4, 15.6
LEG_DEG = 4e-4  # 45 m north and south of the middle
LAP_S = 12.0


def _flown(from_us: int, phase: float, east_deg: float) -> Iterator[tuple[int, tuple[float, float]]]:
    valid_us = -(-from_us // PERIOD_US) * PERIOD_US
    while True:
        share = math.sin(2 * math.pi * (valid_us / 1e6 / LAP_S + phase))
        yield valid_us, (LATITUDE_DEG + LEG_DEG * share, LONGITUDE_DEG + east_deg)
        valid_us += PERIOD_US


def _level(from_us: int, altitude_m: float) -> Iterator[tuple[int, tuple[float]]]:
    valid_us = -(-from_us // PERIOD_US) * PERIOD_US
    while True:
        yield valid_us, (altitude_m,)
        valid_us += PERIOD_US


@source("position")
def gps_0(from_us: int) -> Iterator[tuple[int, tuple[float, float]]]:
    """Latitude and longitude in degrees, WGS-84."""
    return _flown(from_us, 0.0, 0.0)


@source("position")
def gps_1(from_us: int) -> Iterator[tuple[int, tuple[float, float]]]:
    """The same, half a lap later and 6 m to the east."""
    return _flown(from_us, 0.5, 1e-4)


@source("altitude")
def barometer_0(from_us: int) -> Iterator[tuple[int, tuple[float]]]:
    """Metres above mean sea level."""
    return _level(from_us, 120.0)


@source("altitude")
def barometer_1(from_us: int) -> Iterator[tuple[int, tuple[float]]]:
    """Metres above mean sea level."""
    return _level(from_us, 121.0)


@value_unit("distance", "state", name="Between")
def between(state: tuple[tuple[float, float], tuple[float, float]]) -> float:
    """Metres between two positions of one time."""
    here, there = state
    return distance_xy(here, there)
