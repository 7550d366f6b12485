"""What stands on a lane, and how much of the road that leaves."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow import US_PER_S
from dyknow.anchoring.roads.files.formats import read_roads
from dyknow.anchoring.roads.snapping import snap
from dyknow.anchoring.traffic.obstacles import BESIDE_M, OVER_US, LaneObstacle, SlowVehicles, narrowest
from tests.anchoring.roads.towns import crossing, link, text

ROADS = read_roads(
    text(crossing("a", 0, 0), crossing("b", 200, 0), link("ab", "a", "b", [(0, 0), (200, 0)], width_m=7))
)
WIDE = read_roads(
    text(crossing("a", 0, 0), crossing("b", 200, 0), link("ab", "a", "b", [(0, 0), (200, 0)], width_m=12, lanes=4))
)


def slow(drives, seconds=12.0, period_s=0.5, y_m=-1.75):
    """Vehicles by their speed (m/s), from 50 m on; what is slower than 2 m/s."""
    watched = SlowVehicles()
    for step in range(int(seconds / period_s)):
        at_s = step * period_s
        for vehicle, speed_m_s in drives.items():
            place = snap(ROADS, 50.0 + speed_m_s * at_s, y_m, (max(speed_m_s, 1.1), 0.0))
            watched.on_place(vehicle, round(at_s * US_PER_S), place)
    return watched.slower_than(2.0)


def test_what_stands_or_creeps_is_an_obstacle_and_what_drives_is_none() -> None:
    found = slow({"parked": 0.0, "creeping": 1.5, "driving": 3.0})
    assert [each.vehicle for each in found["ab"]] == ["parked", "creeping"]
    assert found["ab"][0].lane == found["ab"][1].lane == 0


def test_before_five_seconds_of_it_are_known_nothing_is_an_obstacle() -> None:
    assert slow({"parked": 0.0}, seconds=OVER_US / US_PER_S) == {}
    assert slow({"parked": 0.0}, seconds=OVER_US / US_PER_S + 0.5) != {}


def test_what_is_not_seen_any_more_or_has_left_the_road_closes_nothing() -> None:
    watched = SlowVehicles()
    place = snap(ROADS, 50.0, -1.75)
    for at_s in range(10):
        watched.on_place("parked", at_s * US_PER_S, place)
        watched.on_place("gone", at_s * US_PER_S, place)
    watched.on_place("gone", 10 * US_PER_S, None)
    assert [each.vehicle for each in watched.slower_than(2.0)["ab"]] == ["parked"]
    watched.on_time(20 * US_PER_S)
    assert watched.slower_than(2.0) == {}


def test_a_place_that_goes_back_in_time_changes_nothing() -> None:
    watched = SlowVehicles()
    for at_s in [*range(10), 3]:
        watched.on_place("car", at_s * US_PER_S, snap(ROADS, 50.0, -1.75))
    assert len(watched.slower_than(2.0)["ab"]) == 1


@pytest.mark.parametrize(
    ("lanes", "open_m"), [((), 12.0), ((0,), 9.0), ((1,), 6.0), ((3,), 9.0), ((1, 2), 3.0), ((0, 1, 2, 3), 0.0)]
)
def test_the_widest_run_of_lanes_next_to_each_other_is_open(lanes, open_m) -> None:
    standing = [LaneObstacle(f"c{lane}", "ab", lane, 50.0, 0.0) for lane in lanes]
    assert narrowest(WIDE.links["ab"], standing).open_m == pytest.approx(open_m)


def test_between_obstacles_that_are_far_apart_there_is_room_to_change_lanes() -> None:
    apart = [LaneObstacle("one", "ab", 0, 50.0, 0.0), LaneObstacle("other", "ab", 1, 50.0 + BESIDE_M + 1.0, 0.0)]
    assert narrowest(ROADS.links["ab"], apart).open_m == pytest.approx(3.5)
    beside = [apart[0], apart[1]._replace(offset_m=50.0 + BESIDE_M - 1.0)]
    place = narrowest(ROADS.links["ab"], beside)
    assert (place.open_m, len(place.obstacles)) == (0.0, 2)


obstacles = st.lists(
    st.builds(
        LaneObstacle, st.text("abc", min_size=1), st.just("ab"), st.integers(0, 3), st.floats(0.0, 200.0), st.just(0.0)
    ),
    max_size=6,
)


@given(obstacles, obstacles)
def test_more_obstacles_never_leave_more(some, more) -> None:
    link = WIDE.links["ab"]
    assert 0.0 <= narrowest(link, some + more).open_m <= narrowest(link, some).open_m <= link.width_m


@given(obstacles)
def test_open_width_is_that_of_the_lanes_that_no_obstacle_near_the_place_is_on(some) -> None:
    """By trying every run of lanes at every obstacle."""
    width_m = 3.0
    expected = 12.0
    for one in some:
        closed = {each.lane for each in some if abs(each.offset_m - one.offset_m) <= BESIDE_M}
        runs = [stop - start for start in range(4) for stop in range(start, 5) if closed.isdisjoint(range(start, stop))]
        expected = min(expected, max(runs) * width_m)
    assert math.isclose(narrowest(WIDE.links["ab"], some).open_m, expected, abs_tol=1e-9)
