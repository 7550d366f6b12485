"""Positions to places on roads: the nearest lane, headings, crossings, hysteresis."""

import math
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow.anchoring.roads.elements import DirectedLink
from dyknow.anchoring.roads.files.formats import read_roads
from dyknow.anchoring.roads.geometry import LEAST_M, Polyline, projected
from dyknow.anchoring.roads.network import RoadNetwork
from dyknow.anchoring.roads.snapping import DEFAULTS, RoadPlace, crossing_at, snap
from tests.anchoring.roads.towns import HEADINGS, POSITIONS, cross, crossing, grid, link, networks, text

TOWN = read_roads(cross())


def place(network: RoadNetwork, x_m: float, y_m: float, **more: object) -> RoadPlace:
    found = snap(network, x_m, y_m, **more)  # type: ignore[arg-type]
    assert found is not None
    return found


def test_a_car_is_put_on_the_centre_of_the_lane_of_its_direction() -> None:
    east = place(TOWN, 50.0, 0.4, velocity_m_s=(10.0, 0.0))
    assert (east.link, east.direction, east.offset_m, east.speed_m_s) == ("e", 1, 50.0, 10.0)
    assert (east.x_m, east.y_m) == (50.0, -1.75)
    assert east.across_m == -0.4
    west = place(TOWN, 50.0, 0.4, velocity_m_s=(-10.0, 1.0))
    assert (west.direction, west.y_m, west.speed_m_s) == (-1, 1.75, 10.0)
    assert abs(west.heading_rad or 0.0) == pytest.approx(math.pi)


def test_without_a_heading_the_side_of_the_road_decides_and_then_the_direction_before() -> None:
    first = place(TOWN, 50.0, 1.0)
    assert first.direction == -1
    assert place(TOWN, 49.0, -1.0, previous=first).direction == -1
    assert place(TOWN, 49.0, -1.0, velocity_m_s=(0.1, 0.0), previous=first).direction == -1


def test_a_lane_for_both_directions_leaves_the_direction_open() -> None:
    town = read_roads(cross(lanes=1))
    assert place(town, 50.0, 1.0).direction == 0
    assert place(town, 50.0, 1.0).heading_rad is None
    assert place(town, 50.0, 1.0, velocity_m_s=(-3.0, 0.0)).direction == -1


def test_the_heading_tells_links_apart_that_lie_close() -> None:
    assert place(TOWN, 10.0, 9.0, velocity_m_s=(9.0, 0.0)).link == "e"
    assert place(TOWN, 9.0, 10.0, velocity_m_s=(9.0, 0.0)).link == "e"
    assert place(TOWN, 10.0, 9.0, velocity_m_s=(0.0, 9.0)).link == "n"


def test_a_crossing_is_entered_at_its_radius_and_left_at_a_fifth_more() -> None:
    outside = place(TOWN, -8.5, -1.0, velocity_m_s=(9.0, 0.0))
    assert (outside.link, outside.crossing) == ("w", None)
    inside = place(TOWN, -7.9, -1.0, velocity_m_s=(9.0, 0.0), previous=outside)
    assert (inside.link, inside.crossing) == (None, "x")
    assert (inside.x_m, inside.y_m) == (-7.9, -1.0)
    assert inside.via == DirectedLink("w", -1)
    assert place(TOWN, 9.0, 0.0, previous=inside).crossing == "x"
    assert place(TOWN, 9.0, 0.0).link == "e"
    after = place(TOWN, 9.7, 1.0, previous=inside)
    assert (after.link, after.crossing, after.direction) == ("e", None, 1)


def test_the_direction_of_entering_and_leaving_is_known_where_no_heading_is() -> None:
    town = read_roads(text(crossing("x", 0, 0), link("in", None, "x", [(-99, 0), (0, 0)], lanes=1),
                           link("out", None, "x", [(99, 0), (0, 0)], lanes=1)))  # fmt: skip
    before = place(town, -20.0, 0.0)
    assert before.direction == 0
    inside = place(town, 0.0, 0.0, previous=before)
    assert inside.via == DirectedLink("in", 1)
    assert place(town, 20.0, 0.0, previous=inside).direction == -1
    assert place(town, 20.0, 0.0).direction == 0


