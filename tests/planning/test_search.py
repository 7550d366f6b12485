"""The search: control formulas over partial state sequences, strategies, times, and what ends it."""

from heapq import heappop, heappush
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow.model.errors import TextError
from dyknow.planning import Declarations, NoPlan, Strategy, find_plan, parse_domain, parse_problem
from tests.planning.flights import MAP, TRUCKS
from tests.planning.logistics import found
from tests.planning.replay import replayed


def planned(control: str = "", goal: str = "#goal seen(d)", more: str = "", **options: Any) -> list[str]:
    domain = parse_domain(TRUCKS)
    problem = parse_problem(f"{MAP}{more}{control}\n{goal}", domain)
    plan = found(domain, problem, **options).plan
    assert replayed(domain, problem, plan) == []
    return [one.shown for one in plan.actions]


def refused(control: str = "", goal: str = "#goal seen(d)", more: str = "") -> NoPlan:
    domain = parse_domain(TRUCKS)
    result = find_plan(domain, parse_problem(f"{MAP}{more}{control}\n{goal}", domain))
    assert isinstance(result, NoPlan)
    return result


CHEAPEST = ["start(u1)", "fly(u1, a, b)", "fly(u1, b, c)", "fly(u1, c, d)", "look(u1, d)"]
DIRECT = ["start(u1)", "fly(u1, a, c)", "fly(u1, c, d)", "look(u1, d)"]


@pytest.mark.parametrize("strategy", [Strategy.BRANCH_AND_BOUND, Strategy.BEST_FIRST])
def test_the_cheapest_plan_is_found_and_known_to_be_it(strategy: Strategy) -> None:
    domain = parse_domain(TRUCKS)
    result = found(domain, parse_problem(MAP + "#goal seen(d)", domain), strategy=strategy)
    assert [one.shown for one in result.plan.actions] == CHEAPEST
    assert (result.plan.cost, result.is_cheapest) == (6.0, True)


@given(st.lists(st.tuples(st.integers(0, 4), st.integers(0, 4), st.integers(1, 9)), min_size=4, max_size=14))
def test_optimal_strategies_find_what_dijkstra_finds(roads: list[tuple[int, int, int]]) -> None:
    known = {(one, other): length for one, other, length in roads}
    best = {0: 0}
    waiting = [(0, 0)]
    while waiting:
        cost, here = heappop(waiting)
        for (one, other), length in known.items():
            if one == here and cost + length < best.get(other, 10**6):
                best[other] = cost + length
                heappush(waiting, (cost + length, other))
    domain = parse_domain(TRUCKS)
    roads_text = "".join(
        f"#init road(p{one}, p{other}), length(p{one}, p{other}) := {length}\n"
        for (one, other), length in known.items()
    )
    problem = parse_problem(
        f"#objects uav = {{u1}}\n#objects place = p0 .. p4\n#init at(u1) := p0, airborne(u1)\n{roads_text}#goal at(u1) == p4",
        domain,
    )
    for strategy in (Strategy.BRANCH_AND_BOUND, Strategy.BEST_FIRST):
        result = find_plan(domain, problem, strategy)
        if 4 in best:
            assert not isinstance(result, NoPlan)
            assert result.plan.cost == best[4]
        else:
            assert isinstance(result, NoPlan) and result.is_certain


@pytest.mark.parametrize(
    ("control", "plan"),
    [
        ("", CHEAPEST),
        ("#control c: always forall uav: at(uav) != b", DIRECT),
        ("#control c: [t] at(uav) == a -> [t + 1] at(uav) != b", DIRECT),
        ("#control c: always (at(uav) == b -> always at(uav) == b)", DIRECT),
        ("#control c: always (at(uav) == a -> eventually [0, 4s] at(uav) == c)", CHEAPEST),
        ("#control c: (exists uav: at(uav) == a) until (exists uav: at(uav) == c)", DIRECT),
    ],
)
def test_control_formulas_choose_among_plans(control: str, plan: list[str]) -> None:
    assert planned(control, strategy=Strategy.BRANCH_AND_BOUND) == plan


def test_a_state_sequence_is_a_prefix_a_formula_is_violated_only_when_its_time_is_over() -> None:
    """Thesis 7.4.2: who takes off must fly within some time; only actions that take longer violate that."""
    within = "#control c: [t] !airborne(uav) -> [t + 1] !airborne(uav) | eventually [0, {}] at(uav) == c"
    assert planned(within.format("10s"), strategy=Strategy.BRANCH_AND_BOUND) == CHEAPEST
    result = refused(within.format("1s"))
    assert result.is_certain
    assert any(cause.startswith("c refused") for cause in result.causes)


