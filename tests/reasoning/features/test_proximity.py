import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow.reasoning import Approach, closest_approach, fence_margin_m, offset_m
from dyknow.reasoning.features.proximity import horizontal_miss_m

LATITUDES = st.floats(-60, 60)
OFFSETS = st.floats(-0.006, 0.006)
METRES = st.integers(-200_000, 200_000).map(lambda cm: cm / 100)
SPEEDS = st.integers(-5_000, 5_000).map(lambda cm_s: cm_s / 100)
VECTORS = st.tuples(METRES, METRES, METRES)
VELOCITIES = st.tuples(SPEEDS, SPEEDS, SPEEDS)
E2 = 6.694379990141316e-3


def earth_fixed(latitude_deg, longitude_deg):
    """On the WGS-84 ellipsoid, metres; the chord of 1 km is shorter than its arc by a micrometre."""
    lat, lon = math.radians(latitude_deg), math.radians(longitude_deg)
    n = 6378137.0 / math.sqrt(1 - E2 * math.sin(lat) ** 2)
    return n * math.cos(lat) * math.cos(lon), n * math.cos(lat) * math.sin(lon), n * (1 - E2) * math.sin(lat)


@given(LATITUDES, st.floats(-180, 180), OFFSETS, OFFSETS)
def test_horizontal_distance_is_within_a_centimetre_per_kilometre(lat, lon, dlat, dlon):
    first, second = (lat, lon), (lat + dlat, lon + dlon)
    exact_m = math.dist(earth_fixed(*first), earth_fixed(*second))
    assert abs(math.hypot(*offset_m(first, second)) - exact_m) <= 1e-5 * exact_m + 1e-6


@given(LATITUDES, st.floats(-170, 170), OFFSETS, OFFSETS)
def test_offsets_are_opposite_from_the_other_end(lat, lon, dlat, dlon):
    north_m, east_m = offset_m((lat, lon), (lat + dlat, lon + dlon))
    assert offset_m((lat + dlat, lon + dlon), (lat, lon)) == pytest.approx((-north_m, -east_m))


def test_north_and_east_point_where_they_should():
    north_m, east_m = offset_m((58.4, 15.6), (58.401, 15.6))
    assert north_m == pytest.approx(111.4, abs=0.05)
    assert east_m == 0.0
    north_m, east_m = offset_m((58.4, 15.6), (58.4, 15.601))
    assert north_m == 0.0
    assert east_m == pytest.approx(58.47, abs=0.05)


def test_the_date_line_is_no_wall():
    _, east_m = offset_m((0.0, 179.9999), (0.0, -179.9999))
    assert east_m == pytest.approx(22.26, abs=0.01)


@given(VECTORS, VELOCITIES)
def test_no_other_time_is_closer_than_the_closest_approach(p, v):
    found = closest_approach(p, v)
    nearest_m = math.hypot(found.xy_m, found.z_m)
    assert found.time_s >= 0
    for time_s in (0.0, 0.5, 1.0, 10.0, 100.0, found.time_s * 0.99, found.time_s * 1.01):
        there_m = math.hypot(*(a + b * time_s for a, b in zip(p, v, strict=True)))
        assert nearest_m <= there_m + 1e-6


def test_equal_velocities_are_closest_now():
    assert closest_approach((3, 4, 5), (0, 0, 0)) == Approach(0.0, 5.0, 5.0)


def test_diverging_courses_are_closest_now():
    assert closest_approach((30, 40, -5), (1, 1, 0)) == Approach(0.0, 50.0, 5.0)


def test_head_on_at_ten_metres_a_second_from_a_hundred_metres_takes_ten_seconds():
    assert closest_approach((100, 3, 2), (-10, 0, 0)) == Approach(10.0, 3.0, 2.0)


@given(VECTORS, VELOCITIES)
def test_the_horizontal_miss_is_no_larger_than_any_horizontal_distance_to_come(p, v):
    miss_m = horizontal_miss_m(p, v)
    assert all(miss_m <= math.hypot(p[0] + v[0] * t, p[1] + v[1] * t) + 1e-6 for t in (0.0, 1.0, 7.0, 60.0))


SQUARE = ((58.4, 15.6), (58.41, 15.6), (58.41, 15.62), (58.4, 15.62))


def test_the_margin_of_a_fence_is_positive_inside_and_negative_outside():
    assert fence_margin_m((58.405, 15.602), SQUARE) == pytest.approx(116.9, abs=0.3)
    assert fence_margin_m((58.405, 15.599), SQUARE) == pytest.approx(-58.5, abs=0.2)
    assert fence_margin_m((58.4, 15.61), SQUARE) == pytest.approx(0.0, abs=1e-6)


@given(st.floats(58.401, 58.409), st.floats(15.601, 15.619))
def test_the_margin_does_not_depend_on_where_the_polygon_begins_or_turns(lat, lon):
    margin_m = fence_margin_m((lat, lon), SQUARE)
    assert margin_m > 0
    assert fence_margin_m((lat, lon), SQUARE[2:] + SQUARE[:2]) == pytest.approx(margin_m)
    assert fence_margin_m((lat, lon), SQUARE[::-1]) == pytest.approx(margin_m)


def test_absurd_positions_harm_nothing():
    for first, second in [
        ((1e308, 15.0), (1e308, 15.0)),
        ((58.0, 1e308), (58.0, -1e308)),
        ((58.0, -190.0), (58.0, 170.0)),
    ]:
        assert all(map(math.isfinite, offset_m(first, second)))
