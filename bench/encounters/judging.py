"""What came of an encounter, judged by where the vehicles truly were."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from itertools import combinations
from pathlib import Path
from typing import Any

from mcap.reader import make_reader

from bench.encounters.arducopter import Copter, Place, Seen
from bench.encounters.cases import NEITHER, YIELDS, Case, Leg

LEAST_M, LONGEST = 10.0, 1.4
TOLD_S = 2.0
LEAST_PACE = 0.95
"""Where simulated time ran slower than this, against that of the machine, the flight does not count."""
WARNED = ("proximity-warn", "opened")
_TROUBLE = ("does not fly its manoeuvre", "does not avoid", "leaves all of it", "leaves the manoeuvre to")
_MICRO = 1_000_000
_MOVES = ("goes ", "stops ", "waits short ", "flies on at ")


@dataclass
class Flown:
    """What came of an encounter.

    Attributes:
        least_m: smallest true distance of any two, of which level_m horizontally and upright_m vertically.
        paces: simulated time over that of this machine; load: of the machine, at the beginning and the end.
        factors: time to arrive as a multiple of the undisturbed one, by vehicle; None: it did not arrive, or only hovers.
        arrived: whether each is at its end when the flight is over.
        stops: how often each was diverted; resumes: how often each flew on after that. Both as noted, or as told to the
            delegator: a note that repeats itself is left out, and one that delegated may be gone.
        lost: the vehicles whose platform or link was lost for good; events: when that happened.
        trouble_s: when a vehicle could not do its part, which the case arranges; None: that is not arranged, or was not.
        told_s: how long after the trouble the operator of each was told, by vehicle; None: not at all.
        latency_s: from the sample that showed the meeting to the first order, by vehicle; None: nothing was ordered.
        modes: (time, vehicle, mode, mission item), each time one changed.
        track: (time, vehicle, north, east, up), twice a second.
    """

    case: Case
    least_m: float = math.inf
    level_m: float = math.inf
    upright_m: float = math.inf
    least_at_s: float = 0.0
    began: float = 0.0
    lasted_s: float = 0.0
    paces: list[float] = field(default_factory=list)
    load: list[float] = field(default_factory=list)
    factors: list[float | None] = field(default_factory=list)
    arrived: list[bool] = field(default_factory=list)
    stops: list[int] = field(default_factory=list)
    resumes: list[int] = field(default_factory=list)
    lost: list[int] = field(default_factory=list)
    events: list[tuple[float, str]] = field(default_factory=list)
    refused: list[tuple[float, str, str]] = field(default_factory=list)
    alarms: list[tuple[float, str, str, tuple[str, ...]]] = field(default_factory=list)
    notes: list[tuple[float, str, str]] = field(default_factory=list)
    told: list[tuple[float, str, str]] = field(default_factory=list)
    orders: list[tuple[float, int, str]] = field(default_factory=list)
    after_takeover: int = 0
    trouble_s: float | None = None
    told_s: list[float | None] = field(default_factory=list)
    latency_s: list[float | None] = field(default_factory=list)
    modes: list[tuple[float, int, str, int]] = field(default_factory=list)
    track: list[tuple[float, int, float, float, float]] = field(default_factory=list)

    @property
    def neither_s(self) -> float | None:
        """When it was told first that neither can avoid."""
        return next((at_s for at_s, monitor, event, _ in self.alarms if monitor == "neither-can-avoid"), None)

    @property
    def is_told(self) -> bool:
        """Whether both operators were told of the trouble in time."""
        return bool(self.told_s) and all(told_s is not None and told_s <= TOLD_S for told_s in self.told_s)

    @property
    def counts(self) -> bool:
        """Whether time ran as it should."""
        return all(pace >= LEAST_PACE for pace in self.paces)

    @property
    def met(self) -> bool:
        """Apart, and all arrived in time, or it was told that one could not; where neither can, that was told at both.

        Of one whose platform or link is lost for good nothing is asked for; in a flight with such a trouble the other
        has to arrive. Where nothing is near nothing may be ordered.
        """
        case = self.case
        if case.fault in NEITHER:
            return self.neither_s is not None and self.is_told
        if self.least_m <= LEAST_M or self.after_takeover:
            return False
        if case.is_harmless:
            return not self.orders
        if case.geometry.endswith("by a task"):
            return bool(self.refused)
        if self.events or case.geometry == "landing above":
            return all(there for number, there in enumerate(self.arrived) if number not in self.lost)
        return all(factor is not None and factor <= LONGEST for factor in self.factors) or self.is_told


def judge(
    found: Flown,
    copters: Sequence[Copter],
    routes: Sequence[Leg],
    alone_s: Sequence[float],
    began_s: float,
    records: Path,
) -> None:
    for one, other in combinations(copters, 2):
        for at_s, here, there in together(one.track, other.track):
            metres = here.distance_m(there)
            if metres < found.least_m:
                found.least_m, found.least_at_s = metres, at_s - began_s
                found.level_m, found.upright_m = math.dist(here[:2], there[:2]), abs(here.up_m - there.up_m)
    for copter, leg, alone in zip(copters, routes, alone_s, strict=True):
        _judge_one(found, copter, leg, alone, began_s, records)
    found.orders.sort()
    found.modes = sorted(mode for mode in found.modes if mode[0] >= 0.0)
    found.track.sort()
    found.trouble_s = found.trouble_s or _trouble_s(found, copters, began_s)
    if found.trouble_s is not None:
        found.told_s = [_told_s(found, copter.number, found.trouble_s) for copter in copters]


def _judge_one(found: Flown, copter: Copter, leg: Leg, alone: float, began_s: float, records: Path) -> None:
    first, last = copter.track[0], copter.track[-1]
    found.paces.append(round((last.sim_s - first.sim_s) / max(1e-6, last.at_s - first.at_s), 3))
    arrived = [seen for seen in copter.track if leg.is_there(seen.place)]
    found.factors.append((arrived[0].at_s - began_s) / alone if arrived and alone else None)
    found.arrived.append(leg.is_there(last.place))
    orders = [(sent.at_s - began_s, copter.number, _in_words(sent.message)) for sent in copter.tap.orders]
    found.orders += orders
    unit = str(copter.number)
    said = [[text for _, by, text in each if by == unit] for each in (found.notes, found.told)]
    found.stops.append(max(sum(_is_stop(unit, text) for text in each) for each in said))
    found.resumes.append(max(sum(_is_resume(unit, text) for text in each) for each in said))
    found.modes += [(mode.at_s - began_s, copter.number, mode.name, mode.item) for mode in copter.modes]
    shown_s = [shown for shown in _shown_s(records, unit, found.began) if orders and shown <= orders[0][0]]
    found.latency_s.append(round(orders[0][0] - min(shown_s), 3) if shown_s else None)
    at_s = -math.inf
    for seen in copter.track:
        if seen.at_s >= at_s + 0.5:
            at_s = seen.at_s
            north_m, east_m, up_m = (round(metres, 1) for metres in seen.place)
            found.track.append((round(at_s - began_s, 1), copter.number, north_m, east_m, up_m))


def _is_stop(unit: str, text: str) -> bool:
    return any(text.startswith(f"{unit} {move}") for move in _MOVES)


def _is_resume(unit: str, text: str) -> bool:
    return text.startswith(f"{unit} flies on") and " on at " not in text


def _shown_s(records: Path, unit: str, began: float) -> Iterator[float]:
    """When the samples were valid that showed a meeting, by the records of that platform."""
    for path in records.glob(f"{unit}-*.mcap"):
        with path.open("rb") as file:
            begun = [*_valid_us(file, path.stem.rpartition("-")[2])]
        if begun:
            yield max(begun) / _MICRO - began


def _valid_us(file: Any, since: str) -> Iterator[int]:
    """Of the positions that were there when the encounter began, at the time that is in the name of its record."""
    since_us = round(datetime.strptime(since, "%Y%m%dT%H%M%S.%f").replace(tzinfo=UTC).timestamp() * _MICRO)
    for _schema, channel, message in make_reader(file).iter_messages():
        if channel.topic.endswith("/heli-position") and message.log_time // 1000 <= since_us + 1000:
            yield message.publish_time // 1000


def _trouble_s(found: Flown, copters: Sequence[Copter], began_s: float) -> float | None:
    """When the vehicles that are to fail have failed: refused, could not be commanded, or their last order was overwritten."""
    fault = found.case.fault
    if fault in {"one AUTO", "both AUTO", "both RTL"}:
        return next((at_s for at_s, monitor, event, _ in found.alarms if (monitor, event) == WARNED), None)
    if fault == "refuses":
        return next((at_s for at_s, number, _ in found.orders if number == YIELDS), None)
    ordered_s = {number: at_s for at_s, number, _ in found.orders if at_s <= (found.neither_s or math.inf)}
    overwritten_s = [
        next((at_s - began_s for at_s in copter.streamed_s if at_s - began_s > ordered_s[copter.number]), math.inf)
        for copter in copters
        if copter.target is not None and copter.number in ordered_s
    ]
    return max(overwritten_s, default=None)


def _told_s(found: Flown, number: int, trouble_s: float) -> float | None:
    """How long after the trouble the operator of that vehicle was told of it, or before it (0)."""
    words = ("neither",) if found.case.fault in NEITHER else _TROUBLE
    told = [at_s for at_s, unit, text in found.notes if unit == str(number) and any(map(text.count, words))]
    if found.case.fault == "autopilot killed":  # nothing is known of it any more: its pairs are not monitored
        told += [at_s for at_s, _, event, units in found.alarms if event == "unknown" and units[:1] == (str(number),)]
    return max(0.0, min(told) - trouble_s) if told else None


def together(one: Sequence[Seen], other: Sequence[Seen]) -> Iterator[tuple[float, Place, Place]]:
    """(time, places) at every fix of the one, the other interpolated."""
    at = 0
    for seen in one:
        while at + 1 < len(other) and other[at + 1].at_s <= seen.at_s:
            at += 1
        if at + 1 >= len(other) or other[at].at_s > seen.at_s:
            continue
        before, after = other[at], other[at + 1]
        part = (seen.at_s - before.at_s) / max(1e-6, after.at_s - before.at_s)
        place = Place(*(a + part * (b - a) for a, b in zip(before.place, after.place, strict=True)))
        yield seen.at_s, seen.place, place


def _in_words(message: Any) -> str:
    known = {"command": "command", "z": "z", "custom_mode": "mode"}
    parts = [f"{name} {getattr(message, part)}" for name, part in known.items() if hasattr(message, part)]
    return " ".join([str(message.get_type()), *parts])