def test_an_eventuality_that_is_open_when_the_last_state_persists_is_met_by_a_longer_plan() -> None:
    back = "#control c: always (seen(d) -> eventually at(u1) == a)"
    assert planned(back, strategy=Strategy.BEST_FIRST) == [*CHEAPEST, "fly(u1, d, a)"]


def test_a_formula_may_ask_what_the_goal_is() -> None:
    only = "#control c: always forall place: seen(place) -> goal(seen(place))"
    first = planned(goal="#goal seen(d) & seen(a)")
    asked = planned(only, goal="#goal seen(d) & seen(a)")
    assert sorted(one for one in asked if one.startswith("look")) == ["look(u1, a)", "look(u1, d)"]
    assert len([one for one in first if one.startswith("look")]) > 2


def test_units_act_at_the_same_time_and_see_what_others_began() -> None:
    domain = parse_domain(TRUCKS)
    more = MAP.replace("{u1}", "{u1, u2}").replace("at(u1) := a", "at(u1) := a, at(u2) := a")
    problem = parse_problem(more + "#goal forall uav: airborne(uav)", domain)
    plan = found(domain, problem).plan
    assert [(one.start_ms, one.end_ms, one.unit) for one in plan.actions] == [(0, 2000, "u1"), (0, 2000, "u2")]


def test_without_units_actions_follow_one_another() -> None:
    domain = parse_domain(
        "#domain box\n#feature up(box) : boolean\n#operator lift(box) :duration 3s :precond [start] !up(box) :effects [end] up(box)"
    )
    plan = found(domain, parse_problem("#objects box = b1 .. b3\n#goal forall box: up(box)", domain)).plan
    assert [(one.start_ms, one.end_ms, one.unit) for one in plan.actions] == [
        (0, 3000, "b1"), (3000, 6000, "b2"), (6000, 9000, "b3"),
    ]  # fmt: skip


def test_a_deadline_chooses_the_faster_way_and_one_that_cannot_be_met_is_told() -> None:
    detour = "#init length(a, b) := 4, length(b, c) := 4\n"
    assert planned(goal="#goal g: seen(d) :deadline 11s", more=detour) == DIRECT
    result = refused(goal="#goal g: seen(d) :deadline 9s", more=detour)
    assert result.is_certain
    assert any("deadline of g refused" in cause for cause in result.causes)


def test_the_lightest_goal_that_cannot_be_met_is_dropped_at_the_cost_of_its_weight() -> None:
    domain = parse_domain(TRUCKS)
    goals = "#goal medicine: seen(d) :deadline 11s :weight 50\n#goal food: seen(b) :deadline 4s :weight 3\n#goal home: at(u1) == d"
    problem = parse_problem(MAP + "#init length(a, b) := 4\n" + goals, domain)
    result = found(domain, problem)
    assert result.plan.unreached == ("food",)
    assert result.plan.cost == sum(one.cost for one in result.plan.actions) + 3
    assert (
        replayed(
            domain, Declarations(**{**_fields(problem), "goals": (problem.goals[0], problem.goals[2])}), result.plan
        )
        == []
    )


def test_of_goals_of_equal_weight_the_one_that_cannot_be_reached_is_left_aside() -> None:
    domain = parse_domain(TRUCKS)
    goals = (
        "#goal food: seen(b) :weight 5\n#goal never: length(a, b) == 99 :weight 5\n#goal medicine: seen(d) :weight 5"
    )
    assert found(domain, parse_problem(MAP + goals, domain)).plan.unreached == ("never",)


def _fields(found: Declarations) -> dict[str, Any]:
    return {name: getattr(found, name) for name in Declarations.__dataclass_fields__}


def test_an_area_that_is_closed_is_waited_for_and_left_before_it_closes() -> None:
    domain = parse_domain(TRUCKS)
    hours = "#init !open(d), [20s] open(d), [60s] !open(d)\n"
    problem = parse_problem(MAP + hours + "#goal seen(d)", domain)
    plan = found(domain, problem, strategy=Strategy.BRANCH_AND_BOUND).plan
    assert replayed(domain, problem, plan) == []
    (arrival,) = [one for one in plan.actions if one.shown == "fly(u1, c, d)"]
    assert 20_000 <= arrival.start_ms < arrival.end_ms <= 60_000
    too_short = parse_problem(MAP + "#init !open(d), [20s] open(d), [21s] !open(d)\n#goal seen(d)", domain)
    result = find_plan(domain, too_short)
    assert isinstance(result, NoPlan) and any("prevail" in cause for cause in result.causes)


