"""Search by estimates, what it shows to be unreachable, how soon a search ends, and whether units get into one another's way."""

from functools import cache
from itertools import combinations, pairwise
from time import perf_counter

import pytest

from dyknow.planning import Declarations, NoPlan, PlanFound, Strategy, find_plan, parse_domain, parse_problem
from tests.planning.flights import MAP, TRUCKS
from tests.planning.logistics import domain, found, problem
from tests.planning.replay import Replay, replayed

BLOCKS = """
#domain block
#feature on(block, block) : boolean
#feature on-table(block) : boolean
#feature clear(block) : boolean
#feature hand-is-empty : boolean = true
#feature holds(block) : boolean
#operator pick-up(block)
  :precond [start] clear(block) & on-table(block) & hand-is-empty
  :effects [end] !on-table(block), [end] !clear(block), [end] !hand-is-empty, [end] holds(block)
#operator put-down(block)
  :precond [start] holds(block)
  :effects [end] !holds(block), [end] clear(block), [end] hand-is-empty, [end] on-table(block)
#operator stack(block, block2)
  :precond [start] holds(block) & clear(block2)
  :effects [end] !holds(block), [end] !clear(block2), [end] clear(block), [end] hand-is-empty, [end] on(block, block2)
#operator unstack(block, block2)
  :precond [start] on(block, block2) & clear(block) & hand-is-empty
  :effects [end] holds(block), [end] clear(block2), [end] !clear(block), [end] !hand-is-empty, [end] !on(block, block2)
"""
TOWER = """
#objects block = {a, b, c, d, e, f}
#init on-table(a), on(b, a), on(c, b), clear(c), on-table(d), on(e, d), clear(e), on-table(f), clear(f)
#goal on(a, b) & on(b, c) & on(c, d) & on(d, e) & on(e, f)
"""
COUNTING = """
#domain box
#feature level(box) : fp = 0
#feature open(box) : boolean
#feature locked(box) : boolean
#operator fill(box) :effects [end] level(box) := level(box) + 1
#operator unlock(box) :precond [start] open(box) :effects [end] !locked(box), [end] open(box)
"""


def test_blocks_without_control_formulas_are_stacked_in_few_actions_of_a_few_nodes() -> None:
    declared = parse_domain(BLOCKS)
    asked = parse_problem(TOWER, declared)
    by_estimates, by_default = found(declared, asked, strategy=Strategy.HEURISTIC), found(declared, asked)
    assert len(by_estimates.plan.actions) == len(by_default.plan.actions) < 40
    assert by_estimates.nodes < 200 < by_default.nodes
    for each in (by_estimates, by_default):
        assert replayed(declared, asked, each.plan) == []


def test_where_formulas_steer_well_estimates_are_not_asked() -> None:
    asked = problem(boxes=3)
    steered = [found(domain(), asked, strategy=way) for way in (Strategy.AUTOMATIC, Strategy.DEPTH_FIRST)]
    assert steered[0] == steered[1]


def test_a_goal_behind_numbers_without_end_is_known_to_be_out_of_reach() -> None:
    declared = parse_domain(COUNTING)
    asked = parse_problem("#objects box = {b1, b2}\n#init locked(b2)\n#goal open(b1) & level(b2) == 2", declared)
    result = find_plan(declared, asked)
    assert isinstance(result, NoPlan) and result.is_certain
    assert "the goal cannot be reached, even if" in result.reason


def test_a_feature_without_an_initial_value_is_named_if_there_is_no_plan() -> None:
    declared = parse_domain(TRUCKS)
    asked = parse_problem(MAP.replace("#init at(u1) := a, ", "#init ") + "#goal seen(d)", declared)
    result = find_plan(declared, asked)
    assert isinstance(result, NoPlan)
    assert any("at[u1] has no initial value" in cause for cause in result.causes)


