"""The ways in which a vehicle can keep clear of all others, and the cheapest of those that do.

Each is flown ahead as a whole: braking, turning, climbing, and then the way back, which is free when it begins. Level
ways veer, go to the side or back, or stop; upright ways take the vehicle's own track at another level. A way that
leaves its limits is left out.
"""

from collections.abc import Callable, Iterator, Sequence
from math import hypot
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from dyknow.navigation.intents.intent import IntentEnding
from dyknow.navigation.intents.meeting import MINIMA, WIDER, Minima, clearance, closeness, first_meetings
from dyknow.navigation.intents.path import (
    ACCELERATION_M_S2,
    SLOW,
    STEP_S,
    FlatMotion,
    FlatPlace,
    Performance,
    Tube,
    fly,
    later,
)

ASIDE_M: Final = (30.0, 60.0, 90.0)
VEERS_M: Final = ((30.0, 50.0), (30.0, 30.0), (60.0, 60.0))
"""How far to a side a vehicle that flies veers from its track, and how far along it meanwhile."""
LEVELS_M: Final = (14.0, 24.0, 36.0)
BACK_M: Final = 40.0
NEAR_M: Final = (18.0, 26.0)
"""Distances aside for a hovering vehicle, within a fence that is narrow: away from the other, and to four sides."""
HOVERS_M_S, HERE_M = 2.0, 10.0
ABOVE_M: Final = WIDER.upright_m + 2.0
"""How far above or below the tube of another a level is."""
SHORT_S: Final = (2.0, 6.0)
"""So long before it would meet another one a vehicle may wait on its own way."""
PLANNED_STEPS: Final = 61
"""A manoeuvre is free for 30 s, or it is none."""
WAY_STEPS: Final = 61
"""The way back is free for 30 s from where it begins."""
RETURNS_S: Final = (4.0, 8.0, 12.0, 17.0, 22.0, 30.0)
LATE_S: Final = 35.0
"""When a way back is taken to be free that is not within half a minute."""
NEVER_S: Final = 60.0
"""The cost of a manoeuvre that is not free of all others."""
CLIMB_COST_S_PER_M: Final = 0.15
TURN_COST_S: Final = 2.0
MOST_LOOKED_INTO: Final = 26
MOST_PLACES: Final = 8

Allowed = Callable[[FlatPlace, FlatPlace | None], bool]
"""Whether it may fly to a place, straight from another one; None: from where it is."""


class PlannedManoeuvre(NamedTuple):
    """Places that are flown to one after the other, to stand at the last.

    Attributes:
        tube: where the vehicle is then.
        minima: the separation from all others; None: it is the way that keeps farthest from them, and is not free.
        cost_s: seconds that it costs, energy and change among them.
        words: the manoeuvre in words.
        speed_m_s: how fast it is flown; None: as fast as the vehicle flies by itself.
        returns: whether its way back becomes free within half a minute.
    """

    places: tuple[FlatPlace, ...]
    tube: Tube
    minima: Minima | None
    cost_s: float
    words: str
    speed_m_s: float | None = None
    returns: bool = True

    def is_here(self, motion: FlatMotion) -> bool:
        """Whether the vehicle is to stand where it is."""
        place = self.places[0]
        away_m = hypot(place.north_m - motion.north_m, place.east_m - motion.east_m)
        return len(self.places) == 1 and away_m < 1.0 and abs(place.altitude_m - motion.altitude_m) < 1.0


class Yielding(NamedTuple):
    """The situation of a vehicle that yields.

    Attributes:
        motion: its own now; legs, ending: its way if there were no others; performance: of the vehicle.
        others: the tubes of all others and of their contingencies, from now on, an array of (K, 5, steps).
        allowed: whether it may fly to a place, and stand there.
        slow_m_s: a lower speed that it may be given for a while; None: none, since it would not be known how it gets its own back.
    """

    motion: FlatMotion
    legs: Sequence[FlatPlace]
    ending: IntentEnding
    performance: Performance
    others: npt.NDArray[np.float64]
    allowed: Allowed
    slow_m_s: float | None = None


