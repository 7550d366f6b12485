"""The recorded files of examples/traffic/, from seeds; `python -m tests.thesis.traffic.written` writes them again."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from bench.overtakes.drives import oncoming_too_near, seen
from bench.overtakes.recognition import relations
from compunits import ROAD_RELATIONS

EXAMPLES = Path(__file__).parents[3] / "examples" / "traffic"


def events() -> Iterator[dict[str, Any]]:
    """Changes of the relations of three cars, of which one overtakes and meets another; with errors of up to 2 m."""
    rng = np.random.default_rng(1)
    last: dict[str, bool] = {}
    for at_us, (one, other), record in relations(seen(oncoming_too_near(rng), 100, 2.0, rng), filtered=True):
        for field, value in zip(ROAD_RELATIONS.fields, record, strict=True):
            attribute = f"car_relations.{field.name}[{one}, {other}]"
            if last.get(attribute) != value:
                yield {"t_ms": at_us // 1000, "attribute": attribute, "from": last.get(attribute), "to": value}
                last[attribute] = value


def written() -> dict[str, str]:
    made = {"relations.jsonl": events()}
    return {name: "".join(f"{json.dumps(line)}\n" for line in lines) for name, lines in made.items()}


if __name__ == "__main__":
    for name, text in written().items():
        (EXAMPLES / name).write_text(text, encoding="utf-8")
