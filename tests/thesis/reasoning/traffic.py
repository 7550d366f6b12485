"""Cars on a road and in a crossing, from seeds, and the events that chronicles are recognised in (thesis 8.7.3-8.7.5).

`python -m tests.thesis.reasoning.traffic` writes the lists of events in examples/chronicles/ anew.

Cars are seen with a random error, "within an e x e meter square" (8.7.6); their relations and areas are computed by the
library's computational units, pass its stability filter of half a second, and are events where they change.
"""

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise, permutations
from pathlib import Path
from random import Random
from typing import NamedTuple, TypeAlias

from dyknow import Sample
from dyknow.compunits.motion import turn_deg
from dyknow.compunits.relations import CAR_RELATIONS
from dyknow.navigation import LocalFrame
from tests.compunits.units import process, value_of

PERIOD_MS = 100
OWN_LANE_M, OTHER_LANE_M, SHOULDER_M = 1.75, -1.75, 5.25
FRAME = LocalFrame(58.4, 15.6, 60.0)

Event: TypeAlias = dict[str, object]


class Leg(NamedTuple):
    """At `at_s` a car is so many metres along its road, and so many to the right of its middle."""

    at_s: float
    along_m: float
    right_m: float


Drive: TypeAlias = Sequence[Leg]


def where(drive: Drive, at_s: float) -> tuple[float, float] | None:
    """(along, right) in metres; None before its first and after its last leg."""
    for one, other in pairwise(drive):
        if one.at_s <= at_s <= other.at_s:
            part = (at_s - one.at_s) / (other.at_s - one.at_s)
            return one.along_m + part * (other.along_m - one.along_m), one.right_m + part * (
                other.right_m - one.right_m
            )
    return None


class Changes:
    """Events of attributes whose values have been stable for half a second."""

    def __init__(self, *, filtered: bool = True) -> None:
        self.events: list[Event] = []
        self._filtered = filtered
        self._filters: dict[str, object] = {}
        self._last: dict[str, object] = {}

    def on_value(self, at_ms: int, attribute: str, value: object) -> None:
        if self._filtered:
            if attribute not in self._filters:
                self._filters[attribute] = process("StabilityFilter")
            made = self._filters[attribute].on_sample(0, Sample(at_ms * 1000, at_ms * 1000, value), at_ms * 1000)
            if made is None:
                return
            value = made.value
        last = self._last.get(attribute)
        if value != last:
            self.events.append({"t_ms": at_ms, "attribute": attribute, "from": last, "to": value})
            self._last[attribute] = value


def road_events(
    drives: Mapping[str, Drive], seed: int, *, prefix: str = "", error_m: float = 1.0, heading_deg: float = 37.0
) -> list[Event]:
    """What cars on one road, which leads towards `heading_deg`, are to each other."""
    rng, changes = Random(seed), Changes()
    forward = {car: _forward(drive, heading_deg) for car, drive in drives.items()}
    last_s = max(drive[-1].at_s for drive in drives.values())
    for at_ms in range(0, int(last_s * 1000) + 1, PERIOD_MS):
        seen = dict(_seen(drives, at_ms / 1000, rng, error_m, heading_deg))
        for car in seen:
            changes.on_value(at_ms, f"{prefix}road[{car}]", "e4")
        for car, other in permutations(seen, 2):
            sides = value_of("CarRelations", seen[car], forward[car], seen[other])
            for field, value in zip(CAR_RELATIONS.fields, sides, strict=True):
                changes.on_value(at_ms, f"{prefix}{field.name}[{car}, {other}]", value)
            is_oncoming = abs(turn_deg(forward[car], forward[other])) > 90
            changes.on_value(at_ms, f"{prefix}oncoming[{car}, {other}]", is_oncoming)
            close = value_of("Close", seen[car], seen[other], metres=60.0)
            changes.on_value(at_ms, f"{prefix}close[{car}, {other}]", close)
    return changes.events


def _forward(drive: Drive, heading_deg: float) -> float:
    return heading_deg if drive[-1].along_m >= drive[0].along_m else (heading_deg + 180.0) % 360.0


def _seen(
    drives: Mapping[str, Drive], at_s: float, rng: Random, error_m: float, heading_deg: float
) -> Iterator[tuple[str, tuple[float, float]]]:
    angle = math.radians(heading_deg)
    for car, drive in drives.items():
        place = where(drive, at_s)
        if place is not None:
            along_m, right_m = (each + rng.uniform(-error_m / 2, error_m / 2) for each in place)
            north_m = along_m * math.cos(angle) - right_m * math.sin(angle)
            east_m = along_m * math.sin(angle) + right_m * math.cos(angle)
            yield car, FRAME.from_ned(north_m, east_m, 0.0)[:2]


# What may happen on a road


def following(rng: Random) -> dict[str, Drive]:
    """Car a stays behind car b."""
    speed_m_s, gap_m = rng.uniform(12, 25), rng.uniform(15, 40)
    return {
        "a": (Leg(0, 0, OWN_LANE_M), Leg(40, 40 * speed_m_s, OWN_LANE_M)),
        "b": (Leg(0, gap_m, OWN_LANE_M), Leg(40, gap_m + 40 * speed_m_s, OWN_LANE_M)),
    }


