"""Where things are to each other and how they move: distance, speed, direction.

Positions are (latitude, longitude) in degrees, WGS-84; altitudes metres; velocities (north, east, down) in m/s.
Headings are degrees clockwise from true north, in [0, 360). Distances are metres, speeds m/s. One field of a record or
a simple value is the same here; the output is a simple value.
"""

import math
from collections import deque
from typing import Generic, TypeAlias, TypeVar

from dyknow import NO_VALUE, US_PER_S, Sample, Value, computational_unit, value_unit
from dyknow.compunits.numeric import Numbers, is_number, numbers_of, numeric, positive
from dyknow.navigation import LocalFrame, distance_m

Position: TypeAlias = tuple[float, float]
"""Latitude and longitude in degrees."""

Known = TypeVar("Known")
_MOST_REMEMBERED = 10_000
_STANDS_STILL_M_S = 0.01


@value_unit("distance", "position", "position", name="DistanceXY")
@numeric(2, 2)
def distance_xy(one: Position, other: Position) -> float:
    """Metres along the ellipsoid, `dyknow.navigation.distance_m`: within 1 mm of the geodesic up to 10 km."""
    return distance_m(*on_earth(one), *on_earth(other))


@value_unit("distance", "altitude", "altitude", name="DistanceZ")
@numeric(1, 1)
def distance_z(one: float, other: float) -> float:
    """|altitude - altitude|, metres; both above the same level."""
    return abs(one - other)


@value_unit("distance", "position", "altitude", "position", "altitude", name="Distance3D")
@numeric(2, 1, 2, 1)
def distance_3d(one: Position, altitude_m: float, other: Position, other_altitude_m: float) -> float:
    """sqrt(DistanceXY^2 + DistanceZ^2), metres."""
    return distance_m(*on_earth(one), *on_earth(other), altitude_m - other_altitude_m)


@value_unit("speed", "velocity", name="GroundSpeed")
@numeric(3)
def ground_speed(velocity: Numbers) -> float:
    """sqrt(north^2 + east^2), m/s."""
    return math.hypot(velocity[0], velocity[1])


@value_unit("speed", "velocity", name="Speed3D")
@numeric(3)
def speed_3d(velocity: Numbers) -> float:
    """sqrt(north^2 + east^2 + down^2), m/s."""
    return math.hypot(*velocity)


@value_unit("speed", "velocity", name="ClimbRate")
@numeric(3)
def climb_rate(velocity: Numbers) -> float:
    """-down, m/s: positive is up."""
    return -velocity[2]


@value_unit("heading", "velocity", name="Track")
@numeric(3)
def track(velocity: Numbers) -> Value:
    """Which way it moves over ground, atan2(east, north); no value below 1 cm/s, where there is none."""
    north_m_s, east_m_s, _ = velocity
    return heading_deg(north_m_s, east_m_s) if math.hypot(north_m_s, east_m_s) >= _STANDS_STILL_M_S else NO_VALUE


@value_unit("heading", "attitude", name="Heading")
@numeric(3)
def heading(attitude: Numbers) -> float:
    """Which way the nose points: the yaw of (roll, pitch, yaw), which is in radians, in degrees."""
    return wrapped_deg(math.degrees(attitude[2]))


@value_unit("heading", "position", "position", name="Bearing")
@numeric(2, 2)
def bearing(one: Position, other: Position) -> Value:
    """In which direction the second position lies, seen from the first; no value where they are one."""
    north_m, east_m = offset_m(one, other)
    return heading_deg(north_m, east_m) if north_m or east_m else NO_VALUE


class _Past(Generic[Known]):
    """The value at, or before, the last instant that lies at least `seconds` back."""

    def __init__(self, seconds: float) -> None:
        if not (is_number(seconds) and 0.0 <= seconds < math.inf):
            raise ValueError(f"seconds must be a number >= 0, got {seconds!r}")
        self._span_us = max(1, round(seconds * US_PER_S))
        self._known: deque[tuple[int, Known]] = deque(maxlen=_MOST_REMEMBERED)

    def before(self, valid_us: int, now: Known) -> tuple[float, Known] | None:
        """(seconds passed since, what was then); None when there is none yet, or `valid_us` is late."""
        known, then_us = self._known, valid_us - self._span_us
        if known and valid_us <= known[-1][0]:
            return None
        known.append((valid_us, now))
        while len(known) > 1 and known[1][0] <= then_us:
            known.popleft()
        oldest_us, then = known[0]
        return ((valid_us - oldest_us) / US_PER_S, then) if oldest_us <= then_us else None


