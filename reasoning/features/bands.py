"""Conflict bands as NASA DAIDALUS makes them: the tracks, speeds, vertical speeds and altitudes that keep well clear.

A band is a range of values that either keeps well clear of all other aircraft for the look-ahead or does not. Values are
tried in steps from the own one, to both sides; each is flown from now on, reached at once or at a rate, while the others
fly straight on. With a rate, what lies behind a value on the way to which well clear is violated is no longer tried.
Directions are north, east, up; tracks in degrees clockwise from north.
"""

from collections.abc import Iterable, Sequence
from math import ceil, degrees, floor, pi, radians
from struct import pack, unpack
from typing import Final, NamedTuple

import numpy as np

from dyknow.reasoning.features.well_clear import AMONG_SMALL, LOOKAHEAD_S, Thresholds
from dyknow.reasoning.features.well_clear_arrays import Booleans, Floats, violation_intervals

_NOTHING: Final = 1e-9
_NEAR_ULPS: Final = 2**40
_NEAR_ZERO: Final = 1e-5
_CIRCLE_DEG: Final = 360.0


class ConflictBand(NamedTuple):
    """The values from `low` to `high`, and whether they keep well clear."""

    low: float
    high: float
    is_clear: bool


class ValueRange(NamedTuple):
    """The values that are tried: from `low` to `high` in steps; `rate`: how fast one changes, a second; 0: at once."""

    low: float
    high: float
    step: float
    rate: float = 0.0


class Intruders(NamedTuple):
    """The own aircraft and all others: where these are relative to it, and how each moves over ground.

    Attributes:
        own_m_s: velocity of the own aircraft: north, east, up.
        s_m: others minus own position, (n, 3); v_m_s: velocities of the others, (n, 3).
    """

    own_m_s: Sequence[float]
    s_m: Floats
    v_m_s: Floats


class Goal(NamedTuple):
    """The thresholds to keep, and for how long."""

    thresholds: Thresholds = AMONG_SMALL
    lookahead_s: float = LOOKAHEAD_S


def track_bands(
    traffic: Intruders, goal: Goal, step_deg: float, turn_deg_s: float = 0.0, least_m_s: float = 0.0
) -> tuple[ConflictBand, ...]:
    """Bands of the track, 0 to 360 degrees; a slower vehicle is taken to fly at `least_m_s`.

    A turn of rate w keeps the speed; after time t, with the track a: north = g (sin(a + w t) - sin a) / w, and so on.
    """
    north, east, up = traffic.own_m_s
    speed, own_rad = max(float(np.hypot(north, east)), least_m_s), float(np.arctan2(east, north))
    most = ceil(_CIRCLE_DEG / 2 / step_deg)
    if most * step_deg > _CIRCLE_DEG / 2 + _NOTHING:
        most -= 1
    clear: set[int] = set()
    for sign in (-1, 1):
        steps = np.arange(most + 1)
        track = own_rad + sign * np.radians(step_deg) * steps
        velocities = np.stack([speed * np.cos(track), speed * np.sin(track), np.full(most + 1, up)], axis=1)
        if turn_deg_s == 0.0:
            free = _clear_at_once(traffic, goal, velocities)
        else:
            omega, times = sign * np.radians(turn_deg_s), np.asarray(steps * (step_deg / turn_deg_s), np.float64)
            moved = np.stack(
                [
                    speed * (np.sin(track) - np.sin(own_rad)) / omega,
                    speed * (np.cos(own_rad) - np.cos(track)) / omega,
                    up * times,
                ],
                axis=1,
            )
            free = _clear_on_the_way(traffic, goal, moved, velocities, times)
        clear.update(sign * int(k) for k in np.flatnonzero(free))
    ranges = _around(_runs(clear), own_rad % (2.0 * pi), radians(step_deg))
    return tuple(ConflictBand(degrees(low), degrees(high), free) for low, high, free in _bands(ranges, 0.0, 2.0 * pi))


