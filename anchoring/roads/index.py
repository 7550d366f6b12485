"""What of a road network is near a position: R-trees (shapely's STRtree) over pieces of links, crossings and areas."""

import math
from collections.abc import Iterable, Iterator
from itertools import pairwise
from typing import Any

from anchoring.roads.elements import LEAVE, Crossing, RoadArea, RoadLink
from anchoring.roads.geometry import Projection, projected


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
        self._link_tree = self._tree([(min(a[0], b[0]), min(a[1], b[1]), max(a[0], b[0]), max(a[1], b[1]))
                                      for a, b, _ in self._pieces])  # fmt: skip
        self._crossing_tree = self._tree([(one.x_m - (reach := LEAVE * one.radius_m), one.y_m - reach,
                                           one.x_m + reach, one.y_m + reach) for one in self._crossings])  # fmt: skip
        self._polygons = [shapely.Polygon(area.rings[0], area.rings[1:]) for area in self._areas]
        self._area_tree = shapely.STRtree(self._polygons)

    def links_near(self, x_m: float, y_m: float, reach_m: float) -> Iterator[tuple[RoadLink, Projection]]:
        """Each link within `reach_m`, with its nearest point, in the order of the network."""
        nearest: dict[int, Projection] = {}
        for n in self._hits(self._link_tree, x_m - reach_m, y_m - reach_m, x_m + reach_m, y_m + reach_m):
            a, b, begin_m = self._pieces[n]
            at = projected(a, b, begin_m, x_m, y_m)
            owner = self._owners[n]
            if abs(at.across_m) <= reach_m and (
                owner not in nearest or abs(at.across_m) < abs(nearest[owner].across_m)
            ):
                nearest[owner] = at
        return ((self._links[owner], at) for owner, at in nearest.items())

    def crossings_near(self, x_m: float, y_m: float) -> Iterator[tuple[Crossing, float]]:
        """Each crossing within whose radius times `LEAVE` (x, y) lies, with its distance in metres."""
        for n in self._hits(self._crossing_tree, x_m, y_m, x_m, y_m):
            one = self._crossings[n]
            distance_m = math.hypot(x_m - one.x_m, y_m - one.y_m)
            if distance_m <= LEAVE * one.radius_m:
                yield one, distance_m

    def areas_at(self, x_m: float, y_m: float) -> Iterator[RoadArea]:
        """Each area that holds (x, y), its border included."""
        if self._areas:
            for n in sorted(self._area_tree.query(self._shapely.Point(x_m, y_m), predicate="intersects").tolist()):
                yield self._areas[n]

    def _tree(self, boxes: list[tuple[float, float, float, float]]) -> Any:
        import numpy as np

        edges = np.asarray(boxes, dtype=float).reshape(-1, 4).T
        return self._shapely.STRtree(self._shapely.box(*edges))

    def _hits(self, tree: Any, left_m: float, low_m: float, right_m: float, high_m: float) -> list[int]:
        if not (math.isfinite(left_m) and math.isfinite(low_m)):
            return []
        hits: list[int] = tree.query(self._shapely.box(left_m, low_m, right_m, high_m)).tolist()
        return sorted(hits)
