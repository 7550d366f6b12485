"""The same motorway on a map that cuts it into links, as maps do wherever a limit, a name or a bridge begins."""

import json
from collections.abc import Iterator
from itertools import pairwise
from math import atan2, cos, sin
from typing import Any, Final

import numpy as np

from bench.traffic.motorway import LANE_M, VIEW_M, CarAt, Minute

_BEYOND_M: Final = 60.0
_STEP_M: Final = 20.0
_LEAST_M: Final = 60.0
_SLIP_M: Final = 150.0


def cut_road(made: Minute, seed: int, links: int, slips: str = "") -> str:
    """GeoJSON of a one-way road cut into links of drawn lengths; `slips`: an "entrance" or an "exit" at one of the borders."""
    rng = np.random.default_rng((seed, 27))
    assert made.place is not None
    begin_m, end_m = VIEW_M[0] - _BEYOND_M, VIEW_M[1] + _BEYOND_M
    while True:
        borders = [begin_m, *np.sort(rng.uniform(VIEW_M[0], VIEW_M[1], links - 1)).tolist(), end_m]
        if min(after - before for before, after in pairwise(borders)) >= _LEAST_M:
            break
    radius_m = rng.uniform(6.0, 25.0, links + 1)
    features = [
        _feature("Point", list(_at(made, at_m)), id=f"x{n}", kind="crossing", radius_m=float(radius_m[n]))
        for n, at_m in enumerate(borders)
    ]
    about = {"oneway": True, "lanes": made.lanes, "width_m": LANE_M * made.lanes, "speed_m_s": 36.0}
    for n, (before_m, after_m) in enumerate(pairwise(borders)):
        steps = max(2, round((after_m - before_m) / _STEP_M))
        points = [list(_at(made, float(at_m))) for at_m in np.linspace(before_m, after_m, steps)]
        features.append(_feature("LineString", points, id=f"l{n}", **{"from": f"x{n}", "to": f"x{n + 1}"}, **about))
    if slips and links > 1:
        features += _slip(made, borders, int(rng.integers(1, links)), rng.uniform(0.25, 0.6), slips)
    return json.dumps({"type": "FeatureCollection", "frame": "local", "features": features})


def placed(made: Minute) -> Iterator[dict[str, Any]]:
    """The feed of a tracker: where cars are seen, without what the map has there."""
    for line in made.lines():
        yield {"t_ms": line["t_ms"], "seen": line["seen"][:3]}


def _slip(made: Minute, borders: list[float], n: int, angle_rad: float, kind: str) -> list[dict[str, Any]]:
    (x_m, y_m), (before_x_m, before_y_m) = _at(made, borders[n]), _at(made, borders[n] - 10.0)
    way_rad = atan2(y_m - before_y_m, x_m - before_x_m)
    sign = -1.0 if kind == "entrance" else 1.0
    heading_rad = way_rad - sign * angle_rad
    there = [x_m + sign * _SLIP_M * cos(heading_rad), y_m + sign * _SLIP_M * sin(heading_rad)]
    ends = {"from": "s", "to": f"x{n}"} if kind == "entrance" else {"from": f"x{n}", "to": "s"}
    points = [there, [x_m, y_m]] if kind == "entrance" else [[x_m, y_m], there]
    return [
        _feature("Point", there, id="s", kind="crossing", radius_m=5.0),
        _feature("LineString", points, id="slip", oneway=True, lanes=1, width_m=LANE_M, speed_m_s=22.0, **ends),
    ]


def _at(made: Minute, along_m: float) -> tuple[float, float]:
    assert made.place is not None
    x_m, y_m, _ = made.place(CarAt(along_m, 0.0, 0.0, is_seen=True))
    return x_m, y_m


def _feature(geometry: str, coordinates: Any, **properties: Any) -> dict[str, Any]:
    return {"type": "Feature", "geometry": {"type": geometry, "coordinates": coordinates}, "properties": properties}
