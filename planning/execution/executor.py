"""The executor of one plan (thesis 7.5.3, 7.6): which action begins when, its flag, its monitors, its effects.

The life of an action: it waits for the actions it depends on, and, in a problem with events such as areas that open,
for its time; its flag is set and its monitors are added; the first state after that shows its conditions, and the
command goes out; it ends, and the flag is cleared; the first state after that settles its monitors, and dependent
actions may begin. Nothing begins without a state.

A fault ends the execution: the caller reads `fault` after every call, and aborts.
"""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Final

from dyknow.model.sample import Value
from dyknow.planning.domains.model import Declarations
from dyknow.planning.execution.beliefs import Beliefs
from dyknow.planning.execution.events import AbortAction, ActionEnded, MissionEffect, MissionNote, StartAction
from dyknow.planning.execution.flags import ExecutionFlags
from dyknow.planning.execution.generation import PlanMonitor, monitors_of, parameters_of
from dyknow.planning.execution.timeline import ExpectedAction, ExpectedChange, Schemas, changes_of, expected_actions
from dyknow.planning.execution.watching import MonitorSet
from dyknow.planning.search.plans import MissionPlan, bound_labels

_RANKS: Final = {"operator": 1, "link": 2, "global": 3}
"""Monitors that may be about an earlier action, and those of the whole plan, come after those of the action."""


class StepPhase(StrEnum):
    """Where an action is in its life."""

    WAITING = "waiting"
    CHECKING = "checking"
    RUNNING = "running"
    ENDING = "ending"
    DONE = "done"
    ABORTED = "aborted"


@dataclass(frozen=True, slots=True)
class ExecutionFault:
    """The fault of a plan.

    Attributes:
        kind: `violated`, `failed`, or `unknown` if states did not show what they should in time.
        name: of the monitor's origin or the action, without the step: faults with one name are repeats.
    """

    kind: str
    name: str
    text: str
    step: int
    at_us: int
    recovery: str | None = None
    bound: Mapping[str, Value] = field(default_factory=dict)


@dataclass(slots=True)
class PlanStep:
    """An action and where it is; `changes` are those of its effects that are to come."""

    expected: ExpectedAction
    monitors: tuple[PlanMonitor, ...]
    phase: StepPhase = StepPhase.WAITING
    since_us: int = 0
    changes: list[ExpectedChange] = field(default_factory=list)

    @property
    def number(self) -> int:
        return self.expected.number

    @property
    def shown(self) -> str:
        return self.expected.action.shown

    @property
    def unit(self) -> str:
        return self.expected.action.unit


