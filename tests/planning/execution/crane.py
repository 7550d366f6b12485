"""The domain of the examples in which every kind of monitor is generated: a crane that moves a box."""

from pathlib import Path

from dyknow.planning import Declarations, MissionPlan, PlanFound, find_plan, parse_domain, parse_problem
from dyknow.planning.execution.generation import PlanMonitor, plan_monitors

FOLDER = Path(__file__).parents[3] / "examples/planning"
DOMAIN = (FOLDER / "crane.dom").read_text(encoding="utf-8")
PROBLEM = (FOLDER / "crane.prob").read_text(encoding="utf-8")


def domain(disturbed: str = "") -> Declarations:
    return parse_domain(DOMAIN.replace("holds(crane, box) : boolean", f"holds(crane, box) : boolean {disturbed}"))


def planned(found: Declarations, problem: str = PROBLEM) -> tuple[Declarations, MissionPlan]:
    """The domain with the problem, and the plan."""
    asked = parse_problem(problem, found)
    result = find_plan(found, asked)
    assert isinstance(result, PlanFound), result
    return found.joined(asked), result.plan


def monitors(disturbed: str = "") -> tuple[PlanMonitor, ...]:
    return plan_monitors(*planned(domain(disturbed)))