@pytest.mark.parametrize("strategy", list(Strategy))
@pytest.mark.parametrize(
    "more", ["", "#control c: always forall block, block2, block3: on(block, block2) & on(block2, block3) -> true\n"]
)
def test_a_search_ends_soon_after_it_is_to_end(strategy: Strategy, more: str) -> None:
    """By its own clock, of which a tenth of a second is allowed, without what other processes take."""
    declared = parse_domain(BLOCKS)
    blocks = [f"k{at}" for at in range(40)]
    table = "".join(f"#init on-table({one}), clear({one})\n" for one in blocks)
    goal = " & ".join(f"on({one}, {other})" for one, other in pairwise(blocks))
    asked = parse_problem(
        f"#objects block = {{{', '.join(blocks)}}}\n{table}{more}#goal {goal} & on({blocks[-1]}, k0)", declared
    )
    begun, told = perf_counter(), list[float]()

    def stop() -> str:
        now = perf_counter()
        told.append(now)
        return "it is to end" if now > begun + 0.15 else ""

    seen: list[int] = []
    result = find_plan(declared, asked, strategy, stop, seen.append)
    assert isinstance(result, NoPlan) and result.reason == "it is to end"
    apart = sorted(later - earlier for earlier, later in pairwise(told))
    assert apart[-1] < 0.1 or apart[-3] < 0.05, apart[-3:]


@cache
def unsteered() -> tuple[PlanFound | NoPlan, tuple[int, ...]]:
    """The blocks depth-first without control formulas, and the progress that was reported."""
    declared = parse_domain(BLOCKS)
    seen: list[int] = []
    result = find_plan(declared, parse_problem(TOWER, declared), Strategy.DEPTH_FIRST, progress=seen.append)
    return result, tuple(seen)


def test_progress_is_reported_while_it_searches() -> None:
    result, seen = unsteered()
    assert list(seen) == sorted(seen) and seen[0] == 1024 and seen[-1] > result.nodes - 1024


def overlaps(declared: Declarations, plan: object) -> list[str]:
    """Units that do two things at once, and conditions that actions of others take away (by replaying every change)."""
    actions = plan.actions  # type: ignore[attr-defined]
    wrong = [
        f"{one.shown} overlaps {other.shown}"
        for one, other in combinations(actions, 2)
        if one.unit == other.unit and one.start_ms < other.end_ms and other.start_ms < one.end_ms
    ]
    replay = Replay(declared)
    record = [one.as_json() for one in actions]
    wrong += replay.check(record)
    for one, action in zip(actions, record, strict=True):
        for at_ms, state in replay.states:
            if one.start_ms < at_ms < one.end_ms:
                _, env = replay.bind(action, state)
                wrong += [
                    f"{one.shown} at {at_ms}"
                    for each in one.operator.prevail
                    if not replay.value(each.formula, env, state)
                ]
    return wrong


@pytest.mark.parametrize("uavs", [2, pytest.param(4, marks=pytest.mark.full)])
def test_units_act_at_once_and_never_take_away_what_others_need(uavs: int) -> None:
    asked = problem(boxes=6, uavs=uavs, carriers=2)
    plan = found(domain(), asked).plan
    assert overlaps(domain().joined(asked), plan) == []
    at_once = [
        (one, other)
        for one, other in combinations(plan.actions, 2)
        if one.start_ms < other.end_ms and other.start_ms < one.end_ms
    ]
    assert len(at_once) > 10
    doubled = plan.actions[0].__class__
    late = doubled(**{name: getattr(plan.actions[5], name) for name in doubled.__dataclass_fields__} | {"start_ms": 0})
    moved = type(plan)((late, *plan.actions), plan.cost)
    assert overlaps(domain().joined(asked), moved) != []


def test_a_formula_that_is_added_ends_a_detour_and_the_formulas_do_the_work() -> None:
    declared = parse_domain(BLOCKS)
    free, _ = unsteered()
    keep = (
        "#control keep: always forall block, block2: goal(on(block, block2)) & on(block, block2)"
        " & (forall block3: goal(on(block2, block3)) -> on(block2, block3)) -> next on(block, block2)\n"
    )
    steered = find_plan(declared, parse_problem(keep + TOWER, declared), Strategy.DEPTH_FIRST)
    assert not isinstance(free, NoPlan) and not isinstance(steered, NoPlan)
    assert len(steered.plan.actions) < len(free.plan.actions)
