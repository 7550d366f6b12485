"""Identities over platforms, as py-motmetrics scores them."""

import sys
from collections import Counter, defaultdict
from collections.abc import Mapping
from math import hypot
from statistics import fmean
from typing import Final, NamedTuple

import motmetrics
import numpy as np

from bench.cooperation.areas import PERIOD_US, Area, watchers
from bench.cooperation.results import keep
from bench.cooperation.wire import Wire
from dyknow.anchoring.cooperation.picture import GlobalPicture
from dyknow.sim_uavs.roads.layouts import blocks
from dyknow.sim_uavs.roads.shared import SharedTraffic

HIT_M: Final = 5.0
AREAS: Final = {str(at): Area(30.0 + 90.0 * at, 80.0, 70.0, 100.0) for at in range(3)}
"""Three platforms in a row over a town of 4 by 3 crossings: none sees it whole, neighbours have 50 m in common."""
CARS: Final = 12
_RNG = 31


class PictureScore(NamedTuple):
    """IDF1 and switches of what each platform sees, under the names that all have; how often all agree on a name."""

    idf1: float
    switches: int
    agreement: float
    names: int


def scored(seed: int, seconds: float = 60.0, warm_s: float = 4.0) -> PictureScore:
    """Run the town with a seed."""
    rng = np.random.default_rng((seed, _RNG))
    traffic = SharedTraffic(blocks(4, 3, 80.0), seed, CARS)
    looking = watchers(AREAS, rng)
    pictures = {unit: GlobalPicture(unit) for unit in AREAS}
    wire = Wire(pictures, rng)
    accumulator = motmetrics.MOTAccumulator(auto_id=True)
    agreed = Counter[bool]()
    numbers: dict[str, int] = defaultdict(lambda: len(numbers))
    start_us = 2_833_333 * 600_000_000
    for now_us in range(start_us, start_us + round(seconds * 1e6), PERIOD_US):
        cars = traffic.at(now_us) or []
        wire.step({unit: each.look(cars, now_us) for unit, each in looking.items()}, now_us)
        seen_by_any = {name: at for each in looking.values() for name, at in each.visible.items()}
        for unit, picture in pictures.items():
            rows = [each for each in picture.rows(now_us) if each.by]
            if now_us - start_us >= warm_s * 1e6:
                _enter(accumulator, seen_by_any, {numbers[row.name]: (row.state.x_m, row.state.y_m) for row in rows})
            for symbol in looking[unit].tracked:
                told = {each.name_of(unit, symbol) for each in pictures.values()}
                if told != {None}:
                    agreed[len(told) == 1] += 1
    metrics = motmetrics.metrics.create()
    found = metrics.compute(accumulator, metrics=["idf1", "num_switches"], name="all")
    return PictureScore(
        float(found["idf1"].iloc[0]),
        int(found["num_switches"].iloc[0]),
        agreed[True] / max(1, sum(agreed.values())),
        len(numbers),
    )


def _enter(
    accumulator: motmetrics.MOTAccumulator,
    truth: Mapping[str, tuple[float, float]],
    shown: Mapping[int, tuple[float, float]],
) -> None:
    """One frame."""
    apart = np.array([[hypot(x - a, y - b) for a, b in shown.values()] for x, y in truth.values()])
    apart = np.where(apart > HIT_M, np.nan, apart) if apart.size else apart.reshape(len(truth), len(shown))
    accumulator.update([int(name[3:]) for name in truth], list(shown), apart)


def main() -> None:
    scores = []
    for seed in range(int(sys.argv[1])):
        scores.append(scored(seed)._asdict())
        print(seed, scores[-1], flush=True)
    figures = {name: fmean(each[name] for each in scores) for name in ("idf1", "agreement")}
    print(keep("cooperation-scores", {"mean": figures, "runs": scores}))


if __name__ == "__main__":
    main()
