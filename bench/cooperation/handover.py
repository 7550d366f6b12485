"""An overtake that begins in the area of one platform and ends in that of another, at each level of sharing.

Platform 0 sees the beginning, and is to recognise it. `python -m bench.cooperation.handover` counts in how many of 200 seeded runs
it does, from 0 to 199: exactly that overtake, and at most 5 s after it happened. The figures are kept in bench/results/.
"""

import sys
from collections.abc import Mapping
from functools import cache
from typing import Final, NamedTuple

import numpy as np

from bench.cooperation.areas import PERIOD_US, Area, Place, Watcher
from bench.cooperation.results import keep
from bench.cooperation.wire import PerceptWire, Wire
from bench.overtakes.drives import LANE_M, Drive, Run
from bench.overtakes.recognition import chronicles
from dyknow.anchoring.cooperation.manoeuvres import (
    LATE_US,
    PairEvents,
    PairRelations,
    SpanningManoeuvres,
    as_relation,
)
from dyknow.anchoring.cooperation.picture import HOLD_US, GlobalPicture
from dyknow.anchoring.cooperation.sharing import LEVELS, SharingLevel

RUNS: Final = 200
START_US: Final = 1_700_000_000_000_000
REACH_M: Final = 300.0
NEAR_S: Final = 5.0
_RNG = 37


class Spanning(NamedTuple):
    """A run, what each platform sees, and when car a is level with car b."""

    run: Run
    areas: Mapping[str, Area]


def spanning(rng: np.random.Generator) -> Spanning:
    """Car a overtakes car b, 3 to 6 m/s faster; where it is level one area ends and the other begins, with up to 5 m between or in common."""
    slow_m_s, more_m_s = rng.uniform(10.0, 15.0), rng.uniform(3.0, 6.0)
    gap_m = rng.uniform(40.0, 50.0)
    level_s = gap_m / more_m_s
    out_s, back_s = (gap_m - 20.0) / more_m_s, (gap_m + 20.0) / more_m_s
    last_s = 2.0 * level_s + 4.0
    at_s = (0.0, out_s - 2.0, out_s, back_s, back_s + 2.0, last_s)
    fast = Drive(at_s, [(slow_m_s + more_m_s) * at for at in at_s], (LANE_M, LANE_M, -LANE_M, -LANE_M, LANE_M, LANE_M))
    passed = Drive((0.0, last_s), (gap_m, gap_m + slow_m_s * last_s), (LANE_M, LANE_M))
    border_m = (slow_m_s + more_m_s) * level_s + rng.uniform(-4.0, 4.0)
    common_m = rng.uniform(-5.0, 5.0)
    half_m = REACH_M / 2
    areas = {
        "0": Area(border_m + common_m / 2 - half_m, 0.0, half_m, 40.0),
        "1": Area(border_m - common_m / 2 + half_m, 0.0, half_m, 40.0),
    }
    return Spanning(Run({"a": fast, "b": passed}, last_s, level_s), areas)


def places(run: Run, at_s: float) -> list[Place]:
    """Where the cars are: the road leads to the east."""
    return [
        Place(name, float(np.interp(at_s, each.at_s, each.along_m)), -float(np.interp(at_s, each.at_s, each.right_m)))
        for name, each in run.drives.items()
    ]


class Outcome(NamedTuple):
    """Pairs of names that were recognised, with the time in s; what the names of the cars were."""

    recognised: list[tuple[tuple[str, ...], float]]
    names: Mapping[str, str | None]


def outcome(seed: int, level: SharingLevel) -> Outcome:
    """One run."""
    rng = np.random.default_rng((seed, _RNG))
    run, areas = spanning(rng)
    watching = {unit: Watcher(unit, area, each) for (unit, area), each in zip(areas.items(), rng.spawn(2), strict=True)}
    pictures = {unit: GlobalPicture(unit) for unit in (areas if level != "percepts" else "0")}
    wire, percepts = Wire(pictures, rng, level), PerceptWire("1", rng)
    if level == "percepts":  # 1 links nothing: 0 links what it detects, and names it
        pictures["0"].name_for("1")
    relations = {unit: PairRelations() for unit in pictures}
    events, spans = PairEvents(), SpanningManoeuvres(chronicles(), "passes")
    names: dict[str, str | None] = {}
    for now_us in range(START_US, START_US + round(run.last_s * 1e6), PERIOD_US):
        cars = places(run, (now_us - START_US) / 1e6)
        if level == "percepts":
            reports = {"0": watching["0"].look(cars, now_us)}
            for report in percepts.step(watching["1"].percepts(cars, now_us), now_us):
                pictures["0"].report(report, now_us)
        else:
            reports = {unit: each.look(cars, now_us) for unit, each in watching.items()}
        wire.step(reports, now_us)
        if now_us % 200_000 == 0:
            at_us = now_us - HOLD_US
            for unit, each in relations.items():
                shown = [row for row in pictures[unit].rows(at_us) if unit == "0" or unit in row.by]
                if unit == "0" and level in {"none", "events", "relations"}:
                    shown = [row for row in shown if "0" in row.by]
                found = each.step(shown, at_us)
                if unit == "0":
                    spans.take(found)
                elif level == "relations":
                    for relation in each.news(found):
                        spans.take_from(relation, now_us)
                elif level == "events":
                    for event in events.news(found):
                        spans.take_from(as_relation(event), now_us)
        if now_us - START_US < (run.level_s - 3.0) * 1e6:
            names |= _names(pictures["0"], cars, now_us)
    instances = spans.on_time(now_us + LATE_US)
    return Outcome([(spans.subjects(each), each.instants["past"] / 1000 - START_US / 1e6) for each in instances], names)


def _names(picture: GlobalPicture, cars: list[Place], now_us: int) -> dict[str, str | None]:
    found: dict[str, str | None] = {}
    rows = [row for row in picture.rows(now_us) if row.by]
    for car in cars:
        near = [row for row in rows if np.hypot(row.state.x_m - car.x_m, row.state.y_m - car.y_m) < 2.0]
        if len(near) == 1 and near[0].by == ("0",):
            found[car.name] = near[0].name
    return found


def is_right(seed: int, level: SharingLevel) -> bool:
    """Whether exactly the overtake that happened was recognised, when it happened."""
    run, _ = spanning(np.random.default_rng((seed, _RNG)))
    found = outcome(seed, level)
    if len(found.recognised) != 1:
        return False
    pair, at_s = found.recognised[0]
    return pair == (found.names.get("a"), found.names.get("b")) and 0.0 <= at_s - run.level_s <= NEAR_S


@cache
def counted(level: SharingLevel, runs: int = RUNS) -> int:
    """In how many runs it is right."""
    return sum(is_right(seed, level) for seed in range(runs))


def main() -> None:
    number = int(sys.argv[1]) if len(sys.argv) > 1 else RUNS
    figures = {"runs": number}
    for each in LEVELS:
        figures[each] = counted(each, number)
        print(f"{each}: {figures[each]} of {number}", flush=True)
    print(keep("cooperation-handover", figures))


if __name__ == "__main__":
    main()
