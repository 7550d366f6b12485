"""The ground that a camera's ray meets: a plane, or a grid of elevations.

Heights are `down_m` in the NED frame of the rays, larger is lower. A ray is a place and a direction, (3,) each.
"""

from math import inf
from typing import NamedTuple, Protocol

import numpy as np

from dyknow.model.errors import WrongCall
from dyknow.navigation.cameras.pinhole import FloatArray


class Hit(NamedTuple):
    """Where a ray meets the ground.

    Attributes:
        place_m: (3,), NED.
        normal: (3,), of the ground there; of any length, downwards.
        reach: in multiples of the ray's direction.
    """

    place_m: FloatArray
    normal: FloatArray
    reach: float


class GroundModel(Protocol):
    """The ground below."""

    def down_m(self, north_m: float, east_m: float) -> float:
        """The height of the ground at a place; outside of the known area that of the nearest place."""

    def meet(self, from_m: FloatArray, direction: FloatArray) -> Hit | None:
        """The first place where a ray meets it from above; None: it does not."""


class FlatGround:
    """A level plane."""

    def __init__(self, down_m: float = 0.0) -> None:
        self._down_m = down_m

    def down_m(self, north_m: float, east_m: float) -> float:  # noqa: ARG002  # it is level
        return self._down_m

    def meet(self, from_m: FloatArray, direction: FloatArray) -> Hit | None:
        above_m, sinks = self._down_m - float(from_m[2]), float(direction[2])
        if above_m < 0.0 or sinks <= 1e-9:
            return None
        reach = above_m / sinks
        return Hit(from_m + reach * direction, np.array([0.0, 0.0, 1.0]), reach)


class ElevationGrid:
    """Bilinear between samples of elevation.

    Args:
        down_m: (i, j), i to the north, j to the east.
        south_m, west_m: the place of the first sample.
        spacing_m: between samples.
        farthest_m: rays that have not met the ground by then do not meet it.

    Raises:
        WrongCall: fewer than two of them either way, a spacing that is not positive, or elevations that are not finite.
    """

    def __init__(
        self, down_m: FloatArray, south_m: float, west_m: float, spacing_m: float, farthest_m: float = 2000.0
    ) -> None:
        if down_m.ndim != 2 or min(down_m.shape) < 2 or spacing_m <= 0.0 or not np.isfinite(down_m).all():
            raise WrongCall(
                f"an elevation grid of shape {down_m.shape} with {spacing_m} m between samples is not usable; "
                "give finite elevations in two lines of two or more, and a positive spacing"
            )
        self._grid, self._south_m, self._west_m = down_m, south_m, west_m
        self._spacing_m, self._farthest_m = spacing_m, farthest_m
        self._highest_m = float(down_m.min())

    def down_m(self, north_m: float, east_m: float) -> float:
        return self._at(north_m, east_m)[0]

    def _at(self, north_m: float, east_m: float) -> tuple[float, float, float]:
        """(down, its change to the north, its change to the east) at a place."""
        rows, columns = self._grid.shape
        row = min(max((north_m - self._south_m) / self._spacing_m, 0.0), rows - 1.0)
        column = min(max((east_m - self._west_m) / self._spacing_m, 0.0), columns - 1.0)
        i, j = min(int(row), rows - 2), min(int(column), columns - 2)
        a, b = row - i, column - j
        (sw, se), (nw, ne) = self._grid[i : i + 2, j : j + 2].tolist()
        down = (1 - a) * ((1 - b) * sw + b * se) + a * ((1 - b) * nw + b * ne)
        to_north = ((1 - b) * (nw - sw) + b * (ne - se)) / self._spacing_m
        to_east = ((1 - a) * (se - sw) + a * (ne - nw)) / self._spacing_m
        return down, to_north, to_east

    def meet(self, from_m: FloatArray, direction: FloatArray) -> Hit | None:
        """March in steps of a quarter of the spacing, then halve the step that crosses the ground thirty times."""
        length = float(np.linalg.norm(direction))
        if not 0.0 < length < inf or self._above(from_m) < 0.0:
            return None
        step = self._spacing_m / 4.0 / length
        sinks = float(direction[2])
        start = max(0.0, (self._highest_m - float(from_m[2])) / sinks) if sinks > 0.0 else 0.0
        near, last = start, self._farthest_m / length
        while near < last:
            far = near + step
            if self._above(from_m + far * direction) <= 0.0:
                return self._crossing(from_m, direction, near, far)
            near = far
        return None

    def _above(self, place_m: FloatArray) -> float:
        return self.down_m(float(place_m[0]), float(place_m[1])) - float(place_m[2])

    def _crossing(self, from_m: FloatArray, direction: FloatArray, near: float, far: float) -> Hit:
        for _ in range(30):
            middle = (near + far) / 2.0
            if self._above(from_m + middle * direction) <= 0.0:
                far = middle
            else:
                near = middle
        place = from_m + far * direction
        _, to_north, to_east = self._at(float(place[0]), float(place[1]))
        return Hit(place, np.array([-to_north, -to_east, 1.0]), far)
