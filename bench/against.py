"""This tree and another checkout measured in turn, A B A B: what a change did to the speed of a row."""

import json
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from statistics import median
from typing import Any

from bench.compare import Judged, judge
from bench.rows import Figures, Options, Ratio
from bench.turn import module_of

HERE = Path(__file__).parents[1]
BAR = 1.05
"""How much worse a median may be than before."""
BEFORE, AFTER = "before", "after"

Found = Mapping[str, Sequence[Figures]]
"""By side: the figures of each turn."""


def compared(name: str, before: Path, options: Options) -> dict[str, Any]:
    """Measure a row's own sides in both trees, `options.rounds` turns each; print and return the ratios.

    A turn is a process that warms up and measures a few rounds; its figure is their median. The trees take turns, so
    that what else the machine does meets both alike. Judged are the metrics that the row's bars are about; a rate is
    judged by its inverse, so that a ratio above 1 is always slower.
    """
    row = import_module(module_of(HERE / "bench", name))
    print(f"{name}  {row.TITLE}: after / before", flush=True)
    found: dict[str, dict[str, list[Figures]]] = {BEFORE: {}, AFTER: {}}
    for _turn in range(options.rounds):
        for tree, directory in ((BEFORE, before.resolve()), (AFTER, HERE)):
            for side, figures in _turned(name, directory, options).items():
                found[tree].setdefault(side, []).append(figures)
    judged = [
        verdict
        for side in sorted(found[BEFORE].keys() & found[AFTER].keys())
        for verdict in _verdicts(row, side, {tree: each[side] for tree, each in found.items()})
    ]
    for verdict in judged:
        met = "met    " if verdict.met else "NOT met"
        print(f"  {met}  {verdict.what}: {verdict.value:.3f} [{verdict.low:.3f}, {verdict.high:.3f}]", flush=True)
    print(flush=True)
    return {
        "row": name,
        "title": row.TITLE,
        "turns": options.rounds,
        "bars": [verdict._asdict() for verdict in judged],
        "figures": found,
    }


def _turned(name: str, directory: Path, options: Options) -> dict[str, Figures]:
    """One turn: by side, the median of each metric over its rounds."""
    done = subprocess.run(
        [sys.executable, "-P", str(HERE / "bench/turn.py"), name, str(options.effort), json.dumps([*options.sides])],
        cwd=directory, env={**os.environ, "PYTHONPATH": str(directory)}, check=True, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    rounds: dict[str, list[Figures]] = json.loads(done.stdout)
    return {side: {metric: median(one[metric] for one in of) for metric in of[0]} for side, of in rounds.items()}


def _verdicts(row: Any, side: str, trees: Found) -> list[Judged]:
    metrics = getattr(row, "COMPARED", None) or dict.fromkeys(bar.metric for bar in row.BARS if bar.ours == side)
    verdicts = []
    for metric in metrics:
        was, now = (median(one[metric] for one in trees[tree]) for tree in (BEFORE, AFTER))
        what = f"{side}: {metric} {was:,.4g} -> {now:,.4g}"
        if not was or not now:  # counts of what must not happen: no ratio
            verdicts.append(Judged(what, now - was, now - was, now - was, now <= was))
            continue
        rate = metric.endswith("per_s")
        given = {tree: [{metric: 1 / one[metric] if rate else one[metric]} for one in of] for tree, of in trees.items()}
        verdict = judge(Ratio(metric, BAR, ours=AFTER, peer=BEFORE), given)
        if verdict is not None:
            verdicts.append(verdict._replace(what=what))
    return verdicts