class _Candidate(NamedTuple):
    places: tuple[FlatPlace, ...]
    change_m: float
    words: str
    speed_m_s: float | None = None

    def flown(self, yielding: Yielding) -> Tube:
        """Where the vehicle is then."""
        performance = yielding.performance
        if self.speed_m_s is not None:
            performance = performance._replace(speed_m_s=self.speed_m_s)
        return fly(yielding.motion, self.places, IntentEnding.HOVER, performance, PLANNED_STEPS)

    def is_within(self, allowed: Allowed) -> bool:
        return all(map(allowed, self.places, (None, *self.places[:-1])))


def way_is_free(yielding: Yielding, minima: Minima = WIDER) -> bool:
    """Whether the own way is free of all others from now on, for 30 s."""
    tube = fly(yielding.motion, yielding.legs, yielding.ending, yielding.performance, WAY_STEPS)
    return clearance(closeness(tube, yielding.others[:, :, :WAY_STEPS], minima)) >= 1.0


def plan(yielding: Yielding) -> PlannedManoeuvre | None:
    """The cheapest manoeuvre that is free, else the one that keeps farthest away; None: nothing is allowed."""
    others = yielding.others[:, :, :PLANNED_STEPS]
    flown: list[tuple[_Candidate, Tube, float]] = []
    best: tuple[float, _Candidate, Tube] | None = None
    for candidate in _candidates(yielding):
        if not candidate.is_within(yielding.allowed):
            continue
        tube = candidate.flown(yielding)
        wide = clearance(closeness(tube, others, WIDER))
        if wide >= 1.0:
            flown.append((candidate, tube, _least_cost_s(candidate)))
        elif best is None or wide > best[0]:
            best = wide, candidate, tube
    if flown:
        return _cheapest(yielding, flown, WIDER)
    if best is None:
        return None
    return _closer(yielding, others, best)


def _closer(
    yielding: Yielding, others: npt.NDArray[np.float64], best: tuple[float, _Candidate, Tube]
) -> PlannedManoeuvre:
    """No way keeps the wider minima: the cheapest that keeps the least ones, else the one that keeps farthest away."""
    flown = []
    for candidate in _candidates(yielding):
        if candidate.is_within(yielding.allowed):
            tube = candidate.flown(yielding)
            if clearance(closeness(tube, others, MINIMA)) >= 1.0:
                flown.append((candidate, tube, _least_cost_s(candidate)))
    if flown:
        return _cheapest(yielding, flown, MINIMA)
    _, candidate, tube = best
    return PlannedManoeuvre(candidate.places, tube, None, NEVER_S, candidate.words, candidate.speed_m_s)


def _least_cost_s(candidate: _Candidate) -> float:
    if candidate.speed_m_s is not None:
        return 0.0  # it keeps its track and its level
    return candidate.change_m * CLIMB_COST_S_PER_M + TURN_COST_S


def _cheapest(yielding: Yielding, flown: list[tuple[_Candidate, Tube, float]], minima: Minima) -> PlannedManoeuvre:
    flown.sort(key=lambda each: each[2])
    straight_s = _flight_s(yielding, yielding.motion)
    found: list[PlannedManoeuvre] = []
    least_s = NEVER_S * 2.0
    for candidate, tube, change_s in flown[:MOST_LOOKED_INTO]:
        if change_s >= least_s:
            break
        delay_s, returns = _delay_s(yielding, tube, straight_s)
        cost_s = change_s + delay_s
        found.append(
            PlannedManoeuvre(candidate.places, tube, minima, cost_s, candidate.words, candidate.speed_m_s, returns)
        )
        least_s = min(least_s, cost_s)
    return min(found, key=lambda each: each.cost_s)


