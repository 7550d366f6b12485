"""Recovery plans: those of the paper, exact optima, and what no plan can tell apart."""

import json
from typing import Any

import pytest

from dyknow.planning.contingent.conditional_plans import (
    dot_lines,
    figures_of,
    lines,
    plan_record,
    print_plan,
    tree_lines,
)
from dyknow.planning.contingent.files import read_recovery, recovery_record
from dyknow.planning.contingent.recovery_planning import NoRecoveryPlan, RecoveryPlan, plan_recovery
from tests.planning.contingent.dynamic_programming import Oracle, generated
from tests.planning.contingent.reading_plans import carried_out, read

ROOM = ["r1_1", "r1_2", "r1_3", "r1_4"]
WAYS = {place: [to for to in ROOM if to != place] for place in ROOM}
PAPER = """\
((move r1_2) (look-at po-4)
 (cond
  ((mark! po-4 = f) (move r1_3) (look-at po-4)
   (cond
    ((mark! po-4 = f) (move r1_4) (look-at po-4)
     (cond
      ((mark! po-4 = t) (anchor b1 po-4) :success)
      ((mark! po-4 = f) (anchor b1 f) :success)))
    ((mark! po-4 = t) (anchor b1 po-4) :success)))
  ((mark! po-4 = t) (anchor b1 po-4) :success)))"""
"""The plan of "Have another look", section 4.2, with the bracket that is missing there after its second branch."""


def hypothesis(answer: str, possibility: float = 1.0, **visible_from: list[str]) -> dict[str, Any]:
    seen = {target.replace("_", "-"): places for target, places in visible_from.items()}
    return {"possibility": possibility, "visible_from": seen, "answer": answer}


def problem(kind: str, objects: list[str], hypotheses: list[dict[str, Any]], **more: Any) -> dict[str, Any]:
    about = {"kind": kind, "places": WAYS, "start": "r1_1", "objects": objects, "hypotheses": hypotheses}
    return {**about, "value": "worst", **more}


def planned(written: dict[str, Any], most_steps: int = 200_000) -> RecoveryPlan | NoRecoveryPlan:
    case = read_recovery(json.dumps(written))
    return plan_recovery(case.problem, case.value, case.least_possibility, most_steps=most_steps)


def found(written: dict[str, Any]) -> RecoveryPlan:
    plan = planned(written)
    assert isinstance(plan, RecoveryPlan)
    return plan


NONE_OF_THEM = hypothesis("f", 0.5)
"""None of them."""
ONE_BOTTLE = problem("identify", ["po-4"], [*(hypothesis("po-4", po_4=[place]) for place in ROOM[1:]), NONE_OF_THEM])


def test_the_paper_s_plan_for_three_viewpoints_and_one_bottle_is_printed_as_in_the_paper() -> None:
    plan = found(ONE_BOTTLE)
    assert "\n".join(lines(plan.plan)) == PAPER
    assert print_plan(plan.plan) == " ".join(PAPER.split())
    assert (plan.figures.depth, plan.figures.leaves, plan.figures.actions) == (7, 4, 10)
    assert plan.expected == pytest.approx((3 + 5 + 7 + 0.5 * 7) / 3.5)


def test_scenario_2_searches_one_place_after_another_and_stops_at_the_first_sighting() -> None:
    places = [hypothesis(place, b1=[place]) for place in ROOM[1:]]
    plan = found(problem("search", ["b1"], [*places, NONE_OF_THEM]))
    assert (plan.figures.depth, plan.figures.leaves, plan.figures.actions) == (6, 4, 6)
    assert print_plan(plan.plan).count("((visible! b1 = t) :success)") == 3


def test_scenario_3_with_two_candidates_looks_at_both_from_each_place() -> None:
    candidates = [hypothesis(target, **{target: [place]}) for target in ("po1", "po2") for place in ROOM[1:]]
    plan = found(problem("identify", ["po1", "po2"], [*candidates, NONE_OF_THEM]))
    assert (plan.figures.depth, plan.figures.leaves) == (10, 7)


def test_scenario_4_elimination_saves_the_last_look() -> None:
    for targets, none in ((["po1", "po2", "po3"], []), (["po1", "po2"], [NONE_OF_THEM])):
        sides = [hypothesis(target, **{target: ["r1_2"]}) for target in targets]
        plan = found(problem("identify", targets, [*sides, *none]))
        assert (plan.figures.depth, plan.figures.leaves) == (4, 3)
    sides = [hypothesis(target, **{target: ["r1_2"]}) for target in ("po1", "po2")]
    plan = found(problem("identify", ["po1", "po2"], sides))
    assert (plan.figures.depth, plan.figures.leaves) == (3, 2)


