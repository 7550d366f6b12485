"""`python -m bench.linkage [SCENE ...]`: one symbol for one car, ours and its peers on the same percepts; table and JSON.

Ours is `dyknow link` with its ready specification, the same for all scenes. norfair is taken at the best of a grid of settings,
chosen by the score itself: for each scene the best of all of them, by IDF1 over what is seen and by that over everything, and the
best of those which, as ours has to, wait a second before there is an object; and the one that is best over all scenes together.
"""

import argparse
import json
import logging
import sys
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from bench.linkage.ours import by_links
from bench.linkage.peers import GRID, Setting, by_norfair, per_percept, variants
from bench.linkage.scores import Score, mean, quick_idf1, score
from bench.machine import machine
from dyknow.sim_uavs.roads.scenes import SCENES, RoadRecording, recorded

_RESULTS = Path(__file__).parent.parent / "results"
BARS = {
    "one": 0.95, "noise": 0.85, "two": 0.95, "six": 0.96, "clutter": 0.90, "twelve": 0.95, "gaps": 0.80, "slow": 0.80,
    "dense": 0.70,
}  # fmt: skip
GAP = 0.8
"""Of the scene "one", where there are no switches either."""
CONFIRMS_S = 1.0
FEW, FINALISTS = 2, 5
"""Recordings on which all settings are compared, and how many settings are compared on all recordings."""


class Row(NamedTuple):
    """Means over the seeds; `clutter_objects` counts objects made of clutter, over all seeds.

    Attributes:
        at_once: ours without the states of an object from before it was established.
        norfair, norfair_all: the best by IDF1 over what is seen, and by that over everything.
        quick: IDF1 over what is seen of all settings over a few seeds.
    """

    scene: str
    seeds: int
    ours: Score
    at_once: Score
    clutter_objects: int
    norfair: Score
    setting: Setting
    norfair_all: Score
    setting_all: Setting
    norfair_confirmed: Score
    setting_confirmed: Setting
    per_percept: Score
    quick: dict[Setting, float]

    @property
    def met(self) -> bool:
        """Whether ours is where it has to be."""
        alone = self.scene != "one" or (self.ours.switches == 0 and self.ours.gap >= GAP)
        return self.ours.idf1 >= BARS[self.scene] and alone and not self.clutter_objects


def row(scene: str, seeds: int) -> Row:
    recordings = _recordings(scene, seeds)
    linked = [by_links(recording) for recording in recordings]
    clutter = sum(each.from_clutter(recording) for each, recording in zip(linked, recordings, strict=True))
    quick, quick_all = (
        {setting: _quick(recordings[:FEW], setting, everything=everything) for setting in GRID}
        for everything in (False, True)
    )
    best, setting = _best(recordings, quick)
    best_all, setting_all = _best(recordings, quick_all, everything=True)
    late = {setting: figure for setting, figure in quick.items() if setting.delay_s >= CONFIRMS_S}
    confirmed, later = _best(recordings, late)
    ours = mean([score(each.looks, tracks) for each, (tracks, _) in zip(recordings, linked, strict=True)])
    at_once = [by_links(recording, since_seen=False).tracks for recording in recordings]
    known = mean([score(each.looks, tracks) for each, tracks in zip(recordings, at_once, strict=True)])
    alone = mean([score(each.looks, per_percept(each.looks)) for each in recordings])
    return Row(scene, seeds, ours, known, clutter, best, setting, best_all, setting_all, confirmed, later, alone, quick)


def _quick(recordings: Sequence[RoadRecording], setting: Setting, *, everything: bool = False) -> float:
    tracks = (by_norfair(each.looks, setting) for each in recordings)
    scores = [
        quick_idf1(each.looks, found, everything=everything) for each, found in zip(recordings, tracks, strict=True)
    ]
    return float(np.mean(scores))


