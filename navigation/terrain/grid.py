"""A regular grid of heights of the ground, bilinear between its posts. Pure.

Degrees are WGS-84; heights are metres above mean sea level.
"""

from dataclasses import dataclass
from math import ceil, floor
from typing import Final, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from dyknow.model.errors import DecodeError

VOID: Final = -32_768
"""The height of a post whose height is not known."""
LOWEST_M, HIGHEST_M = -12_000.0, 9_000.0
"""Between them is all ground and sea bed."""
_EDGE: Final = 1e-6
"""A place that is no farther outside, in distances between posts, is on the edge but for rounding."""
_QUICK_POSTS: Final = 50_000
"""Of no more posts the highest is looked for before the way is followed."""

Floats: TypeAlias = npt.NDArray[np.float64]
Flags: TypeAlias = npt.NDArray[np.bool_]
Heights: TypeAlias = npt.NDArray[np.int16] | npt.NDArray[np.float32]


def unreadable(cause: str, remedy: str) -> DecodeError:
    """Why a file gives no grid."""
    return DecodeError(f"{cause}; {remedy}")


class HighGround(NamedTuple):
    """The highest ground near some places.

    Attributes:
        height_m: of the highest known ground; -inf: none is known, or none above the given height.
        latitude_deg, longitude_deg: where that is.
        unknown: a place whose height is not known, if there is one.
    """

    height_m: float = -np.inf
    latitude_deg: float = 0.0
    longitude_deg: float = 0.0
    unknown: tuple[float, float] | None = None

    @property
    def is_high(self) -> bool:
        """Whether there is ground above the given height."""
        return self.height_m > -np.inf


class BoxedWay(NamedTuple):
    """Places at equal distances on a straight way, each the middle of a box.

    Attributes:
        latitude_deg, longitude_deg: of the first place.
        north_deg, east_deg: from the first to the last.
        half_north_deg, half_east_deg: from a middle to the sides of its box.
        steps: from the first place to the last.
    """

    latitude_deg: float
    longitude_deg: float
    north_deg: float
    east_deg: float
    half_north_deg: float
    half_east_deg: float
    steps: int

    @property
    def shares(self) -> Floats:
        """How far along the way the places are, from 0 to 1."""
        return np.arange(self.steps + 1) / max(1, self.steps)