def test_scenario_5_localises_at_home_and_anchors() -> None:
    drifted = [hypothesis(target, **{target: ["r1_2"]}) for target in ("po1", "po2")]
    plan = found(problem("identify", ["po1", "po2"], drifted))
    assert (plan.figures.depth, plan.figures.leaves) == (3, 2)
    assert print_plan(plan.plan).startswith("((move r1_2) (look-at po1) (cond ")


def test_200_generated_problems_have_the_worth_that_dynamic_programming_finds() -> None:
    solved = unsolved = 0
    for seed in range(200):
        written = generated(seed)
        oracle = Oracle(written)
        best, plan = oracle.best(), planned(written)
        if best is None:
            assert isinstance(plan, NoRecoveryPlan), seed
            unsolved += 1
            numbers = plan.indistinguishable[0]
            if len(numbers) == 2 and "no one way" not in plan.reason:
                assert oracle.is_hopeless_pair(*numbers), seed
            for number in numbers:
                assert f"hypotheses[{number}]" in plan.reason
            continue
        assert isinstance(plan, RecoveryPlan), seed
        assert plan.is_optimal
        cost = plan.figures.depth if oracle.is_worst else plan.expected
        exact = best[0] if oracle.is_worst else oracle.expected(best)
        assert (cost, plan.figures.leaves, plan.figures.actions) == (pytest.approx(float(exact)), *best[1:]), seed
        solved += 1
    assert solved > 100
    assert unsolved > 5


def test_each_generated_plan_finds_the_answer_under_every_hypothesis() -> None:
    for seed in range(60):
        written = generated(seed)
        plan = planned(written)
        if isinstance(plan, NoRecoveryPlan):
            continue
        steps, total = read(print_plan(plan.plan)), 0.0
        for each in written["hypotheses"]:
            end, count = carried_out(steps, written, each)
            total += each["possibility"] * count
            if written["kind"] == "identify":
                assert end == f"anchor {each['answer']}"
        assert plan.expected == pytest.approx(total / sum(each["possibility"] for each in written["hypotheses"]))
        assert figures_of(plan.plan) == plan.figures


def test_hypotheses_that_look_alike_from_everywhere_are_named() -> None:
    written = problem("identify", ["po1"], [hypothesis("po1", po1=["r1_2"]), hypothesis("po1", po1=[]), NONE_OF_THEM])
    plan = planned(written)
    assert isinstance(plan, NoRecoveryPlan)
    assert plan.indistinguishable == ((1, 2),)
    assert plan.reason == "every look shows the same under hypotheses[1] (po1) and hypotheses[2] (f)"
    assert recovery_record(plan)["solvable"] is False


def test_a_place_to_which_no_way_leads_is_named() -> None:
    written = {**ONE_BOTTLE, "places": {**WAYS, "r1_4": []}, "start": "r1_2"}
    for place in ROOM[:3]:
        written["places"] = {**written["places"], place: [to for to in WAYS[place] if to != "r1_4"]}
    plan = planned(written)
    assert isinstance(plan, NoRecoveryPlan)
    assert "hypotheses[2] (po-4) and hypotheses[3] (f); no way leads to r1_4 from r1_2" in plan.reason


def test_hypotheses_that_no_one_way_separates_are_narrowed_down() -> None:
    written = {**ONE_BOTTLE, "places": {"r1_1": ["r1_2", "r1_3", "r1_4"], "r1_4": ["r1_1"]}}
    plan = planned(written)
    assert isinstance(plan, NoRecoveryPlan)
    assert plan.reason.startswith(
        "no one way leads past all looks that separate hypotheses[0] (po-4) and hypotheses[1]"
    )
    assert plan.indistinguishable == ((0, 1, 3),)


def test_what_is_possible_enough_counts_and_what_is_left_out_is_reported() -> None:
    plan = found({**ONE_BOTTLE, "least_possibility": 0.5})
    assert print_plan(plan.plan) == "((anchor b1 po-4) :success)"
    assert plan.notes == ("1 hypotheses are no more possible than 0.5, and are left out",)


def test_what_is_known_already_needs_no_look() -> None:
    assert print_plan(found(problem("search", ["b1"], [hypothesis("r1_2", b1=["r1_2"])])).plan) == "(:success)"


def test_the_search_gives_up_at_a_limit_with_a_good_plan_and_says_so() -> None:
    plan = planned(ONE_BOTTLE, most_steps=1)
    assert isinstance(plan, RecoveryPlan)
    assert (plan.is_optimal, plan.covered, plan.figures.depth) == (False, 1.0, 7)
    assert plan.notes == ("the plan may not be the best: gave up after 1 steps",)


