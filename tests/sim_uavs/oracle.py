"""What monitors should have said, worked out anew from what arrived and from where the vehicles really were.

Shares no code with the monitors: own geometry (through the centre of the earth), own joining of samples into states.
"""

from bisect import bisect_right
from collections.abc import Iterable, Sequence
from math import cos, hypot, radians, sin, sqrt
from typing import Any, NamedTuple

from dyknow import NO_VALUE, Sample
from dyknow.agents.monitoring.alarm_log import AlarmLog
from dyknow.sim_uavs.dynamics.vehicles import TrueState
from dyknow.sim_uavs.world.world import World
from tests.sim_uavs.worlds import Watched

PERIOD_US = 100_000
MAX_DELAY_US = 500_000
LABELS = ("heli-position", "heli-altitude", "heli-velocity")
DOUBTFUL_M = 0.05
"""Nearer than this to a threshold either verdict is right."""

Vector3 = tuple[float, float, float]


def ecef(latitude_deg: float, longitude_deg: float, altitude_m: float) -> Vector3:
    a, e2 = 6378137.0, 6.69437999014e-3
    lat, lon = radians(latitude_deg), radians(longitude_deg)
    n = a / sqrt(1.0 - e2 * sin(lat) ** 2)
    return (
        (n + altitude_m) * cos(lat) * cos(lon),
        (n + altitude_m) * cos(lat) * sin(lon),
        (n * (1.0 - e2) + altitude_m) * sin(lat),
    )


def level_offset_m(one: Sequence[float], other: Sequence[float]) -> tuple[float, float]:
    """(north, east) from one (latitude, longitude) to the other, both put at height 0, in the plane between them."""
    p, q = ecef(one[0], one[1], 0.0), ecef(other[0], other[1], 0.0)
    dx, dy, dz = (b - a for a, b in zip(p, q, strict=True))
    lat, lon = radians((one[0] + other[0]) / 2), radians((one[1] + other[1]) / 2)
    east = -sin(lon) * dx + cos(lon) * dy
    north = -sin(lat) * cos(lon) * dx - sin(lat) * sin(lon) * dy + cos(lat) * dz
    return north, east


class Pair(NamedTuple):
    """One state, and when it was there: position, altitude, velocity of the unit itself, then of the other; None where lacking."""

    valid_us: int
    complete_us: int
    values: tuple[Any, ...]


def violates_proximity(state: Pair) -> bool | None:
    """Whether the two are too close; None where that is not known, or too near to call."""
    pos, alt, _, other_pos, other_alt, _ = state.values
    if None in (pos, alt, other_pos, other_alt):
        return None
    xy, z = hypot(*level_offset_m(pos, other_pos)), abs(alt[0] - other_alt[0])
    return _and(_less(xy, 15.0), _less(z, 10.0))


def violates_warning(state: Pair) -> bool | None:
    """Whether `proximity-warn` does not hold."""
    pos, alt, vel, other_pos, other_alt, other_vel = state.values
    if None in (pos, alt, other_pos, other_alt):
        return None
    north, east = level_offset_m(pos, other_pos)
    down = alt[0] - other_alt[0]
    near = _and(_less(hypot(north, east), 60.0), _less(abs(down), 20.0))
    if vel is None or other_vel is None:
        return True if near else None
    vn, ve, vd = (b - a for a, b in zip(vel, other_vel, strict=True))
    squared = vn * vn + ve * ve + vd * vd
    time_s = 0.0 if squared == 0.0 else max(0.0, -(north * vn + east * ve + down * vd) / squared)
    soon = _and(
        _less(time_s, 10.0, 0.02),
        _less(hypot(north + vn * time_s, east + ve * time_s), 15.0),
        _less(abs(down + vd * time_s), 10.0),
    )
    return _or(near, soon)


def _less(value: float, bound: float, doubtful: float = DOUBTFUL_M) -> bool | None:
    return None if abs(value - bound) < doubtful else value < bound


def _and(*parts: bool | None) -> bool | None:
    return False if False in parts else None if None in parts else True


