"""`python -m bench.identity [SCENE ...]`: which thing is which, ours and its peers on the same percepts; table and JSON.

Ours is `dyknow link` as it is ready, without a map and without an option. norfair has the best of 36 settings, chosen by the score itself,
for each scene and each of the two figures: IDF1 over what is seen, and over all things since they were first seen and all
objects, predicted ones included.
"""

import argparse
import json
import logging
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from itertools import product
from math import hypot
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from bench.identity.crowds import CROWDS, CrowdLook, crowd
from bench.linkage.ours import lines_of
from bench.linkage.peers import Setting, by_norfair, per_percept
from bench.linkage.scores import Shown, Track
from bench.machine import machine

_RESULTS = Path(__file__).parent.parent / "results"
LIVES_S, DELAYS_S = (1.0, 2.5, 5.0), (0.0, 0.4, 1.0)
_TRUSTS = 4.0


class Figures(NamedTuple):
    """IDF1 over what is seen, and over everything."""

    seen: float
    everything: float


class Row(NamedTuple):
    """Of one scene, one seed."""

    scene: str
    seed: int
    percepts: int
    things: int
    at_once: int
    ours: Figures
    objects: int
    ms_per_percept: float
    norfair: Figures
    settings: tuple[Setting, Setting]
    per_percept: Figures

    @property
    def met(self) -> bool:
        """Whether ours is behind neither of both."""
        peers = zip(self.ours, self.norfair, self.per_percept, strict=True)
        return all(ours >= norfair and ours >= alone for ours, norfair, alone in peers)


def row(scene: str, seed: int, lasts_s: float | None = None) -> Row:
    looks, near_m = crowd(scene, seed, lasts_s), CROWDS[scene].near_m
    began_s = time.process_time()
    tracks = by_link(looks)
    spent_s = time.process_time() - began_s
    percepts = sum(len(look.percepts) for look in looks)
    best = [(-1.0, Setting(0.0, 0.0, 0.0, 0.0, ids=True))] * 2
    for setting in grid(scene):
        scores = figures(looks, by_norfair(looks, setting), near_m)
        best = [max(before, (score, setting)) for before, score in zip(best, scores, strict=True)]
    return Row(
        scene,
        seed,
        percepts,
        len({place.name for look in looks for place in look.truth}),
        max(len(look.truth) for look in looks),
        figures(looks, tracks, near_m),
        len({symbol for track in tracks for symbol in track}),
        round(spent_s / percepts * 1e3, 4),
        Figures(*(score for score, _ in best)),
        (best[0][1], best[1][1]),
        figures(looks, per_percept(looks), near_m),
    )


def grid(scene: str) -> Iterator[Setting]:
    """The settings of norfair, which matches a percept that continues by its name, as links do."""
    for reach_m, keeps_s, delay_s in product(CROWDS[scene].reaches_m, LIVES_S, DELAYS_S):
        yield Setting(reach_m, keeps_s, delay_s, _TRUSTS, ids=True)


