"""Made ground: small grids, tiles as their files have them, and what a dense look at a way finds."""

from collections.abc import Callable

import numpy as np

from dyknow.navigation.geodesy import metres_per_degree
from dyknow.navigation.terrain.grid import HeightGrid

SECOND_DEG = 1 / 3600.0
Surface = Callable[[np.ndarray, np.ndarray], np.ndarray]


def grid_of(
    surface: Surface, north_deg: float = 55.02, west_deg: float = 13.0, posts: int = 73, step_deg: float = SECOND_DEG
) -> HeightGrid:
    """A grid of float32 heights; `surface` takes latitudes and longitudes."""
    steps = np.arange(posts) * step_deg
    latitudes, longitudes = np.meshgrid(north_deg - steps, west_deg + steps, indexing="ij")
    return HeightGrid(north_deg, west_deg, step_deg, step_deg, surface(latitudes, longitudes).astype(np.float32))


def tile_bytes(south: int, west: int, surface: Surface, side: int = 1201) -> bytes:
    """A tile as a file has it."""
    steps = np.arange(side) / (side - 1)
    latitudes, longitudes = np.meshgrid(south + 1.0 - steps, west + steps, indexing="ij")
    return np.rint(surface(latitudes, longitudes)).astype(">i2").tobytes()


def ridge(at_longitude_deg: float, height_m: float, half_width_deg: float, base_m: float = 50.0) -> Surface:
    """A ridge that runs north and south over level ground."""

    def surface(_latitudes: np.ndarray, longitudes: np.ndarray) -> np.ndarray:
        return base_m + height_m * np.clip(1.0 - np.abs(longitudes - at_longitude_deg) / half_width_deg, 0.0, 1.0)

    return surface


def densest_m(grid: HeightGrid, start: tuple[float, float], end: tuple[float, float], near_m: float) -> float:
    """The highest ground that a look every metre finds on the way, and up to `near_m` north, south, east and west of it."""
    north_m, east_m = metres_per_degree((start[0] + end[0]) / 2.0)
    far_m = float(np.hypot((end[0] - start[0]) * north_m, (end[1] - start[1]) * east_m))
    shares = np.linspace(0.0, 1.0, int(far_m) + 2)
    sides_m = np.linspace(-near_m, near_m, 61 if near_m else 1)
    up, right, share = np.meshgrid(sides_m[[0, -1]] / north_m, sides_m / east_m, shares, indexing="ij")
    found = grid.heights_m(
        (start[0] + (end[0] - start[0]) * share + up).ravel(), (start[1] + (end[1] - start[1]) * share + right).ravel()
    )
    return float(np.nanmax(found))