def test_noise_at_the_border_of_a_crossing_changes_the_place_once() -> None:
    """The figure 8.8 of the thesis: in, out and in again."""
    seen, last = [], None
    for x_m in (-9.5, -8.2, -7.8, -8.3, -7.9, -8.6, -6.0, 0.0, 6.0, 8.4, 7.8, 9.0, 9.7, 8.5, 10.0):
        last = place(TOWN, x_m, -1.0, velocity_m_s=(9.0, 0.0), previous=last)
        seen.append(last.link or last.crossing)
    changes = [b for a, b in pairwise([None, *seen]) if a != b]
    assert changes[:3] == ["w", "x", "e"]


def test_a_place_does_not_jump_to_a_road_that_is_not_adjacent() -> None:
    roads = read_roads(text(link("a", None, None, [(0, 0), (500, 0)]), link("b", None, None, [(0, 8), (500, 8)])))
    before = place(roads, 100.0, 1.0)
    assert before.link == "a"
    assert place(roads, 101.0, 5.0).link == "b"
    assert place(roads, 101.0, 5.0, previous=before).link == "a"
    assert place(roads, 101.0, 7.5, previous=before).link == "b"


def test_switching_costs_nothing_between_adjacent_links() -> None:
    before = place(TOWN, 20.0, -2.0, velocity_m_s=(-9.0, 0.0))
    assert place(TOWN, -20.0, 2.0, velocity_m_s=(-9.0, 0.0), previous=before).link == "w"


def test_a_lane_is_kept_until_another_is_clearly_nearer() -> None:
    wide = read_roads(cross(lanes=4, width_m=14))
    right = place(wide, 50.0, -4.5, velocity_m_s=(9.0, 0.0))
    assert right.lane == 0
    assert place(wide, 51.0, -3.4, velocity_m_s=(9.0, 0.0)).lane == 1
    assert place(wide, 51.0, -3.4, velocity_m_s=(9.0, 0.0), previous=right).lane == 0
    assert place(wide, 51.0, -2.5, velocity_m_s=(9.0, 0.0), previous=right).lane == 1


@pytest.mark.parametrize("at", [(math.nan, 0.0), (0.0, math.inf), (-math.inf, math.nan), (50.0, 26.0), (1e9, -1e9)])
def test_what_is_off_the_roads_or_no_position_has_no_place(at: tuple[float, float]) -> None:
    assert snap(TOWN, *at) is None
    assert not TOWN.on_road(*at)


def test_the_index_has_nothing_near_what_is_no_position() -> None:
    assert not list(TOWN.index.links_near(math.nan, 0.0, 10.0))
    assert not list(TOWN.index.crossings_near(0.0, math.inf))


def test_a_velocity_that_is_no_number_counts_for_nothing() -> None:
    assert place(TOWN, 50.0, -1.0, velocity_m_s=(math.nan, 1.0)).direction == 1


def test_on_road_is_half_the_width_and_the_slack() -> None:
    assert TOWN.on_road(50.0, 3.5)
    assert not TOWN.on_road(50.0, 3.6)
    assert TOWN.on_road(50.0, 4.5, slack_m=1.0)
    assert TOWN.on_road(5.0, 6.0), "in the crossing"
    assert not TOWN.on_road(7.0, 7.0)


def test_the_deepest_of_crossings_that_overlap_is_the_one() -> None:
    town = read_roads(text(crossing("a", 0, 0, 10), crossing("b", 12, 0, 5), link("l", "a", "b", [(0, 0), (12, 0)])))
    near_b = crossing_at(town, 9.5, 0.0)
    assert near_b is not None
    assert near_b.id == "b"


