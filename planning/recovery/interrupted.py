"""The rest of a plan that was interrupted, and whether it can continue from the state now."""

from dataclasses import replace

from dyknow.model.errors import DyknowError
from dyknow.planning.domains.model import Declarations
from dyknow.planning.execution.executor import PlanExecutor, StepPhase
from dyknow.planning.execution.timeline import Schemas, expected_actions
from dyknow.planning.search.plans import MissionPlan


def rest_of(executor: PlanExecutor | None) -> MissionPlan | None:
    """The actions of a plan that are not done, those under way from their beginning; None: there are none."""
    if executor is None:
        return None
    over = {StepPhase.ENDING, StepPhase.DONE}
    left = [one.expected.action for one in executor.steps.values() if one.phase not in over]
    if not left:
        return None
    first_ms = min(one.start_ms for one in left)
    moved = (replace(one, start_ms=one.start_ms - first_ms, end_ms=one.end_ms - first_ms) for one in left)
    return MissionPlan(tuple(moved), executor.plan.cost, executor.plan.unreached)


def hindrance(declared: Declarations, rest: MissionPlan) -> str:
    """Why it cannot continue from the initial state of these declarations; empty: the preconditions of each action will hold."""
    try:
        schemas = Schemas(declared)
        for one in expected_actions(schemas, rest):
            if not schemas.holds(one.action, one.before):
                return f"the preconditions of {one.action.shown} do not hold any longer"
    except DyknowError as wrong:
        return str(wrong)
    return ""
