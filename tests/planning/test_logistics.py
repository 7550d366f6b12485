"""The UAV logistics domain of thesis 7.4.1, planned and replayed."""

from dataclasses import replace
from itertools import pairwise

import pytest

from dyknow.planning import Declarations, NoPlan, PlanFound, find_plan, parse_domain, parse_problem
from dyknow.planning.domains.model import Application
from tests.planning.logistics import FOLDER, domain, found, problem, problem_text, text
from tests.planning.replay import Replay, replayed


def test_the_domain_has_the_thirteen_operators_of_the_thesis() -> None:
    assert sorted(one.name for one in domain().operators) == sorted(
        [
            "climb-for-flying-empty",
            "fly-empty-to-box",
            "fly-empty-to-carrier",
            "adjust-for-attach",
            "attach-box",
            "attach-carrier",
            "climb-for-flying-with",
            "fly-box-to-carrier",
            "fly-box-to-goal",
            "fly-carrier",
            "adjust-for-detach",
            "detach-box",
            "detach-carrier",
        ]
    )


@pytest.mark.parametrize(
    "wanted",
    [
        {"boxes": 1},
        {"boxes": 4, "seed": 2},
        {"boxes": 10, "seed": 3, "uavs": 2, "carriers": 2},
        pytest.param({"boxes": 20, "uavs": 2, "carriers": 2, "sites": 3}, marks=pytest.mark.full),
        pytest.param({"boxes": 30, "uavs": 3, "carriers": 3, "sites": 2}, marks=pytest.mark.full),
    ],
    ids=str,
)
def test_plans_replay(wanted: dict[str, int]) -> None:
    asked = problem(**wanted)
    plan = found(domain(), asked).plan
    assert replayed(domain(), asked, plan) == []


def test_two_uavs_are_done_before_one_is() -> None:
    alone, together = (found(domain(), problem(boxes=8, uavs=uavs, carriers=2)).plan for uavs in (1, 2))
    assert {one.unit for one in together.actions} == {"uav1", "uav2"}
    assert together.end_ms < alone.end_ms


def test_one_uav_at_a_time_is_above_a_carrier() -> None:
    plan = found(domain(), problem(boxes=6, uavs=2, carriers=1)).plan
    above, loaded = [], set()
    for at, one in enumerate(plan.actions):
        unit, box = (*one.objects, "")[:2]
        last = {"fly-box-to-carrier": "detach-box", "fly-empty-to-box": "attach-box" if box in loaded else ""}
        if last.get(one.operator.name):
            wanted = f"{last[one.operator.name]}({unit}, {box})"
            end_ms = next(each.end_ms for each in plan.actions[at:] if each.shown == wanted)
            above.append((one.start_ms, end_ms, unit))
            loaded.add(box)
    assert len({unit for _, _, unit in above}) == 2 and len(above) > 4
    for (_, end_ms, one_unit), (start_ms, _, other) in pairwise(sorted(above)):
        assert one_unit == other or end_ms <= start_ms, above


def without_controls(names: tuple[str, ...] = ()) -> Declarations:
    """The domain without its control formulas, or without those of some operators."""
    operators = tuple(
        replace(one, controls=()) if not names or one.name in names else one for one in domain().operators
    )
    return replace(domain(), operators=operators, controls=domain().controls if names else ())


def test_without_control_formulas_plans_take_longer_and_cost_more() -> None:
    asked = problem(boxes=4)
    steered, free = found(domain(), asked).plan, found(without_controls(), asked).plan
    assert replayed(domain(), asked, free) == []
    assert free.end_ms > 1.5 * steered.end_ms
    assert free.cost > 1.5 * steered.cost


def test_a_formula_that_is_added_to_the_text_changes_the_plan() -> None:
    """By itself a UAV takes off with the first box; the formula forbids that box until the other one is delivered."""
    asked = problem(boxes=4)
    first = found(domain(), asked).plan
    added = "#objects box = {b1, b2, b3, b4}\n#control b4-first: always (!delivered(b4) -> !exists uav: attached(uav, b1))\n"
    domain_text = text() + added
    problem_lines = [line for line in problem_text(boxes=4).splitlines() if not line.startswith("#objects box")]
    changed_domain = parse_domain(domain_text)
    changed = found(changed_domain, parse_problem("\n".join(problem_lines), changed_domain)).plan
    before, order = (
        [one.shown for one in plan.actions if one.operator.name == "attach-box"] for plan in (first, changed)
    )
    assert before[0] == "attach-box(uav1, b1)"
    assert order.index("attach-box(uav1, b4)") < order.index("attach-box(uav1, b1)")


