"""The elevation of the ground from one grid or several tiles. Pure."""

from collections.abc import Sequence
from math import ceil, floor, hypot
from typing import Final

import numpy as np

from dyknow.navigation.geodesy import metres_per_degree
from dyknow.navigation.terrain.grid import BoxedWay, HeightGrid, HighGround

NEAR_M: Final = 30.0
"""The ground so far north, south, east and west of a place counts as that below it."""
_STEP_M: Final = 30.0
_MOST_STEPS: Final = 10_000


class Elevation:
    """Grids of heights; where two overlap the higher ground counts.

    Args:
        grids: at least one.
        name: the file they were read from, for users.
    """

    def __init__(self, grids: Sequence[HeightGrid], name: str = "") -> None:
        self.grids, self.name = tuple(grids), name
        self._of_degrees: dict[tuple[int, int], list[HeightGrid]] = {}
        for grid in grids:
            for latitude in range(floor(grid.south_deg), floor(grid.north_deg) + 1):
                for longitude in range(floor(grid.west_deg), floor(grid.east_deg) + 1):
                    self._of_degrees.setdefault((latitude, _wrapped(longitude)), []).append(grid)

    def __str__(self) -> str:
        south, north = min(each.south_deg for each in self.grids), max(each.north_deg for each in self.grids)
        west, east = min(each.west_deg for each in self.grids), max(each.east_deg for each in self.grids)
        tiles = f"{len(self.grids)} tiles" if len(self.grids) > 1 else "1 grid"
        step_m = max(each.latitude_step_deg * metres_per_degree(each.north_deg)[0] for each in self.grids)
        place = f"{south:.4f} to {north:.4f} N, {west:.4f} to {east:.4f} E"
        return f"{self.name}: {tiles} with posts {step_m:.0f} m apart, {place}"

    def height_m(self, latitude_deg: float, longitude_deg: float) -> float | None:
        """Of the ground at a place; None: not known."""
        latitudes, longitudes = np.array([latitude_deg]), np.array([longitude_deg])
        grids = self._near(latitude_deg, latitude_deg, longitude_deg, longitude_deg)
        heights = [float(grid.heights_m(latitudes, longitudes)[0]) for grid in grids]
        return max((each for each in heights if each == each), default=None)  # noqa: PLR0124  (NaN is not itself)

    def highest(self, start: tuple[float, float], end: tuple[float, float], above_m: float = -np.inf) -> HighGround:
        """The highest ground within 30 m of places every 30 m on the straight way, if it is higher than `above_m`.

        Args:
            start: latitude and longitude.
            end: latitude and longitude.
            above_m: only higher ground is looked for.
        """
        north_m, east_m = metres_per_degree((start[0] + end[0]) / 2.0)
        north_deg, east_deg = end[0] - start[0], _between_180(end[1] - start[1])
        half_north, half_east = NEAR_M / north_m, NEAR_M / east_m
        steps = min(_MOST_STEPS, ceil(hypot(north_deg * north_m, east_deg * east_m) / _STEP_M))
        way = BoxedWay(start[0], start[1], north_deg, east_deg, half_north, half_east, steps)
        best, known, is_known = HighGround(), None, False
        for grid in self._near(
            start[0] + min(north_deg, 0.0) - half_north, start[0] + max(north_deg, 0.0) + half_north,
            start[1] + min(east_deg, 0.0) - half_east, start[1] + max(east_deg, 0.0) + half_east,
        ):  # fmt: skip
            found, places = grid.highest(way, above_m)
            best = found if found.height_m > best.height_m else best
            is_known = is_known or places is None
            if places is not None:
                known = places if known is None else known | places
        if is_known or (known is not None and known.all()):
            return best
        at = 0.0 if known is None else float(way.shares[known.argmin()])
        unknown = start[0] + north_deg * at, _between_180(start[1] + east_deg * at)
        return best._replace(unknown=unknown)

    def _near(self, south_deg: float, north_deg: float, west_deg: float, east_deg: float) -> list[HeightGrid]:
        """The grids of those degrees, each once."""
        rows, columns = range(floor(south_deg), floor(north_deg) + 1), range(floor(west_deg), floor(east_deg) + 1)
        if len(rows) * len(columns) > len(self._of_degrees):
            return list(self.grids)
        places = [(row, _wrapped(column)) for row in rows for column in columns]
        if len(places) == 1:
            return self._of_degrees.get(places[0], [])
        return list({id(grid): grid for place in places for grid in self._of_degrees.get(place, ())}.values())


def _wrapped(longitude: int) -> int:
    return (longitude + 180) % 360 - 180


def _between_180(longitude_deg: float) -> float:
    return (longitude_deg + 180.0) % 360.0 - 180.0
