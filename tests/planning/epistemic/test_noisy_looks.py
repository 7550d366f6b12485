"""Plans for looks that may err, against what happens when they are carried out under every hypothesis."""

import json
from typing import Any

import pytest

from dyknow.model.errors import TextError
from dyknow.planning.contingent.conditional_plans import ConditionalPlan
from dyknow.planning.contingent.files import read_recovery
from dyknow.planning.contingent.recovery_planning import RecoveryPlan, plan_recovery
from dyknow.planning.contingent.sensing_problems import LookErrors
from dyknow.planning.epistemic.noisy_looks import NoisyPlan, plan_noisy
from tests.planning.contingent.dynamic_programming import generated
from tests.planning.contingent.test_recovery_plans import ONE_BOTTLE


def planned(problem: dict[str, Any], **errors: float) -> NoisyPlan:
    case = read_recovery(json.dumps({**problem, "errors": errors}))
    assert case.errors is not None
    return plan_noisy(case.problem, case.errors)


def carried_out(problem: dict[str, Any], plan: ConditionalPlan, errors: LookErrors) -> tuple[float, float, float]:
    """Probabilities that a plan ends with an answer, and with the right one, and its mean cost."""
    total = sum(each["possibility"] for each in problem["hypotheses"])
    success = right = cost = 0.0
    for each in problem["hypotheses"]:
        stack = [(plan, problem["start"], each["possibility"] / total)]
        while stack:
            part, place, probability = stack.pop()
            cost += probability * len(part.actions)
            for action in part.actions:
                place = action.arguments[0] if action.name == "move" else place
            if part.end == "success":
                success += probability
                right += probability * (part.answer == each["answer"])
            for seen, rest in part.branches:
                is_visible = place in each["visible_from"].get(seen.target, ())
                shows = 1.0 - errors.unseen if is_visible else errors.false
                stack.append((rest, place, probability * (shows if seen.value == "t" else 1.0 - shows)))
    return success, right, cost


@pytest.mark.parametrize("seed", range(12))
def test_success_and_cost_are_what_happens_when_the_plan_is_carried_out(seed: int) -> None:
    problem = generated(seed)
    errors = LookErrors(0.15, 0.05, sure=0.8, looks=3)
    found = planned(problem, unseen=0.15, false=0.05, sure=0.8, looks=3)
    success, right, cost = carried_out(problem, found.plan, errors)
    assert (found.success, found.expected) == (pytest.approx(success), pytest.approx(cost))
    assert found.success * found.right == pytest.approx(right)
    assert found.success == pytest.approx(0.0) or found.right >= 0.8 - 1e-9


def test_looks_that_never_err_are_planned_as_well_as_without_probabilities() -> None:
    exact = plan_recovery(read_recovery(json.dumps(ONE_BOTTLE)).problem, "expected")
    assert isinstance(exact, RecoveryPlan)
    found = planned(ONE_BOTTLE, sure=1.0)
    assert (found.success, found.right, found.expected) == pytest.approx((1.0, 1.0, exact.expected))


def test_more_looks_end_with_an_answer_more_often() -> None:
    found = [planned(ONE_BOTTLE, unseen=0.2, false=0.1, sure=0.95, looks=looks).success for looks in (1, 3, 5)]
    assert found == sorted(found)
    assert found[-1] > found[0]


def test_where_the_search_is_given_up_the_plan_has_fewer_looks_and_says_so() -> None:
    case = read_recovery(json.dumps({**ONE_BOTTLE, "errors": {"unseen": 0.1, "false": 0.1, "looks": 20}}))
    assert case.errors is not None
    found = plan_noisy(case.problem, case.errors, most_steps=500)
    assert 1 <= found.looks < 20
    assert found.notes == (f"planned with {found.looks} looks at most: gave up after 500 steps with one more",)


@pytest.mark.parametrize(
    ("errors", "message"),
    [
        ({"unseen": 0.6, "false": 0.5}, "unseen and false together are below 1"),
        ({"unseen": -0.1}, "errors.unseen: a number from 0 to 1 is expected"),
        ({"looks": 2.5}, "errors.looks: a whole number from 1 to 20 is expected"),
        ({"looks": 100}, "errors.looks: a whole number from 1 to 20 is expected"),
        ({"sure": 0.1}, "errors.sure: a number from 0.5 to 1 is expected"),
        (3, "errors: an object is expected"),
    ],
)
def test_what_is_wrong_is_refused(errors: Any, message: str) -> None:
    with pytest.raises(TextError) as wrong:
        read_recovery(json.dumps({**ONE_BOTTLE, "errors": errors}))
    assert message in wrong.value.message