@given(network=networks(lanes=1), share=st.floats(0.0, 1.0), number=st.integers(0, 7), heading=HEADINGS)
def test_what_lies_on_a_centre_line_stays_there(
    network: RoadNetwork, share: float, number: int, heading: float
) -> None:
    """At once if it was put there; where links meet, each step to another link lowers the cost, so that soon none is better."""
    chosen = list(network.links.values())[number % len(network.links)]
    x_m, y_m, _ = chosen.line.at(share * chosen.length_m)
    velocity = (9 * math.cos(heading), 9 * math.sin(heading))
    first = last = place(network, x_m, y_m, velocity_m_s=velocity)
    for _ in network.links:
        before, last = last, place(network, last.x_m, last.y_m, velocity_m_s=velocity, previous=last)
    assert math.dist(before[:2], last[:2]) < 1e-6
    if math.dist(first[:2], (x_m, y_m)) < 1e-6:
        assert abs(first.across_m) < 1e-6
        assert math.dist(last[:2], first[:2]) < 1e-6


@given(x_m=st.floats(10.0, 90.0), y_m=st.floats(-6.0, 6.0), forward=st.booleans())
def test_a_snapped_position_snaps_to_itself(x_m: float, y_m: float, forward: bool) -> None:
    town = grid(3)
    velocity = (9.0 if forward else -9.0, 0.0)
    once = place(town, x_m, y_m, velocity_m_s=velocity)
    twice = place(town, once.x_m, once.y_m, velocity_m_s=velocity, previous=once)
    assert twice[2:6] == once[2:6]
    assert math.dist(twice[:2], once[:2]) < 1e-9


@given(network=networks(), at=POSITIONS, reach=st.floats(0.5, 300.0))
def test_the_index_finds_what_a_search_through_all_links_finds(
    network: RoadNetwork, at: tuple[float, float], reach: float
) -> None:
    found = {one.id: where for one, where in network.index.links_near(*at, reach)}
    for one in network.links.values():
        nearest_m = min(abs(projected(a, b, 0.0, *at).across_m) for a, b in pairwise(one.line.points))
        if one.id in found:
            assert abs(found[one.id].across_m) == pytest.approx(nearest_m)
        else:
            assert nearest_m >= reach * (1 - 1e-12)
    inside = {one.id for one, _ in network.index.crossings_near(*at)}
    assert inside == {
        one.id for one in network.crossings.values() if math.dist(at, (one.x_m, one.y_m)) <= 1.2 * one.radius_m
    }


@given(network=networks(), at=POSITIONS, heading=HEADINGS)
def test_the_place_minimises_the_cost_over_all_links(
    network: RoadNetwork, at: tuple[float, float], heading: float
) -> None:
    """Against a search through every link, as the definition has it."""
    found = snap(network, *at, (9 * math.cos(heading), 9 * math.sin(heading)))
    if found is not None and found.crossing is not None:
        return
    costs = {}
    for one in network.links.values():
        where = one.line.project(*at)
        if abs(where.across_m) <= DEFAULTS.reach_m:
            turned = [
                math.remainder(heading - where.heading_rad - (math.pi if d < 0 else 0), math.tau)
                for d in one.directions
            ]
            costs[one.id] = (where.across_m / 3.0) ** 2 + (min(map(abs, turned)) / 0.5) ** 2
    if found is None:
        assert not costs
    else:
        assert found.link is not None
        assert costs[found.link] == pytest.approx(min(costs.values()), abs=1e-6)


@given(
    points=st.lists(POSITIONS, min_size=2, max_size=6).filter(lambda points: math.dist(*points[:2]) >= LEAST_M),
    at=POSITIONS,
)
def test_a_projection_is_the_nearest_point_and_its_side_is_right(
    points: list[tuple[float, float]], at: tuple[float, float]
) -> None:
    line = Polyline(points)
    where = line.project(*at)
    x_m, y_m, _ = line.at(where.offset_m)
    assert math.dist((x_m, y_m), (where.x_m, where.y_m)) < 1e-6
    assert math.dist(at, (x_m, y_m)) == pytest.approx(abs(where.across_m), abs=1e-6)
    sampled = min(math.dist(at, line.at(n / 200 * line.length_m)[:2]) for n in range(201))
    assert abs(where.across_m) <= sampled + 1e-6