def _flight_s(yielding: Yielding, motion: FlatMotion) -> float:
    """About how long the own way takes from there."""
    if not yielding.legs:
        return 0.0
    performance, at, total_s = yielding.performance, FlatPlace(*motion[:3]), 0.0
    speed = max(1.0, performance.speed_m_s)
    for leg in yielding.legs:
        up_m = leg.altitude_m - at.altitude_m
        rate = performance.climb_m_s if up_m > 0 else performance.descent_m_s
        total_s += max(hypot(leg.north_m - at.north_m, leg.east_m - at.east_m) / speed, abs(up_m) / rate)
        at = leg
    return total_s


def _delay_s(yielding: Yielding, tube: Tube, straight_s: float) -> tuple[float, bool]:
    """How much later it arrives than without the others, since it returns to its way as soon as that is free; and whether that is soon."""
    if not yielding.legs:
        return 0.0, True
    for after_s in RETURNS_S:
        motion = _at(tube, after_s)
        way = fly(motion, yielding.legs, yielding.ending, yielding.performance, WAY_STEPS)
        there = later(yielding.others, after_s, WAY_STEPS)
        if clearance(closeness(way, there, WIDER)) >= 1.0:
            return max(0.0, after_s + _flight_s(yielding, motion) - straight_s), True
    return max(0.0, LATE_S + _flight_s(yielding, _at(tube, LATE_S)) - straight_s), False


def _at(tube: Tube, after_s: float) -> FlatMotion:
    """Where it is by then, and how it moves level."""
    at = min(round(after_s / STEP_S), tube.shape[1] - 1)
    here, before = tube[:, at], tube[:, at - 1]
    v_north, v_east = ((here[:2] - before[:2]) / STEP_S).tolist()
    return FlatMotion(float(here[0]), float(here[1]), float(here[2] + here[3]) / 2.0, v_north, v_east, 0.0)


def _candidates(yielding: Yielding) -> Iterator[_Candidate]:
    """All ways there are, those that change least first."""
    motion, legs, performance = yielding.motion, yielding.legs, yielding.performance
    speed = hypot(motion.north_m_s, motion.east_m_s)
    d_north, d_east = _direction(motion, legs, speed)
    brakes_m = speed**2 / (2.0 * ACCELERATION_M_S2)
    runs_m = speed * 0.5 + brakes_m

    def ahead(along_m: float, right_m: float, altitude_m: float) -> FlatPlace:
        return FlatPlace(
            motion.north_m + d_north * along_m - d_east * right_m,
            motion.east_m + d_east * along_m + d_north * right_m,
            altitude_m,
        )

    here_m = motion.altitude_m
    levels, short, away = _look_ahead(yielding)
    for place in short:
        if hypot(place.north_m - motion.north_m, place.east_m - motion.east_m) > runs_m:
            yield _Candidate((place,), 0.0, "waits short of it")
    yield _Candidate((ahead(runs_m, 0.0, here_m),), 0.0, "stops")
    if legs and yielding.slow_m_s is not None:
        words = f"flies on at {yielding.slow_m_s:.1f} m/s"
        yield _Candidate(tuple(legs[:MOST_PLACES]), 0.0, words, yielding.slow_m_s)
    for level_m in levels:
        change_m = abs(level_m - here_m)
        rate = (performance.climb_m_s if level_m > here_m else performance.descent_m_s) * SLOW
        if legs:
            climb = ahead(max(runs_m, min(speed, performance.speed_m_s) * change_m / (2.0 * rate)), 0.0, level_m)
            on = tuple(leg._replace(altitude_m=level_m) for leg in legs[:2])
            yield _Candidate((climb, *on), change_m, f"flies on at {level_m:.0f} m")
        yield _Candidate((ahead(runs_m, 0.0, level_m),), change_m, f"goes to {level_m:.0f} m and holds")
    if legs and hypot(legs[-1].north_m - motion.north_m, legs[-1].east_m - motion.east_m) > HERE_M:
        for right_m, along_m in VEERS_M:
            for side in (1.0, -1.0):
                words = f"veers {right_m:.0f} m {'right' if side > 0 else 'left'}"
                yield _Candidate((ahead(runs_m + along_m, side * right_m, here_m),), 0.0, words)
    for right_m in ASIDE_M:
        for side in (1.0, -1.0):
            words = f"goes {right_m:.0f} m {'right' if side > 0 else 'left'}"
            yield _Candidate((ahead(runs_m, side * right_m, here_m),), 0.0, words)
            if legs:
                yield _Candidate(
                    (ahead(runs_m, side * right_m, here_m), ahead(runs_m + 2.0 * right_m, side * right_m, here_m)),
                    0.5 * right_m, words + " and on",
                )  # fmt: skip
    yield _Candidate((ahead(-BACK_M, 0.0, here_m),), 10.0, f"goes back {BACK_M:.0f} m")
    if speed < HOVERS_M_S and (
        not legs or hypot(legs[-1].north_m - motion.north_m, legs[-1].east_m - motion.east_m) < HERE_M
    ):
        for near_m in NEAR_M:
            for north, east in (*away, (1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)):
                place = FlatPlace(motion.north_m + near_m * north, motion.east_m + near_m * east, here_m)
                yield _Candidate((place,), 0.0, f"goes {near_m:.0f} m aside")
    for level_m in levels[:2]:
        for side in (1.0, -1.0):
            place = ahead(runs_m, side * ASIDE_M[0], level_m)
            yield _Candidate((place,), abs(level_m - here_m), f"goes aside to {level_m:.0f} m")


