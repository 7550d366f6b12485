"""Polylines in a plane: x east, y north, metres; headings in radians, counter-clockwise from east.

`offset` runs along a line from its first point; `across` is the distance from it, positive on the right.
"""

import math
from bisect import bisect_right
from collections.abc import Sequence
from itertools import pairwise
from typing import Final, NamedTuple, TypeAlias

Point2: TypeAlias = tuple[float, float]
"""(x_m, y_m)."""


class Projection(NamedTuple):
    """The point of a line that is nearest to a position, and on which side of the line the position is.

    Attributes:
        offset_m: along the line from its first point.
        across_m: distance of the position from the line; positive on the right of the direction of its points.
        heading_rad: of the line there, in the direction of its points.
    """

    offset_m: float
    across_m: float
    x_m: float
    y_m: float
    heading_rad: float


def wrapped(angle_rad: float) -> float:
    """The same angle in (-pi, pi]."""
    turned = math.remainder(angle_rad, math.tau)
    return math.pi if turned == -math.pi else turned


LEAST_M: Final = 0.001
"""Points of a line that are nearer are one."""


class Polyline:
    """Two or more points; a point less than a millimetre from its predecessor is left out.

    Raises:
        ValueError: fewer than two different points.
    """

    __slots__ = ("offsets_m", "points")

    def __init__(self, points: Sequence[Point2]) -> None:
        kept = list(points[:1])
        for point in points[1:]:
            if math.dist(kept[-1], point) >= LEAST_M:
                kept.append(point)
        offsets, total = [0.0], 0.0
        for (ax, ay), (bx, by) in pairwise(kept):
            total += math.hypot(bx - ax, by - ay)
            offsets.append(total)
        if not total > 0.0:
            raise ValueError("a line has two different points")
        self.points: tuple[Point2, ...] = tuple(kept)
        self.offsets_m: tuple[float, ...] = tuple(offsets)

    @property
    def length_m(self) -> float:
        return self.offsets_m[-1]

    def at(self, offset_m: float, across_m: float = 0.0) -> tuple[float, float, float]:
        """(x_m, y_m, heading_rad) at an offset, which is clamped to the line, `across_m` to the right of it."""
        n = min(max(bisect_right(self.offsets_m, offset_m) - 1, 0), len(self.points) - 2)
        (ax, ay), (bx, by) = self.points[n], self.points[n + 1]
        begin_m, end_m = self.offsets_m[n], self.offsets_m[n + 1]
        share = min(max((offset_m - begin_m) / (end_m - begin_m), 0.0), 1.0)
        dx, dy = bx - ax, by - ay
        x, y = ax + share * dx, ay + share * dy
        if across_m:
            length = math.hypot(dx, dy)
            x, y = x + across_m * dy / length, y - across_m * dx / length
        return x, y, math.atan2(dy, dx)

    def project(self, x_m: float, y_m: float) -> Projection:
        """The nearest point of the line; of several the first."""
        return min(
            (projected(a, b, begin_m, x_m, y_m) for (a, b), begin_m in zip(pairwise(self.points), self.offsets_m)),  # noqa: B905  # one offset more than pieces
            key=lambda one: abs(one.across_m),
        )

    def heading_rad(self, from_m: float, to_m: float) -> float:
        """The direction of the chord between two offsets."""
        ax, ay, _ = self.at(from_m)
        bx, by, _ = self.at(to_m)
        return math.atan2(by - ay, bx - ax)


def projected(a: Point2, b: Point2, begin_m: float, x_m: float, y_m: float) -> Projection:
    """The point of the piece from `a` to `b` that is nearest to (x, y); the piece begins at `begin_m` of its line."""
    (ax, ay), (bx, by) = a, b
    dx, dy = bx - ax, by - ay
    length_m = math.hypot(dx, dy)
    share = min(max(((x_m - ax) * dx + (y_m - ay) * dy) / (length_m * length_m), 0.0), 1.0)
    px, py = ax + share * dx, ay + share * dy
    distance_m = math.hypot(x_m - px, y_m - py)
    is_right = dx * (y_m - ay) - dy * (x_m - ax) <= 0.0
    return Projection(begin_m + share * length_m, distance_m if is_right else -distance_m, px, py, math.atan2(dy, dx))
