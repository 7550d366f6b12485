"""Turns between links at a crossing: the relations of 8.7.4."""

import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from dyknow.anchoring.roads.elements import DirectedLink
from dyknow.anchoring.roads.files.formats import read_roads
from dyknow.anchoring.roads.network import RoadNetwork
from dyknow.anchoring.roads.turns import LEFT, RIGHT, STRAIGHT, TURNS, UTURN
from tests.anchoring.roads.towns import cross, crossing, link, networks, text

TOWN = read_roads(cross())


def star(*degrees: float) -> RoadNetwork:
    """Arms named by their number, which lead away from the crossing x in these directions."""
    ends = [(100 * math.cos(math.radians(each)), 100 * math.sin(math.radians(each))) for each in degrees]
    arms = [link(str(n), "x", None, [(0.0, 0.0), end]) for n, end in enumerate(ends)]
    return read_roads(text(crossing("x", 0, 0), *arms))


def turns_from(network: RoadNetwork, name: str) -> dict[str, str | None]:
    return {other: network.turns.relation_of(name, "x", other) for other in network.links}


def test_at_a_cross_each_arm_has_one_of_each() -> None:
    assert turns_from(TOWN, "s") == {"e": RIGHT, "n": STRAIGHT, "w": LEFT, "s": UTURN}
    assert turns_from(TOWN, "e") == {"e": UTURN, "n": RIGHT, "w": STRAIGHT, "s": LEFT}


def test_the_state_of_a_link_has_its_turns_as_pairs_of_crossing_and_link() -> None:
    assert TOWN.turns.attributes("s") == {
        LEFT: (("x", "w"),), RIGHT: (("x", "e"),), STRAIGHT: (("x", "n"),), UTURN: (("x", "s"),)
    }  # fmt: skip


def test_a_link_that_may_not_be_entered_is_no_turn_of_the_network_and_has_a_relation_yet() -> None:
    town = read_roads(
        text(crossing("x", 0, 0), link("s", None, "x", [(0, -100), (0, 0)]),
             link("w", None, "x", [(-100, 0), (0, 0)], oneway=True), link("e", "x", None, [(0, 0), (100, 0)], oneway=True))
    )  # fmt: skip
    assert town.turns.attributes("s")[LEFT] == ()
    assert town.turns.relation_of("s", "x", "w") == LEFT
    assert town.turns.exits(DirectedLink("s", 1)) == {DirectedLink("e", 1): RIGHT}
    assert town.turns.attributes("e") == dict.fromkeys(TURNS, ())


@pytest.mark.parametrize(
    ("degrees", "ways"),
    [
        ((270, 90), {"1": STRAIGHT}),
        ((270, 104), {"1": STRAIGHT}),
        ((270, 130), {"1": STRAIGHT}),
        ((270, 140), {"1": LEFT}),
        ((270, 60, 120), {"1": RIGHT, "2": LEFT}),
        ((270, 80, 120), {"1": STRAIGHT, "2": LEFT}),
        ((270, 180, 0), {"1": LEFT, "2": RIGHT}),
        ((270, 260), {"1": UTURN}),
        ((270, 240, 0), {"1": LEFT, "2": RIGHT}),
    ],
)
def test_forks_bends_and_sharp_turns(degrees: tuple[float, ...], ways: dict[str, str]) -> None:
    assert turns_from(star(*degrees), "0") == {"0": UTURN, **ways}


def test_links_that_do_not_meet_have_no_relation() -> None:
    town = read_roads(
        text(crossing("x", 0, 0), link("a", "x", None, [(0, 0), (9, 0)]), link("b", None, None, [(0, 0), (0, 9)]))
    )
    assert town.turns.relation_of("a", "x", "b") is None
    assert town.turns.relation_of("a", "y", "a") is None
    assert town.turns.relation(DirectedLink("b", 1), DirectedLink("a", 1)) is None
    assert town.turns.relation(DirectedLink("a", -1), DirectedLink("b", 1)) is None


def test_a_u_turn_is_a_way_out_of_a_dead_end_only() -> None:
    exits = TOWN.turns.exits
    assert set(exits(DirectedLink("s", -1))) == {DirectedLink(one, 1) for one in "enw"}
    assert exits(DirectedLink("s", 1)) == {DirectedLink("s", -1): UTURN}
    one_way = read_roads(text(link("l", None, None, [(0, 0), (9, 0)], oneway=True)))
    assert exits(DirectedLink("e", 1)) == {DirectedLink("e", -1): UTURN}
    assert one_way.turns.exits(DirectedLink("l", 1)) == {}


OPPOSITE = {LEFT: RIGHT, RIGHT: LEFT, STRAIGHT: STRAIGHT, UTURN: UTURN}


@given(degrees=st.lists(st.floats(0.0, 360.0), min_size=2, max_size=6))
def test_what_is_left_one_way_is_right_the_other(degrees: list[float]) -> None:
    town = star(*degrees)
    for one in town.links:
        for other in town.links:
            back = town.turns.relation_of(other, "x", one)
            assert town.turns.relation_of(one, "x", other) == OPPOSITE[back or ""]


@given(degrees=st.lists(st.integers(0, 359), min_size=2, max_size=6, unique=True), by=st.integers(1, 359))
def test_turning_the_map_changes_no_turn(degrees: list[int], by: int) -> None:
    gaps = [abs((a - b) % 360 - edge) for a in degrees for b in degrees for edge in (15, 165, 195, 345, 135, 225, 180)]
    assume(min(gap for gap in gaps if gap) >= 1)
    here, there = star(*degrees), star(*(each + by + 1e-7 for each in degrees))
    for one in here.links:
        for other in here.links:
            angle = here.turns.angle_rad("x", DirectedLink(one, -1), DirectedLink(other, 1))
            if all(abs(abs(angle) - math.radians(edge)) > 1e-3 for edge in (15, 45, 165)):
                moved = there.turns.angle_rad("x", DirectedLink(one, -1), DirectedLink(other, 1))
                assert math.isclose(abs(angle), abs(moved), abs_tol=1e-6)


@given(network=networks())
def test_the_ways_out_of_a_link_begin_where_it_ends(network: RoadNetwork) -> None:
    for one in network.links.values():
        for direction in one.directions:
            arrived = DirectedLink(one.id, direction)
            for way, turn in network.turns.exits(arrived).items():
                following = network.links[way.link]
                assert way.direction in following.directions
                assert one.crossing_at(direction) == following.crossing_at(-way.direction)
                assert turn == network.turns.relation(arrived, way)
            ways = set(network.turns.exits(arrived).values())
            assert UTURN not in ways or ways == {UTURN}
