"""`python -m bench.attention [SCENE ...]`: gap coverage and reacquisition, attention next to a camera that looks down."""

import argparse
import json
import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

from bench.attention.flights import Hover, LooksAttentively, looks_down
from bench.attention.scenes import SCENES, scene
from bench.attention.scores import AttentionScore, mean, score
from bench.machine import machine

_RESULTS = Path(__file__).parent.parent / "results"
AHEAD = 0.10
"""By how much attention has to be ahead, in both scores."""


class Row(NamedTuple):
    """Means over the seeds of one scene, or over all scenes."""

    scene: str
    seeds: int
    attention: AttentionScore
    down: AttentionScore

    @property
    def met(self) -> bool:
        gap, reacquired = (self.attention[axis] - self.down[axis] for axis in (0, 1))
        return gap >= AHEAD and reacquired >= AHEAD


def row(name: str, seeds: int) -> Row:
    attention, down = [], []
    for seed in range(1, seeds + 1):
        flown = scene(name, seed)
        one, other = Hover(flown, seed), Hover(flown, seed)
        attention.append(score(one.fly(LooksAttentively(one.network))))
        down.append(score(other.fly(looks_down)))
    return Row(name, seeds, mean(attention), mean(down))


def show(found: Row) -> None:
    print(f"{found.scene}: {'met' if found.met else 'NOT met'}")
    for name, each in (("attention", found.attention), ("looks down", found.down)):
        figures = " ".join(f"{value:10.3f}" for value in each[:3]) + " ".join(f"{value:10.1f}" for value in each[3:])
        print(f"  {name:12}{figures}", flush=True)


def _plain(found: Row) -> dict[str, Any]:
    scores = {"attention": found.attention._asdict(), "down": found.down._asdict()}
    return {"scene": found.scene, "seeds": found.seeds, "met": found.met, **scores}


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m bench.attention", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help=f"of {', '.join(SCENES)}; default: all")
    parser.add_argument("--seeds", type=int, default=5, help="how many runs of every scene (5)")
    parser.add_argument("--out", type=Path, default=_RESULTS, help="directory for the JSON")
    asked = parser.parse_args()
    print(f"{'':14}" + " ".join(f"{name:>10}" for name in AttentionScore._fields))
    rows = []
    for name in asked.scenes or SCENES:
        rows.append(row(name, asked.seeds))
        show(rows[-1])
    rows.append(Row("all", asked.seeds, mean([each.attention for each in rows]), mean([each.down for each in rows])))
    show(rows[-1])
    asked.out.mkdir(parents=True, exist_ok=True)
    path = asked.out / f"{datetime.now(UTC):%Y%m%dT%H%M%S}-attention.json"
    report = {
        "taken": datetime.now(UTC).isoformat(timespec="seconds"),
        "command": " ".join(["python -m bench.attention", *sys.argv[1:]]),
        "machine": machine(),
        "scenes": [_plain(each) for each in rows],
    }
    path.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    print(f"kept in {path}")
    return 0 if rows[-1].met else 1


if __name__ == "__main__":
    sys.exit(main())
