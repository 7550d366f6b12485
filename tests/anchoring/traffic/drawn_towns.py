"""Towns of the tests' own making, from seeds: one set of roads as GeoJSON, OpenStreetMap XML and a network of SUMO, and cars on it.

A road is called by the crossings at its ends, `r1_4`. SUMO has an edge for each direction, and that back has the name with `-`.
"""

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Final, NamedTuple, TypeAlias

import networkx as nx
import numpy as np

from dyknow.anchoring.roads.geometry import Polyline, wrapped
from dyknow.navigation.geodesy import LocalFrame

Point: TypeAlias = tuple[float, float]
Way: TypeAlias = tuple[int, int]

ORIGIN: Final = LocalFrame(58.41, 15.62, 0.0)
RADIUS_M: Final = 8.0
LANE_M: Final = 3.5
ASIDE_M: Final = LANE_M / 2
SIDE: Final = 3
BLOCK_M: Final = 120.0
SPEED_M_S: Final = 8.0
PERIOD_MS: Final = 200
SD_M: Final = 0.3
SUMO_SHIFT: Final = (1234.5, -77.25)
"""The netOffset of the network: x and y of SUMO are not those of another map."""


class Road(NamedTuple):
    """A road between two crossings; `is_one_way` from the first to the second."""

    ends: Way
    points: tuple[Point, ...]
    is_one_way: bool

    @property
    def name(self) -> str:
        return f"r{self.ends[0]}_{self.ends[1]}"

    @property
    def aside_m(self) -> float:
        return 0.0 if self.is_one_way else ASIDE_M


class Turn(NamedTuple):
    """A car, what it did, and from which road through which crossing onto which."""

    car: str
    kind: str
    before: str
    crossing: str
    after: str


