"""Intents flown ahead: tubes in space over steps of half a second.

A copter is flown with the acceleration and braking that autopilots keep by default. How it climbs on a leg differs: at once,
or along the straight line; a tube has the heights of both and of all between. Metres north and east of an origin, metres above
mean sea level.
"""

from collections.abc import Sequence
from math import hypot, isfinite, sqrt
from typing import Final, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from dyknow.navigation.geodesy import metres_per_degree
from dyknow.navigation.intents.intent import IntendedPlace, Intent, IntentEnding

STEP_S: Final = 0.5
STEPS: Final = 81
"""A tube reaches 40 s ahead."""
ACCELERATION_M_S2: Final = 2.5
_GAIN_PER_S: Final = 0.9
ARRIVAL_M, ARRIVAL_UP_M = 3.0, 1.5
SLOW: Final = 0.5
"""A vehicle that climbs or sinks slowly does it at this share of its rate."""
SLOW_LANDING: Final = 0.2
OPEN_M_S, OPEN_MOST_M = 1.0, 15.0
"""How fast a tube widens whose vehicle may do anything, and how wide it grows by that."""
COASTS_S: Final = 10.0
"""A vehicle that shows its motion alone is taken to fly on for so long."""

Tube: TypeAlias = npt.NDArray[np.float64]
"""An array of (5, steps): north, east, lowest, highest, radius, all metres."""


class FlatOrigin(NamedTuple):
    """The origin of metres; good for a few kilometres."""

    latitude_deg: float
    longitude_deg: float
    north_m_per_deg: float
    east_m_per_deg: float

    @classmethod
    def at(cls, latitude_deg: float, longitude_deg: float) -> "FlatOrigin":
        return cls(latitude_deg, longitude_deg, *metres_per_degree(latitude_deg))

    def metres(self, latitude_deg: float, longitude_deg: float) -> tuple[float, float]:
        """North and east of it."""
        east_deg = (longitude_deg - self.longitude_deg + 180.0) % 360.0 - 180.0
        return (latitude_deg - self.latitude_deg) * self.north_m_per_deg, east_deg * self.east_m_per_deg

    def degrees(self, north_m: float, east_m: float) -> tuple[float, float]:
        """Latitude and longitude of a place so far north and east of it."""
        longitude_deg = self.longitude_deg + east_m / self.east_m_per_deg
        if abs(longitude_deg) > 180.0:
            longitude_deg = (longitude_deg + 180.0) % 360.0 - 180.0
        return self.latitude_deg + north_m / self.north_m_per_deg, longitude_deg


class FlatPlace(NamedTuple):
    """Metres north and east of an origin, metres above mean sea level."""

    north_m: float
    east_m: float
    altitude_m: float


class FlatMotion(NamedTuple):
    """Where a vehicle is and how it moves, in metres and metres per second north, east, up."""

    north_m: float
    east_m: float
    altitude_m: float
    north_m_s: float
    east_m_s: float
    up_m_s: float


class Performance(NamedTuple):
    """How fast a vehicle flies, m/s, and how far off its line it may be, m."""

    speed_m_s: float
    climb_m_s: float
    descent_m_s: float
    radius_m: float
    half_height_m: float


def performance_of(intent: Intent) -> Performance:
    return Performance(intent.speed_m_s, intent.climb_m_s, intent.descent_m_s, intent.radius_m, intent.half_height_m)


def motion_of(intent: Intent, origin: FlatOrigin) -> FlatMotion:
    north_m, east_m = origin.metres(intent.latitude_deg, intent.longitude_deg)
    return FlatMotion(north_m, east_m, intent.altitude_m, intent.north_m_s, intent.east_m_s, -intent.down_m_s)


def flat_legs(legs: Sequence[IntendedPlace], origin: FlatOrigin) -> list[FlatPlace]:
    return [FlatPlace(*origin.metres(leg.latitude_deg, leg.longitude_deg), leg.altitude_m) for leg in legs]


def fly(
    motion: FlatMotion,
    legs: Sequence[FlatPlace],
    ending: IntentEnding,
    performance: Performance,
    steps: int = STEPS,
    delay_steps: int = 0,
) -> Tube:
    """The tube of a vehicle that flies these legs; it stands for `delay_steps` first (it brakes meanwhile).

    Raises:
        ValueError: a number is not finite; such a tube would be free of everything.
    """
    tube = np.empty((5, steps))
    if ending is IntentEnding.OPEN:
        _straight(tube, motion, performance)
    else:
        _flown(tube, motion, legs, ending, performance, delay_steps)
    if not isfinite(float(tube.sum())):
        raise ValueError("the way of a vehicle is not finite")
    return tube


def _straight(tube: Tube, motion: FlatMotion, performance: Performance) -> None:
    seconds = np.arange(tube.shape[1]) * STEP_S
    flown = np.minimum(seconds, COASTS_S)
    grows = np.minimum(seconds * OPEN_M_S, OPEN_MOST_M)
    tube[0] = motion.north_m + motion.north_m_s * flown
    tube[1] = motion.east_m + motion.east_m_s * flown
    reached = motion.altitude_m + motion.up_m_s * flown
    spread = performance.half_height_m + 0.5 * grows
    tube[2], tube[3] = reached - spread, reached + spread
    tube[4] = performance.radius_m + grows


