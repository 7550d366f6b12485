"""Prediction along roads: hypotheses split at crossings, are weighed, pruned and exported."""

import math
from collections import deque
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from dyknow import US_PER_S
from dyknow.anchoring.links.individuals import Individual
from dyknow.anchoring.links.prediction import ConstantVelocity, ObjectPrediction, Predictor
from dyknow.anchoring.links.states import ObjectState, diagonal
from dyknow.anchoring.roads.elements import DirectedLink
from dyknow.anchoring.roads.files.formats import read_roads
from dyknow.anchoring.roads.fluents import NO_CROSSING, NO_LINK, place_of
from dyknow.anchoring.roads.hypotheses import Pruning, RouteHypothesis, TurnTable, advance, lane_after, pruned
from dyknow.anchoring.roads.network import RoadNetwork
from dyknow.anchoring.roads.objects import OnRoad
from dyknow.anchoring.roads.prediction import AlongRoads
from tests.anchoring.roads.towns import cross, crossing, grid, link, networks, text

TOWN = read_roads(cross())
START = (RouteHypothesis(DirectedLink("s", -1), 150.0, 1, 1.0),)


def ways(found: tuple[RouteHypothesis, ...]) -> dict[DirectedLink, float]:
    return {each.way: pytest.approx(each.weight) for each in found}


def test_a_hypothesis_follows_its_link() -> None:
    (one,) = advance(TOWN, START, 30.0)
    assert (one.way, one.travelled_m, one.weight) == (DirectedLink("s", -1), 180.0, 1.0)
    assert one.offset_m(TOWN) == 20.0
    assert one.at(TOWN) == pytest.approx((1.75, -20.0, math.pi / 2))


def test_at_a_crossing_it_splits_into_every_way_but_back() -> None:
    found = advance(TOWN, START, 70.0)
    assert ways(found) == dict.fromkeys((DirectedLink(name, 1) for name in "enw"), 1 / 3)
    places = {each.way.link: each.at(TOWN)[:2] for each in found}
    assert places["n"] == pytest.approx((1.75, 20.0))
    right_m, left_m = (16.0 - math.pi / 2 * radius_m for radius_m in (6.25, 9.75))
    assert places["e"] == pytest.approx((20.0 + right_m, -1.75), abs=0.1), "curves are shorter than corners"
    assert places["w"] == pytest.approx((-20.0 - left_m, 1.75), abs=0.1)


def test_at_a_dead_end_it_turns_round_and_on_a_way_out_of_a_one_way_street_it_stops() -> None:
    (back,) = advance(TOWN, (RouteHypothesis(DirectedLink("e", 1), 190.0, 0, 1.0),), 30.0)
    assert (back.way, back.travelled_m) == (DirectedLink("e", -1), 20.0)
    street = read_roads(text(link("l", None, None, [(0, 0), (50, 0)], oneway=True)))
    (stopped,) = advance(street, (RouteHypothesis(DirectedLink("l", 1), 40.0, 0, 1.0),), 30.0)
    assert stopped.travelled_m == 50.0


def test_turns_are_as_probable_as_the_table_of_the_crossing_says() -> None:
    table = TurnTable({"x": {"left": 6.0, "straight": 3.0, "right": 1.0}})
    found = advance(TOWN, START, 70.0, table)
    assert ways(found) == {DirectedLink("w", 1): 0.6, DirectedLink("n", 1): 0.3, DirectedLink("e", 1): 0.1}
    assert found[0].way.link == "w", "the heaviest first"
    elsewhere = TurnTable({"y": {"left": 1.0}}, usual={"straight": 1.0})
    assert ways(advance(TOWN, START, 70.0, elsewhere)) == {DirectedLink("n", 1): 1.0}
    assert len(advance(TOWN, START, 70.0, TurnTable())) == 3
    nothing = TurnTable(usual={"left": 0.0}, least=0.0)
    assert len(advance(TOWN, START, 70.0, nothing)) == 3, "a table that allows no way allows them all"


def test_light_hypotheses_are_pruned_and_the_others_weigh_one() -> None:
    table = TurnTable(usual={"left": 0.01, "straight": 0.5, "right": 0.49})
    found = advance(TOWN, START, 70.0, table)
    assert {each.way.link for each in found} == {"n", "e"}
    assert sum(each.weight for each in found) == pytest.approx(1.0)