def _or(*parts: bool | None) -> bool | None:
    return True if True in parts else None if None in parts else False


MONITORS = {"proximity": violates_proximity, "proximity-warn": violates_warning}


# -- what arrived ----------------------------------------------------------------------------------------------------


def arrived(watched: Watched, label: str, unit: str) -> list[Sample]:
    """Every sample of a label of a unit that got into that platform's instance, in the order in which it did."""
    platform = watched.platform
    local = platform.built.gateway.translation.local_label(label, unit)
    if not platform.ports.network.has(local):
        return []
    held = platform.ports.network.generator(local).history.get_between(-(2**62), 2**62)
    return sorted(held, key=lambda sample: sample.available_us)


def delivered(samples: Iterable[Sample], from_us: int) -> dict[int, Sample]:
    """What the monitors' policy lets through: on the grid, in order, in time, from when the monitor was there."""
    found: dict[int, Sample] = {}
    last_us = None
    for sample in samples:
        if sample.available_us < from_us or sample.valid_us % PERIOD_US or sample.value is NO_VALUE:
            continue
        if last_us is not None and sample.valid_us <= last_us:
            continue
        if sample.available_us - sample.valid_us > MAX_DELAY_US:
            continue
        last_us = sample.valid_us
        found[sample.valid_us] = sample
    return found


def states(watched: Watched, other: str, from_us: int, to_us: int) -> list[Pair]:
    """The states of a monitor over `other` that exists from, to."""
    unit = watched.platform.unit
    inputs = [delivered(arrived(watched, label, one), from_us) for one in (unit, other) for label in LABELS]
    times = sorted(set().union(*inputs))
    found = []
    for valid_us in times:
        samples = [given.get(valid_us) for given in inputs]
        complete_us = max(_settled_us(given, valid_us) for given in inputs)
        if complete_us < to_us:
            values = tuple(None if sample is None else sample.value for sample in samples)
            found.append(Pair(valid_us, complete_us, values))
    return found


def _settled_us(given: dict[int, Sample], valid_us: int) -> int:
    """When it was clear what an input says about an instant: its sample came, or a later one, or the time was over."""
    if valid_us in given:
        return given[valid_us].available_us
    later = [sample.available_us for at_us, sample in given.items() if at_us > valid_us]
    return min([valid_us + MAX_DELAY_US, *later])


class Span(NamedTuple):
    """A monitor over one unit existed from, to; meanwhile it was told to doubt that unit's inputs in `doubted`."""

    monitor: str
    other: str
    from_us: int
    to_us: int
    doubted: tuple[tuple[int, int], ...]

    def doubts(self, from_us: int, to_us: int) -> bool:
        return any(start <= to_us and from_us <= end for start, end in self.doubted)


def spans(watched: Watched, end_us: int) -> list[Span]:
    """When which monitors existed, from what the platform's table of monitors was told."""
    owners: dict[str, set[str]] = {}
    members: dict[str, list[tuple[int, str]]] = {}
    named: dict[str, list[tuple[int, int]]] = {}
    since: dict[str, int] = {}
    for at_us, what, name, why in watched.calls:
        if what == "create":
            owners.setdefault(name, set()).add(why)
            since.setdefault(name, at_us)
        elif what == "remove" and name in owners:
            owners[name].discard(why)
            if not owners[name]:
                named.setdefault(name, []).append((since.pop(name), at_us))
                del owners[name]
        else:
            members.setdefault(name, []).append((at_us, what))
    for name, from_us in since.items():
        named.setdefault(name, []).append((from_us, end_us))
    return [
        Span(monitor, other, max(lo, start), min(hi, stop), doubted)
        for monitor, periods in named.items()
        for lo, hi in periods
        for other, told in members.items()
        for start, stop, doubted in _presences(told, end_us)
        if max(lo, start) < min(hi, stop)
    ]


