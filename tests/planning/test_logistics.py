"""The UAV logistics domain of thesis 7.4.1, planned and replayed."""

from pathlib import Path

import pytest

from planning import parse_problem
from tests.planning.logistics import FOLDER, domain, found, problem, problem_text
from tests.planning.replay import replayed


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


@pytest.mark.parametrize(("boxes", "seed"), [(1, 1), (4, 1), (4, 2), (10, 3)])
def test_plans_replay(boxes: int, seed: int) -> None:
    asked = problem(boxes=boxes, seed=seed)
    plan = found(domain(), asked).plan
    assert replayed(domain(), asked, plan) == []


def test_the_problem_of_the_examples_is_made_by_its_script() -> None:
    assert (Path(FOLDER) / "four.prob").read_text(encoding="utf-8") == problem_text(boxes=4)


def test_a_box_that_is_where_it_should_be_is_left_alone() -> None:
    asked = parse_problem(
        "#objects uav = {uav1}\n#objects box = {b1}\n#init xpos(uav1) := 0, ypos(uav1) := 0, xpos(b1) := 5, ypos(b1) := 5, "
        "goal-x(b1) := 5.5, goal-y(b1) := 5\n#goal delivered(b1)",
        domain(),
    )
    assert found(domain(), asked).plan.actions == ()