def test_of_many_the_heaviest_are_kept() -> None:
    many = [RouteHypothesis(DirectedLink("e", 1), 2.0 * n, 0, 1.0 + n / 100) for n in range(40)]
    kept = pruned(many)
    assert len(kept) == 32
    assert min(each.travelled_m for each in kept) == 16.0
    even = pruned([each._replace(weight=1.0) for each in many], Pruning(least_weight=0.1))
    assert len(even) == 1, "there is always one"


def test_hypotheses_that_meet_are_one() -> None:
    two = [
        RouteHypothesis(DirectedLink("e", 1), at, 0, 0.5, DirectedLink(via, -1)) for at, via in ((5.0, "n"), (5.2, "s"))
    ]
    assert [each.weight for each in pruned(two)] == [1.0]
    assert len(pruned([two[0], two[1]._replace(travelled_m=6.0)])) == 2
    assert len(pruned([two[0], two[1]._replace(way=DirectedLink("e", -1))])) == 2


def test_blocks_of_a_grid_are_met_again_from_two_sides() -> None:
    network = grid(6)
    start = (RouteHypothesis(DirectedLink("e 2,0", 1), 50.0, 0, 1.0),)
    found = advance(network, start, 250.0)
    assert len({(each.way, round(each.travelled_m)) for each in found}) == len(found)
    assert found[0].weight == pytest.approx(2 / 27), "two of 27 ways lead there"


def test_the_lane_counts_from_the_right() -> None:
    roads = read_roads(
        text(
            crossing("x", 0, 0),
            link("two", None, "x", [(-99, 0), (0, 0)], lanes=4),
            link("one", "x", None, [(0, 0), (99, 0)]),
        )
    )
    two, one = DirectedLink("two", 1), DirectedLink("one", 1)
    assert [lane_after(roads, two, lane, one) for lane in (0, 1)] == [0, 0]
    assert lane_after(roads, one.back, 1, two.back) == 3


@given(
    network=networks(),
    number=st.integers(0, 7),
    share=st.floats(0.0, 1.0),
    steps=st.lists(st.floats(0.0, 400.0), min_size=1, max_size=5),
)
def test_weights_sum_to_one_and_hypotheses_stay_on_links_in_a_direction_that_is_allowed(
    network: RoadNetwork, number: int, share: float, steps: list[float]
) -> None:
    chosen = list(network.links.values())[number % len(network.links)]
    way = DirectedLink(chosen.id, chosen.directions[0])
    found = (RouteHypothesis(way, share * chosen.length_m, chosen.lanes_of(way.direction)[0], 1.0),)
    for step in steps:
        found = advance(network, found, step)
        assert sum(each.weight for each in found) == pytest.approx(1.0)
        assert [each.weight for each in found] == sorted((each.weight for each in found), reverse=True)
        assert 1 <= len(found) <= 32
        for each in found:
            on = network.links[each.way.link]
            assert each.way.direction in on.directions
            assert each.lane in on.lanes_of(each.way.direction)
            least_m = 0.0 if each.via is None else -network.paths.begins_m(each.via) - 1e-9
            assert least_m <= each.travelled_m <= on.length_m


@given(first=st.floats(0.0, 300.0), second=st.floats(0.0, 300.0))
@example(first=279.0, second=283.0)
@example(first=275.5, second=275.625)
def test_two_steps_are_one_step(first: float, second: float) -> None:
    """Where nothing is pruned and nothing meets."""
    keep = Pruning(least_weight=0.0, most=10_000)
    town = grid(4, block_m=97.0)
    start = (RouteHypothesis(DirectedLink("e 1,0", 1), 13.0, 0, 1.0),)
    at_once = advance(town, start, first + second, pruning=keep)
    stepwise = advance(town, advance(town, start, first, pruning=keep), second, pruning=keep)
    left = {id(each): each.weight for each in stepwise}
    apart = 0.0
    for each in at_once:
        if 3.0 < each.travelled_m < 94.0:  # nearer to a crossing a step that ended in one differs by decimetres
            weight = each.weight
            for other in stepwise:
                if other.way == each.way and abs(other.travelled_m - each.travelled_m) < 1.0:
                    shared = min(weight, left[id(other)])
                    weight, left[id(other)] = weight - shared, left[id(other)] - shared
            apart += weight
    assert apart < 0.02


def test_a_tangle_of_short_links_is_bounded_work() -> None:
    network = grid(10, block_m=0.2)
    start = (RouteHypothesis(DirectedLink("e 5,5", 1), 0.0, 0, 1.0),)
    found = advance(network, start, 1e6)
    assert sum(each.weight for each in found) == pytest.approx(1.0)


# What is seen, and then is not.


