"""Heights of the ground: bilinear between posts, unknown beyond them and next to voids, one over the borders of tiles."""

from math import isnan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow.navigation.geodesy import metres_per_degree
from dyknow.navigation.terrain.elevation import NEAR_M, Elevation
from dyknow.navigation.terrain.grid import VOID, HeightGrid
from dyknow.navigation.terrain.tiles import read_tile
from tests.navigation.terrain.ground import SECOND_DEG, densest_m, grid_of, tile_bytes

SLOPES = st.floats(-2000.0, 2000.0)
SHARES = st.floats(0.0, 1.0)


def place(grid: HeightGrid, down: float, right: float) -> tuple[float, float]:
    return (
        grid.north_deg - down * (grid.north_deg - grid.south_deg),
        grid.west_deg + right * (grid.east_deg - grid.west_deg),
    )


@given(SLOPES, SLOPES, SHARES, SHARES)
def test_a_plane_is_read_exactly_between_posts(north: float, east: float, down: float, right: float) -> None:
    grid = grid_of(lambda latitudes, longitudes: 100.0 + north * (latitudes - 55.0) + east * (longitudes - 13.0))
    latitude_deg, longitude_deg = place(grid, down, right)
    height_m = Elevation([grid]).height_m(latitude_deg, longitude_deg)
    assert height_m == pytest.approx(100.0 + north * (latitude_deg - 55.0) + east * (longitude_deg - 13.0), abs=1e-4)


@given(st.integers(0, 2**32 - 1), st.tuples(SHARES, SHARES, SHARES, SHARES))
def test_the_highest_on_a_way_is_what_a_dense_look_finds(seed: int, shares: tuple[float, ...]) -> None:
    random = np.random.default_rng(seed)
    grid = grid_of(lambda latitudes, _: random.uniform(0.0, 90.0, latitudes.shape), posts=25)
    start, end = place(grid, *shares[:2]), place(grid, *shares[2:])
    found = Elevation([grid]).highest(start, end)
    assert found.height_m >= densest_m(grid, start, end, 0.0) - 1e-6
    assert Elevation([grid]).height_m(found.latitude_deg, found.longitude_deg) == pytest.approx(
        found.height_m, abs=1e-3
    )
    here = Elevation([grid]).highest(start, start)
    north_m, east_m = metres_per_degree(start[0])
    latitudes = start[0] + np.linspace(-NEAR_M, NEAR_M, 121)[:, None] / north_m + np.zeros((1, 121))
    longitudes = start[1] + np.linspace(-NEAR_M, NEAR_M, 121)[None, :] / east_m + np.zeros((121, 1))
    dense_m = float(np.nanmax(grid.heights_m(latitudes.ravel(), longitudes.ravel())))
    assert dense_m - 1e-6 <= here.height_m <= dense_m + 5.0


@given(SHARES, SHARES)
def test_one_high_post_is_found_wherever_it_is_within_30_m(down: float, right: float) -> None:
    grid = grid_of(lambda latitudes, _: np.zeros(latitudes.shape))
    grid.heights[30, 40] = 70.0
    north_m, east_m = metres_per_degree(55.0)
    peak = grid.north_deg - 30 * SECOND_DEG, grid.west_deg + 40 * SECOND_DEG
    near = peak[0] + (2.0 * down - 1.0) * 29.9 / north_m, peak[1] + (2.0 * right - 1.0) * 29.9 / east_m
    found = Elevation([grid]).highest(near, near)
    assert found.height_m == pytest.approx(70.0)
    assert (found.latitude_deg, found.longitude_deg) == pytest.approx(peak, abs=1e-9)
    assert not Elevation([grid]).highest(near, near, 70.0).is_high