def test_a_goal_that_no_operator_can_bring_about_is_told_at_once() -> None:
    result = refused(goal="#goal way: road(d, b)")
    assert (result.is_certain, result.nodes) == (True, 0)
    assert "way cannot be reached: no operator changes" in result.reason


def test_a_space_that_is_searched_whole_is_told_with_what_ended_it() -> None:
    result = refused("#control c: always forall uav: at(uav) != c")
    assert result.is_certain
    assert "the whole search space was searched" in result.reason
    assert any(cause.startswith("c refused") for cause in result.causes)


def test_an_initial_state_that_violates_a_formula_is_told() -> None:
    assert (
        "initial state violates the control formula grounded"
        in refused("#control grounded: always airborne(uav)").reason
    )


def test_the_search_can_be_cancelled_and_says_why() -> None:
    domain = parse_domain(TRUCKS)
    problem = parse_problem(MAP + "#goal seen(d) & seen(a) & !airborne(u1)", domain)
    result = find_plan(domain, problem, stop=lambda: "gave up: the operator wants it")
    assert isinstance(result, NoPlan)
    assert (result.reason, result.is_certain) == ("gave up: the operator wants it", False)


@pytest.mark.parametrize("boxes", [1000, pytest.param(100_000, marks=pytest.mark.full)])
def test_very_many_objects_are_bounded_work(boxes: int) -> None:
    domain = parse_domain(
        "#domain uav\n#domain box\n#units uav\n#feature held(uav, box) : boolean\n#feature done(box) : boolean\n"
        "#operator take(uav, box) :precond [start] !held(uav, box) & !exists box2: held(uav, box2) & done(box2)\n"
        "  :effects [end] held(uav, box), [end] done(box)\n#control c: always forall box, box2: done(box) & done(box2) -> box == box2"
    )
    problem = parse_problem(
        f"#objects uav = {{u1}}\n#objects box = b1 .. b{boxes}\n#goal forall box: done(box)", domain
    )
    polls = 0

    def stop() -> str:
        nonlocal polls
        polls += 1
        return "gave up after 50 looks" if polls >= 50 else ""

    result = find_plan(domain, problem, stop=stop)
    assert isinstance(result, NoPlan)
    assert result.reason == "gave up after 50 looks"


def test_a_feature_of_what_only_a_state_tells_is_taken_apart_in_conditions_and_refused_in_costs() -> None:
    assert planned("#control c: always forall uav: airborne(uav) -> !road(at(uav), at(uav))") == planned()
    domain = parse_domain(TRUCKS.replace(":cost length(place, place2)", ":cost length(at(uav), place2)"))
    with pytest.raises(TextError, match="name it by a parameter"):
        find_plan(domain, parse_problem(MAP + "#goal seen(d)", domain))


def test_nodes_are_told_apart_by_what_formulas_remember() -> None:
    """The way back passes a state that was met before; only the remainder of the formula differs."""
    tour = "#control c: eventually (exists uav: at(uav) == c)"
    assert planned(tour, goal="#goal at(u1) == a & airborne(u1)", strategy=Strategy.BEST_FIRST) == [
        "start(u1)", "fly(u1, a, b)", "fly(u1, b, c)", "fly(u1, c, d)", "fly(u1, d, a)",
    ]  # fmt: skip


def test_definitions_that_double_one_another_are_refused_and_not_expanded() -> None:
    doubling = "".join(f"#define d{n}(uav) := d{n + 1}(uav) -> !d{n + 1}(uav)\n" for n in range(40))
    domain = parse_domain(f"{TRUCKS}{doubling}#define d40(uav) := airborne(uav)\n#control c: always d0(uav)")
    with pytest.raises(TextError, match="expands to more than 2000000 parts"):
        find_plan(domain, parse_problem(MAP + "#goal seen(d)", domain))


@pytest.mark.parametrize("cost", ["1 / length(place, place2)", "0 - 1"])
def test_a_cost_that_is_no_number_ends_a_branch_and_is_told(cost: str) -> None:
    domain = parse_domain(TRUCKS.replace(":cost length(place, place2)", f":cost {cost}"))
    problem = parse_problem(
        MAP.replace(":= 5", ":= 0").replace(":= 2", ":= 0") + "#init length(a, b) := 0\n#goal at(u1) == b", domain
    )
    result = find_plan(domain, problem)
    assert isinstance(result, NoPlan) and any("has no cost" in cause for cause in result.causes)
