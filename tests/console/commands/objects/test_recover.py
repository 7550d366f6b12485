"""`dyknow recover` over files."""

import json
from pathlib import Path

from tests.console.conftest import Run

MARK = Path(__file__).parents[4] / "examples/matching/mark.json"


def test_a_plan_is_answered_with_one_line_of_json_and_drawn(dyknow: Run) -> None:
    done = dyknow("recover", str(MARK))
    assert done.returncode == 0
    found = json.loads(done.stdout)
    assert (found["solvable"], found["depth"], found["leaves"], found["actions"]) == (True, 7, 4, 10)
    assert found["why_not"] is None
    drawn = dyknow("recover", str(MARK), "--draw", "plan")
    assert " ".join(drawn.stdout.split()) == found["plan"]


def test_that_there_is_no_plan_is_the_answer_no_with_the_reason(dyknow: Run, tmp_path: Path) -> None:
    file = tmp_path / "alike.json"
    case = json.loads(MARK.read_text())
    case["places"]["r1_1"] = []
    file.write_text(json.dumps(case))
    done = dyknow("recover", str(file))
    assert done.returncode == 1
    found = json.loads(done.stdout)
    assert (found["solvable"], found["plan"], found["indistinguishable"]) == (False, None, [[0, 1, 2, 3]])
    assert "no way leads to r1_2, r1_3, r1_4 from r1_1" in found["why_not"]


def test_a_problem_of_actions_is_answered_as_well(dyknow: Run) -> None:
    done = dyknow("recover", str(MARK.with_suffix(".ptl")))
    assert done.returncode == 0
    found = json.loads(done.stdout)
    assert (found["solvable"], found["depth"], found["leaves"], found["actions"]) == (True, 7, 4, 10)


def test_looks_that_may_err_are_answered_with_how_sure_the_plan_is(dyknow: Run, tmp_path: Path) -> None:
    file = tmp_path / "errors.json"
    file.write_text(json.dumps({**json.loads(MARK.read_text()), "errors": {"unseen": 0.1, "false": 0.05, "sure": 0.9}}))
    found = json.loads(dyknow("recover", str(file)).stdout)
    assert found["solvable"] is True
    assert found["covered"] >= 0.9
    assert found["right"] >= 0.9
