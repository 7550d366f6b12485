"""Road networks to simulate, as GeoJSON in a local frame, which users can write and `dyknow.anchoring.roads` reads."""

import json
from collections.abc import Callable, Iterable, Mapping
from math import cos, pi, sin
from typing import Any, NamedTuple, TypeAlias

from dyknow.anchoring.roads.files.formats import read_roads
from dyknow.anchoring.roads.geometry import Point2
from dyknow.anchoring.roads.network import RoadNetwork
from dyknow.model.errors import WrongCall

LANE_M = 3.5
LIMIT_M_S = 14.0

RoadsJson: TypeAlias = Mapping[str, Any]


class _Place(NamedTuple):
    name: str
    x_m: float
    y_m: float
    radius_m: float = 10.0


class _Road(NamedTuple):
    """A road that is driven both ways, half of its lanes each; `between` are the points between the two centres."""

    name: str
    start: str
    end: str
    between: tuple[Point2, ...] = ()
    lanes: int = 2


def _collection(places: Iterable[_Place], roads: Iterable[_Road]) -> RoadsJson:
    at = {place.name: place for place in places}
    points = [
        _feature("Point", [x, y], {"id": name, "kind": "crossing", "radius_m": radius})
        for name, x, y, radius in at.values()
    ]
    lines = [
        _feature(
            "LineString",
            [list(at[road.start][1:3]), *map(list, road.between), list(at[road.end][1:3])],
            {
                "id": road.name,
                "from": road.start,
                "to": road.end,
                "width_m": road.lanes * LANE_M,
                "lanes": road.lanes,
                "speed_m_s": LIMIT_M_S,
            },
        )
        for road in roads
    ]
    return {"type": "FeatureCollection", "frame": "local", "features": points + lines}


def _feature(kind: str, coordinates: list[Any], properties: dict[str, Any]) -> dict[str, Any]:
    return {"type": "Feature", "geometry": {"type": kind, "coordinates": coordinates}, "properties": properties}


def straight(length_m: float = 2000.0, lanes: int = 2) -> RoadsJson:
    """One road to the east."""
    ends = (_Place("west", 0.0, 0.0), _Place("east", length_m, 0.0))
    return _collection(ends, [_Road("road", "west", "east", lanes=lanes)])


def cross(arm_m: float = 250.0, lanes: int = 2) -> RoadsJson:
    """One crossing with an arm to each of the four winds."""
    ends = {"west": (-arm_m, 0.0), "east": (arm_m, 0.0), "south": (0.0, -arm_m), "north": (0.0, arm_m)}
    places = [_Place("middle", 0.0, 0.0, 12.0), *(_Place(name, *at) for name, at in ends.items())]
    return _collection(places, [_Road(f"{name}_arm", name, "middle", lanes=lanes) for name in ends])


def bends() -> RoadsJson:
    """A road that bends twice on its way to a crossing, in the manner of Figure 5 of the paper on object linkage."""
    places = (
        _Place("start", 0.0, 0.0),
        _Place("x1", 150.0, 60.0, 12.0),
        _Place("end", 330.0, 20.0),
        _Place("north", 130.0, 260.0),
        _Place("south", 180.0, -140.0),
    )
    wave = tuple((8.0 * step, 30.0 - 30.0 * cos(pi * step / 16.0)) for step in range(1, 17))
    away = tuple((180.0 + 15.0 * step, 40.0 + 20.0 * cos(pi * step / 10.0)) for step in range(10))
    return _collection(
        places,
        [
            _Road("l1", "start", "x1", wave),
            _Road("l2", "x1", "end", away),
            _Road("l3", "x1", "north", ((145.0, 120.0), (135.0, 190.0))),
            _Road("l4", "x1", "south", ((158.0, 0.0), (172.0, -70.0))),
        ],
    )


def town(across: int = 3, apart_m: float = 140.0, lanes: int = 2) -> RoadsJson:
    """Streets in a square grid, those to the east slightly bent, and an arm out of town at both ends of each."""
    inside = range(across)
    places = {
        (column, row): _Place(f"x{column}_{row}", column * apart_m, row * apart_m)
        for column in range(-1, across + 1)
        for row in range(-1, across + 1)
        if column in inside or row in inside
    }
    roads = []
    for (column, row), here in places.items():
        east, north = places.get((column + 1, row)), places.get((column, row + 1))
        if east is not None and row in inside:
            side = 6.0 * (-1) ** (column + row)
            bent = tuple(
                (here.x_m + apart_m * step / 8.0, here.y_m + side * sin(pi * step / 8.0) ** 2) for step in range(1, 8)
            )
            roads.append(_Road(f"e{column}_{row}", here.name, east.name, bent, lanes))
        if north is not None and column in inside:
            roads.append(_Road(f"n{column}_{row}", here.name, north.name, lanes=lanes))
    return _collection(places.values(), roads)


def blocks(across: int = 3, down: int = 3, apart_m: float = 80.0) -> RoadsJson:
    """Streets around square blocks, numbered to the east and to the north, that lead nowhere else: traffic stays in them."""
    places = {
        (column, row): _Place(f"x{column}{row}", column * apart_m, row * apart_m)
        for column in range(across)
        for row in range(down)
    }
    roads = []
    for (column, row), here in places.items():
        for name, other in ((f"e{column}{row}", (column + 1, row)), (f"n{column}{row}", (column, row + 1))):
            if other in places:
                roads.append(_Road(name, here.name, places[other].name))
    return _collection(places.values(), roads)


_LAYOUTS: dict[str, Callable[[], RoadsJson]] = {
    "bends": bends,
    "blocks": blocks,
    "cross": cross,
    "straight": straight,
    "town": town,
}
LAYOUTS = tuple(sorted(_LAYOUTS))


def layout(name: str) -> RoadsJson:
    """The roads of that name.

    Raises:
        WrongCall: there are none.
    """
    if name not in _LAYOUTS:
        raise WrongCall(f"no road layout is called {name!r}; there are {', '.join(LAYOUTS)}")
    return _LAYOUTS[name]()


def network_of(roads: RoadsJson) -> RoadNetwork:
    return read_roads(json.dumps(roads))
