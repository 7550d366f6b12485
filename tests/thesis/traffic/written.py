"""The recorded files of examples/traffic/, from seeds; `python -m tests.thesis.traffic.written` writes them again."""

import json
import math
from collections.abc import Iterator
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from bench.crossings.passes import car_passes
from bench.crossings.recognition import links, snapped, stable
from bench.crossings.recognition import seen as seen_places
from bench.overtakes.drives import LANE_M, oncoming_too_near, seen
from bench.overtakes.recognition import LINK, relations
from bench.traffic.situations import drawn, lines
from dyknow.compunits import NO_CROSSING, ROAD_RELATIONS

EXAMPLES = Path(__file__).parents[3] / "examples" / "traffic"


Change = tuple[int, str, Any]
"""Valid time (us), attribute, value."""


def road() -> Iterator[Change]:
    """Relations of three cars, of which one overtakes and meets another; positions with errors of up to 2 m."""
    rng = np.random.default_rng(1)
    for at_us, (one, other), record in relations(seen(oncoming_too_near(rng), 100, 2.0, rng), filtered=True):
        for field, value in zip(ROAD_RELATIONS.fields, record, strict=True):
            yield at_us, f"car_relations.{field.name}[{one}, {other}]", value


def seen_cars() -> Iterator[dict[str, Any]]:
    """The same cars as samples of the source of overtakes.kpl."""
    rng = np.random.default_rng(1)
    positions = seen(oncoming_too_near(rng), 100, 2.0, rng)
    for i, at_us in enumerate(positions.at_us):
        for car, places in positions.places.items():
            x_m, y_m = (round(each, 2) for each in places[i].tolist())
            yield {"t_ms": at_us // 1000, "seen": [car, x_m, y_m, round(positions.road_deg, 2), LINK, NO_CROSSING]}


def vision_objects() -> Iterator[dict[str, Any]]:
    """On the map of town.geojson: a car overtakes another one on l1 and turns left at x1, where the other goes straight on.

    The tracker loses the other for three seconds, and has another symbol for it then.
    """
    rng = np.random.default_rng(1)
    at_s = np.arange(0.0, 60.0, 0.1)
    fast_m, slow_m = np.cumsum(np.interp(18.0 * at_s, [480.0, 560.0], [1.8, 0.7])), 60.0 + 12.0 * at_s
    out_m = np.interp(fast_m - slow_m, [-30.0, -20.0, 20.0, 30.0], [0.0, -2 * LANE_M, -2 * LANE_M, 0.0])
    turn = np.linspace(0.0, math.pi / 2, 20)
    east_m = np.concatenate([[0.0], 588.0 + 13.75 * np.sin(turn), [601.75]])
    north_m = np.concatenate([[0.0], 13.75 * (1.0 - np.cos(turn)), [300.0]]) - LANE_M
    done_m = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(east_m), np.diff(north_m)))])
    places = {
        "v1": np.stack([np.interp(fast_m, done_m, east_m), np.interp(fast_m, done_m, north_m) - out_m], axis=1),
        "v2": np.stack([slow_m, np.full(len(at_s), -LANE_M)], axis=1),
    }
    for i in range(len(at_s)):
        for symbol, each in places.items():
            x_m, y_m = (round(float(one + rng.uniform(-2.0, 2.0)), 2) for one in each[i])
            if symbol == "v2" and 20.0 <= at_s[i] < 23.0:
                continue
            called = "v3" if symbol == "v2" and at_s[i] >= 23.0 else symbol
            yield {"t_ms": round(1000 * at_s[i]), "tracker": [called, x_m, y_m, True]}


def streets() -> Iterator[dict[str, Any]]:
    """On the map of streets.geojson: traffic on the main road, on which one car breaks down, later one next to it.

    The first one stands in its lane from second 20 on, the other comes towards it and stops there from second 40 to 70.
    """
    rng = np.random.default_rng(1)
    at_s = np.arange(0.0, 80.0, 0.5)
    places = {f"car{n}": np.stack([10.0 * (at_s - begin), np.full(len(at_s), -1.75)], axis=1)
              for n, begin in enumerate((0.0, 6.0, 12.0))}  # fmt: skip
    broken = np.interp(at_s, [0.0, 4.0, 19.0, 20.0], [-40.0, 0.0, 148.0, 150.0])
    places["car3"] = np.stack([broken, np.full(len(at_s), -1.75)], axis=1)
    stops = np.interp(at_s, [26.0, 39.0, 40.0, 70.0, 71.0, 84.0], [290.0, 160.0, 155.0, 155.0, 150.0, 20.0])
    places["car4"] = np.stack([stops, np.full(len(at_s), 1.75)], axis=1)
    wants = {0.0: ("ambulance", "station", "hospital", 2.6), 10.0: ("crane", "station", "hospital", 6.0)}
    for i, now_s in enumerate(at_s):
        if now_s in wants:
            yield {"t_ms": round(1000 * now_s), "dispatcher": list(wants[now_s])}
        for symbol, each in places.items():
            x_m, y_m = (round(float(one + rng.uniform(-0.5, 0.5)), 2) for one in each[i])
            if 0.0 <= each[i][0] < 300.0 and not (symbol == "car4" and now_s < 26.0):
                yield {"t_ms": round(1000 * now_s), "tracker": [symbol, x_m, y_m]}


def manoeuvres() -> Iterator[dict[str, Any]]:
    """Samples for manoeuvres.kpl: a car cuts in in front of another one; later, elsewhere, a car turns back."""
    cuts = next(seed for seed in count(1, 5) if any(each[0] == "cuts_in" for each in drawn(seed).happens))
    turns = next(seed for seed in count(3, 5) if drawn(seed).happens)
    begin_ms = 0
    for seed, names in ((cuts, {"a": "a", "c": "b"}), (turns, {"a": "c"})):
        for each in lines(drawn(seed), seed, 0.5):
            name, *rest = each["seen"]
            yield {"t_ms": begin_ms + each["t_ms"], "seen": [names[name], *rest]}
        begin_ms += 40_000


def crossing() -> Iterator[Change]:
    """What the map says of a crossing, and the areas of two cars that turn left in it; the second is not seen in it."""
    driven = next(
        each for number in count() if (each := car_passes(np.random.default_rng(number), straight=False)).turn == "left"
    )
    for label in links(driven.roads):
        yield 0, str(label), True
    for hidden in (False, True):
        begin_us = 30_000_000 if hidden else 0
        places = seen_places(driven, np.random.default_rng(1), hidden=hidden)
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
    made = {
        "relations.jsonl": events(road()),
        "crossing.jsonl": events(crossing()),
        "streets.jsonl": streets(),
        "seen_cars.jsonl": seen_cars(),
        "seen_lanes.jsonl": manoeuvres(),
        "vision_objects.jsonl": vision_objects(),
    }
    return {name: "".join(f"{json.dumps(line)}\n" for line in lines) for name, lines in made.items()}


if __name__ == "__main__":
    for name, text in written().items():
        (EXAMPLES / name).write_text(text, encoding="utf-8")