def test_outside_is_unknown_and_so_is_what_touches_a_void_while_known_posts_next_to_it_count() -> None:
    grid = grid_of(lambda latitudes, _: np.full(latitudes.shape, 40.0))
    grid.heights[30, 40] = VOID
    grid.heights[30, 41] = 80.0
    ground = Elevation([grid])
    row, column = grid.north_deg - 30 * SECOND_DEG, grid.west_deg + 40 * SECOND_DEG
    assert ground.height_m(55.2, 13.0) is None
    assert ground.height_m(row, column) is None
    assert ground.height_m(row + 0.5 * SECOND_DEG, column + 0.5 * SECOND_DEG) is None
    assert ground.height_m(row, column + SECOND_DEG) == pytest.approx(80.0)
    assert ground.height_m(row, column + 2 * SECOND_DEG) == pytest.approx(40.0)
    found = ground.highest((row, column), (row, column))
    assert found.height_m == pytest.approx(80.0)
    assert found.unknown == pytest.approx((row, column))
    assert ground.highest((row, column + 5 * SECOND_DEG), (row, column + 20 * SECOND_DEG)).unknown is None
    assert ground.highest((54.0, 12.0), (54.0, 12.0)).unknown == pytest.approx((54.0, 12.0))
    far = ground.highest((55.01, 13.01), (55.01, 13.05))
    assert far.unknown is not None
    assert 13.02 <= far.unknown[1] <= 13.0205


@pytest.mark.parametrize("south", [54, -1])
@pytest.mark.parametrize("west", [13, -1, 179])
def test_tiles_are_one_over_their_borders(south: int, west: int) -> None:
    def surface(latitudes: np.ndarray, longitudes: np.ndarray) -> np.ndarray:
        return np.rint(1200.0 * (latitudes - south)) + np.rint(1200.0 * ((longitudes - west) % 360.0))

    tiles = []
    for latitude in (south, south + 1):
        for longitude in (west, (west + 1 + 180) % 360 - 180):
            name = f"{'S' if latitude < 0 else 'N'}{abs(latitude):02}{'W' if longitude < 0 else 'E'}{abs(longitude):03}.hgt"
            tiles.append(read_tile(name, tile_bytes(latitude, longitude, surface)))
    ground, north_m = Elevation(tiles), metres_per_degree(south)[0]
    for north, east in ((1.0, 1.0), (1.0 - 1e-7, 1.0 + 1e-7), (1.0003, 0.5), (0.25, 1.0), (0.75, 0.75), (0.0, 0.0)):
        longitude = (west + east + 180.0) % 360.0 - 180.0
        height_m = ground.height_m(south + north, longitude)
        assert height_m == pytest.approx(1200.0 * (north + east), abs=1e-2)
    start, end = (south + 0.999, west + 0.999), (south + 1.001, (west + 1.001 + 180.0) % 360.0 - 180.0)
    found = ground.highest(start, end)
    assert found.unknown is None
    assert found.height_m == pytest.approx(
        1200.0 * (2.002 + 30.0 / north_m + 30.0 / metres_per_degree(south + 1)[1]), abs=0.1
    )


def test_the_border_of_a_single_tile_is_known() -> None:
    tile = read_tile("N57E014.hgt", tile_bytes(57, 14, lambda latitudes, _: np.full(latitudes.shape, 61.0)))
    for corner in ((57.0, 14.0), (58.0, 15.0), (57.0, 15.0), (58.0, 14.0)):
        assert Elevation([tile]).height_m(*corner) == 61.0
        assert Elevation([tile]).highest(corner, corner).unknown is None
    assert (
        str(Elevation([tile], "tile"))
        == "tile: 1 grid with posts 93 m apart, 57.0000 to 58.0000 N, 14.0000 to 15.0000 E"
    )


def test_heights_at_many_places_at_once() -> None:
    grid = grid_of(lambda latitudes, _: np.full(latitudes.shape, 40.0))
    found = grid.heights_m(np.array([55.01, 54.0]), np.array([13.01, 13.01])).tolist()
    assert found[0] == pytest.approx(40.0)
    assert isnan(found[1])