def seen(x_m: float, y_m: float, vx_m_s: float, vy_m_s: float, valid_us: int = 0, **about: Any) -> ObjectState:
    return ObjectState(valid_us, x_m, y_m, vx_m_s, vy_m_s, diagonal(1.0, 0.5), about)


def shown(network: RoadNetwork, *states: ObjectState) -> deque[ObjectState]:
    """The states of the on-road object, as its link makes them."""
    unit = OnRoad(network)
    found: deque[ObjectState] = deque(maxlen=10)
    for state in states:
        found.append(unit(state, found[-1] if found else None))
    return found


def predicted(predictor: Predictor, history: Sequence[ObjectState], *times_s: float, **more: Any) -> ObjectPrediction:
    before = None
    for time_s in times_s:
        before = predictor.predict(history, history[-1].valid_us + round(time_s * US_PER_S), before, **more)
    assert before is not None
    return before


def test_an_on_road_object_is_on_its_lane_and_keeps_what_it_was() -> None:
    (state,) = shown(TOWN, seen(1.0, -60.0, 0.0, 10.0, colour="red"))
    assert (state.x_m, state.y_m) == (1.75, -60.0)
    assert state.attributes["colour"] == "red"
    assert state.attributes["world_x_m"] == 1.0
    assert (state.attributes["link"], state.attributes["crossing"]) == ("s", NO_CROSSING)
    assert state.attributes["along_m_s"] == pytest.approx(10.0)
    (off,) = shown(TOWN, seen(100.0, 100.0, 0.0, 10.0))
    assert (off.x_m, off.attributes["link"], off.attributes["crossing"]) == (100.0, NO_LINK, NO_CROSSING)
    assert place_of(off) is None


def test_the_place_of_a_state_is_in_its_attributes() -> None:
    states = shown(TOWN, seen(1.0, -12.0, 0.0, 9.0), seen(1.0, -5.0, 0.0, 9.0))
    place = place_of(states[-1])
    assert place is not None
    assert (place.crossing, place.via) == ("x", DirectedLink("s", -1))


def test_what_is_not_seen_goes_on_along_its_road_at_its_speed() -> None:
    history = shown(TOWN, seen(1.0, -60.0, 0.0, 10.0))
    prediction = predicted(AlongRoads(TOWN), history, 1.0, 2.0, 3.0)
    assert [each.weight for each in prediction.hypotheses] == [1.0]
    likely = prediction.likely
    assert (likely.x_m, likely.y_m, likely.vx_m_s, likely.vy_m_s) == pytest.approx((1.75, -30.0, 0.0, 10.0))
    assert likely.valid_us == 3 * US_PER_S
    assert likely.attributes["link"] == "s"


def test_through_a_crossing_it_is_one_symbol_with_hypotheses_that_name_their_routes() -> None:
    history = shown(TOWN, seen(1.0, -60.0, 0.0, 10.0))
    inside = predicted(AlongRoads(TOWN), history, *(n / 10 for n in range(1, 61)))
    assert {each.state.attributes["crossing"] for each in inside.hypotheses} == {"x"}
    assert {each.state.attributes["via"] for each in inside.hypotheses} == {"s"}
    after = predicted(AlongRoads(TOWN), history, *(n / 10 for n in range(1, 81)))
    assert sorted(each.state.attributes["link"] for each in after.hypotheses) == ["e", "n", "w"]
    assert sum(each.weight for each in after.hypotheses) == pytest.approx(1.0)
    turned = after.nearest(seen(-22.0, 3.0, -10.0, 0.0))
    assert (turned.x_m, turned.y_m) == pytest.approx((-20.7, 1.75), abs=0.1)
    assert (turned.vx_m_s, turned.vy_m_s) == pytest.approx((-10.0, 0.0))


def test_a_step_at_once_is_as_good_as_many() -> None:
    history = shown(TOWN, seen(1.0, -60.0, 0.0, 10.0))
    once = predicted(AlongRoads(TOWN), history, 8.0)
    many = predicted(AlongRoads(TOWN), history, *(n / 10 for n in range(1, 81)))
    for one, other in zip(once.hypotheses, many.hypotheses, strict=True):
        assert one.state[:5] == pytest.approx(other.state[:5])
        assert one.state.covariance == pytest.approx(other.state.covariance)


def test_it_grows_uncertain_along_the_road_and_not_across() -> None:
    history = shown(TOWN, seen(1.0, -60.0, 0.0, 10.0))
    after = predicted(AlongRoads(TOWN, noise=1.0), history, 7.0)
    east = next(each.state for each in after.hypotheses if each.state.vx_m_s > 5.0)
    assert east.covariance[0, 0] == pytest.approx(1.0 + 0.25 * 49 + 343 / 3)
    assert east.covariance[1, 1] == pytest.approx(1.0)
    assert np.linalg.eigvalsh(east.covariance).min() > 0.0