class PlanExecutor:
    """Executes a plan from `begun_us` on.

    Args:
        declared: the domain with the problem that the plan is for.
        plan: its actions.
        begun_us: the origin of the plan's times.
        beliefs: the beliefs; effects of actions are added.
        flags: execution flags.
        first: the number of the first step.
        patience_us: how long an action may wait for states that show its conditions.
        missing: units that take no part: global formulas are not monitored for them.

    Raises:
        TextError: a condition that is monitored has no formula.
    """

    def __init__(
        self,
        declared: Declarations,
        plan: MissionPlan,
        begun_us: int,
        beliefs: Beliefs,
        flags: ExecutionFlags,
        first: int,
        patience_us: int,
        missing: Collection[str] = (),
    ) -> None:
        self._schemas, self.plan = Schemas(declared), plan
        actions = expected_actions(self._schemas, plan, first)
        monitors = monitors_of(declared, actions)
        self.steps = {
            one.number: PlanStep(one, tuple(each for each in monitors if each.step == one.number)) for one in actions
        }
        self.fault: ExecutionFault | None = None
        self._begun_us, self._beliefs, self._flags = begun_us, beliefs, flags
        self._patience_us = patience_us
        self._state_us: int | None = None
        self._watched = MonitorSet(flags, beliefs)
        whole = [one for one in monitors if one.step == 0 and not set(missing) & set(map(str, one.bound.values()))]
        self._watched.add(whole, begun_us)

    @property
    def labels(self) -> frozenset[str]:
        """The labels that states have to show now: of active monitors, and of the conditions of the next actions."""
        found = set(self._watched.labels)
        for one in self.steps.values():
            if one.phase is StepPhase.WAITING and self._depends_on_nothing(one):
                found.update(label for each in one.monitors for label in each.labels if "executing-" not in label)
        return frozenset(found)

    @property
    def monitors(self) -> tuple[PlanMonitor, ...]:
        return self._watched.monitors

    @property
    def is_done(self) -> bool:
        return all(one.phase is StepPhase.DONE for one in self.steps.values())

    def needs(self, unit: str) -> bool:
        """Whether the unit still has something to do."""
        return any(one.unit == unit and one.phase is not StepPhase.DONE for one in self.steps.values())

    @property
    def acting(self) -> tuple[PlanStep, ...]:
        """Steps whose flags are set."""
        return tuple(one for one in self.steps.values() if one.phase in {StepPhase.CHECKING, StepPhase.RUNNING})

    @property
    def deadline_us(self) -> int | None:
        """When something is to be done if nothing comes before."""
        times = [self._due_us(one) for one in self._ready()]
        for one in self.steps.values():
            if one.phase in {StepPhase.CHECKING, StepPhase.ENDING}:
                times.append(one.since_us + self._patience_us)
            if one.phase is StepPhase.RUNNING:
                times += [one.since_us + each.at_ms * 1000 for each in one.changes if not each.at_end]
        return min(times, default=None)

    def on_time(self, now_us: int) -> list[MissionEffect]:
        """Begin what is due, have effects come about, lose patience."""
        if self.fault is not None:
            return []
        effects: list[MissionEffect] = []
        for one in self.steps.values():
            if one.phase is StepPhase.RUNNING:
                self._take_effect(one, now_us, ended=False)
            if one.phase in {StepPhase.CHECKING, StepPhase.ENDING} and now_us - one.since_us >= self._patience_us:
                self._lose_patience(one, now_us)
        for one in self._ready():
            if now_us >= self._due_us(one):
                self._flags.begin(one.number, one.expected.action.operator.name, one.expected.action.objects, now_us)
                self._watched.add(one.monitors, now_us)
                one.phase, one.since_us = StepPhase.CHECKING, now_us
        return effects

    def on_state(self, valid_us: int, now_us: int) -> list[MissionEffect]:
        """Progress the monitors through a state that the beliefs have taken."""
        if self.fault is not None or (self._state_us is not None and valid_us <= self._state_us):
            return []
        self._state_us = valid_us
        self._watched.on_state(valid_us)
        effects: list[MissionEffect] = [
            MissionNote("violated", f"{one.about}: {one.kind}: {one.text}", one.step or None)
            for one in self._watched.violated
        ]
        for blind, lacking in self._watched.newly_blind(valid_us, self._patience_us):
            text = f"{blind.about}: {blind.kind} is not monitored: no value of {', '.join(lacking)}"
            effects.append(MissionNote("blind", text, blind.step or None))
        if self._watched.violated:
            self._violated(valid_us)
            return effects
        for one in self.steps.values():
            if valid_us < one.since_us:
                continue
            if one.phase is StepPhase.CHECKING and not self._watched.awaited(one.number):
                effects += self._started(one, now_us)
            elif one.phase is StepPhase.ENDING and not self._watched.unsettled(one.number):
                self._watched.remove(one.number, outliving=False)
                one.phase, one.since_us = StepPhase.DONE, now_us
        return effects + self.on_time(now_us)

    def on_ended(self, event: ActionEnded, now_us: int) -> list[MissionEffect]:
        """The unit has ended an action; events about others are ignored."""
        one = self.steps.get(event.step)
        if self.fault is not None or one is None or one.phase is not StepPhase.RUNNING:
            return []
        self._flags.end(one.number, now_us)
        self._take_effect(one, now_us, ended=False)
        if not event.succeeded:
            text = f"{one.shown} failed: {event.reason or 'no reason is given'}"
            self.fault = self._fault("failed", one, text, now_us)
            one.phase = StepPhase.ABORTED
            return [MissionNote("failed", text, one.number)]
        self._take_effect(one, now_us, ended=True)
        self._beliefs.change(now_us, event.seen.items())
        one.phase, one.since_us = StepPhase.ENDING, now_us
        return [MissionNote("ended", one.shown, one.number)]

    def abort(self, reason: str, now_us: int) -> list[MissionEffect]:
        """Leave the plan: flags are cleared, commands that are out are taken back."""
        effects: list[MissionEffect] = []
        for one in self.steps.values():
            if one.phase is StepPhase.RUNNING:
                self._take_effect(one, now_us, ended=False)
                effects.append(AbortAction(one.number, one.unit, reason))
            if one.phase is not StepPhase.DONE:
                self._flags.end(one.number, now_us)
                one.phase, one.since_us = StepPhase.ABORTED, now_us
        return effects

    def _started(self, one: PlanStep, now_us: int) -> list[MissionEffect]:
        """The command, after the state that has shown the conditions; its effects are those in this state."""
        action = one.expected.action
        one.phase, one.since_us = StepPhase.RUNNING, now_us
        values = self._schemas.task.values | self._beliefs.values()
        one.changes = list(changes_of(one.expected.instance, values, 0, action.end_ms - action.start_ms))
        located = bound_labels(action.operator.located, action.bound)
        start = StartAction(one.number, one.unit, action, located, values if located else {})
        return [MissionNote("started", one.shown, one.number), start]

    def _take_effect(self, one: PlanStep, now_us: int, *, ended: bool) -> None:
        """Effects that count from the start when their time has come; all of them at the end."""
        due = [
            each for each in one.changes if ended or (not each.at_end and now_us >= one.since_us + each.at_ms * 1000)
        ]
        if due:
            one.changes = [each for each in one.changes if each not in due]
            self._beliefs.change(now_us, ((each.label, each.value) for each in due))

    def _ready(self) -> Iterator[PlanStep]:
        """Steps that wait for nothing but their time."""
        return (one for one in self.steps.values() if one.phase is StepPhase.WAITING and self._depends_on_nothing(one))

    def _due_us(self, one: PlanStep) -> int:
        return self._begun_us + (one.expected.action.start_ms * 1000 if self._schemas.task.events else 0)

    def _depends_on_nothing(self, one: PlanStep) -> bool:
        begun = {StepPhase.RUNNING, StepPhase.ENDING, StepPhase.DONE}
        return all(self.steps[each].phase is StepPhase.DONE for each in one.expected.after_ends) and all(
            self.steps[each].phase in begun for each in one.expected.after_starts
        )

    def _violated(self, at_us: int) -> None:
        """The fault of the newest state's violation: a monitor with a recovery goes first, then a current action's."""
        first = min(self._watched.violated, key=lambda one: (one.recovery is None, _RANKS.get(one.kind, 0)))
        name = first.about if first.kind == "global" else f"{first.kind} of {first.about}"
        text = f"{first.kind} of {first.about} is violated: {first.text}"
        self.fault = ExecutionFault("violated", name, text, first.step, at_us, first.recovery, first.bound)

    def _lose_patience(self, one: PlanStep, now_us: int) -> None:
        lacking = self._watched.awaited(one.number) or self._watched.unsettled(one.number)
        what = f"no value of {', '.join(lacking)}" if lacking else "no state"
        text = f"{one.shown}: {what} for {self._patience_us / 1e6:g} s"
        self.fault = self._fault("unknown", one, text, now_us)

    def _fault(self, kind: str, one: PlanStep, text: str, at_us: int) -> ExecutionFault:
        operator, bound = one.expected.action.operator, parameters_of(one.expected)
        return ExecutionFault(kind, one.shown, text, one.number, at_us, operator.recovery, bound)
