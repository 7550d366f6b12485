"""Against formulas that share nothing with ours: the defining equation of the ellipsoid, and the geodesic's arc."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow.navigation.geodesy import LocalFrame, distance_m, from_ecef, to_ecef

A, B = 6_378_137.0, 6_356_752.314245
LATITUDES = st.floats(-89.9, 89.9)
LONGITUDES = st.floats(-180, 180)
ALTITUDES = st.floats(-400, 9_000)
OFFSETS = st.floats(-10_000, 10_000)


@given(LATITUDES, LONGITUDES, ALTITUDES)
def test_a_point_lies_at_its_altitude_along_the_normal_of_the_ellipsoid(lat, lon, alt) -> None:
    x, y, z = to_ecef(lat, lon, alt)
    la, lo = math.radians(lat), math.radians(lon)
    up = (math.cos(la) * math.cos(lo), math.cos(la) * math.sin(lo), math.sin(la))
    foot = tuple(p - alt * u for p, u in zip((x, y, z), up, strict=True))
    assert (foot[0] ** 2 + foot[1] ** 2) / A**2 + foot[2] ** 2 / B**2 == pytest.approx(1.0, abs=1e-12)
    gradient = (foot[0] / A**2, foot[1] / A**2, foot[2] / B**2)
    norm = math.hypot(*gradient)
    assert tuple(g / norm for g in gradient) == pytest.approx(up, abs=1e-12), "the normal is the gradient there"


@given(LATITUDES, LONGITUDES, ALTITUDES)
def test_earth_centred_coordinates_lead_back(lat, lon, alt) -> None:
    back = from_ecef(*to_ecef(lat, lon, alt))
    assert back[0] == pytest.approx(lat, abs=1e-11)
    assert math.remainder(back[1] - lon, 360.0) == pytest.approx(0.0, abs=1e-11)
    assert back[2] == pytest.approx(alt, abs=1e-5)


def test_known_points_of_the_ellipsoid() -> None:
    assert to_ecef(0, 0, 0) == pytest.approx((A, 0, 0))
    assert to_ecef(90, 0, 0) == pytest.approx((0, 0, B), abs=1e-6)
    assert from_ecef(0, 0, -B - 100)[0::2] == pytest.approx((-90, 100), abs=1e-6)


@given(LATITUDES, LONGITUDES, ALTITUDES, OFFSETS, OFFSETS, st.floats(-3_000, 3_000))
def test_a_local_frame_keeps_distances_and_leads_back(lat, lon, alt, north, east, down) -> None:
    frame = LocalFrame(lat, lon, alt)
    point = frame.from_ned(north, east, down)
    assert frame.to_ned(*point) == pytest.approx((north, east, down), abs=1e-4)
    straight = math.dist(to_ecef(lat, lon, alt), to_ecef(*point))
    assert straight == pytest.approx(math.hypot(north, east, down), abs=1e-4)


@given(st.floats(-80, 80), LONGITUDES, ALTITUDES)
def test_the_axes_point_north_east_and_down(lat, lon, alt) -> None:
    frame = LocalFrame(lat, lon, alt)
    north, east = frame.to_ned(lat + 1e-4, lon, alt), frame.to_ned(lat, lon + 1e-4, alt)
    assert north[0] > 11
    assert abs(north[1]) < 1e-3
    assert east[1] > 1
    assert abs(east[0]) < 1e-3
    assert frame.to_ned(lat, lon, alt + 7.5) == pytest.approx((0, 0, -7.5), abs=1e-6)


@given(st.floats(-80, 80), LONGITUDES, st.floats(-7_000, 7_000), st.floats(-7_000, 7_000))
def test_distance_agrees_with_the_straight_line_less_its_sagitta(lat, lon, north, east) -> None:
    far = LocalFrame(lat, lon, 0.0).from_ned(north, east, 0.0)
    chord = math.dist(to_ecef(lat, lon, 0.0), to_ecef(far[0], far[1], 0.0))
    arc = chord * (1 + chord**2 / (24 * 6.37e6**2))
    assert distance_m(lat, lon, far[0], far[1]) == pytest.approx(arc, abs=1e-3)


def test_distance_crosses_the_date_line_and_takes_a_height() -> None:
    assert distance_m(0, 179.9999, 0, -179.9999) == pytest.approx(22.264, abs=1e-3)
    assert distance_m(47, 8, 47, 8, 10.0) == 10.0
    assert distance_m(0, 0, 0, 0.001, 0) == pytest.approx(A * math.radians(0.001), rel=1e-9)
