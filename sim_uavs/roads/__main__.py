"""`python -m sim_uavs.roads SCENE`: percepts of simulated traffic, the roads and the truth, as files to try things on.

`python -m sim_uavs.roads six`, then `dyknow link --percepts six.percepts.jsonl --roads six.roads.geojson`.
"""

import argparse
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from sim_uavs.roads.scenes import SCENES, RoadRecording, recorded


def truth_lines(recording: RoadRecording) -> Iterator[dict[str, Any]]:
    """Where every vehicle is at every look, and by which percept it is seen, if it is."""
    for look in recording.looks:
        percepts = {each.of: each.percept for each in look.percepts if not each.end}
        for state in look.truth:
            yield {
                "t_ms": look.t_us // 1000, "vehicle": state.name, "kind": state.kind, "percept": percepts.get(state.name),
                "x_m": round(state.x_m, 3), "y_m": round(state.y_m, 3), "speed_m_s": round(state.speed_m_s, 3),
                "link": state.link, "crossing": state.crossing, "passing": state.passing,
            }  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m sim_uavs.roads", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("scene", choices=SCENES)
    parser.add_argument("--seed", type=int, default=1, help="equal seeds give equal files (1)")
    parser.add_argument("--out", type=Path, default=Path(), help="directory for the files")
    options = parser.parse_args()
    recording = recorded(options.scene, options.seed)
    options.out.mkdir(parents=True, exist_ok=True)
    texts = {
        "percepts.jsonl": "".join(json.dumps(record) + "\n" for record in recording.records()),
        "truth.jsonl": "".join(json.dumps(record) + "\n" for record in truth_lines(recording)),
        "roads.geojson": json.dumps(recording.scene.roads) + "\n",
    }
    for name, text in texts.items():
        path = options.out / f"{options.scene}.{name}"
        path.write_text(text, encoding="utf-8")
        sys.stdout.write(f"{path}\n")


if __name__ == "__main__":
    main()