class Town:
    """Crossings and roads; each road is a street with a bend, most of them two-way."""

    def __init__(self, seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        while True:
            self.crossings, self.roads = self._drawn()
            self.graph = nx.DiGraph()
            for road in self.roads.values():
                self.graph.add_edge(*road.ends)
                if not road.is_one_way:
                    self.graph.add_edge(*road.ends[::-1])
            if len(self.graph) == SIDE**2 and nx.is_strongly_connected(self.graph):
                return

    def _drawn(self) -> tuple[dict[int, Point], dict[Way, Road]]:
        rng = self.rng
        places = {
            row * SIDE + column + 1: (column * BLOCK_M + rng.uniform(-8, 8), row * BLOCK_M + rng.uniform(-8, 8))
            for row in range(SIDE)
            for column in range(SIDE)
        }
        pairs = [(n, n + 1) for n in places if n % SIDE] + [(n, n + SIDE) for n in places if n + SIDE in places]
        corners = {1, SIDE, SIDE * (SIDE - 1) + 1, SIDE * SIDE}
        at_corners = [pair for pair in pairs if not corners.isdisjoint(pair)]
        pairs.remove(
            at_corners[rng.integers(len(at_corners))]
        )  # one elsewhere would leave a crossing that is none for OpenStreetMap
        roads = {}
        for pair in pairs:
            ends: Way = pair if rng.random() < 0.5 else pair[::-1]
            line = Polyline([places[n] for n in ends])
            bend = line.at(line.length_m / 2, rng.uniform(-3.0, 3.0))[:2]
            roads[ends] = Road(ends, (places[ends[0]], bend, places[ends[1]]), bool(rng.random() < 0.15))
        return places, roads

    def road(self, way: Way) -> Road:
        return self.roads.get(way) or self.roads[way[::-1]]

    def lane(self, way: Way) -> list[Point]:
        """Points of the lane that leads along a way, outside of crossings."""
        road = self.road(way)
        line = Polyline(road.points if road.ends == way else road.points[::-1])
        steps = np.arange(RADIUS_M, line.length_m - RADIUS_M, 2.0)
        return [line.at(float(at), road.aside_m)[:2] for at in (*steps, line.length_m - RADIUS_M)]

    # the three maps

    def geojson(self) -> str:
        features = [
            _feature("Point", at, id=str(n), kind="crossing", radius_m=RADIUS_M) for n, at in self.crossings.items()
        ]
        for road in self.roads.values():
            about = {"from": str(road.ends[0]), "to": str(road.ends[1]), "oneway": road.is_one_way}
            width_m = LANE_M if road.is_one_way else 2 * LANE_M
            features.append(_feature("LineString", road.points, id=road.name, width_m=width_m, **about))
        origin = [ORIGIN.longitude_deg, ORIGIN.latitude_deg]
        return json.dumps({"type": "FeatureCollection", "frame": "local", "origin": origin, "features": features})

    def openstreetmap(self) -> str:
        """Streets are ways that pass crossings; next to them what an extract has besides."""
        nodes = dict(self.crossings)
        ways = []
        for number, street in enumerate(self._streets()):
            references: list[int] = []
            for way in street:
                bend = 1000 + len(nodes)
                nodes[bend] = self.road(way).points[1]
                references += [bend, way[1]] if references else [way[0], bend, way[1]]
            tags = {"highway": "residential", "name": f"street {number}"}
            if self.road(street[0]).is_one_way:
                is_reversed = bool(self.rng.random() < 0.5)
                references = references[::-1] if is_reversed else references
                tags |= {"oneway": "-1" if is_reversed else "yes"}
            ways.append(_osm_way(4711 + number, references, tags))
        ways.append(_osm_way(99, list(self.crossings), {"highway": "footway"}))
        ways.append(_osm_way(98, list(self.crossings), {"building": "yes"}))
        listed = (
            f'<node id="{n}" lat="{ORIGIN.from_ned(y, x, 0)[0]:.9f}" lon="{ORIGIN.from_ned(y, x, 0)[1]:.9f}"/>'
            for n, (x, y) in nodes.items()
        )
        return f'<?xml version="1.0"?><osm version="0.6">{"".join(listed)}{"".join(ways)}<relation id="1"/></osm>'

    def _streets(self) -> Iterator[list[Way]]:
        """Two-way roads in a row or in a column are one street; a one-way road is a street of its own."""
        lines = [[n + row * SIDE for n in range(1, SIDE + 1)] for row in range(SIDE)]
        lines += [[column + row * SIDE for row in range(SIDE)] for column in range(1, SIDE + 1)]
        for line in lines:
            street: list[Way] = []
            for way in pairwise(line):
                road = self.roads.get(way) or self.roads.get(way[::-1])
                if road is not None and not road.is_one_way:
                    street.append(way)
                    continue
                if street:
                    yield street
                street = []
                if road is not None:
                    yield [road.ends]
            if street:
                yield street

    def sumo(self) -> str:
        """As netconvert writes it: edges within junctions, lanes that end before them, the way back with `-`."""
        parts = []
        for way in self.graph.edges:
            road = self.road(way)
            name = road.name if road.ends == way else f"-{road.name}"
            shape = _shape(self.lane(way))
            lane = f'<lane id="{name}_0" index="0" disallow="tram rail" speed="13.89" length="99" width="{LANE_M}" shape="{shape}"/>'
            parts.append(f'<edge id="{name}" from="{way[0]}" to="{way[1]}" priority="-1">{lane}</edge>')
        for n, (x, y) in self.crossings.items():
            lane = f'<lane id=":{n}_0_0" index="0" speed="6" length="9" shape="{_shape([(x, y), (x + 1, y)])}"/>'
            parts.insert(0, f'<edge id=":{n}_0" function="internal">{lane}</edge>')
            border = [(x + RADIUS_M * math.cos(a), y + RADIUS_M * math.sin(a)) for a in np.linspace(0, math.tau, 9)]
            at = _shape([(x, y)]).split(",")
            about = f'id="{n}" type="priority" x="{at[0]}" y="{at[1]}" incLanes="" intLanes=":{n}_0_0"'
            parts.append(f'<junction {about} shape="{_shape(border)}"><request index="0" response="0"/></junction>')
            parts.append(f'<junction id=":{n}_1" type="internal" x="{at[0]}" y="{at[1]}" incLanes="" intLanes=""/>')
        location = f'<location netOffset="{SUMO_SHIFT[0]},{SUMO_SHIFT[1]}" convBoundary="0,0,9,9" projParameter="!"/>'
        comment = "<!-- generated by netconvert\n<netconvertConfiguration><osm/></netconvertConfiguration>\n-->"
        return (
            f'<?xml version="1.0" encoding="UTF-8"?>\n{comment}\n<net version="1.20">{location}{"".join(parts)}</net>'
        )

    # the cars

    def drives(self, cars: int, seconds: float) -> tuple[list[tuple[int, str, Point]], list[Turn], list[Turn]]:
        """Where cars are seen, with the error they have; the turns that they make well before the end, and those at the end."""
        seen: list[tuple[int, str, Point]] = []
        turns: list[Turn] = []
        last: list[Turn] = []
        for number in range(cars):
            name, start_ms = f"v{number + 1}", 2 * PERIOD_MS * number
            line, made = self._route(name, seconds * SPEED_M_S)
            for step in range(int(seconds * 1000 / PERIOD_MS)):
                x, y, _ = line.at(step * PERIOD_MS / 1000 * SPEED_M_S)
                error = self.rng.normal(0.0, SD_M, 2)
                seen.append((start_ms + step * PERIOD_MS, name, (x + error[0], y + error[1])))
            done_m = min(line.length_m, seconds * SPEED_M_S)
            turns += [turn for at_m, turn in made if at_m <= done_m]
            last += [turn for at_m, turn in made if done_m < at_m <= done_m + 60.0]
        return sorted(seen), turns, last

    def _route(self, car: str, length_m: float) -> tuple[Polyline, list[tuple[float, Turn]]]:
        """A way through the town without turning back; and each turn with how far one has driven 30 m behind it."""
        ways = list(self.graph.edges)
        way = ways[self.rng.integers(len(ways))]
        points, turns = self.lane(way), []
        done_m = Polyline(points).length_m
        while done_m < length_m + BLOCK_M:
            choices = [each for each in sorted(self.graph.out_edges(way[1])) if each[1] != way[0]]
            if not choices:
                break
            after = choices[self.rng.integers(len(choices))]
            lane = self.lane(after)
            curve = _curve(points[-2], points[-1], lane[0], lane[1])
            kind = self._kind(way, after)
            turn = Turn(car, kind, self.road(way).name, str(way[1]), self.road(after).name)
            points += [*curve, *lane]
            done_m = Polyline(points).length_m
            turns.append((done_m - Polyline(lane).length_m + 30.0, turn))
            way = after
        return Polyline(points), turns

    def _kind(self, way: Way, after: Way) -> str:
        """By the angle between where one road ends and the next begins."""
        (ax, ay), (bx, by) = self.lane(way)[-2:]
        (cx, cy), (dx, dy) = self.lane(after)[:2]
        turned = wrapped(math.atan2(dy - cy, dx - cx) - math.atan2(by - ay, bx - ax))
        if abs(turned) < math.radians(40.0):
            return "straight"
        return "left" if turned > 0 else "right"


def _curve(before: Point, start: Point, end: Point, after: Point) -> list[Point]:
    """A cubic Bezier curve along both headings."""
    reach_m = math.dist(start, end) * 0.4
    one, two = _along(before, start, reach_m), _along(after, end, reach_m)
    shares = np.linspace(0.0, 1.0, 12)[1:-1]
    return [
        tuple(
            float((1 - s) ** 3 * a + 3 * (1 - s) ** 2 * s * b + 3 * (1 - s) * s * s * c + s**3 * d)
            for a, b, c, d in zip(start, one, two, end, strict=True)
        )
        for s in shares
    ]  # type: ignore[misc]


def _along(before: Point, at: Point, reach_m: float) -> Point:
    share = reach_m / math.dist(before, at)
    return at[0] + share * (at[0] - before[0]), at[1] + share * (at[1] - before[1])


def _feature(geometry: str, coordinates: object, **properties: object) -> dict[str, object]:
    return {"type": "Feature", "geometry": {"type": geometry, "coordinates": coordinates}, "properties": properties}


def _osm_way(number: int, nodes: Sequence[int], tags: Mapping[str, str]) -> str:
    listed = "".join(f'<nd ref="{n}"/>' for n in nodes)
    return f'<way id="{number}">{listed}{"".join(f"""<tag k="{k}" v="{v}"/>""" for k, v in tags.items())}</way>'


def _shape(points: Sequence[Point]) -> str:
    return " ".join(f"{x + SUMO_SHIFT[0]:.2f},{y + SUMO_SHIFT[1]:.2f}" for x, y in points)
