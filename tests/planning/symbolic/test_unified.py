"""The symbolic part of domains, to unified-planning and PDDL and back; plans judged by its validator."""

from dataclasses import replace
from pathlib import Path

import pytest

from dyknow.model.errors import TextError, WrongCall
from dyknow.planning import Declarations, parse_domain, parse_problem
from dyknow.planning.symbolic.exporting import to_unified
from dyknow.planning.symbolic.importing import read_pddl
from tests.planning.flights import MAP, TRUCKS
from tests.planning.logistics import domain, found, problem
from tests.planning.replay import replayed

pytest.importorskip("unified_planning", reason='needs the extra: pip install "dyknow[planning]"')
EXAMPLES = Path(__file__).parents[3] / "examples/planning"
PDDL_DOMAIN = """(define (domain d) (:requirements :typing :conditional-effects :action-costs :negative-preconditions)
  (:types room ball - object)
  (:constants hall - room)
  (:predicates (next ?a ?b - room) (at ?o - ball ?r - room) (in ?r - room) (held ?o - ball))
  (:functions (length ?a ?b - room) (total-cost))
  (:action move :parameters (?a ?b - room) :precondition (and (in ?a) (next ?a ?b))
    :effect (and (not (in ?a)) (in ?b) (increase (total-cost) (length ?a ?b))
      (forall (?o - ball) (when (held ?o) (and (not (at ?o ?a)) (at ?o ?b))))))
  (:action grab :parameters (?o - ball ?r - room)
    :precondition (and (in ?r) (at ?o ?r) (forall (?p - ball) (not (held ?p))))
    :effect (and (held ?o) (increase (total-cost) 1)))
  (:action release :parameters (?o - ball) :precondition (held ?o) :effect (and (not (held ?o)) (increase (total-cost) 1))))
"""
PDDL_PROBLEM = """(define (problem p) (:domain d) (:objects attic - room b1 b2 - ball)
  (:init (next hall attic) (next attic hall) (in hall) (at b1 attic) (at b2 attic) (= (total-cost) 0)
    (= (length hall attic) 3) (= (length attic hall) 2))
  (:goal (and (at b1 hall) (at b2 hall) (not (held b2)))) (:metric minimize (total-cost)))
"""


def sampling() -> tuple[Declarations, Declarations]:
    declared = parse_domain((EXAMPLES / "sampling.dom").read_text())
    return declared, parse_problem((EXAMPLES / "steered.prob").read_text(), declared)


@pytest.mark.parametrize(
    "wanted",
    [
        {"boxes": 2},
        {"boxes": 4, "uavs": 2, "carriers": 2},
        pytest.param({"boxes": 10, "seed": 3}, marks=pytest.mark.full),
    ],
    ids=str,
)
def test_plans_for_boxes_with_coordinates_are_valid_for_unified_planning(wanted: dict[str, int]) -> None:
    asked = problem(**wanted)
    plan = found(domain(), asked).plan
    exported = to_unified(domain(), asked)
    assert exported.refusal(plan) == ""
    assert set(exported.left_out) >= {"durations", "control formulas", "monitors", "the cost of fly-carrier"}


def test_a_plan_of_several_units_is_valid_and_one_without_a_sample_is_not() -> None:
    declared, asked = sampling()
    plan = found(declared, asked).plan
    exported = to_unified(declared, asked)
    assert exported.refusal(plan) == ""
    for at, one in enumerate(plan.actions):
        if one.operator.name == "take-sample":
            shorter = replace(plan, actions=plan.actions[:at] + plan.actions[at + 1 :])
            assert exported.refusal(shorter) != "", at


def test_of_two_effects_on_one_feature_the_later_one_counts() -> None:
    declared = parse_domain(
        "#domain box\n#feature up(box) : boolean\n#feature done(box) : boolean\n#operator lift(box) :precond !done(box)\n"
        "  :effects [start] up(box), forall box2: [start] !done(box2) -> [end] up(box2) := false, [end] done(box)"
    )
    asked = parse_problem("#objects box = {b1, b2} #goal done(b1) & forall box: !up(box)", declared)
    plan = found(declared, asked).plan
    assert replayed(declared, asked, plan) == []
    assert to_unified(declared, asked).refusal(plan) == ""


def test_a_problem_in_pddl_is_read_and_its_plan_is_valid_there() -> None:
    declared, asked = read_pddl(PDDL_DOMAIN, PDDL_PROBLEM)
    assert {one.name for one in declared.features} == {"next_", "at", "in", "held", "length"}
    result = found(declared, asked, strategy="best-first")
    assert result.plan.cost == 13
    assert replayed(declared, asked, result.plan) == []
    assert to_unified(declared, asked).refusal(result.plan) == ""


def test_what_is_written_as_pddl_is_read_back_as_a_problem_with_the_same_plans(tmp_path: Path) -> None:
    declared = parse_domain(TRUCKS)
    asked = parse_problem(MAP + "#goal seen(d)", declared)
    paths = to_unified(declared, asked).write_pddl(tmp_path / "new")
    again = read_pddl(*(path.read_text() for path in paths))
    plans = [found(*both, strategy="branch-and-bound").plan for both in ((declared, asked), again)]
    assert [[(one.operator.name, one.objects) for one in plan.actions] for plan in plans] == [
        [
            ("start", ("u1",)), ("fly", ("u1", "a", "b")), ("fly", ("u1", "b", "c")), ("fly", ("u1", "c", "d")),
            ("look", ("u1", "d")),
        ]
    ] * 2  # fmt: skip


def test_what_has_no_form_there_is_refused_with_its_place() -> None:
    nothing = parse_domain(
        "#domain uav\n#feature at(uav) : uav\n#operator o(uav) :precond at(uav) == uav :effects [end] at(uav) := uav"
    )
    with pytest.raises(TextError, match=r"at\[u1\] has no initial value"):
        to_unified(nothing, parse_problem("#objects uav = {u1} #goal at(u1) == u1", nothing))
    length = parse_domain(
        "#domain uav\n#feature x(uav) : fp = 0\n#operator o(uav)\n :precond hypot(x(uav), 1) + x(uav) <= 3 :effects [end] x(uav) := 2"
    )
    with pytest.raises(TextError, match="hypot of what changes has no form"):
        to_unified(length, parse_problem("#objects uav = {u1} #goal x(u1) == 2", length))
    with pytest.raises(WrongCall, match="the PDDL text is not read"):
        read_pddl(PDDL_DOMAIN, "(define (problem p)")