def speed_bands(traffic: Intruders, goal: Goal, span: ValueRange) -> tuple[ConflictBand, ...]:
    """Bands of the horizontal speed along the own track, m/s; none if it is out of range. The rate is an acceleration."""
    north, east, up = traffic.own_m_s
    speed, own_rad = float(np.hypot(north, east)), float(np.arctan2(east, north))
    along = np.array([np.cos(own_rad), np.sin(own_rad), 0.0])
    return _linear_bands(traffic, goal, span, speed, along, np.array([0.0, 0.0, up]), is_positive=True)


def vertical_speed_bands(traffic: Intruders, goal: Goal, span: ValueRange) -> tuple[ConflictBand, ...]:
    """Bands of the vertical speed, m/s, up positive; none if it is out of range. The rate is an acceleration."""
    north, east, up = traffic.own_m_s
    return _linear_bands(traffic, goal, span, up, np.array([0.0, 0.0, 1.0]), np.array([north, east, 0.0]))


def altitude_bands(traffic: Intruders, goal: Goal, span: ValueRange, altitude_m: float) -> tuple[ConflictBand, ...]:
    """Bands of the altitude in m, each reached at once and then kept; `altitude_m` is the own one.

    Altitudes are tried in steps from `span.low`; its rate is not used.
    """
    north, east, _ = traffic.own_m_s
    steps = np.arange(floor((span.high - span.low) / span.step) + 2)
    moved = np.zeros((len(steps), 3))
    moved[:, 2] = span.low + span.step * steps - altitude_m
    velocities = np.tile(np.array([north, east, 0.0]), (len(steps), 1))
    free = ~_conflicts(traffic, goal, moved, velocities, np.zeros(len(steps)), goal.lookahead_s)
    clear = {int(k) for k in np.flatnonzero(free)}
    runs = [(span.low + span.step * first, span.low + span.step * last) for first, last in _runs(clear)]
    return _bands(runs, span.low, span.high)


def _linear_bands(
    traffic: Intruders,
    goal: Goal,
    span: ValueRange,
    own: float,
    along: Floats,
    rest: Floats,
    *,
    is_positive: bool = False,
) -> tuple[ConflictBand, ...]:
    """Bands of the component of the own velocity along a direction; `rest` is the remainder of the velocity."""
    if not span.low <= own <= span.high:
        return ()
    clear: set[int] = set()
    for sign, room in ((-1, own - span.low), (1, span.high - own)):
        steps = np.arange(ceil(room / span.step) + 1)
        values = own + sign * span.step * steps
        velocities = values[:, None] * along + rest
        if span.rate == 0.0:
            free = _clear_at_once(traffic, goal, velocities)
        else:
            times = np.asarray(steps * (span.step / span.rate), np.float64)
            moved = (own * times + sign * span.rate * times * times / 2.0)[:, None] * along + times[:, None] * rest
            free = _clear_on_the_way(traffic, goal, moved, velocities, times, np.asarray(values < 0.0) & is_positive)
        if is_positive and span.rate == 0.0:
            free |= values < 0.0
        clear.update(sign * int(k) for k in np.flatnonzero(free))
    runs = [(own + span.step * first, own + span.step * last) for first, last in _runs(clear)]
    return _bands(runs, span.low, span.high)


def _clear_at_once(traffic: Intruders, goal: Goal, velocities: Floats) -> Booleans:
    still = np.zeros_like(velocities)
    return ~_conflicts(traffic, goal, still, velocities, np.zeros(len(velocities)), goal.lookahead_s)


