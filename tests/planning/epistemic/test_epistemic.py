"""The action language of "Have another look", and plans over e-states."""

from pathlib import Path
from typing import Any

import pytest

from dyknow.model.errors import TextError
from dyknow.planning.contingent.conditional_plans import figures_of, lines, print_plan
from dyknow.planning.epistemic.actions import outcomes, reaches
from dyknow.planning.epistemic.epistemic_search import EpistemicPlan, plan_epistemic
from dyknow.planning.epistemic.reading import read_epistemic
from tests.planning.contingent.dynamic_programming import Oracle, generated
from tests.planning.contingent.test_recovery_plans import PAPER

MARK = (Path(__file__).parents[3] / "examples/matching/mark.ptl").read_text()
ACTIONS = MARK[MARK.index("(ptl-action") : MARK.index("(known")].replace(
    "(mark ?y = t) (mark-visible-from ?y = ?p)", "(seen ?y ?p)"
)
ACTIONS = ACTIONS.replace("(mark ?y = t)\n              (mark-visible-from ?y = ?p)", "(seen ?y ?p)")
DOOR = """
(ptl-action :name (push) :precond ((() (at = outside)))
 :results (cond ((locked) (obs (opens! door = f))) ((not (locked)) (open) (obs (opens! door = t)))))
(ptl-action :name (unlock) :precond ((() (at = outside)) (() (locked))) :results ((locked = f)) :cost 2)
(ptl-action :name (enter) :precond ((() (open))) :results ((at = inside)))
(known (at = outside))
(hypothesis 1.0)
(hypothesis 0.4 (locked))
(goal () (at = inside))
"""


def planned(text: str) -> EpistemicPlan:
    return plan_epistemic(read_epistemic(text))


def written(problem: dict[str, Any]) -> str:
    """A problem of places and objects in the action language."""
    ways = [f"(way {place} {to})" for place, others in problem["places"].items() for to in others]
    objects = [f"(perceived-object {each})" for each in problem["objects"]]
    known = f"(known (robot-at = {problem['start']}) {' '.join((*ways, *objects))})"
    hypotheses = [
        f"(hypothesis {each['possibility']} (anchor b1 = {each['answer']}) "
        + " ".join(f"(seen {target} {place})" for target, places in each["visible_from"].items() for place in places)
        + ")"
        for each in problem["hypotheses"]
    ]
    return "\n".join((ACTIONS, known, *hypotheses, "(goal (?x) (and (done) (anchored b1 = ?x)))"))


def test_the_paper_s_action_gives_the_paper_s_plan() -> None:
    found = planned(MARK)
    assert found.plan is not None
    assert "\n".join(lines(found.plan)) == PAPER


def test_an_observation_splits_an_e_state_and_what_is_known_is_what_holds_in_all_its_worlds() -> None:
    problem = read_epistemic(MARK)
    state = tuple(enumerate(problem.worlds))
    first = {str(each.action): each for each in outcomes(problem.actions, state)}
    assert set(first) == {"(look-at po-4)", "(move r1_2)", "(move r1_3)", "(move r1_4)"}
    moved = first["(move r1_2)"].branches[0][1]
    (look,) = [each for each in outcomes(problem.actions, moved) if each.action.name == "look-at"]
    assert [(str(seen), [number for number, _ in part]) for seen, part in look.branches] == [
        ("(mark! po-4 = t)", [0]),
        ("(mark! po-4 = f)", [1, 2, 3]),
    ]
    assert reaches(problem.goal, state) is None
    assert "(anchor b1 po-4)" in {str(each.action) for each in outcomes(problem.actions, look.branches[0][1])}


def test_generated_problems_have_the_worth_that_dynamic_programming_finds() -> None:
    count = 0
    for seed in range(60):
        problem = {**generated(seed), "value": "worst"}
        best = Oracle(problem).best()
        if problem["kind"] == "search" or best is None or len(problem["hypotheses"]) > 6:
            continue
        found = planned(written(problem))
        assert found.plan is not None, seed
        figures = figures_of(found.plan)
        assert (figures.worst_cost, figures.leaves, figures.actions) == best, seed
        count += 1
    assert count > 10


def test_effects_may_depend_on_the_hypothesis_and_cost_what_they_cost() -> None:
    found = planned(DOOR)
    assert found.plan is not None
    assert print_plan(found.plan) == (
        "((push) (cond ((opens! door = t) (enter) :success) ((opens! door = f) (unlock) (push) (enter) :success)))"
    )
    assert figures_of(found.plan).worst_cost == 5


def test_where_nothing_leads_to_the_goal_that_is_said() -> None:
    assert planned("(ptl-action :name (wait) :results ((waited)))(goal () (at = inside))") == EpistemicPlan(
        None, "no actions lead to what is to be known", 2
    )
    problem = read_epistemic(MARK.replace("(way r1_1 r1_4)", "").replace("(way r1_3 r1_4)", "(way r1_3 r1_1)"))
    assert plan_epistemic(problem, most_cost=12).reason == "no plan costs 12 or less in the worst case"
    assert plan_epistemic(problem, most_steps=50).reason == "gave up after 50 steps"
    assert plan_epistemic(problem, stop=lambda: "time is up").plan is None


@pytest.mark.parametrize(
    ("text", "place", "message"),
    [
        ("", (1, 1), "there is no goal"),
        ("(goal () (a))", (1, 1), "there are no actions"),
        ("(goal ()\n (a)", (1, 1), "opened and not closed"),
        ("(goal () (a)))", (1, 14), "closed that was not opened"),
        ("(" * 40, (1, 33), "nested deeper than 32"),
        ("(gaol () (a))", (1, 1), "unknown statement 'gaol'. Did you mean 'goal'?"),
        ("goal", (1, 1), "a statement is a list"),
        ("(goal (x) (a))", (1, 7), "variables begin with ?"),
        ("(goal () (a = b c))", (1, 10), "a fluent has one value"),
        ("(hypothesis 2 (a))", (1, 13), "a possibility is above 0"),
        ("(hypothesis x)", (1, 13), "a number is expected"),
        ("(hypothesis)", (1, 1), "a hypothesis that is not complete"),
        ("(ptl-action :name (m))", (1, 1), "an action has :name and :results"),
        ("(ptl-action :nam (m))", (1, 13), "is no part of an action. Did you mean ':name'?"),
        ("(ptl-action :name (m ?q) :results ((a)))", (1, 19), "every variable of a name is bound"),
        ("(ptl-action :name (m) :results ((a)) :cost 0)", (1, 44), "a cost is a whole number from 1 to 1000"),
        ("(ptl-action :name (m) :results a)", (1, 32), "a list is expected, got a"),
        ("(ptl-action :name (m) :results (cond ()))", (1, 32), "a clause without condition"),
        ("(ptl-action :name (m) :precond ((a)) :results ((a)))", (1, 33), "a precondition has variables"),
        ("(known ((a)))", (1, 9), "a word is expected, got a list"),
        ("(ptl-action :name (m) :precond (((?p) (at = cupboard))) :results ((a)))", (1, 34), "?p does not occur"),
    ],
)
def test_what_is_wrong_is_refused_with_place_cause_and_remedy(text: str, place: tuple[int, int], message: str) -> None:
    with pytest.raises(TextError) as wrong:
        read_epistemic(text, "wrong.ptl")
    assert message in wrong.value.message
    assert (wrong.value.line, wrong.value.column) == place
    assert wrong.value.repair