def overtaking(rng: Random, side_m: float = OTHER_LANE_M) -> dict[str, Drive]:
    """Car a passes car b with 3 to 5 m/s more; it is out of its lane from 25 m behind to 25 m ahead."""
    slow_m_s, more_m_s, gap_m = rng.uniform(12, 20), rng.uniform(3, 5), rng.uniform(40, 70)
    fast_m_s = slow_m_s + more_m_s
    out_s, back_s = (gap_m - 25) / more_m_s, (gap_m + 25) / more_m_s
    end_s = back_s + 15
    return {
        "a": (
            Leg(0, 0, OWN_LANE_M),
            Leg(out_s - 2, fast_m_s * (out_s - 2), OWN_LANE_M),
            Leg(out_s, fast_m_s * out_s, side_m),
            Leg(back_s, fast_m_s * back_s, side_m),
            Leg(back_s + 2, fast_m_s * (back_s + 2), OWN_LANE_M),
            Leg(end_s, fast_m_s * end_s, OWN_LANE_M),
        ),
        "b": (Leg(0, gap_m, OWN_LANE_M), Leg(end_s, gap_m + slow_m_s * end_s, OWN_LANE_M)),
    }


def meeting(rng: Random, *, too_near: bool, after_s: float = 1.0) -> dict[str, Drive]:
    """Car a passes car b, and meets car c: so long, or up to a second more, after it was level with b, or six seconds
    after it is back in its lane.
    """
    drives = overtaking(rng)
    passing = drives["a"]
    back, end = passing[3], passing[-1]
    fast_m_s = end.along_m / end.at_s
    beside_s = (passing[2].at_s + back.at_s) / 2
    meets_s = beside_s + rng.uniform(after_s, after_s + 1) if too_near else back.at_s + 8
    towards_m_s = rng.uniform(15, 22)
    begin_m = (fast_m_s + towards_m_s) * meets_s
    lane_m = OTHER_LANE_M * (2.5 if too_near else 1.0)
    return {**drives, "c": (Leg(0, begin_m, lane_m), Leg(end.at_s, begin_m - towards_m_s * end.at_s, lane_m))}


def hesitating(rng: Random, times: int = 3) -> dict[str, Drive]:
    """Car a draws level with car b and falls back behind it, so many times in less than a minute."""
    speed_m_s, gap_m = rng.uniform(15, 20), rng.uniform(12, 16)
    legs, at_s = [Leg(0, 0, OWN_LANE_M)], 0.0

    def on(seconds: float, behind_m: float, right_m: float) -> None:
        nonlocal at_s
        at_s += seconds
        legs.append(Leg(at_s, speed_m_s * at_s + gap_m - behind_m, right_m))

    for _ in range(times):
        on(4, gap_m, OWN_LANE_M)
        on(3, gap_m, OTHER_LANE_M)
        on(2, 0.5, OTHER_LANE_M)
        on(2, 0.5, OTHER_LANE_M)
        on(3, gap_m, OTHER_LANE_M)
        on(2, gap_m, OWN_LANE_M)
    on(5, gap_m, OWN_LANE_M)
    return {"a": tuple(legs), "b": (Leg(0, gap_m, OWN_LANE_M), Leg(at_s, gap_m + speed_m_s * at_s, OWN_LANE_M))}


# A crossing of four links: south l1, west l2, north l3, east l4

LEFT_TURNS = (("l1", "l2"), ("l2", "l3"), ("l3", "l4"), ("l4", "l1"))
_ARMS = {"l1": (0.0, -1.0), "l2": (-1.0, 0.0), "l3": (0.0, 1.0), "l4": (1.0, 0.0)}
_HALF_M = 10.0


def crossing_events(
    turns: Sequence[tuple[str, str, str]], seed: int, *, period_ms: int = PERIOD_MS, error_m: float = 1.0
) -> list[Event]:
    """Cars, (name, from, to), one after the other through the crossing x1, and what the map says of left turns."""
    rng = Random(seed)
    changes = Changes(filtered=period_ms <= 500)
    found: list[Event] = [
        {"t_ms": 0, "attribute": f"links.left[{one}, x1, {other}]", "from": None, "to": True}
        for one, other in LEFT_TURNS
    ]
    for number, (car, source, target) in enumerate(turns):
        speed_m_s, begin_ms = rng.uniform(8, 14), 1000 + number * 40_000
        for at_ms in range(0, int(160_000 / speed_m_s), period_ms):
            done_m = at_ms / 1000 * speed_m_s - 80
            arm, far_m = (_ARMS[source], -done_m) if done_m < 0 else (_ARMS[target], done_m)
            x, y = (each * far_m + rng.uniform(-error_m / 2, error_m / 2) for each in arm)
            link, crossing = area(x, y)
            changes.on_value(begin_ms + at_ms, f"cars.link[{car}]", link)
            changes.on_value(begin_ms + at_ms, f"cars.crossing[{car}]", crossing)
    return found + changes.events


def area(x: float, y: float) -> tuple[str, str]:
    """The link and the crossing of a place: areas that cover the roads, as in the GIS of 8.7.4."""
    if max(abs(x), abs(y)) <= _HALF_M:
        return "no_link", "x1"
    for link, (east, north) in _ARMS.items():
        if east * x + north * y > _HALF_M and abs(east * y) + abs(north * x) <= _HALF_M:
            return link, "no_crossing"
    return "no_link", "no_crossing"


EXAMPLES = Path(__file__).parents[3] / "examples" / "chronicles"


def written() -> dict[str, str]:
    """The lists of events in examples/chronicles/: a reckless overtake, and three cars through a crossing."""
    made = {
        "road.jsonl": road_events(meeting(Random(7), too_near=True), 7),
        "crossing.jsonl": crossing_events([("car1", "l1", "l2"), ("car2", "l4", "l2"), ("car3", "l4", "l1")], 7),
    }
    return {name: "".join(f"{json.dumps(event)}\n" for event in events) for name, events in made.items()}


if __name__ == "__main__":
    for name, text in written().items():
        (EXAMPLES / name).write_text(text, encoding="utf-8")
