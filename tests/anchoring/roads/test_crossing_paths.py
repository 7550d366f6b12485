"""Curves through crossings: from lane to lane, along both headings, no longer than the corner."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow.anchoring.roads.elements import DirectedLink
from dyknow.anchoring.roads.files.formats import read_roads
from dyknow.anchoring.roads.geometry import wrapped
from dyknow.anchoring.roads.network import RoadNetwork
from tests.anchoring.roads.towns import cross, networks

TOWN = read_roads(cross())


def test_a_turn_by_a_right_angle_is_a_quarter_of_a_circle() -> None:
    path = TOWN.paths.through(DirectedLink("s", -1), DirectedLink("e", 1), 0)
    assert path is not None
    assert (path.before_m, path.after_m) == (8.0, 8.0)
    assert path.line.length_m == pytest.approx(math.pi / 2 * 6.25, rel=0.01)
    for share in (0.0, 0.2, 0.5, 0.8, 1.0):
        x_m, y_m, _ = path.at(16.0 * share - 8.0)
        assert math.hypot(x_m - 8.0, y_m + 8.0) == pytest.approx(6.25, abs=0.1)
    assert path.comfortable_m_s == pytest.approx(math.sqrt(3.0 * 6.25), rel=0.05)
    straight = TOWN.paths.through(DirectedLink("s", -1), DirectedLink("n", 1), 0)
    assert straight is not None
    assert straight.comfortable_m_s > 100.0


def test_there_is_none_back_and_none_between_links_that_do_not_meet() -> None:
    assert TOWN.paths.through(DirectedLink("s", -1), DirectedLink("s", 1), 0) is None
    assert TOWN.paths.through(DirectedLink("s", 1), DirectedLink("e", 1), 0) is None
    assert TOWN.paths.through(None, DirectedLink("e", 1), 0) is None
    assert TOWN.paths.begins_m(DirectedLink("s", -1)) == 8.0
    assert TOWN.paths.begins_m(DirectedLink("s", 1)) == 0.0, "at a dead end one turns round at the end"


@given(network=networks(), number=st.integers(0, 50), lane=st.integers(0, 3))
def test_it_leaves_one_lane_and_reaches_the_other_along_their_headings(
    network: RoadNetwork, number: int, lane: int
) -> None:
    ways = [(DirectedLink(link.id, each), link) for link in network.links.values() for each in link.directions]
    via, _ = ways[number % len(ways)]
    for way in network.turns.exits(via):
        after = network.links[way.link]
        chosen = after.lanes_of(way.direction)[lane % len(after.lanes_of(way.direction))]
        path = network.paths.through(via, way, chosen)
        if path is None:
            continue
        x_m, y_m, heading_rad = path.at(path.after_m)
        offset_m = path.after_m if way.direction > 0 else after.length_m - path.after_m
        on_x_m, on_y_m, line_rad = after.line.at(offset_m, after.lanes[chosen].offset_m)
        assert (x_m, y_m) == pytest.approx((on_x_m, on_y_m), abs=1e-6)
        along_rad = line_rad + (0.0 if way.direction > 0 else math.pi)
        assert abs(wrapped(heading_rad - along_rad)) < 0.4
        nearest = path.nearest(x_m, y_m)
        assert nearest[1] == pytest.approx(0.0, abs=1e-6)
