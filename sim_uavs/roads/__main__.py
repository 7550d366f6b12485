"""`python -m dyknow.sim_uavs.roads SCENE`: percepts of simulated traffic, the roads and the truth, as files.

`python -m dyknow.sim_uavs.roads six`, then `dyknow link --percepts six.percepts.jsonl --roads six.roads.geojson`. With `--sumo FILE`,
floating car data of SUMO, its vehicles take the place of ours; their roads are the network of SUMO.
"""

import argparse
import json
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from dyknow.model.errors import WrongCall
from dyknow.sim_uavs.roads.percepts import PerceptSource, Seeing
from dyknow.sim_uavs.roads.scenes import SCENES, Look, recorded
from dyknow.sim_uavs.roads.sumo import floating_cars


def truth_lines(looks: Iterable[Look]) -> Iterator[dict[str, Any]]:
    """Where every vehicle is at every look, and by which percept it is seen, if it is."""
    for look in looks:
        percepts = {each.of: each.percept for each in look.percepts if not each.end}
        for state in look.truth:
            yield {
                "t_ms": look.t_us // 1000, "vehicle": state.name, "kind": state.kind, "percept": percepts.get(state.name),
                "x_m": round(state.x_m, 3), "y_m": round(state.y_m, 3), "speed_m_s": round(state.speed_m_s, 3),
                "link": state.link, "crossing": state.crossing, "passing": state.passing,
            }  # fmt: skip


def seen_of_sumo(text: bytes, seed: int) -> tuple[Look, ...]:
    """The vehicles of SUMO, seen in cycles as those of our scenes."""
    source = PerceptSource(Seeing(), (0.0, 0.0, 0.0, 0.0), np.random.default_rng(seed))
    return tuple(
        Look(now_us, tuple(states), tuple(source.look(states, now_us))) for now_us, states in floating_cars(text)
    )


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python -m dyknow.sim_uavs.roads", description=(__doc__ or "").partition("\n")[0]
    )
    parser.add_argument("scene", nargs="?", choices=SCENES, help="a scene of our own (six)", default="six")
    parser.add_argument("--sumo", type=Path, metavar="FILE", help="floating car data of SUMO instead of a scene")
    parser.add_argument("--seed", type=int, default=1, help="equal seeds give equal files (1)")
    parser.add_argument("--out", type=Path, default=Path(), help="directory for the files")
    options = parser.parse_args()
    texts = {}
    try:
        if options.sumo is None:
            recording = recorded(options.scene, options.seed)
            name, looks = options.scene, recording.looks
            texts["roads.geojson"] = json.dumps(recording.scene.roads) + "\n"
        else:
            name, looks = options.sumo.stem, seen_of_sumo(options.sumo.read_bytes(), options.seed)
    except (OSError, WrongCall) as error:
        parser.error(str(error))
    records = (percept.record() for look in looks for percept in look.percepts)
    texts["percepts.jsonl"] = "".join(json.dumps(record) + "\n" for record in records)
    texts["truth.jsonl"] = "".join(json.dumps(record) + "\n" for record in truth_lines(looks))
    options.out.mkdir(parents=True, exist_ok=True)
    for kind, text in sorted(texts.items()):
        path = options.out / f"{name}.{kind}"
        path.write_text(text, encoding="utf-8")
        sys.stdout.write(f"{path}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