def _flown(
    tube: Tube,
    motion: FlatMotion,
    legs: Sequence[FlatPlace],
    ending: IntentEnding,
    performance: Performance,
    delay_steps: int,
) -> None:
    north, east, fast, v_north, v_east, _ = motion
    slow = fast
    fastest, climb, descent, radius, half = performance
    norths, easts, lows, highs = [], [], [], []
    at, last = 0, len(legs) - 1
    most_dv, linear_m = ACCELERATION_M_S2 * STEP_S, ACCELERATION_M_S2 / _GAIN_PER_S**2
    if not legs:
        stop_m = hypot(v_north, v_east) ** 2 / (2.0 * ACCELERATION_M_S2)
        speed = hypot(v_north, v_east) or 1.0
        legs, last = [FlatPlace(north + v_north / speed * stop_m, east + v_east / speed * stop_m, fast)], 0
    sinks = SLOW_LANDING if ending is IntentEnding.LAND else SLOW
    for step in range(tube.shape[1]):
        norths.append(north)
        easts.append(east)
        lows.append(min(slow, fast))
        highs.append(max(fast, slow))
        to = legs[at]
        d_north, d_east = to.north_m - north, to.east_m - east
        away = hypot(d_north, d_east)
        if at < last and away <= ARRIVAL_M and abs(to.altitude_m - fast) <= ARRIVAL_UP_M:
            at += 1
            to = legs[at]
            d_north, d_east = to.north_m - north, to.east_m - east
            away = hypot(d_north, d_east)
        wanted = 0.0
        if step >= delay_steps:
            wanted = _GAIN_PER_S * away if away <= linear_m else sqrt(2.0 * ACCELERATION_M_S2 * (away - linear_m / 2.0))
            wanted = min(wanted, fastest)
        share = wanted / away if away > 1e-6 else 0.0
        dv_north, dv_east = d_north * share - v_north, d_east * share - v_east
        dv = hypot(dv_north, dv_east)
        if dv > most_dv:
            dv_north, dv_east = dv_north * most_dv / dv, dv_east * most_dv / dv
        v_north += dv_north
        v_east += dv_east
        north += v_north * STEP_S
        east += v_east * STEP_S
        if step < delay_steps:
            continue
        up = to.altitude_m - fast
        if up:
            most = (climb if up > 0 else descent) * STEP_S
            fast += up if abs(up) <= most else most if up > 0 else -most
        up = to.altitude_m - slow
        if up:
            flown_m = hypot(v_north, v_east) * STEP_S
            least = (climb if up > 0 else descent * sinks / SLOW) * SLOW * STEP_S
            even = abs(up) * flown_m / away if away > ARRIVAL_M else least
            most = (climb if up > 0 else descent) * STEP_S
            by = min(most, even)
            slow += up if abs(up) <= by else by if up > 0 else -by
    tube[0], tube[1] = norths, easts
    tube[2], tube[3] = lows, highs
    tube[2] -= half
    tube[3] += half
    tube[4] = radius


def nominal(intent: Intent, origin: FlatOrigin, steps: int = STEPS) -> Tube:
    """The tube of an intent, from its own time on."""
    legs = flat_legs(intent.legs, origin)
    return fly(motion_of(intent, origin), legs, intent.ending, performance_of(intent), steps)


def contingent(intent: Intent, origin: FlatOrigin, steps: int = STEPS) -> Tube | None:
    """The tube if platform or link die at once; None: it is the nominal one."""
    if intent.contingency is None or intent.ending is IntentEnding.OPEN:
        return None
    return _changed(intent, origin, steps, *intent.contingency)


def resumed(intent: Intent, own_way: Intent, origin: FlatOrigin, after_s: float, steps: int = STEPS) -> Tube:
    """The tube if the vehicle flies its own way again so long after a manoeuvre was published."""
    return _changed(intent, origin, steps, after_s, own_way.legs, own_way.ending)


def _changed(
    intent: Intent, origin: FlatOrigin, steps: int, after_s: float, legs: Sequence[IntendedPlace], ending: IntentEnding
) -> Tube:
    """The tube of an intent that ends after that time with other legs."""
    delayed = min(steps, max(0, round(after_s / STEP_S)))
    performance = performance_of(intent)
    whole = fly(motion_of(intent, origin), flat_legs(intent.legs, origin), intent.ending, performance, steps)
    if delayed >= steps:
        return whole
    at = whole[:, delayed]
    before = whole[:, max(0, delayed - 1)]
    v_north, v_east = ((at[:2] - before[:2]) / STEP_S).tolist()
    height_m = float(at[2] + at[3]) / 2.0
    from_there = FlatMotion(float(at[0]), float(at[1]), height_m, v_north, v_east, 0.0)
    whole[:, delayed:] = fly(from_there, flat_legs(legs, origin), ending, performance, steps - delayed)
    return whole


def later(tubes: Tube, seconds: float, steps: int) -> Tube:
    """One tube or many from `seconds` on; after its end a vehicle stands where it is."""
    last = tubes.shape[-1] - 1
    at = np.minimum(np.arange(steps) + max(0.0, seconds) / STEP_S, last)
    before = at.astype(int)
    share = at - before
    found: Tube = tubes[..., before] * (1.0 - share) + tubes[..., np.minimum(before + 1, last)] * share
    return found
