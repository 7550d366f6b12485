"""Overtakes that are harder than those of Table 8.2, and what only looks like one: `python -m bench.overtakes.varied`.

Speeds, distances to the side, overtakes that are broken off, several cars, and crossings shortly before, shortly after, or
in the middle of one. A run counts if what `passes` recognises is what happened: each overtake once, and no other.
"""

import argparse
import itertools
import json
import sys
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from bench.machine import machine
from bench.overtakes.drives import LANE_M, Drive, Run, seen
from bench.overtakes.recognition import recognised
from bench.overtakes.table import READINGS, wilson
from dyknow.compunits import NO_LINK

_RESULTS = Path(__file__).parent.parent / "results"
ERRORS_M: Final = (0, 2, 5)
PERIOD_MS: Final = 100
RUNS: Final = 100
CROSSING_M: Final = 24.0


class Situation(NamedTuple):
    """A run, the overtakes in it, (overtaker, overtaken), and where a crossing begins, if there is one (m)."""

    run: Run
    overtakes: Sequence[tuple[str, str]]
    crossing_m: float | None = None


def _gap(points: Sequence[tuple[float, float, float]], slow_m_s: float, **others: float) -> Run:
    """Car a by (s, metres behind b, metres to the right); b and others drive at one speed, others so far ahead of b."""
    at_s = [each[0] for each in points]
    start_m = points[0][1]
    along_m = [slow_m_s * at + start_m - behind for at, behind, _ in points]
    drives = {"a": Drive(at_s, along_m, [each[2] for each in points])}
    for car, ahead_m in {"b": 0.0, **others}.items():
        begin_m = start_m + ahead_m
        drives[car] = Drive((0.0, at_s[-1]), (begin_m, begin_m + slow_m_s * at_s[-1]), (LANE_M, LANE_M))
    level_s = float(np.interp(0.0, [-each[1] for each in points], at_s))
    return Run(drives, at_s[-1], level_s)


def _passing(
    rng: np.random.Generator, faster_m_s: tuple[float, float] = (4.0, 6.0), side_m: float = -LANE_M, **others: float
) -> Run:
    """From 60 m behind b to 60 m ahead of the last one; out from 20 m behind the first to 20 m ahead of the last."""
    faster, last_m = rng.uniform(*faster_m_s), max(others.values(), default=0.0)
    gaps_m = (60.0, 20.0, -20.0 - last_m, -60.0 - last_m)
    times = [(60.0 - gap) / faster for gap in gaps_m]
    sides = (LANE_M, side_m, side_m, LANE_M)
    return _gap(list(zip(times, gaps_m, sides, strict=True)), rng.uniform(8.0, 18.0), **others)


def slow(rng: np.random.Generator) -> Situation:
    return Situation(_passing(rng, (1.5, 3.0)), [("a", "b")])


def fast(rng: np.random.Generator) -> Situation:
    return Situation(_passing(rng, (10.0, 15.0)), [("a", "b")])


def close_by(rng: np.random.Generator) -> Situation:
    """The lanes are 2 m apart, as of a car that keeps to the middle."""
    return Situation(_passing(rng, side_m=LANE_M - 2.0), [("a", "b")])


def far_aside(rng: np.random.Generator) -> Situation:
    """Two lanes away."""
    return Situation(_passing(rng, side_m=LANE_M - 7.0), [("a", "b")])


def two_at_once(rng: np.random.Generator) -> Situation:
    return Situation(_passing(rng, c=rng.uniform(15.0, 30.0)), [("a", "b"), ("a", "c")])


def and_back(rng: np.random.Generator) -> Situation:
    """Car a passes b, slows down, and is passed by it."""
    there, back = rng.uniform(4.0, 6.0), rng.uniform(4.0, 6.0)
    gaps_m = (60.0, 20.0, -20.0, -50.0)
    points = [((60.0 - gap) / there, gap, side) for gap, side in zip(gaps_m, (1, -1, -1, 1), strict=True)]
    turn_s = points[-1][0] + 5.0
    points += [(turn_s + (gap + 50.0) / back, gap, -1) for gap in (-50.0, 50.0)]
    return Situation(_gap([(at, gap, side * LANE_M) for at, gap, side in points], 15.0), [("a", "b"), ("b", "a")])


def broken_off(rng: np.random.Generator) -> Situation:
    """Car a pulls out, comes to 8 to 15 m behind b, and falls back."""
    return _falls_back(rng, rng.uniform(8.0, 15.0))


def level_and_back(rng: np.random.Generator) -> Situation:
    """Car a draws level with b, stays there for some seconds, and falls back."""
    return _falls_back(rng, 0.0)


