"""Which straight ways stay above the ground: drawn ways over drawn ridges, compared with a dense look at them."""

import re

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dyknow.navigation.geodesy import metres_per_degree
from dyknow.navigation.terrain.clearance import HOVERS_M, STOPS_M, AerialPlace, judge_way
from dyknow.navigation.terrain.elevation import NEAR_M, Elevation
from dyknow.navigation.terrain.grid import HeightGrid
from tests.navigation.terrain.ground import SECOND_DEG, densest_m, grid_of, ridge

FLOOR_M = 10.0
NORTH_M, EAST_M = metres_per_degree(55.01)
LATITUDES, LONGITUDES = st.floats(55.002, 55.018), st.floats(13.002, 13.018)
ALTITUDES = st.floats(40.0, 160.0)


def east_of(place: AerialPlace, east_m: float, up_m: float = 0.0) -> AerialPlace:
    return place._replace(longitude_deg=place.longitude_deg + east_m / EAST_M, altitude_m=place.altitude_m + up_m)


@given(
    st.floats(13.003, 13.017), st.floats(5.0, 90.0), st.floats(0.5, 6.0),
    st.sampled_from([SECOND_DEG, 3 * SECOND_DEG]), st.tuples(LATITUDES, LONGITUDES, ALTITUDES), st.tuples(LATITUDES, LONGITUDES, ALTITUDES),
)  # fmt: skip
def test_a_way_is_refused_if_and_only_if_the_ground_on_it_or_near_it_is_too_high(
    at: float, height_m: float, width: float, step: float, one: tuple[float, ...], other: tuple[float, ...]
) -> None:
    grid = grid_of(ridge(at, height_m, width * SECOND_DEG), posts=73 if step == SECOND_DEG else 25, step_deg=step)
    start, end = AerialPlace(*one), AerialPlace(*other)
    lowest_m = min(end.altitude_m, start.altitude_m + HOVERS_M)
    refusal = judge_way(Elevation([grid]), start, end, FLOOR_M).refusal
    if refusal is not None:
        assert densest_m(grid, start[:2], end[:2], NEAR_M) >= lowest_m - FLOOR_M - 0.05 * height_m
    elif not may_stop_or_climb(grid, start, end):
        assert densest_m(grid, start[:2], end[:2], 0.0) <= lowest_m - FLOOR_M + 0.02
        assert densest_m(grid, end[:2], end[:2], NEAR_M) <= end.altitude_m - FLOOR_M + 0.02


def may_stop_or_climb(grid: HeightGrid, start: AerialPlace, end: AerialPlace) -> bool:
    away_m = np.hypot((end[0] - start[0]) * NORTH_M, (end[1] - start[1]) * EAST_M)
    too_low = densest_m(grid, start[:2], start[:2], NEAR_M) > start.altitude_m - FLOOR_M - 0.02
    return bool(too_low and away_m < STOPS_M + 0.1 and end.altitude_m >= start.altitude_m - 0.02)


HILL = Elevation([grid_of(ridge(13.01, 60.0, 6 * SECOND_DEG))])
"""Level ground of 50 m, and 110 m at 13.01 E, 106 m wide on either side."""
WEST = AerialPlace(55.01, 13.004, 100.0)
TOP = AerialPlace(55.01, 13.01, 125.0)


def words(start: AerialPlace | None, end: AerialPlace, speed_m_s: float = 0.0) -> str:
    return judge_way(HILL, start, end, FLOOR_M, speed_m_s).refusal or ""


def test_the_sentence_names_the_heights_the_place_and_the_floor() -> None:
    assert re.fullmatch(
        r"100.0 m is 10.0 m below the ground on the way there \(110.0 m at 55.010\d\d,13.01000\); the floor is 10 m",
        words(WEST, east_of(WEST, 700.0)),
    )
    high = WEST._replace(altitude_m=115.0)
    assert re.fullmatch(
        r"115.0 m is 5.0 m above the ground on the way there .*; the floor is 10 m", words(high, east_of(high, 700.0))
    )
    assert words(WEST, TOP._replace(altitude_m=118.0)).startswith("118.0 m is 8.0 m above the ground there (110.0 m at")
    assert words(None, TOP._replace(altitude_m=118.0)).startswith("118.0 m is 8.0 m above the ground there (110.0 m at")
    assert words(None, TOP) == ""


def test_it_climbs_first_where_the_straight_way_begins_too_low() -> None:
    assert words(WEST, TOP).startswith("100.0 m is 10.0 m below the ground on the way there")
    assert words(WEST, TOP).endswith("the floor is 10 m: let the vehicle climb where it is first")
    assert words(WEST, WEST._replace(altitude_m=125.0)) == ""
    assert words(WEST._replace(altitude_m=125.0), TOP) == ""
    assert words(TOP, east_of(TOP, 300.0, -50.0)).startswith("75.0 m is 35.0 m below the ground on the way there")


def test_a_little_lower_than_ordered_is_where_it_hovers() -> None:
    high = WEST._replace(altitude_m=120.0)
    assert words(high._replace(altitude_m=119.3), east_of(high, 700.0)) == ""
    assert words(high._replace(altitude_m=118.9), east_of(high, 700.0)).endswith("climb where it is first")


def test_one_that_is_too_low_already_may_stop_and_climb_and_nothing_else() -> None:
    low = TOP._replace(altitude_m=115.0)
    assert words(low, low) == ""
    assert words(low, low._replace(altitude_m=117.0)) == ""
    assert words(low, east_of(low, 20.0)) == ""
    assert words(low, east_of(low, 50.0)) != ""
    assert words(low, east_of(low, 50.0), speed_m_s=10.0) == "", "it needs that to brake"
    assert words(low, low._replace(altitude_m=114.0)).startswith("114.0 m is 4.0 m above the ground there")
    assert words(low, east_of(low, 300.0, 20.0)).endswith("climb where it is first")


def test_unknown_ground_refuses_nothing_and_is_named() -> None:
    outside = WEST._replace(longitude_deg=12.99)
    judged = judge_way(HILL, outside, WEST, FLOOR_M)
    assert judged.refusal is None
    assert judged.unknown is not None
    assert np.allclose(judged.unknown, (55.01, 12.99))
    assert judge_way(HILL, outside, TOP._replace(altitude_m=118.0), FLOOR_M).refusal is not None


def test_fine_grids_keep_their_highest_posts() -> None:
    from dyknow.navigation.terrain.ascii_grid import _coarser

    random = np.random.default_rng(3)
    fine = grid_of(lambda latitudes, _: random.uniform(0.0, 50.0, latitudes.shape), posts=211, step_deg=SECOND_DEG / 17)
    coarse = _coarser(fine)
    assert coarse.latitude_step_deg * NORTH_M >= 9.0
    latitudes, longitudes = (
        random.uniform(low, high, 4000) for low, high in ((fine.south_deg, 55.02), (13.0, fine.east_deg))
    )
    assert np.all(coarse.heights_m(latitudes, longitudes) >= fine.heights_m(latitudes, longitudes) - 1e-4)