def _clear_on_the_way(
    traffic: Intruders,
    goal: Goal,
    moved: Floats,
    velocities: Floats,
    times: Floats,
    ignored: Booleans | None = None,
) -> Booleans:
    """Which steps are clear: no violation on straight courses after the step, nor, step by step, on the way to it."""
    lookahead_s = goal.lookahead_s
    lasting_s = float(times[1] - times[0]) if len(times) > 1 else 0.0
    on_way = _conflicts(traffic, goal, moved, velocities, times, times + lasting_s) & (times < lookahead_s)
    after = _conflicts(traffic, goal, moved, velocities, times, lookahead_s) & (times <= lookahead_s)
    if ignored is not None:
        on_way, after = on_way & ~ignored, after & ~ignored
    free = ~after
    lost = np.flatnonzero(on_way)
    if len(lost):
        free[lost[0] :] = False
    return free


def _conflicts(
    traffic: Intruders, goal: Goal, moved: Floats, velocities: Floats, from_s: Floats, until_s: float | Floats
) -> Booleans:
    """Per step, whether from the place reached at `from_s`, flown straight on, any other is met until `until_s`."""
    v = traffic.v_m_s[None, :, :] - velocities[:, None, :]
    s = traffic.s_m[None, :, :] - moved[:, None, :] + velocities[:, None, :] * from_s[:, None, None]
    until = np.broadcast_to(np.asarray(until_s, float), from_s.shape)[:, None]
    entry_s, exit_s = violation_intervals(s, v, goal.thresholds, until, from_s[:, None])
    with np.errstate(invalid="ignore"):
        met = exit_s - entry_s > 3e-12 * np.maximum(np.abs(exit_s), 1e-1)
    result: Booleans = np.any(met, axis=1)
    return result


def _runs(clear: set[int]) -> list[tuple[int, int]]:
    """First and last of the steps that follow each other, where they are two at least."""
    runs: list[tuple[int, int]] = []
    for k in sorted(clear):
        if runs and k == runs[-1][1] + 1:
            runs[-1] = runs[-1][0], k
        else:
            runs.append((k, k))
    return [run for run in runs if run[0] < run[1]]


def _around(runs: Iterable[tuple[int, int]], own_rad: float, step_rad: float) -> list[tuple[float, float]]:
    """Runs of steps from the own track as ranges between 0 and 2 pi."""
    ranges: list[tuple[float, float]] = []
    for first, last in runs:
        if (last - first) * step_rad >= 2.0 * pi - _NOTHING:
            return [(0.0, 2.0 * pi)]
        low, high = (own_rad + first * step_rad) % (2.0 * pi), (own_rad + last * step_rad) % (2.0 * pi)
        ranges += [(low, high)] if low < high else [(0.0, high), (low, 2.0 * pi)]
    return ranges


def _ordered(value: float) -> int:
    """The bits of a number as an integer in the order of the numbers."""
    bits: int = unpack("<q", pack("<d", value))[0]
    return bits if bits >= 0 else -(bits + 2**63)


def _are_near(a: float, b: float) -> bool:
    """Whether DAIDALUS takes two bounds for one: within 2^40 units in the last place, about 1 in 5000."""
    if a == 0.0 or b == 0.0:
        return abs(a - b) < _NEAR_ZERO
    return abs(_ordered(a) - _ordered(b)) <= _NEAR_ULPS


def _bands(clear: Iterable[tuple[float, float]], low: float, high: float) -> tuple[ConflictBand, ...]:
    """Bands from `low` to `high`: the clear ranges, joined where they meet, and the ranges between them."""
    joined: list[tuple[float, float]] = []
    for first, last in sorted(clear):
        start, end = max(first, low), min(last, high)
        if start >= end or _are_near(start, end):
            continue
        if joined and (start <= joined[-1][1] or _are_near(start, joined[-1][1])):
            joined[-1] = joined[-1][0], max(joined[-1][1], end)
        else:
            joined.append((start, end))
    bands: list[ConflictBand] = []
    at = low
    for start, end in joined:
        begin = at if _are_near(at, start) else start
        if begin > at:
            bands.append(ConflictBand(at, begin, is_clear=False))
        at = high if _are_near(end, high) else end
        bands.append(ConflictBand(begin, at, is_clear=True))
    if at < high:
        bands.append(ConflictBand(at, high, is_clear=False))
    return tuple(bands)