def _falls_back(rng: np.random.Generator, nearest_m: float) -> Situation:
    stays_s = rng.uniform(2.0, 5.0)
    gaps = (60.0, 25.0, nearest_m, nearest_m, 25.0, 50.0)
    steps = [0.0, *(abs(other - one) / 4.0 for one, other in itertools.pairwise(gaps))]
    steps[3] = stays_s
    at_s = np.cumsum(steps).tolist()
    sides = (LANE_M, -LANE_M, -LANE_M, -LANE_M, -LANE_M, LANE_M)
    return Situation(_gap(list(zip(at_s, gaps, sides, strict=True)), rng.uniform(10.0, 18.0)), [])


def before_a_crossing(rng: np.random.Generator) -> Situation:
    """It is 15 to 25 m ahead when it comes to the crossing."""
    run = _passing(rng)
    return Situation(run, [("a", "b")], _where_ahead(run, rng.uniform(15.0, 25.0)))


def after_a_crossing(rng: np.random.Generator) -> Situation:
    """It is 35 to 45 m behind, and so b is, on the link when it comes out of the crossing."""
    run = _passing(rng)
    return Situation(run, [("a", "b")], _where_ahead(run, -rng.uniform(35.0, 45.0)) - CROSSING_M)


def in_a_crossing(rng: np.random.Generator) -> Situation:
    """They are level in it: behind on one link, ahead on another."""
    run = _passing(rng)
    return Situation(run, [("a", "b")], _where_ahead(run, 0.0) - CROSSING_M / 2)


def _where_ahead(run: Run, ahead_m: float) -> float:
    """Where car a is when it is so far ahead of b."""
    at_s = np.arange(0.0, run.last_s, 0.05)
    a, b = (np.interp(at_s, run.drives[car].at_s, run.drives[car].along_m) for car in "ab")
    return float(np.interp(ahead_m, a - b, a))


SITUATIONS: Final[Mapping[str, Callable[[np.random.Generator], Situation]]] = {
    "slow": slow, "fast": fast, "close by": close_by, "far aside": far_aside, "two at once": two_at_once,
    "and back": and_back, "broken off": broken_off, "level and back": level_and_back,
    "before a crossing": before_a_crossing, "after a crossing": after_a_crossing, "in a crossing": in_a_crossing,
}  # fmt: skip


def is_right(name: str, number: int, error_m: float) -> bool:
    """Whether exactly what happens in run `number`, its seed, is recognised."""
    rng = np.random.default_rng((number, list(SITUATIONS).index(name)))
    situation = SITUATIONS[name](rng)
    positions = seen(situation.run, PERIOD_MS, error_m, rng)
    if situation.crossing_m is not None:
        positions = positions._replace(links=_links(situation, positions.at_us))
    found = recognised(positions, filtered=True, names=("passes",))
    made = [(one.bindings["?car1"], one.bindings["?car2"]) for one in found]
    return sorted(made) == sorted(situation.overtakes)


def _links(situation: Situation, at_us: Sequence[int]) -> dict[str, list[str]]:
    """The link of each car at each time, by where it really is: what the map says is not in question here."""
    begin_m = situation.crossing_m or 0.0
    found = {}
    for car, drive in situation.run.drives.items():
        along_m = np.interp(np.array(at_us) / 1e6, drive.at_s, drive.along_m)
        found[car] = ["l1" if at < begin_m else NO_LINK if at < begin_m + CROSSING_M else "l2" for at in along_m]
    return found


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python -m bench.overtakes.varied", description=(__doc__ or "").partition("\n")[0]
    )
    parser.add_argument("--runs", type=int, default=RUNS, help=f"of each situation and error ({RUNS})")
    parser.add_argument("--out", type=Path, default=_RESULTS, help="directory for the JSON")
    chosen = parser.parse_args()
    columns = [(reading, error_m) for reading in READINGS for error_m in ERRORS_M]
    print(" " * 20 + "".join(f"{f'{error_m} m, {reading}':>22}" for reading, error_m in columns))
    rows: list[dict[str, Any]] = []
    for name in SITUATIONS:
        shares = []
        for reading, error_m in columns:
            right = sum(is_right(name, number, READINGS[reading] * error_m) for number in range(chosen.runs))
            low, high = wilson(right, chosen.runs)
            rows.append(
                {"situation": name, "reading": reading, "error_m": error_m, "runs": chosen.runs, "right": right}
            )
            shares.append(f"{100 * right / chosen.runs:.0f} [{100 * low:.0f}, {100 * high:.0f}]")
        print(f"{name:20}" + "".join(f"{each:>22}" for each in shares), flush=True)
    taken = datetime.now(UTC)
    path = chosen.out / f"{taken:%Y%m%dT%H%M%S}-overtakes-varied.json"
    report = {"taken": taken.isoformat(timespec="seconds"), "machine": machine(), "situations": rows}
    path.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    print(f"kept in {path}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
