"""Crossings and cars that pass them, from seeds.

A crossing has three or four arms; each is a link of two lanes, on which cars drive on the right. A car comes along the
lane of one arm, slows down, goes through the crossing in a curve, and leaves along the lane of another arm, or of the same.
"""

import json
import math
from typing import Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dyknow.anchoring.roads.files.formats import read_roads
from dyknow.anchoring.roads.network import RoadNetwork
from dyknow.anchoring.roads.turns import STRAIGHT

ARM_M: Final = 100.0
RADIUS_M: Final = 12.0
LANE_M: Final = 1.75
CROSSING: Final = "x1"

Floats: TypeAlias = NDArray[np.float64]


class Pass(NamedTuple):
    """A car that passes a crossing.

    Attributes:
        roads: the crossing `x1` and its links `l1`, `l2`, ...
        source, target, turn: the links, and what the map says of them.
        at_s: times of the places.
        places: (n, 2), x east and y north in metres.
    """

    roads: RoadNetwork
    source: str
    target: str
    turn: str
    at_s: Floats
    places: Floats


def car_passes(rng: np.random.Generator, *, straight: bool, back: bool = True) -> Pass:
    """A car that goes straight on, or that turns left, right or, if it may, sometimes back on its link."""
    while True:
        headings = _headings(rng)
        roads = crossing(headings)
        ways = {
            (one, other): roads.turns.relation_of(one, CROSSING, other)
            for one in roads.links
            for other in roads.links
            if one != other or (back and rng.random() < 0.1)
        }
        wanted = [(*pair, way) for pair, way in ways.items() if way is not None and (way == STRAIGHT) is straight]
        if wanted:
            source, target, turn = wanted[rng.integers(len(wanted))]
            path = _path(headings[int(source[1:]) - 1], headings[int(target[1:]) - 1])
            return Pass(roads, source, target, turn, *_driven(path, rng))


def crossing(headings_rad: Floats) -> RoadNetwork:
    """Arms that lead away from the origin in these directions, counter-clockwise from east."""
    features = [
        {
            "properties": {"id": CROSSING, "kind": "crossing", "radius_m": RADIUS_M},
            "geometry": _geometry("Point", (0, 0)),
        }
    ]
    for number, heading in enumerate(headings_rad, start=1):
        line = ((0.0, 0.0), (ARM_M * math.cos(heading), ARM_M * math.sin(heading)))
        about = {"id": f"l{number}", "from": CROSSING, "width_m": 7.0, "speed_m_s": 14.0}
        features.append({"properties": about, "geometry": _geometry("LineString", line)})
    collection = {
        "type": "FeatureCollection",
        "frame": "local",
        "features": [{"type": "Feature", **each} for each in features],
    }
    return read_roads(json.dumps(collection).encode(), "crossing")


def _geometry(kind: str, coordinates: object) -> dict[str, object]:
    return {"type": kind, "coordinates": coordinates}


def _headings(rng: np.random.Generator) -> Floats:
    """Three or four arms at right angles, each up to 15 degrees off."""
    count = 4 if rng.random() < 0.7 else 3
    turned = np.sort(rng.permutation(4)[:count]) * math.pi / 2
    return turned + rng.uniform(0, 2 * math.pi) + np.radians(rng.uniform(-15.0, 15.0, count))


def _path(source_rad: float, target_rad: float) -> Floats:
    """Points along the way, (n, 2): in on the right of one arm, by a curve, out on the right of the other."""
    away, out = _direction(source_rad), _direction(target_rad)
    start, entry = (_lane(away, each, -1) for each in (ARM_M, RADIUS_M))
    leave, end = (_lane(out, each, 1) for each in (RADIUS_M, ARM_M))
    share = np.linspace(0.0, 1.0, 41)[:, None]
    control_in, control_out = entry - away * RADIUS_M * 0.7, leave - out * RADIUS_M * 0.7
    curve = (
        (1 - share) ** 3 * entry
        + 3 * (1 - share) ** 2 * share * control_in
        + 3 * (1 - share) * share**2 * control_out
        + share**3 * leave
    )
    return np.concatenate([start[None], curve, end[None]])


def _direction(heading_rad: float) -> Floats:
    return np.array([math.cos(heading_rad), math.sin(heading_rad)])


def _lane(away: Floats, far_m: float, way: int) -> Floats:
    """On the right of an arm, for a car that drives away (1) or comes (-1)."""
    return away * far_m + way * LANE_M * np.array([away[1], -away[0]])


def _driven(path: Floats, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Every half metre: at 8 to 14 m/s, in the crossing at 4 to 8, slower from 25 m before it to 25 m behind it."""
    steps_m = np.hypot(*np.diff(path, axis=0).T)
    done_m = np.concatenate([[0.0], np.cumsum(steps_m)])
    along_m = np.arange(0.0, done_m[-1], 0.5)
    places = np.stack([np.interp(along_m, done_m, axis) for axis in path.T], axis=1)
    fast_m_s, slow_m_s = rng.uniform(8.0, 14.0), rng.uniform(4.0, 8.0)
    speeds_m_s = np.interp(np.hypot(*places.T), [RADIUS_M, RADIUS_M + 25.0], [slow_m_s, fast_m_s])
    return np.cumsum(0.5 / speeds_m_s), places
