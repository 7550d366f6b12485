"""The situation in which a new plan is made: assumptions of recovery operators, the state then, goals with their times."""

from collections.abc import Iterable, Mapping
from dataclasses import replace

from dyknow.model.sample import Value
from dyknow.planning.domains import model
from dyknow.planning.domains.model import Application, Declarations, Expression, GoalStatement
from dyknow.planning.domains.sorts import free_variables
from dyknow.planning.execution.beliefs import Beliefs
from dyknow.planning.execution.executor import ExecutionFault
from dyknow.planning.search.control import closed
from dyknow.planning.search.grounding import FALSE, TRUE, Grounder
from dyknow.planning.search.tasks import PlanningTask
from dyknow.reasoning.formulas import tree


def recovery_from(
    fault: ExecutionFault, recoveries: Mapping[str, model.RecoveryOperator], declared: Declarations, beliefs: Beliefs
) -> model.RecoveryOperator:
    """The recovery operator that the fault names, if it is to be done in this state; otherwise one that changes nothing."""
    found = recoveries.get(fault.recovery or "")
    if found is not None and found.when is not None:
        task = PlanningTask(declared)
        task.fluents |= set(task.features)
        if not holds(Grounder(task), found.when, _constants(fault.bound), state_of(task, beliefs)):
            found = None
    return found or model.RecoveryOperator("replanning alone")


def assume(
    declared: Declarations,
    recovery: model.RecoveryOperator,
    bound: Mapping[str, Value],
    beliefs: Beliefs,
    now_us: int,
) -> tuple[tuple[str, Value], ...]:
    """Change assumptions as a recovery operator says, clause by clause, from the values before each; return what changed."""
    task = PlanningTask(declared)
    task.fluents |= set(task.features)
    grounder = Grounder(task, remembers=False)
    changed: list[tuple[str, Value]] = []
    for clause in recovery.assumptions:
        values = state_of(task, beliefs)
        found = [each for one in clause for each in _changes(grounder, one, bound, values)]
        beliefs.change(now_us, found)
        changed += [(label, value) for label, value in found if values.get(label) != value]
    return tuple(changed)


def _changes(
    grounder: Grounder, effect: model.Effect, bound: Mapping[str, Value], values: dict[str, Value]
) -> Iterable[tuple[str, Value]]:
    for inside in grounder.bindings(effect.variables, _constants(bound)):
        if effect.condition is not None and not holds(grounder, effect.condition, inside, values):
            continue
        target = grounder.term(effect.target, inside)
        assert isinstance(target, tree.Feature)  # noqa: S101 - what is assumed is the value of a feature
        value = _evaluated(grounder, effect.value, inside, values)
        yield target.label, value


def _is_plain(value: Value) -> bool:
    return isinstance(value, bool | int | float | str)


def _constants(bound: Mapping[str, Value]) -> dict[str, tree.Formula]:
    return {name: tree.Const(value) for name, value in bound.items() if _is_plain(value)}


def holds(grounder: Grounder, formula: Expression, env: Mapping[str, tree.Formula], values: dict[str, Value]) -> bool:
    """Whether a formula is true in a state."""
    ground = grounder.ground(formula, env)
    if ground in {TRUE, FALSE}:
        return ground == TRUE
    grounder_test = grounder.compiler.whole_test(ground)
    _meet(grounder, ground, values)
    return grounder_test(0, values, {}, (), {}) == 1


def _evaluated(
    grounder: Grounder, expression: Expression, env: Mapping[str, tree.Formula], values: dict[str, Value]
) -> Value:
    term = grounder.term(expression, env)
    _meet(grounder, term, values)
    return grounder.compiler.whole_term(term)(0, values, {}, (), {})


def _meet(grounder: Grounder, ground: tree.Formula, values: dict[str, Value]) -> None:
    """Values of labels that are met for the first time: their defaults."""
    for node in tree.walk(ground):
        if isinstance(node, tree.Feature) and node.label not in values and node.label in grounder.task.values:
            values[node.label] = grounder.task.values[node.label]


def state_of(task: PlanningTask, beliefs: Beliefs) -> dict[str, Value]:
    """The believed state; values without a belief are those of the problem."""
    return task.values | beliefs.values()


def problem_now(
    problem: Declarations,
    task: PlanningTask,
    beliefs: Beliefs,
    unknown: Iterable[str],
    goals: Iterable[GoalStatement],
    elapsed_ms: int,
) -> Declarations:
    """The problem from now on: its initial state is the state now, times that are to come are that much nearer.

    Args:
        problem: the first one.
        task: of the domain with it.
        beliefs: the state.
        unknown: labels that have no value now.
        goals: the goals that are pursued.
        elapsed_ms: since the problem's times began.
    """
    values = {label: value for label, value in task.values.items() if label not in set(unknown)} | beliefs.values()
    later = [replace(one, at_ms=one.at_ms - elapsed_ms) for one in problem.init if one.at_ms > elapsed_ms]
    declared = {one.name for one in task.declared.features}
    now = [
        model.Observation(_application(label), _expression(value))
        for label, value in values.items()
        if label.partition("[")[0] in declared and _is_plain(value)
    ]
    shifted = tuple(_shifted(one, elapsed_ms) for one in goals)
    return replace(problem, init=(*now, *later), goals=shifted)


def past_events(task: PlanningTask, since_ms: int, elapsed_ms: int) -> Iterable[tuple[str, Value]]:
    """The problem's events between two times, such as an area that has opened."""
    return ((label, value) for at_ms, label, value in task.events if since_ms < at_ms <= elapsed_ms)


def unreached_goals(
    declared: Declarations, goals: Iterable[GoalStatement], beliefs: Beliefs
) -> tuple[GoalStatement, ...]:
    """The goals that do not hold now."""
    task = PlanningTask(declared)
    task.fluents |= set(task.features)
    grounder = Grounder(task)
    found = []
    for one in goals:
        formula = closed(one.formula, free_variables(one.formula, declared))
        if not holds(grounder, formula, {}, state_of(task, beliefs)):
            found.append(one)
    return tuple(found)


def _shifted(goal: GoalStatement, elapsed_ms: int) -> GoalStatement:
    return goal if goal.deadline_ms is None else replace(goal, deadline_ms=max(0, goal.deadline_ms - elapsed_ms))


def objects_of(label: str) -> tuple[str, ...]:
    """The objects in a label: of `near[uav1, b1]` uav1 and b1."""
    rest = label.partition("[")[2].rstrip("]")
    return tuple(rest.split(", ")) if rest else ()


def _application(label: str) -> Application:
    return Application(label.partition("[")[0], tuple(Application(one) for one in objects_of(label)))


def _expression(value: Value) -> Expression:
    return tree.Const(value) if isinstance(value, bool | int | float) else Application(str(value))
