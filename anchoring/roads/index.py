"""The parts of a road network near a position: shapely's STRtree over pieces of links, crossings and areas."""

import math
from collections.abc import Iterable, Iterator
from itertools import pairwise
from typing import Any, Final, TypeAlias

from dyknow.anchoring.roads.elements import LEAVE, Crossing, RoadArea, RoadLink
from dyknow.anchoring.roads.geometry import Projection, projected

_Box: TypeAlias = tuple[float, float, float, float]
"""Left, low, right, high."""
_CELL_M: Final = 16.0
_MOST_CELLS: Final = 4096


class RoadIndex:
    """Answers are exact, and in an order that does not depend on the tree."""

    def __init__(self, links: Iterable[RoadLink], crossings: Iterable[Crossing], areas: Iterable[RoadArea]) -> None:
        import shapely

        self._shapely = shapely
        self._links = list(links)
        self._crossings = list(crossings)
        self._areas = list(areas)
        self.widest_m = max((link.width_m for link in self._links), default=0.0)
        self._owners = [n for n, link in enumerate(self._links) for _ in link.line.points[1:]]
        self._pieces = [
            (a, b, begin_m)
            for link in self._links
            for (a, b), begin_m in zip(pairwise(link.line.points), link.line.offsets_m, strict=False)
        ]
        self._near_pieces = _NearBoxes(
            (min(a[0], b[0]), min(a[1], b[1]), max(a[0], b[0]), max(a[1], b[1])) for a, b, _ in self._pieces
        )
        self._near_crossings = _NearBoxes(
            (one.x_m - (reach := LEAVE * one.radius_m), one.y_m - reach, one.x_m + reach, one.y_m + reach)
            for one in self._crossings
        )
        self._polygons = [shapely.Polygon(area.rings[0], area.rings[1:]) for area in self._areas]
        self._area_tree = shapely.STRtree(self._polygons)

    def links_near(self, x_m: float, y_m: float, reach_m: float) -> Iterator[tuple[RoadLink, Projection]]:
        """Each link within `reach_m`, with its nearest point, in the order of the network."""
        nearest: dict[int, Projection] = {}
        for n in self._near_pieces.around(x_m, y_m, reach_m):
            a, b, begin_m = self._pieces[n]
            at = projected(a, b, begin_m, x_m, y_m)
            owner = self._owners[n]
            if abs(at.across_m) <= reach_m and (
                owner not in nearest or abs(at.across_m) < abs(nearest[owner].across_m)
            ):
                nearest[owner] = at
        return ((self._links[owner], at) for owner, at in nearest.items())

    def on_link(self, x_m: float, y_m: float, slack_m: float) -> bool:
        """Whether some link's centre line is within half its width and `slack_m`."""
        for n in self._near_pieces.around(x_m, y_m, self.widest_m / 2 + slack_m):
            a, b, begin_m = self._pieces[n]
            half_m = self._links[self._owners[n]].width_m / 2
            if abs(projected(a, b, begin_m, x_m, y_m).across_m) <= half_m + slack_m:
                return True
        return False

    def crossings_near(self, x_m: float, y_m: float) -> Iterator[tuple[Crossing, float]]:
        """Each crossing within whose radius times `LEAVE` (x, y) lies, with its distance in metres."""
        for n in self._near_crossings.around(x_m, y_m, 0.0):
            one = self._crossings[n]
            distance_m = math.hypot(x_m - one.x_m, y_m - one.y_m)
            if distance_m <= LEAVE * one.radius_m:
                yield one, distance_m

    def areas_at(self, x_m: float, y_m: float) -> Iterator[RoadArea]:
        """Each area that holds (x, y), its border included."""
        if self._areas:
            for n in sorted(self._area_tree.query(self._shapely.Point(x_m, y_m), predicate="intersects").tolist()):
                yield self._areas[n]


class _NearBoxes:
    """Boxes by their place: a tree, and a cache of its answers around the cells used lately."""

    def __init__(self, boxes: Iterable[_Box]) -> None:
        import numpy as np
        import shapely

        self._box, self._boxes = shapely.box, list(boxes)
        edges = np.asarray(self._boxes, dtype=float).reshape(-1, 4).T
        self._tree: Any = shapely.STRtree(shapely.box(*edges))
        self._cells: dict[tuple[int, int, float], list[tuple[int, _Box]]] = {}

    def around(self, x_m: float, y_m: float, reach_m: float) -> list[int]:
        """The boxes that a square around (x, y) meets, in the order in which they were given."""
        left_m, low_m, right_m, high_m = x_m - reach_m, y_m - reach_m, x_m + reach_m, y_m + reach_m
        if not (math.isfinite(left_m) and math.isfinite(low_m)):
            return []
        return [
            n
            for n, (box_left_m, box_low_m, box_right_m, box_high_m) in self._cell(x_m, y_m, reach_m)
            if box_left_m <= right_m and box_right_m >= left_m and box_low_m <= high_m and box_high_m >= low_m
        ]

    def _cell(self, x_m: float, y_m: float, reach_m: float) -> list[tuple[int, _Box]]:
        key = math.floor(x_m / _CELL_M), math.floor(y_m / _CELL_M), reach_m
        found = self._cells.get(key)
        if found is None:
            if len(self._cells) >= _MOST_CELLS:
                self._cells.clear()
            left_m, low_m = key[0] * _CELL_M - reach_m, key[1] * _CELL_M - reach_m
            wide_m = _CELL_M + 2 * reach_m
            hits = self._tree.query(self._box(left_m, low_m, left_m + wide_m, low_m + wide_m)).tolist()
            found = self._cells[key] = [(n, self._boxes[n]) for n in sorted(hits)]
        return found
