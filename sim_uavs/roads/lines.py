"""Lines that are driven: polylines with lengths, offsets, and curves through crossings. Metres and radians."""

from bisect import bisect_right
from collections.abc import Sequence
from functools import cached_property
from itertools import pairwise
from math import atan2, cos, hypot, pi, sin
from typing import NamedTuple, TypeAlias

from dyknow.model.errors import WrongCall

Point: TypeAlias = tuple[float, float]

_CURVE_PIECES = 16


class LinePose(NamedTuple):
    x_m: float
    y_m: float
    heading_rad: float


class DrivenLine:
    """A polyline of two points or more; points that repeat are left out."""

    def __init__(self, points: Sequence[Point]) -> None:
        kept = [points[0]]
        kept += [point for before, point in pairwise(points) if point != before]
        if len(kept) < 2:
            raise WrongCall(f"a line needs two different points, got {list(points)[:3]}")
        self.points: tuple[Point, ...] = tuple(kept)
        self._starts = [0.0]
        for (x0, y0), (x1, y1) in pairwise(kept):
            self._starts.append(self._starts[-1] + hypot(x1 - x0, y1 - y0))
        self.length_m = self._starts[-1]

    @cached_property
    def headings(self) -> tuple[float, ...]:
        """Of each piece, rad."""
        return tuple(atan2(y1 - y0, x1 - x0) for (x0, y0), (x1, y1) in pairwise(self.points))

    def at(self, along_m: float, left_m: float = 0.0) -> LinePose:
        """The pose `along_m` from the start and `left_m` to the left; beyond the ends straight on."""
        piece = min(max(bisect_right(self._starts, along_m) - 1, 0), len(self.headings) - 1)
        (x, y), heading = self.points[piece], self.headings[piece]
        forward, c, s = along_m - self._starts[piece], cos(heading), sin(heading)
        return LinePose(x + forward * c - left_m * s, y + forward * s + left_m * c, heading)

    def parallel(self, left_m: float) -> "DrivenLine":
        """The parallel `left_m` to the left (negative: right), mitred at the vertices."""
        if not left_m:
            return self
        turns = [self.headings[0], *self.headings, self.headings[-1]]
        moved = []
        for (x, y), before, after in zip(self.points, turns, turns[1:], strict=False):
            half = turned(before, after) / 2.0
            reach = left_m / max(cos(half), 0.5)
            moved.append((x - reach * sin(before + half), y + reach * cos(before + half)))
        return DrivenLine(moved)

    def between(self, from_m: float, to_m: float) -> "DrivenLine":
        """The stretch from `from_m` to `to_m`."""
        inner = [point for point, start in zip(self.points, self._starts, strict=True) if from_m < start < to_m]
        return DrivenLine([self.at(from_m)[:2], *inner, self.at(to_m)[:2]])

    def reversed(self) -> "DrivenLine":
        return DrivenLine(self.points[::-1])


def turned(from_rad: float, to_rad: float) -> float:
    """By how much one turns left from one heading to the other, in [-pi, pi)."""
    return (to_rad - from_rad + pi) % (2.0 * pi) - pi


def curve(start: LinePose, end: LinePose) -> DrivenLine:
    """A cubic Bezier curve that leaves `start` and reaches `end` along their headings."""
    reach = 0.4 * hypot(end.x_m - start.x_m, end.y_m - start.y_m)
    xs = (start.x_m, start.x_m + reach * cos(start.heading_rad), end.x_m - reach * cos(end.heading_rad), end.x_m)
    ys = (start.y_m, start.y_m + reach * sin(start.heading_rad), end.y_m - reach * sin(end.heading_rad), end.y_m)
    points = []
    for number in range(_CURVE_PIECES + 1):
        u = number / _CURVE_PIECES
        weights = ((1 - u) ** 3, 3 * u * (1 - u) ** 2, 3 * u * u * (1 - u), u**3)
        points.append(
            (sum(w * x for w, x in zip(weights, xs, strict=True)), sum(w * y for w, y in zip(weights, ys, strict=True)))
        )
    return DrivenLine(points)