def test_when_time_is_up_the_plan_covers_a_part_and_says_how_much() -> None:
    case = read_recovery(json.dumps(ONE_BOTTLE))
    calls = iter(["", "", "gave up after 1 s"])
    plan = plan_recovery(case.problem, stop=lambda: next(calls, "gave up after 1 s"), most_steps=0)
    assert isinstance(plan, RecoveryPlan)
    assert plan.covered == pytest.approx(2.0 / 3.5)
    record = recovery_record(plan)
    assert record["solvable"] is False
    assert record["why_not"] == "the plan covers 57.1% of what is possible: gave up after 1 s"
    assert ":fail" in record["plan"]


def test_thousands_of_hypotheses_are_planned_for_within_bounds() -> None:
    places = [f"p{number}" for number in range(300)]
    ways = {place: [places[(number + 1) % 300]] for number, place in enumerate(places)}
    seen = [hypothesis(place, b1=[place]) for place in places]
    plan = found({**problem("search", ["b1"], [*seen, NONE_OF_THEM]), "places": ways, "start": "p0"})
    assert (plan.is_optimal, plan.covered, plan.figures.leaves) == (False, 1.0, 301)
    assert len(list(lines(plan.plan))) == len(list(tree_lines(plan.plan))) + 300
    assert len(plan_record(plan.plan)["nodes"]) == 601
    many = [hypothesis("r1_2", 0.5, b1=["r1_2"]) for _ in range(5000)]
    case = read_recovery(json.dumps(problem("search", ["b1"], [NONE_OF_THEM, *many, hypothesis("r1_3", b1=["r1_3"])])))
    assert len(case.problem.hypotheses) == 4096
    assert case.problem.hypotheses[-1].answer == "r1_3"
    assert case.notes == (
        "5002 hypotheses, at most 4096 are planned for: 906 of the least possible are left out, up to 0.5",
    )


def test_a_plan_is_drawn_as_a_tree_and_as_a_graph() -> None:
    plan = found(
        problem("identify", ["po1", "po2"], [hypothesis("po1", po1=["r1_1"]), hypothesis("po2", po2=["r1_1"])])
    )
    assert list(tree_lines(plan.plan)) == [
        "look-at po1",
        "|- po1 mark f:  anchor b1 po2  [success]",
        "`- po1 mark t:  anchor b1 po1  [success]",
    ]
    assert [line for line in dot_lines(plan.plan) if "->" in line] == [
        '  n0 -> n1 [label="po1 mark f"];',
        '  n0 -> n2 [label="po1 mark t"];',
    ]


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"kind": "find"}, "kind: one of identify, search is expected"),
        ({"places": []}, "places: an object is expected"),
        ({"places": {"r 1": []}}, "places.r 1: a name of 1 to 64 characters"),
        ({"places": {"r1_1": {"r1_2": 1}}}, "places.r1_1: a list of names is expected"),
        ({"start": None}, "start: a name of 1 to 64 characters"),
        ({"objects": ["f"]}, "objects[0]: a name of 1 to 64 characters"),
        ({"hypotheses": []}, "hypotheses: a list of objects is expected"),
        ({"hypotheses": [NONE_OF_THEM, 3]}, "hypotheses[1]: an object is expected"),
        ({"hypotheses": [hypothesis("po1", 2.0)]}, "hypotheses[0].possibility: a number from 0 to 1"),
        (
            {"hypotheses": [hypothesis("po1", po1=["r1_2"])]},
            "hypotheses[0].visible_from.po1: unknown object. Known: po-4.",
        ),
        ({"hypotheses": [hypothesis("po4")]}, "answer is an object, or f for none, got \"po4\". Did you mean 'po-4'?"),
        ({"hypotheses": [{"possibility": 1.0}]}, "answer is an object, or f for none, got null"),
        ({"hypotheses": [hypothesis("f", 0.0)]}, "no hypothesis is possible"),
        ({"value": "best"}, "value: one of worst, expected is expected"),
        ({"least_possibility": 1.0}, "no hypothesis is more possible than that"),
        ({"symbol": "b 1"}, "symbol: a name of 1 to 64 characters"),
    ],
)
def test_what_is_wrong_is_refused_with_place_cause_and_remedy(changed: dict[str, Any], message: str) -> None:
    from dyknow.model.errors import TextError

    with pytest.raises(TextError) as wrong:
        read_recovery(json.dumps({**ONE_BOTTLE, **changed}, indent=1), "case.json")
    assert message in wrong.value.message
    assert wrong.value.line > 1
    assert wrong.value.repair


def test_what_is_changed_or_ignored_is_reported() -> None:
    written = problem("identify", ["po1"], [{**hypothesis("po1", 0.5, po1=["r1_2"]), "why": 1}, hypothesis("f", 0.0)])
    assert read_recovery(json.dumps({**written, "least": 0})).notes == (
        "least is no known key and is ignored.",
        "hypotheses[0].why is no known key and is ignored.",
        "no hypothesis is wholly possible: possibilities are divided by the greatest, 0.5",
        "1 hypotheses have possibility 0 and count for nothing",
    )
