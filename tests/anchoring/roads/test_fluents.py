"""Attributes of places and relations between vehicles on roads."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow.anchoring.links.states import ObjectState, diagonal
from dyknow.anchoring.roads.files.formats import read_roads
from dyknow.anchoring.roads.fluents import ahead_m, attributes_of, place_of
from dyknow.anchoring.roads.snapping import RoadPlace, snap
from tests.anchoring.roads.towns import cross

TOWN = read_roads(cross())


def place(x_m: float, y_m: float, *velocity_m_s: float) -> RoadPlace:
    found = snap(TOWN, x_m, y_m, velocity_m_s)  # type: ignore[arg-type]
    assert found is not None
    return found


@given(x_m=st.floats(-200, 200), y_m=st.floats(-20, 20), vx=st.floats(-20, 20), vy=st.floats(-20, 20))
def test_attributes_say_all_of_a_place(x_m: float, y_m: float, vx: float, vy: float) -> None:
    found = snap(TOWN, x_m, y_m, (vx, vy), snap(TOWN, x_m - vx, y_m - vy, (vx, vy)))
    at = (x_m, y_m) if found is None else found[:2]
    assert place_of(ObjectState(0, *at, vx, vy, diagonal(1.0), attributes_of(found))) == found


@pytest.mark.parametrize(
    ("one", "gap_m"),
    [
        (place(120, -1, 9, 0), 20.0),
        (place(80, -1, 9, 0), -20.0),
        (place(103, 1, 9, 0), 3.0),
        (place(120, 1, -9, 0), 20.0),
        (place(-20, -1, 9, 0), -120.0),
    ],
)
def test_who_is_ahead_is_so_along_the_road(one: RoadPlace, gap_m: float) -> None:
    assert ahead_m(TOWN, one, place(100, -1, 9, 0)) == pytest.approx(gap_m)


def test_across_a_crossing_one_is_in_front_of_the_other_where_their_links_follow_each_other() -> None:
    before, after = place(-1, 12, 0, -9), place(12, -1, 9, 0)
    assert ahead_m(TOWN, after, before) == pytest.approx(24.0)
    assert ahead_m(TOWN, before, after) == pytest.approx(-24.0)
    oncoming = place(1, -12, 0, 9)
    assert ahead_m(TOWN, before, oncoming) is None


def test_in_a_crossing_and_without_a_direction_there_is_no_relation() -> None:
    inside = place(0, 0, 9, 0)
    assert ahead_m(TOWN, inside, place(20, -1, 9, 0)) is None
    assert ahead_m(TOWN, place(20, -1, 9, 0), inside) is None
    unknown = place(100, -1, 9, 0)._replace(direction=0)
    assert ahead_m(TOWN, place(90, -1, 9, 0), unknown) is None
    assert ahead_m(TOWN, unknown, place(-20, -1, 9, 0)) is None


@given(one=st.floats(10, 199), other=st.floats(10, 199))
def test_of_two_that_drive_the_same_way_one_is_as_far_ahead_as_the_other_behind(one: float, other: float) -> None:
    a, b = (place(at, -1, 9, 0) for at in (one, other))
    assert ahead_m(TOWN, a, b) == pytest.approx(one - other)
    assert ahead_m(TOWN, b, a) == pytest.approx(other - one)
