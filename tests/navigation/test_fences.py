"""Ways within and around fences; shapely's distances are the oracle."""

from math import cos, pi, sin

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from shapely.geometry import LineString, Point, Polygon

from dyknow.navigation.fences import FenceArea, FenceKind, LevelPlace, clearance_m, fence_refusal
from dyknow.navigation.geodesy import metres_per_degree

HOME = (55.72, 13.46)
NORTH_M, EAST_M = metres_per_degree(HOME[0])


def place(north_m: float, east_m: float) -> LevelPlace:
    return HOME[0] + north_m / NORTH_M, HOME[1] + east_m / EAST_M


def polygon(kind: FenceKind, *corners: tuple[float, float]) -> FenceArea:
    return FenceArea(kind, tuple(place(*corner) for corner in corners))


def circle(kind: FenceKind, north_m: float, east_m: float, radius_m: float) -> FenceArea:
    return FenceArea(kind, centre=place(north_m, east_m), radius_m=radius_m)


SQUARE = ((-50.0, -50.0), (-50.0, 50.0), (50.0, 50.0), (50.0, -50.0))


def test_a_place_keeps_two_metres_from_the_edge_of_an_inclusion() -> None:
    inside = polygon(FenceKind.INCLUSION, *SQUARE)
    assert fence_refusal([inside], place(0, 0), place(47.9, 0)) is None
    assert fence_refusal([inside], place(0, 0), place(48.1, 0)) == (
        "the place is not 2 m inside the autopilot's inclusion fence (4 corners)"
    )
    assert fence_refusal([inside], place(0, 0), place(49.9, 0), margin_m=0.0) is None
    assert clearance_m(inside, place(60.0, 0)) == pytest.approx(-10.0, abs=0.02)


def test_a_straight_way_through_an_exclusion_is_refused_and_one_around_it_is_not() -> None:
    for outside in (
        polygon(FenceKind.EXCLUSION, (-5, 40), (5, 40), (5, 60), (-5, 60)),
        circle(FenceKind.EXCLUSION, 0, 50, 5),
    ):
        refusal = fence_refusal([outside], place(0, 0), place(0, 100))
        assert refusal is not None and "the straight way there crosses" in refusal
        assert fence_refusal([outside], place(0, 0), place(30, 50)) is None
        assert fence_refusal([outside], place(30, 50), place(0, 100)) is None
        assert "outside of" in (fence_refusal([outside], place(0, 0), place(0, 50)) or "")
        assert fence_refusal([outside], None, place(0, 100)) is None, "nothing is known of the way"


def test_a_way_across_the_bay_of_an_inclusion_is_refused() -> None:
    horseshoe = polygon(
        FenceKind.INCLUSION, (0, 0), (100, 0), (100, 30), (30, 30), (30, 70), (100, 70), (100, 100), (0, 100)
    )
    assert "straight way" in (fence_refusal([horseshoe], place(90, 15), place(90, 85)) or "")
    assert fence_refusal([horseshoe], place(15, 15), place(15, 85)) is None


def test_a_vehicle_on_the_wrong_side_may_stay_or_come_back() -> None:
    inside, outside = polygon(FenceKind.INCLUSION, *SQUARE), circle(FenceKind.EXCLUSION, 0, 0, 20)
    assert fence_refusal([inside], place(70, 0), place(70, 0)) is None
    assert fence_refusal([inside], place(70, 0), place(60, 0)) is None
    assert fence_refusal([inside], place(70, 0), place(30, 0)) is None
    assert fence_refusal([inside], place(70, 0), place(80, 0)) is not None
    assert fence_refusal([outside], place(5, 0), place(30, 0)) is None
    assert fence_refusal([outside], place(5, 0), place(2, 0)) is not None
    assert fence_refusal([outside], place(21, 0), place(40, 0)) is None, "it is nearer than 2 m, and leaves"


def test_every_inclusion_counts_or_one_of_them_as_the_autopilot_has_it() -> None:
    areas = [polygon(FenceKind.INCLUSION, (0, 0), (0, 60), (40, 60), (40, 0)), circle(FenceKind.INCLUSION, 20, 80, 40)]
    start, end = place(20, 10), place(20, 110)
    assert fence_refusal(areas, start, end) is not None
    assert fence_refusal(areas, start, end, union=True) is None
    assert fence_refusal(areas, place(20, 50), place(20, 55)) is None
    assert "any of" in (fence_refusal(areas, start, place(20, 130), union=True) or "")
    apart = [areas[0], circle(FenceKind.INCLUSION, 20, 110, 40)]
    assert "leaves" in (fence_refusal(apart, start, place(20, 120), union=True) or "")
    walled = [*areas, circle(FenceKind.EXCLUSION, 20, 60, 3)]
    assert "crosses" in (fence_refusal(walled, start, end, union=True) or "")


def test_fences_at_the_date_line_are_measured_across_it() -> None:
    area = FenceArea(FenceKind.EXCLUSION, centre=(0.0, 180.0), radius_m=30.0)
    assert fence_refusal([area], (0.0, 179.999), (0.0, -179.999)) is not None
    assert fence_refusal([area], (0.001, 179.999), (0.001, -179.999)) is None


@st.composite
def stars(draw: st.DrawFn) -> list[tuple[float, float]]:
    """A simple polygon about the origin, however jagged, metres."""
    count = draw(st.integers(3, 12))
    reaches = draw(st.lists(st.floats(10.0, 150.0), min_size=count, max_size=count))
    return [(reach * cos(2 * pi * n / count), reach * sin(2 * pi * n / count)) for n, reach in enumerate(reaches)]


POINTS = st.tuples(st.floats(-200.0, 200.0), st.floats(-200.0, 200.0))


@given(stars(), POINTS, POINTS, st.sampled_from([FenceKind.INCLUSION, FenceKind.EXCLUSION]))
def test_what_is_refused_is_what_comes_nearer_than_the_margin(
    corners: list[tuple[float, float]], start: tuple[float, float], end: tuple[float, float], kind: FenceKind
) -> None:
    shape = Polygon(corners)
    assume(shape.is_valid)
    area, way = polygon(kind, *corners), LineString([start, end])
    keeps = 1.0 if kind == FenceKind.INCLUSION else -1.0

    def right_m(point: tuple[float, float]) -> float:
        return keeps * (1.0 if shape.contains(Point(point)) else -1.0) * shape.exterior.distance(Point(point))

    assert clearance_m(area, place(*start)) == pytest.approx(right_m(start), abs=0.05)
    assume(right_m(start) > 2.1)
    least_m = min(shape.exterior.distance(way), right_m(end))
    assume(abs(least_m - 2.0) > 0.1)
    assert (fence_refusal([area], place(*start), place(*end)) is None) is (least_m > 2.0)