def _direction(motion: FlatMotion, legs: Sequence[FlatPlace], speed: float) -> tuple[float, float]:
    """North and east parts of where it flies, or is to fly."""
    if speed > 0.5:
        return motion.north_m_s / speed, motion.east_m_s / speed
    for leg in legs:
        away = hypot(leg.north_m - motion.north_m, leg.east_m - motion.east_m)
        if away > 1.0:
            return (leg.north_m - motion.north_m) / away, (leg.east_m - motion.east_m) / away
    return 1.0, 0.0


class _Ahead(NamedTuple):
    """The meeting on its own way: levels just clear of it, places short of it, and the ways away from it."""

    levels: list[float]
    short: list[FlatPlace]
    away: list[tuple[float, float]]


def _look_ahead(yielding: Yielding) -> _Ahead:
    motion, others = yielding.motion, yielding.others
    found: list[float] = []
    short: list[FlatPlace] = []
    away: list[tuple[float, float]] = []
    if len(others):
        own = fly(motion, yielding.legs, yielding.ending, yielding.performance, min(PLANNED_STEPS, others.shape[2]))
        close = closeness(own, others[:, :, : own.shape[1]], WIDER)
        seconds = first_meetings(close)
        for at in np.flatnonzero(np.isfinite(seconds))[:4]:
            found += [float(others[at, 3].max()) + ABOVE_M, float(others[at, 2].min()) - ABOVE_M]
            away += _away(own, others[at], int(seconds[at] / STEP_S))
        for before_s in SHORT_S if np.isfinite(seconds).any() else ():
            at = max(0, int((float(seconds.min()) - before_s) / STEP_S))
            short.append(FlatPlace(float(own[0, at]), float(own[1, at]), float(own[2, at] + own[3, at]) / 2.0))
    found += [motion.altitude_m + sign * step_m for step_m in LEVELS_M for sign in (1.0, -1.0)]
    levels: list[float] = []
    for level_m in found:  # those just clear of others go before round ones
        if all(abs(level_m - each) > 3.0 for each in levels):
            levels.append(level_m)
    levels.sort(key=lambda level_m: abs(level_m - motion.altitude_m))
    return _Ahead(levels, short, away)


def _away(own: Tube, other: Tube, step: int) -> list[tuple[float, float]]:
    """North and east parts of the way from where another one is met; none if it is straight above or below."""
    north_m, east_m = (own[:2, step] - other[:2, step]).tolist()
    apart_m = hypot(north_m, east_m)
    return [] if apart_m < 0.5 else [(north_m / apart_m, east_m / apart_m)]
