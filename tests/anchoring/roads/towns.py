"""Road networks of the tests: a cross, a grid of any size, and their text."""

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

from hypothesis import strategies as st

from dyknow.anchoring.roads.files.formats import read_roads
from dyknow.anchoring.roads.network import RoadNetwork


def crossing(name: str, x_m: float, y_m: float, radius_m: float = 8.0) -> dict[str, Any]:
    return feature("Point", [x_m, y_m], id=name, kind="crossing", radius_m=radius_m)


def link(
    name: str, start: str | None, end: str | None, points: Sequence[Sequence[float]], **more: Any
) -> dict[str, Any]:
    return feature("LineString", [list(each) for each in points], id=name, **{"from": start, "to": end}, **more)


def feature(geometry: str, coordinates: Any, **properties: Any) -> dict[str, Any]:
    return {"type": "Feature", "geometry": {"type": geometry, "coordinates": coordinates}, "properties": properties}


NO_LINE = feature("LineString", [[0, 0], [0, 0]], id="zero")


def text(*features: Any, frame: str | None = "local", **more: Any) -> str:
    return json.dumps({"type": "FeatureCollection", "frame": frame, "features": features, **more})


def cross(arm_m: float = 200.0, **more: Any) -> str:
    """A crossing x at the origin with arms e, n, w, s, which lead away from it and out of the network."""
    ends = {"e": (arm_m, 0.0), "n": (0.0, arm_m), "w": (-arm_m, 0.0), "s": (0.0, -arm_m)}
    arms = [link(name, "x", None, [(0.0, 0.0), end], **more) for name, end in ends.items()]
    return text(crossing("x", 0.0, 0.0), *arms)


def grid_text(rows: int, across: int | None = None, block_m: float = 100.0) -> str:
    """Crossings "row,place" at the corners of blocks; links "e row,place" lead east of them, "n row,place" north."""
    across = rows if across is None else across
    features = []
    for i in range(rows):
        for j in range(across):
            features.append(crossing(f"{i},{j}", j * block_m, i * block_m))
            for name, (k, m) in {"e": (i, j + 1), "n": (i + 1, j)}.items():
                if k < rows and m < across:
                    ends = [(j * block_m, i * block_m), (m * block_m, k * block_m)]
                    features.append(link(f"{name} {i},{j}", f"{i},{j}", f"{k},{m}", ends))
    return text(*features)


def grid(rows: int, across: int | None = None, block_m: float = 100.0) -> RoadNetwork:
    return read_roads(grid_text(rows, across, block_m))


@st.composite
def networks(draw: st.DrawFn, lanes: int = 4) -> RoadNetwork:
    """Crossings at random, links between any two of them by way of up to three points, one way or both; with at most `lanes` lanes."""
    places = draw(st.lists(st.tuples(_METRES, _METRES), min_size=2, max_size=6, unique=True))
    features = [crossing(f"x{n}", *at, draw(st.floats(1.0, 20.0))) for n, at in enumerate(places)]
    pairs = draw(
        st.lists(
            st.tuples(st.integers(0, len(places) - 1), st.integers(0, len(places) - 1)).filter(lambda p: p[0] != p[1]),
            min_size=1,
            max_size=8,
        )
    )
    for n, (a, b) in enumerate(pairs):
        middle = draw(st.lists(st.tuples(_METRES, _METRES), max_size=3))
        about: Mapping[str, Any] = {
            "width_m": draw(st.floats(3.0, 20.0)),
            "lanes": draw(st.integers(1, lanes)),
            "oneway": draw(st.booleans()),
        }
        features.append(link(f"l{n}", f"x{a}", f"x{b}", [places[a], *middle, places[b]], **about))
    return read_roads(text(*features))


_METRES = st.integers(-300, 300).map(float)
POSITIONS = st.tuples(st.floats(-400.0, 400.0), st.floats(-400.0, 400.0))
HEADINGS = st.floats(-math.pi, math.pi)