def test_lost_in_a_crossing_the_way_it_had_begun_to_take_is_the_likeliest() -> None:
    before = seen(1.5, -12.0, 0.0, 8.0)
    turning = predicted(AlongRoads(TOWN), shown(TOWN, before, seen(4.5, -2.5, 7.5, 2.0)), 1.0)
    assert turning.likely.attributes["route"] == "e"
    assert turning.hypotheses[0].weight > 0.8
    entering = predicted(AlongRoads(TOWN), shown(TOWN, before, seen(1.7, -7.5, 0.0, 8.0)), 0.5)
    assert len(entering.hypotheses) == 3
    assert entering.likely.y_m == pytest.approx(-3.5, abs=1.5)


@pytest.mark.parametrize(("speed_m_s", "way"), [(13.0, "n"), (5.0, "e")])
def test_what_slows_down_on_the_way_into_a_crossing_turns_and_what_does_not_goes_straight_on(
    speed_m_s: float, way: str
) -> None:
    individual = Individual()
    for n in range(30):
        individual.observe(seen(13.0 * n, 0.0, 13.0, 0.0, n * US_PER_S))
    history = shown(TOWN, seen(1.75, -12.0, 0.0, speed_m_s), seen(1.9, -5.5, 0.1 * speed_m_s, speed_m_s))
    found = predicted(AlongRoads(TOWN), history, 0.1, individual=individual)
    assert found.likely.attributes["route"] == way
    assert found.hypotheses[0].weight > 0.45


def test_what_starts_in_a_crossing_may_go_anywhere() -> None:
    found = predicted(AlongRoads(TOWN), shown(TOWN, seen(0.0, 0.0, 0.0, 0.0)), 1.0)
    assert sorted(each.state.attributes["route"] for each in found.hypotheses) == ["e", "n", "s", "w"]


def test_without_a_direction_it_may_go_both_ways() -> None:
    street = read_roads(text(link("l", None, None, [(0, 0), (200, 0)], lanes=1)))
    slow = seen(100.0, 0.0, 0.3, 0.0)
    found = predicted(AlongRoads(street), shown(street, slow), 1.0)
    assert sorted(each.state.attributes["direction"] for each in found.hypotheses) == [-1, 1]
    one_way = predicted(AlongRoads(street), shown(street, slow._replace(vx_m_s=9.0)), 1.0)
    assert [each.state.x_m for each in one_way.hypotheses] == pytest.approx([109.0])


def test_a_velocity_that_was_not_measured_is_that_of_the_last_positions() -> None:
    states = [seen(1.75, -60.0 + n, 0.0, 0.0, 100_000 * n)._replace(covariance=diagonal(1.0)) for n in range(6)]
    found = predicted(AlongRoads(TOWN), shown(TOWN, *states), 1.0)
    assert found.likely.y_m == pytest.approx(-45.0, abs=0.1)


def test_off_the_roads_it_goes_straight_on() -> None:
    history = shown(TOWN, seen(100.0, 100.0, 3.0, 4.0))
    found = predicted(AlongRoads(TOWN), history, 1.0, 2.0)
    assert found.likely[1:3] == predicted(ConstantVelocity(), list(history), 1.0, 2.0).likely[1:3] == (106.0, 108.0)


def test_against_a_one_way_street_it_goes_on_as_it_went() -> None:
    street = read_roads(text(link("l", None, None, [(0, 0), (500, 0)], oneway=True)))
    found = predicted(AlongRoads(street), shown(street, seen(300.0, 0.0, -10.0, 0.0)), 1.0, 2.0)
    assert found.likely[1:3] == pytest.approx((280.0, 0.0))


def test_habits_of_an_individual_change_where_it_is_expected() -> None:
    individual = Individual()
    for n in range(30):
        individual.observe(seen(10.0 * n, 0.0, 9.0 + 2 * (n % 2), 0.0, n * US_PER_S))
    individual.turns.update({"left": 12})
    history = shown(TOWN, seen(1.0, -60.0, 0.0, 4.0))
    found = predicted(AlongRoads(TOWN), history, *(n / 10 for n in range(1, 101)), individual=individual)
    assert found.likely.attributes["link"] == "w"
    assert found.hypotheses[0].weight == pytest.approx((4 / 3 + 12) / 16)
    assert found.likely.speed_m_s > 4.0


