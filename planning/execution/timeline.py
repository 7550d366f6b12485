"""The expected course of a plan: the state at each start, the labels that actions read and write, the dependencies of
each.

An action depends on those that make what it reads, on those that read or write what it writes, and on the one before of
its unit. It waits for their ends, or for their starts if they overlap in the plan.
"""

from dataclasses import dataclass
from typing import Any, Final, NamedTuple

from dyknow.model.sample import Value
from dyknow.planning.domains.model import Declarations
from dyknow.planning.search.grounding import Grounder
from dyknow.planning.search.operators import OperatorInstance, Schema, State, Write
from dyknow.planning.search.plans import MissionPlan, PlannedAction
from dyknow.planning.search.tasks import PlanningTask

_NONE: Final[dict[str, Any]] = {}


class ExpectedChange(NamedTuple):
    """A label gets a value, at milliseconds after the start of the plan; `at_end` if that counts from the action's end."""

    at_ms: int
    label: str
    value: Value
    at_end: bool = False


@dataclass(frozen=True, slots=True)
class ExpectedAction:
    """An action in its plan.

    Attributes:
        number: in the order of the plan.
        before: the expected state at its start.
        after_ends, after_starts: numbers of the actions whose end, or start, it waits for.
    """

    number: int
    action: PlannedAction
    instance: OperatorInstance
    before: State
    changes: tuple[ExpectedChange, ...]
    after_ends: frozenset[int]
    after_starts: frozenset[int]

    @property
    def written(self) -> frozenset[str]:
        return frozenset(one.label for one in self.changes)


class Schemas:
    """The operators of a domain with a problem, made ready to give instances of their actions."""

    def __init__(self, declared: Declarations) -> None:
        self.task = PlanningTask(declared)
        self.grounder = Grounder(self.task, remembers=False)
        units = frozenset(declared.units)
        self._of = {one.name: Schema(one, self.grounder, units) for one in declared.operators}

    def instance(self, action: PlannedAction) -> OperatorInstance:
        return self._of[action.operator.name].instance(action.objects)

    def holds(self, action: PlannedAction, state: State) -> bool:
        """Whether an action can begin in a state."""
        found = self._of[action.operator.name].instances(action.unit, state)
        return any(one.objects == action.objects for one in found)


def changes_of(instance: OperatorInstance, state: State, start_ms: int, end_ms: int) -> tuple[ExpectedChange, ...]:
    """The changes of an action that starts in this state."""
    return tuple(
        ExpectedChange(_time(one, start_ms, end_ms), one.label, one.value(0, state, _NONE, (), _NONE), one.from_end)
        for one in instance.effects
        if one.when is None or one.when(0, state, _NONE, (), _NONE) == 1
    )


def _time(one: Write, start_ms: int, end_ms: int) -> int:
    at_ms = end_ms + one.offset_ms if one.from_end else start_ms + max(1, one.offset_ms)
    return min(max(at_ms, start_ms + 1), end_ms)


def expected_actions(schemas: Schemas, plan: MissionPlan, first: int = 1) -> tuple[ExpectedAction, ...]:
    """The actions of a plan, from the initial state of its problem, numbered from `first` on."""
    instances = [schemas.instance(one) for one in plan.actions]  # meets every label that is read
    state = dict(schemas.task.values)
    waiting = [ExpectedChange(*event) for event in schemas.task.events]
    found: list[ExpectedAction] = []
    for number, (action, instance) in enumerate(zip(plan.actions, instances, strict=True), first):
        waiting.sort(key=lambda one: one.at_ms)
        while waiting and waiting[0].at_ms <= action.start_ms:
            change = waiting.pop(0)
            state[change.label] = change.value
        changes = changes_of(instance, state, action.start_ms, action.end_ms)
        waiting += changes
        ends, starts = _dependencies(found, action, instance, {one.label for one in changes})
        found.append(ExpectedAction(number, action, instance, dict(state), changes, ends, starts))
    return tuple(found)


def _dependencies(
    earlier: list[ExpectedAction], action: PlannedAction, instance: OperatorInstance, writes: set[str]
) -> tuple[frozenset[int], frozenset[int]]:
    """Numbers of the actions whose ends, and whose starts, come first."""
    ends, starts = set[int](), set[int]()
    unsettled = set(instance.reads | writes)
    for one in reversed(earlier):
        produces = unsettled & one.written
        is_disturbed = bool(writes & one.instance.reads)
        if produces or is_disturbed or one.action.unit == action.unit:
            (ends if one.action.end_ms <= action.start_ms else starts).add(one.number)
            unsettled -= produces - writes
    return frozenset(ends), frozenset(starts)