def _presences(told: list[tuple[int, str]], end_us: int) -> list[tuple[int, int, tuple[tuple[int, int], ...]]]:
    found, start, doubt, doubted = [], None, None, []
    for at_us, what in told:
        if what == "join":
            start = at_us if start is None else start
            if doubt is not None:
                doubted.append((doubt, at_us))
                doubt = None
        elif what == "doubt" and start is not None:
            doubt = at_us if doubt is None else doubt
        elif what == "leave" and start is not None:
            if doubt is not None:
                doubted.append((doubt, at_us))
            found.append((start, at_us, tuple(doubted)))
            start, doubt, doubted = None, None, []
    if start is not None:
        if doubt is not None:
            doubted.append((doubt, end_us))
        found.append((start, end_us, tuple(doubted)))
    return found


# -- properties ------------------------------------------------------------------------------------------------------


def unalarmed(watched: Watched, end_us: int) -> list[str]:
    """Property (a), one way: states that violate a formula and were not alarmed within one period."""
    wrong = []
    for span in spans(watched, end_us):
        judge = MONITORS[span.monitor]
        events = _events(watched, span)
        for state in states(watched, span.other, span.from_us, span.to_us):
            if judge(state) is not True or span.doubts(state.valid_us, state.complete_us + PERIOD_US):
                continue
            if not _is_open(events, state.valid_us, state.complete_us + PERIOD_US):
                wrong.append(f"{watched.platform.unit}: {span.monitor} over {span.other}: no alarm at {state.valid_us}")
    return wrong


def _events(watched: Watched, span: Span) -> list[Any]:
    return [
        event
        for event in watched.platform.part(AlarmLog).events
        if event.monitor == span.monitor
        and event.units[1:] == (span.other,)
        and span.from_us <= event.detected_us <= span.to_us
    ]


def _is_open(events: list[Any], valid_us: int, by_us: int) -> bool:
    is_open = False
    for event in events:
        if event.valid_us <= valid_us and event.detected_us <= by_us:
            is_open = event.event == "opened"
    return is_open


def unfounded(watched: Watched, end_us: int) -> list[str]:
    """Property (a), the other way: alarms that opened or closed at a state that does not say so, or ended without their monitor."""
    wrong = []
    for span in spans(watched, end_us):
        judge = MONITORS[span.monitor]
        by_time = {state.valid_us: state for state in states(watched, span.other, span.from_us, end_us)}
        for event in _events(watched, span):
            state = by_time.get(event.valid_us)
            verdict = None if state is None else judge(state)
            if event.event == "ended":
                is_wrong = event.detected_us < span.to_us - PERIOD_US
            else:
                is_wrong = state is None or verdict is (event.event == "closed")
            if is_wrong:
                wrong.append(
                    f"{watched.platform.unit}: {span.monitor} over {span.other} {event.event} at {event.valid_us}"
                )
    return wrong


def truly_violated(world: World, one: str, other: str, margin_m: float) -> list[tuple[int, int]]:
    """Spells (first, last) in which the two were really too close, by more than `margin_m`."""
    spells: list[tuple[int, int]] = []
    for p, q in zip(world.nodes[one].truth, world.nodes[other].truth, strict=False):
        if not _too_close(p, q, margin_m):
            continue
        if spells and p.at_us - spells[-1][1] <= PERIOD_US:
            spells[-1] = (spells[-1][0], p.at_us)
        else:
            spells.append((p.at_us, p.at_us))
    return spells


def _too_close(p: TrueState, q: TrueState, margin_m: float) -> bool:
    xy = hypot(*level_offset_m((p.latitude_deg, p.longitude_deg), (q.latitude_deg, q.longitude_deg)))
    return xy < 15.0 - margin_m and abs(p.altitude_m - q.altitude_m) < 10.0 - margin_m


def heard_in(watched: Watched, other: str, from_us: int, to_us: int) -> int:
    """How many complete samples of `other`, valid in [from, to], this platform had within max delay."""
    sets = []
    for label in LABELS[:2]:
        good = {
            sample.valid_us
            for sample in arrived(watched, label, other)
            if sample.available_us - sample.valid_us <= MAX_DELAY_US
        }
        sets.append(good)
    both = sorted(set.intersection(*sets))
    return bisect_right(both, to_us) - bisect_right(both, from_us - 1)