def _best(
    recordings: Sequence[RoadRecording], quick: dict[Setting, float], *, everything: bool = False
) -> tuple[Score, Setting]:
    """The best setting over all recordings among those that are best in a few, or a variant of it."""
    chosen = sorted(quick, key=lambda setting: -quick[setting])[:FINALISTS]
    first = max(chosen, key=lambda setting: _quick(recordings, setting, everything=everything))
    scored = [
        (mean([score(each.looks, by_norfair(each.looks, setting)) for each in recordings]), setting)
        for setting in variants(first)
    ]
    return max(scored, key=lambda each: each[0].idf1_all if everything else each[0].idf1)


def show(found: Row) -> None:
    sides: tuple[tuple[str, Score], ...] = (
        ("ours", found.ours),
        ("ours, as known at each time", found.at_once),
        ("norfair, best over what is seen", found.norfair),
        ("norfair, best over everything", found.norfair_all),
        ("norfair, best that waits 1 s", found.norfair_confirmed),
        ("an object per percept", found.per_percept),
    )
    print(f"{found.scene}: bar {BARS[found.scene]:.2f}, {'met' if found.met else 'NOT met'}; "
          f"{found.clutter_objects} objects of clutter", flush=True)  # fmt: skip
    for name, each in sides:
        print(f"  {name:30} {_figures(each)}")


def one_for_all(rows: Sequence[Row]) -> tuple[Setting, dict[str, Score]]:
    """The setting of norfair that is best over all scenes, and its scores."""
    setting = max(GRID, key=lambda each: sum(row.quick[each] for row in rows))
    scores = {}
    print(f"norfair with one setting for all, {setting}")
    for row in rows:
        recordings = _recordings(row.scene, row.seeds)
        found = scores[row.scene] = mean([score(each.looks, by_norfair(each.looks, setting)) for each in recordings])
        print(f"  {row.scene:30} {_figures(found)}   ours {row.ours.idf1:.3f}", flush=True)
    return setting, scores


def _recordings(scene: str, seeds: int) -> list[RoadRecording]:
    return [recorded(scene, seed) for seed in range(1, seeds + 1)]


def _figures(each: Score) -> str:
    return f"{each.idf1:8.3f} {each.idf1_all:8.3f} {each.switches:8.1f} {each.gap:8.3f} {each.objects:8.1f}"


def _report(rows: Sequence[Row]) -> list[dict[str, Any]]:
    return [
        {
            **{name: _plain(value) for name, value in each._asdict().items() if name != "quick"},
            "bar": BARS[each.scene],
            "met": each.met,
        }
        for each in rows
    ]


def _plain(value: Any) -> Any:
    return value._asdict() if isinstance(value, Score | Setting) else value


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m bench.linkage", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help=f"of {', '.join(SCENES)}; default: all")
    parser.add_argument("--seeds", type=int, default=5, help="how many runs of every scene (5)")
    parser.add_argument("--out", type=Path, default=_RESULTS, help="directory for the JSON")
    asked = parser.parse_args()
    logging.disable(logging.WARNING)  # norfair's advice to use a vectorised distance
    print(f"{'':32} {'IDF1':>8} {'with all':>8} {'switches':>8} {'gap':>8} {'objects':>8}")
    rows = []
    for scene in asked.scenes or SCENES:
        rows.append(row(scene, asked.seeds))
        show(rows[-1])
    setting, scores = one_for_all(rows)
    asked.out.mkdir(parents=True, exist_ok=True)
    path = asked.out / f"{datetime.now(UTC):%Y%m%dT%H%M%S}-linkage.json"
    report = {
        "taken": datetime.now(UTC).isoformat(timespec="seconds"),
        "command": " ".join(["python -m bench.linkage", *sys.argv[1:]]),
        "machine": machine(),
        "scenes": _report(rows),
        "one_for_all": {"setting": _plain(setting), "scores": {name: _plain(each) for name, each in scores.items()}},
    }
    path.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    print(f"kept in {path}")
    return 0 if all(each.met for each in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