@dataclass(frozen=True, slots=True, eq=False)
class HeightGrid:
    """Posts in rows from north to south, each row from west to east.

    Attributes:
        north_deg, west_deg: of the first post.
        latitude_step_deg, longitude_step_deg: from one post to the next, both positive.
        heights: of the posts, or `VOID`.
    """

    north_deg: float
    west_deg: float
    latitude_step_deg: float
    longitude_step_deg: float
    heights: Heights

    @property
    def south_deg(self) -> float:
        return self.north_deg - self.latitude_step_deg * (len(self.heights) - 1)

    @property
    def east_deg(self) -> float:
        return self.west_deg + self.longitude_step_deg * (len(self.heights[0]) - 1)

    def heights_m(self, latitudes_deg: Floats, longitudes_deg: Floats) -> Floats:
        """The heights of the ground at places; NaN: outside, or next to a post that is not known."""
        west_deg = self._west_near(float(longitudes_deg[0]))
        rows = (self.north_deg - latitudes_deg) / self.latitude_step_deg
        return self._known(rows, (longitudes_deg - west_deg) / self.longitude_step_deg)

    def highest(self, way: BoxedWay, above_m: float) -> tuple[HighGround, Flags | None]:
        """The highest ground in the boxes of a way, exactly, and the places on it whose own height is known; None: all are.

        Args:
            way: straight, with a box about each of its places.
            above_m: only higher ground is looked for.
        """
        west_deg = self._west_near(way.longitude_deg)
        row = (self.north_deg - way.latitude_deg) / self.latitude_step_deg
        column = (way.longitude_deg - west_deg) / self.longitude_step_deg
        rows, columns = -way.north_deg / self.latitude_step_deg, way.east_deg / self.longitude_step_deg
        high, wide = way.half_north_deg / self.latitude_step_deg, way.half_east_deg / self.longitude_step_deg
        last_row, last_column = len(self.heights) - 1, len(self.heights[0]) - 1
        top, bottom, left, right = (
            row + min(0.0, rows),
            row + max(0.0, rows),
            column + min(0.0, columns),
            column + max(0.0, columns),
        )
        block = self.heights[
            max(0, floor(top - high)) : max(0, ceil(bottom + high) + 1),
            max(0, floor(left - wide)) : max(0, ceil(right + wide) + 1),
        ]
        shares = way.shares
        if block.size == 0:
            return HighGround(), np.zeros(len(shares), np.bool_)
        is_inside = min(top, left) >= -_EDGE and bottom <= last_row + _EDGE and right <= last_column + _EDGE
        is_known = is_inside and block.size <= _QUICK_POSTS and block.min() != VOID
        if is_known and block.max() <= above_m:
            return HighGround(), None
        middles = row + rows * shares, column + columns * shares
        lines = _lines(middles[0], high, last_row), _lines(middles[1], wide, last_column)
        found = self._highest_on(*lines, above_m, west_deg, voids=not is_known)
        return found, None if is_known else ~np.isnan(self._known(*middles))

    def _highest_on(self, y: Floats, x: Floats, above_m: float, west_deg: float, *, voids: bool) -> HighGround:
        """On a box the highest of a bilinear surface is where its sides and the lines of posts inside it cross."""
        is_touched = y[:, 0] + x[:, 0] >= 0.0
        if not is_touched.all():
            y, x = y[is_touched], x[is_touched]
            if not len(y):
                return HighGround()
        heights = self._between(y[:, :, None], x[:, None, :], voids=voids)
        if voids:
            heights[np.isnan(heights)] = -np.inf
        at = int(heights.argmax())
        height_m = float(heights.flat[at])
        if height_m <= above_m:
            return HighGround()
        box, crossing = divmod(at, heights[0].size)
        row, column = divmod(crossing, x.shape[1])
        latitude_deg = self.north_deg - float(y[box, row]) * self.latitude_step_deg
        return HighGround(height_m, latitude_deg, west_deg + float(x[box, column]) * self.longitude_step_deg)

    def _known(self, rows: Floats, columns: Floats) -> Floats:
        """The heights at places inside or not; NaN: outside, or not known."""
        last_row, last_column = len(self.heights) - 1, len(self.heights[0]) - 1
        inside = (rows >= -_EDGE) & (rows <= last_row + _EDGE)
        inside &= (columns >= -_EDGE) & (columns <= last_column + _EDGE)
        return np.where(inside, self._between(rows.clip(0, last_row), columns.clip(0, last_column)), np.nan)

    def _west_near(self, longitude_deg: float) -> float:
        """The first meridian, by as many whole turns as bring the grid nearest to that one."""
        middle_deg = (self.west_deg + self.east_deg) / 2.0
        return self.west_deg + 360.0 * round((longitude_deg - middle_deg) / 360.0)

    def _between(self, rows: Floats, columns: Floats, *, voids: bool = True) -> Floats:
        """Bilinear at places inside; with `voids` posts may be unknown, and have no effect where they have no weight."""
        width = len(self.heights[0])
        above = np.minimum(rows.astype(np.intp), len(self.heights) - 2)
        before = np.minimum(columns.astype(np.intp), width - 2)
        down, right = rows - above, columns - before
        posts, first = self.heights.ravel(), above * width + before
        corners = [posts.take(first + more).astype(np.float64) for more in (0, 1, width, width + 1)]
        if voids and min(each.min(initial=0.0) for each in corners) == VOID:
            return _among_voids(corners, down, right)
        upper = corners[0] + (corners[1] - corners[0]) * right
        lower = corners[2] + (corners[3] - corners[2]) * right
        between: Floats = upper + (lower - upper) * down
        return between


def _among_voids(corners: list[Floats], down: Floats, right: Floats) -> Floats:
    """Bilinear between corners; NaN where one that is not known has a weight."""
    up, left = 1.0 - down, 1.0 - right
    found, unknown = np.zeros(corners[0].shape), np.zeros(corners[0].shape, np.bool_)
    for corner, weight in zip(corners, (up * left, up * right, down * left, down * right), strict=True):
        found += np.where(corner == VOID, 0.0, corner) * weight
        unknown |= (corner == VOID) & (weight > _EDGE)
    found[unknown] = np.nan
    return found


def _lines(middles: Floats, half: float, last: int) -> Floats:
    """The sides of each box and the lines of posts inside it, one row for each box; -inf where it is wholly outside."""
    low, high = np.maximum(middles - half, 0.0), np.minimum(middles + half, last)
    lines = np.empty((len(middles), ceil(2.0 * half) + 2))
    lines[:, 0] = low
    np.minimum(np.ceil(low)[:, None] + np.arange(lines.shape[1] - 1), high[:, None], out=lines[:, 1:])
    lines[low > high] = -np.inf
    return lines