def test_example_7_4_1_a_box_is_not_moved_from_its_goal() -> None:
    """No box moves that is close enough to its goal and blocks nothing, in any state of a plan."""
    asked = problem(boxes=4, uavs=2)
    plan = found(domain(), asked).plan
    replay = Replay(domain().joined(asked))
    assert replay.check([one.as_json() for one in plan.actions]) == []
    moved = 0
    for (_, before), (_, after) in pairwise(replay.states):
        for box in replay.members("box"):
            if before["xpos", (box,)] != after["xpos", (box,)]:
                moved += 1
                assert not replay.value(Application("close-enough-to-goal", (Application(box),)), {}, before)
    assert moved >= 4


def test_example_7_4_2_no_preparing_for_a_carrier_with_a_misplaced_box() -> None:
    """The operator-specific formula refuses to attach a carrier next to which a box lies; without it that is done."""
    lying = (
        "#objects uav = {{uav1}}\n#objects box = {{b1, b2}}\n#objects carrier = {{c1}}\n#objects carrier-position = {{p1, p2}}\n"
        "#init xpos(uav1) := 0, ypos(uav1) := 40, xpos(c1) := 0, ypos(c1) := 40, state(uav1) := ready-to-fly\n"
        "#init claimed(uav1, c1), xpos(b1) := 0.5, ypos(b1) := 40, on-carrier(b1, c1) := {}, carrier-load(c1) := 1\n"
        "#init xpos(b2) := 300, ypos(b2) := 0, goal-x(b1) := 1000, goal-y(b1) := 0, goal-x(b2) := 300, goal-y(b2) := 0\n"
        "#init position-x(p1) := 0, position-y(p1) := 40, position-x(p2) := 1000, position-y(p2) := 40\n"
        "#goal state(uav1) == ready-to-attach\n"
    )
    placed = parse_problem(lying.format("correctly-placed"), domain())
    misplaced = parse_problem(lying.format("perhaps-blocking"), domain())
    assert [one.shown for one in found(domain(), placed).plan.actions] == ["adjust-for-attach(uav1, c1)"]
    refused = find_plan(domain(), misplaced)
    assert isinstance(refused, NoPlan) and any("no misplaced boxes" in cause for cause in refused.causes)
    freely = without_controls(("adjust-for-attach",))
    assert [one.shown for one in found(freely, misplaced).plan.actions] == ["adjust-for-attach(uav1, c1)"]


def test_the_problem_of_the_examples_is_made_by_its_script() -> None:
    assert (FOLDER / "four.prob").read_text(encoding="utf-8") == problem_text(boxes=4)


def test_a_box_that_is_where_it_should_be_is_left_alone() -> None:
    asked = parse_problem(
        "#objects uav = {uav1}\n#objects box = {b1}\n#init xpos(uav1) := 0, ypos(uav1) := 0, xpos(b1) := 5, ypos(b1) := 5, "
        "goal-x(b1) := 5.5, goal-y(b1) := 5\n#goal delivered(b1)",
        domain(),
    )
    assert found(domain(), asked).plan.actions == ()


@pytest.mark.parametrize(
    ("boxes", "seconds"), [(6, 300), pytest.param(10, 320, marks=pytest.mark.full)], ids=["six", "ten"]
)
def test_a_box_with_a_deadline_goes_on_the_carrier_first(boxes: int, seconds: int) -> None:
    """By its order in the text it would be the last one: the search would not come back to where that was decided."""
    lines = [one for one in problem_text(boxes=boxes, uavs=2).splitlines() if not one.startswith("#goal")]
    goals = f"#goal all: forall box: delivered(box)\n#goal medicine: delivered(b{boxes}) :deadline {seconds}s\n"
    asked = parse_problem("\n".join([*lines, goals]), domain())
    nodes = iter(range(40_000))
    plan = find_plan(domain(), asked, stop=lambda: "" if next(nodes, None) is not None else "enough")
    assert isinstance(plan, PlanFound), plan
    assert replayed(domain(), asked, plan.plan) == []