LEFT_TURN = [
    (1.0, -20.0, 0.0, 9.0),
    (1.5, -6.0, 0.0, 8.0),
    (-2.0, 1.0, -6.0, 4.0),
    (-11.0, 1.5, -8.0, 0.0),
    (-30.0, 2.0, -9.0, 0.0),
]


def test_a_turn_that_was_made_stays_an_attribute_and_is_a_habit_of_the_individual() -> None:
    states = [seen(*at, n * US_PER_S) for n, at in enumerate(LEFT_TURN)]
    history = shown(TOWN, *states)
    assert [state.attributes.get("turn") for state in history] == [None, None, None, "left", "left"]
    assert history[-1].attributes["turned_us"] == 3 * US_PER_S
    individual = Individual()
    for state in history:
        individual.observe(state)
    assert individual.turns == {"left": 1}
    later = predicted(AlongRoads(TOWN), history, 1.0)
    assert later.likely.attributes["turn"] == "left"
    (again,) = shown(TOWN, seen(-45.0, 2.0, -9.0, 0.0, 6 * US_PER_S))
    assert "turn" not in again.attributes
    assert OnRoad(TOWN)(again, later.likely).attributes["turned_us"] == 3 * US_PER_S


def test_a_crossing_that_no_sample_shows_is_turned_in_all_the_same() -> None:
    history = shown(TOWN, seen(1.0, -20.0, 0.0, 20.0), seen(20.0, -1.0, 20.0, 0.0, US_PER_S))
    assert history[-1].attributes["turn"] == "right"


def test_changing_the_direction_on_a_link_is_no_turn() -> None:
    history = shown(TOWN, seen(50.0, -1.0, 5.0, 0.0), seen(50.0, -1.0, -5.0, 0.0))
    assert "turn" not in history[-1].attributes


def test_a_direction_that_the_place_does_not_have_is_that_of_the_last_positions() -> None:
    street = read_roads(text(link("l", None, None, [(0, 0), (200, 0)], lanes=1)))
    states = [seen(100.0 - 2 * n, 0.0, 0.0, 0.0, 100_000 * n)._replace(covariance=diagonal(1.0)) for n in range(3)]
    found = predicted(AlongRoads(street), shown(street, *states), 1.0)
    assert [each.state.attributes["direction"] for each in found.hypotheses] == [-1]
    assert found.likely.x_m == pytest.approx(76.0)


def test_what_comes_from_elsewhere_into_a_crossing_may_leave_it_everywhere() -> None:
    town = grid(2)
    (inside,) = shown(town, seen(0.0, 99.0, 1.0, 0.0))
    moved = inside._replace(attributes={**inside.attributes, "via": "e 0,0", "via_direction": 1})
    found = predicted(AlongRoads(town), deque([moved]), 0.5)
    assert {each.state.attributes["route"] for each in found.hypotheses} <= {"e 1,0", "n 0,0"}
    assert {each.state.attributes["via"] for each in found.hypotheses} == {NO_LINK}


def test_in_a_crossing_that_no_road_leaves_it_goes_straight_on() -> None:
    sink = read_roads(text(crossing("x", 0, 0), link("l", None, "x", [(-99, 0), (0, 0)], oneway=True)))
    found = predicted(AlongRoads(sink), shown(sink, seen(-3.0, 0.0, 9.0, 0.0)), 1.0)
    assert found.likely.x_m == pytest.approx(6.0)


NAMES = (
    "link",
    "crossing",
    "via",
    "route",
    "direction",
    "via_direction",
    "lane",
    "offset_m",
    "travelled_m",
    "turn",
    "turned_us",
)
JUNK = st.one_of(
    st.sampled_from(["s", "e", "x", "left", "nowhere"]),
    st.integers(-2, 99),
    st.floats(),
    st.booleans(),
    st.just(10**400),
)


@given(about=st.dictionaries(st.sampled_from(NAMES), JUNK), y_m=st.sampled_from([-60.0, -3.0, 300.0]))
@example(about={"crossing": "x", "via": "s"}, y_m=-60.0)
def test_percepts_with_attributes_of_these_names_harm_no_prediction(about: dict[str, Any], y_m: float) -> None:
    state, individual, before = seen(1.75, y_m, 0.0, 9.0, **about), Individual(), None
    for second in range(1, 9):
        individual.observe(state._replace(valid_us=second * US_PER_S))
        before = AlongRoads(TOWN).predict([state], second * US_PER_S, before, individual)
    assert before is not None
    assert sum(each.weight for each in before.hypotheses) == pytest.approx(1.0)