def by_link(looks: Sequence[CrowdLook]) -> list[Track]:
    """The objects of `dyknow link`, as it reports them until the end."""
    visible = {look.t_us // 1000: {each.percept for each in look.percepts} for look in looks}
    states: dict[int, dict[str, Shown]] = defaultdict(dict)
    for line in lines_of(percept.record() for look in looks for percept in look.percepts):
        if "event" not in line:
            seen = not visible.get(line["t_ms"], set()).isdisjoint(line["linked_to"])
            states[line["t_ms"]][line["symbol"]] = Shown(line["x_m"], line["y_m"], seen)
    return [states[look.t_us // 1000] for look in looks]


def figures(looks: Sequence[CrowdLook], tracks: Sequence[Track], near_m: float) -> Figures:
    """IDF1, 2 IDTP / (things + objects), by its definition, twice."""
    return Figures(*(_idf1(looks, tracks, near_m, everything=everything) for everything in (False, True)))


def _idf1(looks: Sequence[CrowdLook], tracks: Sequence[Track], near_m: float, *, everything: bool) -> float:
    together: Counter[tuple[str, str]] = Counter()
    known: set[str | None] = set()
    count = 0
    for look, track in zip(looks, tracks, strict=True):
        visible = {percept.of for percept in look.percepts}
        known |= visible
        truth = [place for place in look.truth if place.name in (known if everything else visible)]
        shown = {symbol: place for symbol, place in track.items() if place.seen or everything}
        count += len(truth) + len(shown)
        together.update(_near(truth, shown, near_m))
    if not together:
        return 0.0
    things, symbols = (
        {name: at for at, name in enumerate(dict.fromkeys(pair[side] for pair in together))} for side in (0, 1)
    )
    table = np.zeros((len(things), len(symbols)))
    for (thing, symbol), looks_together in together.items():
        table[things[thing], symbols[symbol]] = looks_together
    rows, chosen = linear_sum_assignment(table, maximize=True)
    return 2.0 * float(table[rows, chosen].sum()) / count


def _near(truth: Sequence[Any], shown: Mapping[str, Shown], near_m: float) -> Iterator[tuple[str, str]]:
    for place in truth:
        for symbol, there in shown.items():
            if abs(there.x_m - place.x_m) <= near_m and hypot(there.x_m - place.x_m, there.y_m - place.y_m) <= near_m:
                yield place.name, symbol


def met(rows: Sequence[Row]) -> dict[str, bool]:
    """By scene: whether the mean of ours over the seeds is behind none of the others."""
    found: dict[str, bool] = {}
    for scene in dict.fromkeys(each.scene for each in rows):
        means = [
            np.mean([side for each in rows if each.scene == scene for side in (getattr(each, name),)], axis=0)
            for name in ("ours", "norfair", "per_percept")
        ]
        found[scene] = bool((means[0] >= means[1]).all() and (means[0] >= means[2]).all())
    return found


def show(found: Row) -> None:
    sides = (("ours", found.ours), ("norfair", found.norfair), ("an object per percept", found.per_percept))
    text = "  ".join(f"{name} {each.seen:.3f} {each.everything:.3f}" for name, each in sides)
    print(f"{found.scene:9} {found.seed:2}  {found.at_once:3} at once  {text}  {found.ms_per_percept:.3f} ms  "
          f"{'met' if found.met else 'NOT met'}", flush=True)  # fmt: skip


def _plain(value: Any) -> Any:
    if isinstance(value, Figures | Setting):
        return value._asdict()
    return [_plain(each) for each in value] if isinstance(value, tuple) else value


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m bench.identity", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help=f"of {', '.join(CROWDS)}; default: all")
    parser.add_argument("--seeds", type=int, default=3, help="how many runs of every scene (3)")
    parser.add_argument("--first", type=int, default=1, help="the first seed (1)")
    parser.add_argument("--out", type=Path, default=_RESULTS, help="directory for the JSON")
    asked = parser.parse_args()
    logging.disable(logging.WARNING)
    by_link(crowd("street", 0, 1.0))  # what the first command imports is no cost of a percept
    rows = []
    for scene, seed in product(asked.scenes or CROWDS, range(asked.first, asked.first + asked.seeds)):
        rows.append(row(scene, seed))
        show(rows[-1])
    bars = met(rows)
    asked.out.mkdir(parents=True, exist_ok=True)
    path = asked.out / f"{datetime.now(UTC):%Y%m%dT%H%M%S}-identity.json"
    report = {
        "taken": datetime.now(UTC).isoformat(timespec="seconds"),
        "command": " ".join(["python -m bench.identity", *sys.argv[1:]]),
        "machine": machine(),
        "met": bars,
        "rows": [{**{name: _plain(value) for name, value in each._asdict().items()}, "met": each.met} for each in rows],
    }
    path.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    print(f"kept in {path}")
    print(f"met: {bars}")
    return 0 if all(bars.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
