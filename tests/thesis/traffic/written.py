"""The recorded files of examples/traffic/, from seeds; `python -m tests.thesis.traffic.written` writes them again."""

import json
from collections.abc import Iterator
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from bench.crossings.passes import car_passes
from bench.crossings.recognition import links, snapped, stable
from bench.crossings.recognition import seen as positions
from bench.overtakes.drives import oncoming_too_near, seen
from bench.overtakes.recognition import relations
from compunits import ROAD_RELATIONS

EXAMPLES = Path(__file__).parents[3] / "examples" / "traffic"


Change = tuple[int, str, Any]
"""Valid time (us), attribute, value."""


def road() -> Iterator[Change]:
    """Relations of three cars, of which one overtakes and meets another; positions with errors of up to 2 m."""
    rng = np.random.default_rng(1)
    for at_us, (one, other), record in relations(seen(oncoming_too_near(rng), 100, 2.0, rng), filtered=True):
        for field, value in zip(ROAD_RELATIONS.fields, record, strict=True):
            yield at_us, f"car_relations.{field.name}[{one}, {other}]", value


def crossing() -> Iterator[Change]:
    """What the map says of a crossing, and the areas of two cars that turn left in it; the second is not seen in it."""
    driven = next(
        each for number in count() if (each := car_passes(np.random.default_rng(number), straight=False)).turn == "left"
    )
    for label in links(driven.roads):
        yield 0, str(label), True
    for hidden in (False, True):
        begin_us = 30_000_000 if hidden else 0
        places = positions(driven, np.random.default_rng(1), hidden=hidden)
        for at_us, _, areas in stable(snapped(driven.roads, *places)):
            for name, value in zip(("link", "crossing"), areas, strict=True):
                yield begin_us + at_us, f"cars.{name}[{'c2' if hidden else 'c1'}]", value


def events(values: Iterator[Change]) -> Iterator[dict[str, Any]]:
    """Where a value is another one than before."""
    last: dict[str, Any] = {}
    for at_us, attribute, value in values:
        if last.get(attribute) != value:
            yield {"t_ms": at_us // 1000, "attribute": attribute, "from": last.get(attribute), "to": value}
            last[attribute] = value


def written() -> dict[str, str]:
    made = {"relations.jsonl": events(road()), "crossing.jsonl": events(crossing())}
    return {name: "".join(f"{json.dumps(line)}\n" for line in lines) for name, lines in made.items()}


if __name__ == "__main__":
    for name, text in written().items():
        (EXAMPLES / name).write_text(text, encoding="utf-8")
