"""Areas on the ground, divided in proportion to shares (thesis 9.2.3): by parallel cuts across their longer side.

Between two corners the length of a cut changes linearly along the axis, so the area up to it is a quadratic: each cut is found in closed form.
Areas are measured in the plane that touches the middle of the area; of one below 100 km they are right to a part in a thousand.
"""

import math
from collections.abc import Sequence
from typing import Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dyknow.model.errors import Refused
from dyknow.navigation.geodesy import metres_per_degree

Corner: TypeAlias = tuple[float, float]
"""Latitude and longitude in degrees."""
LARGEST_DEG: Final = 1.0
SMALLEST_M2: Final = 1.0


class Piece(NamedTuple):
    """A part of an area: its rings (outer borders, the last corner is not the first again), size and middle."""

    rings: tuple[tuple[Corner, ...], ...]
    area_m2: float
    middle: Corner


class Area:
    """A polygon without holes, by its corners in order.

    Raises:
        Refused: it is no polygon, its border crosses itself, or it is larger than a degree or smaller than a square metre.
    """

    def __init__(self, corners: Sequence[Corner]) -> None:
        import shapely

        self._origin = (
            sum(each[0] for each in corners) / len(corners),
            sum(each[1] for each in corners) / len(corners),
        )
        spans = [max(each[at] for each in corners) - min(each[at] for each in corners) for at in (0, 1)]
        if len(corners) < 3 or max(spans) > LARGEST_DEG or abs(self._origin[0]) > 85:
            raise Refused(
                "an area has three corners at least, is a degree wide at most, and is not at a pole", "no-area"
            )
        self._scale = metres_per_degree(self._origin[0])
        polygon = shapely.Polygon([self._metres(each) for each in corners])
        if not polygon.is_valid or polygon.area < SMALLEST_M2:
            raise Refused(
                f"the area is no polygon: {shapely.is_valid_reason(polygon)}, {polygon.area:.1f} m2", "no-area"
            )
        box = shapely.minimum_rotated_rectangle(polygon)
        sides = np.diff(np.array(box.exterior.coords)[:3], axis=0)
        east, north = sides[np.argmax(np.hypot(sides[:, 0], sides[:, 1]))]
        angle = math.atan2(north, east) % math.pi
        self._cosine, self._sine = math.cos(angle), math.sin(angle)
        self._turned = shapely.Polygon([self._turn(*point) for point in polygon.exterior.coords])
        self.area_m2 = float(self._turned.area)

    def along_m(self, place: Corner) -> float:
        """How far a place lies along the axis across which the area is cut; metres."""
        return self._turn(*self._metres(place))[0]

    def divide(self, shares: Sequence[float]) -> list[Piece]:
        """Pieces whose sizes are in proportion to the shares, none negative, from one end to the other: together the area.

        Raises:
            Refused: no share is positive.
        """
        import shapely

        total = sum(shares)
        if total <= 0:
            raise Refused("there is no share to divide by", "no-area")
        low, bottom, high, top = self._turned.bounds
        cuts = [low - 1.0, *self._cuts(np.cumsum(shares)[:-1] / total), high + 1.0]
        pieces = []
        for share, from_m, to_m in zip(shares, cuts[:-1], cuts[1:], strict=True):
            strip = shapely.box(from_m, bottom - 1.0, to_m, top + 1.0)
            pieces.append(self._piece(shapely.intersection(self._turned, strip) if share > 0 else shapely.Polygon()))
        return pieces

    def _cuts(self, parts: NDArray[np.float64]) -> list[float]:
        """Where the area up to a cut is these parts of the whole, increasing."""
        points = np.array(self._turned.exterior.coords)
        xs = np.unique(points[:, 0])
        (x0, y0), (x1, y1) = points[:-1].T, points[1:].T
        with np.errstate(divide="ignore", invalid="ignore"):
            slope = np.where(x1 == x0, 0.0, (y1 - y0) / (x1 - x0))
        middles = (xs[:-1] + xs[1:]) / 2
        is_over = (np.minimum(x0, x1) < middles[:, None]) & (np.maximum(x0, x1) > middles[:, None])
        sign = np.where(x1 < x0, 1.0, -1.0) * is_over  # upper borders of a ring that turns left lead back
        sign *= 1.0 if _turns_left(points) else -1.0
        length = [(sign * (y0 + slope * (at[:, None] - x0))).sum(axis=1) for at in (xs[:-1], xs[1:])]
        widths = np.diff(xs)
        upto = np.concatenate([[0.0], np.cumsum((length[0] + length[1]) / 2 * widths)])
        found = []
        for part in parts:
            wanted = float(part) * upto[-1]
            slab = min(int(np.searchsorted(upto, wanted, side="right")) - 1, len(widths) - 1)
            found.append(float(xs[slab] + _reach(wanted - upto[slab], length[0][slab], length[1][slab], widths[slab])))
        return found

    def _piece(self, turned: "object") -> Piece:
        import shapely

        polygons = [each for each in shapely.get_parts(turned) if isinstance(each, shapely.Polygon) and each.area > 0]
        rings = tuple(tuple(self._degrees(*point) for point in each.exterior.coords[:-1]) for each in polygons)
        area_m2 = float(sum(each.area for each in polygons))
        if not polygons:
            return Piece((), 0.0, self._origin)
        inside = max(polygons, key=lambda each: float(each.area)).representative_point()
        return Piece(rings, area_m2, self._degrees(inside.x, inside.y))

    def _metres(self, place: Corner) -> tuple[float, float]:
        return (
            (place[1] - self._origin[1]) * self._scale[1],
            (place[0] - self._origin[0]) * self._scale[0],
        )

    def _turn(self, east_m: float, north_m: float) -> tuple[float, float]:
        return east_m * self._cosine + north_m * self._sine, north_m * self._cosine - east_m * self._sine

    def _degrees(self, along_m: float, across_m: float) -> Corner:
        east_m = along_m * self._cosine - across_m * self._sine
        north_m = along_m * self._sine + across_m * self._cosine
        return self._origin[0] + north_m / self._scale[0], self._origin[1] + east_m / self._scale[1]


def _turns_left(points: NDArray[np.float64]) -> bool:
    x, y = points.T
    return bool((x[:-1] * y[1:] - x[1:] * y[:-1]).sum() > 0)


def _reach(wanted: float, first: float, last: float, width: float) -> float:
    """How far into a slab, whose cuts grow from `first` to `last` over `width`, the area up to there is `wanted`."""
    slope = (last - first) / width
    root = math.sqrt(max(0.0, first * first + 2 * slope * wanted))
    return min(width, 2 * wanted / (first + root)) if first + root > 0 else 0.0