@computational_unit("speed", "position", history_us=US_PER_S)
class SpeedEst:
    """Speed over ground from successive positions (thesis 4.4.1): distance over the time it took, m/s.

    Valid when the later position is. Late positions give nothing.

    Args:
        seconds: how long ago the position compared with is, at least; 0 is the one before.
    """

    def __init__(self, seconds: float = 0.0) -> None:
        self._past: _Past[Position] = _Past(seconds)

    def __call__(self, _now_us: int, sample: Sample) -> Value:
        now = position_of(sample.value)
        if now is None:
            return NO_VALUE
        found = self._past.before(sample.valid_us, now)
        return None if found is None else distance_m(*found[1], *now) / found[0]


@computational_unit("speed", "altitude", history_us=US_PER_S)
class ClimbEst:
    """Climb rate from successive altitudes, m/s, positive is up; as `SpeedEst`."""

    def __init__(self, seconds: float = 0.0) -> None:
        self._past: _Past[Numbers] = _Past(seconds)

    def __call__(self, _now_us: int, sample: Sample) -> Value:
        now = numbers_of(sample.value, 1)
        if now is None:
            return NO_VALUE
        found = self._past.before(sample.valid_us, now)
        return None if found is None else _rate(found[0], found[1][0], now[0])


@numeric(1, 1, 1)
def _rate(seconds: float, then: float, now: float) -> float:
    return (now - then) / seconds


@computational_unit("heading", "position", history_us=US_PER_S)
class TrackEst:
    """Which way it moves, from successive positions: "the derivative of the position" (thesis 8.7.5), in degrees.

    It has an output whenever it has moved by `metres`: an object that stands still or wavers gives nothing new.
    """

    def __init__(self, metres: float = 0.5) -> None:
        self._least_m = positive("metres", metres)
        self._from: tuple[int, Position] | None = None

    def __call__(self, _now_us: int, sample: Sample) -> Value:
        now = position_of(sample.value)
        if now is None:
            return NO_VALUE
        if self._from is None:
            self._from = sample.valid_us, now
            return None
        valid_us, then = self._from
        if sample.valid_us <= valid_us or distance_m(*then, *now) < self._least_m:
            return None
        self._from = sample.valid_us, now
        return bearing(then, now)


def position_of(value: Value) -> Position | None:
    """(latitude_deg, longitude_deg), if `value` is a place: latitude within 90 degrees, longitude within a turn."""
    found = numbers_of(value, 2)
    return (found[0], found[1]) if found and abs(found[0]) <= 90.0 and abs(found[1]) <= 360.0 else None


def on_earth(position: Position) -> Position:
    """The position. ValueError if there is no such place."""
    if position_of(position) is None:
        raise ValueError(f"latitude {position[0]}, longitude {position[1]} is no place on earth")
    return position


def offset_m(one: Position, other: Position) -> tuple[float, float]:
    """(north, east) in metres from one position to the other, in the plane that touches the ellipsoid at `one`."""
    north_m, east_m, _ = LocalFrame(*on_earth(one), 0.0).to_ned(*on_earth(other), 0.0)
    return north_m, east_m


def heading_deg(north: float, east: float) -> float:
    """Degrees clockwise from north, in [0, 360)."""
    return wrapped_deg(math.degrees(math.atan2(east, north)))


def wrapped_deg(angle_deg: float) -> float:
    """The same angle in [0, 360), also where the remainder of a tiny negative one is rounded to 360."""
    return angle_deg % 360.0 % 360.0


def turn_deg(start_deg: float, end_deg: float) -> float:
    """From one heading to the other by the shorter way, in [-180, 180]; to the right is positive."""
    return math.remainder(end_deg - start_deg, 360.0)
