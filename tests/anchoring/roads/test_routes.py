"""Routes: the shortest, the fastest, those that a vehicle can pass."""

from itertools import pairwise

import pytest
from hypothesis import given

from dyknow.anchoring.roads.elements import DirectedLink
from dyknow.anchoring.roads.files.formats import read_roads
from dyknow.anchoring.roads.files.summary import summary_of
from dyknow.anchoring.roads.network import RoadNetwork
from dyknow.anchoring.roads.routes import BY_TIME, RoadNeeds, RoadRoutes
from tests.anchoring.roads.towns import crossing, grid, link, networks, text

A, B, C = (crossing(name, *at) for name, at in {"a": (0, 0), "b": (100, 0), "c": (50, 50)}.items())
DIRECT = link("ab", "a", "b", [(0, 0), (100, 0)], speed_m_s=5)
TO_C = link("ac", "a", "c", [(0, 0), (50, 50)], speed_m_s=20)
FROM_C = link("cb", "c", "b", [(50, 50), (100, 0)], speed_m_s=20, width_m=4)
TRIANGLE = read_roads(text(A, B, C, DIRECT, TO_C, FROM_C))
ROUTES = RoadRoutes(TRIANGLE)


def ways(*names: str) -> tuple[DirectedLink, ...]:
    return tuple(DirectedLink(name, 1) for name in names)


def test_the_shortest_route_is_not_the_fastest() -> None:
    shortest, fastest = ROUTES.shortest("a", "b"), ROUTES.shortest("a", "b", BY_TIME)
    assert shortest == (ways("ab"), 100.0, 20.0)
    assert fastest is not None
    assert fastest.links == ways("ac", "cb")
    assert fastest.time_s == pytest.approx(141.4 / 20, abs=0.01)


def test_measured_speeds_change_the_fastest_route() -> None:
    jam = ROUTES.shortest("a", "b", BY_TIME, {DirectedLink("ac", 1): 1.0})
    assert jam is not None
    assert jam.links == ways("ab")
    stands = ROUTES.shortest("a", "b", BY_TIME, {DirectedLink("ac", 1): 0.0, DirectedLink("ab", 1): 0.1})
    assert stands is not None
    assert stands.links == ways("ab")


def test_what_an_emergency_vehicle_can_pass() -> None:
    both = ROUTES.passable("a", "b", {})
    assert [route.links for route in both] == [ways("ac", "cb"), ways("ab")]
    assert [route.links for route in ROUTES.passable("a", "b", {}, most=1)] == [ways("ac", "cb")]
    wide = ROUTES.passable("a", "b", {}, RoadNeeds(width_m=5.0))
    assert [route.links for route in wide] == [ways("ab")]
    jammed = ROUTES.passable("a", "b", {DirectedLink("ab", 1): 1.0, DirectedLink("ab", -1): 20.0})
    assert [route.links for route in jammed] == [ways("ac", "cb")]
    assert ROUTES.passable("a", "b", {DirectedLink("ab", 1): 1.0, DirectedLink("cb", 1): 1.0}) == ()


def test_a_route_may_begin_on_a_link_and_does_not_turn_round() -> None:
    route = ROUTES.shortest(DirectedLink("ab", 1), "a")
    assert route is not None
    assert route.links == (DirectedLink("cb", -1), DirectedLink("ac", -1))
    jammed = ROUTES.passable(DirectedLink("ab", 1), "c", {DirectedLink("ab", 1): 0.0})
    assert [each.links for each in jammed] == [(DirectedLink("cb", -1),)]


def test_one_is_there_already_or_never() -> None:
    assert ROUTES.shortest("a", "a") == ((), 0.0, 0.0)
    assert ROUTES.passable("a", "a", {}) == (((), 0.0, 0.0),)
    apart = RoadRoutes(read_roads(text(A, B, link("l", "a", None, [(0, 0), (9, 9)]))))
    assert apart.shortest("a", "b") is None
    assert apart.passable("a", "b", {}) == ()
    one_way = RoadRoutes(read_roads(text(A, B, link("l", "a", "b", [(0, 0), (100, 0)], oneway=True))))
    assert one_way.shortest("b", "a") is None
    with pytest.raises(KeyError):
        ROUTES.shortest("a", "nowhere")
    with pytest.raises(KeyError):
        one_way.shortest(DirectedLink("l", -1), "a")


def test_in_a_grid_the_shortest_route_is_the_manhattan_distance() -> None:
    network = grid(5)
    routes = RoadRoutes(network)
    for name, one in network.crossings.items():
        route = routes.shortest("1,2", name)
        assert route is not None
        assert route.length_m == pytest.approx(abs(one.x_m - 200.0) + abs(one.y_m - 100.0))


@given(network=networks())
def test_a_route_is_connected_and_no_longer_than_any_that_passes_another_crossing(network: RoadNetwork) -> None:
    routes = RoadRoutes(network)
    for start in network.crossings:
        for end in network.crossings:
            route = routes.shortest(start, end)
            if route is None or not route.links:
                continue
            for one, other in pairwise(route.links):
                assert other in network.turns.exits(one)
            first, last = (network.links[way.link] for way in (route.links[0], route.links[-1]))
            assert first.crossing_at(-route.links[0].direction) == start
            assert last.crossing_at(route.links[-1].direction) == end
            assert route.length_m == pytest.approx(sum(network.links[way.link].length_m for way in route.links))
            passable = routes.passable(start, end, {}, RoadNeeds(0.0, 0.0), most=3)
            times = [each.time_s for each in passable]
            assert times == pytest.approx(sorted(times))
            assert min(each.length_m for each in passable) >= route.length_m - 1e-9


def test_a_summary_counts_parts_and_dead_ends() -> None:
    apart = read_roads(text(A, B, C, DIRECT, link("l", "c", None, [(50, 50), (99, 99)])))
    summary = summary_of(apart)
    assert (summary.crossings, summary.links, summary.lanes, summary.areas) == (3, 2, 4, 0)
    assert (summary.parts, summary.dead_ends) == (2, 4)
    assert summary.length_m == pytest.approx(169.3, abs=0.1)
    assert summary_of(TRIANGLE)[5:7] == (1, 0)
    assert summary_of(TRIANGLE).turns == sum(
        len(way) for way in (TRIANGLE.turns.attributes(link) for link in TRIANGLE.links) for way in way.values()
    )
