"""The monitors of a plan (thesis 7.6, 7.7): the conditions of domain and plan during execution, as formulas.

EXEC is the flag of the action, phi the condition; only conditions that are flagged `monitored` give one:

* precondition: `phi`, at the start;
* prevail condition: `(EXEC and phi) until not EXEC`;
* effect: `EXEC until (not EXEC and phi)`; `EXEC until phi` if the action itself changes it again before its end;
* duration: `EXEC until [0, longest] not EXEC`;
* causal link from one action to the last one that needs its effect: `EXEC1 until (phi until EXEC2)`; if actions between
  may undo it for a time `d`, `EXEC1 until (phi and ((not EXEC2 and eventually [0, d] phi) until (EXEC2 and phi)))`.

A formula begins with the first state in which the flag of its action is set. Until is that of thesis 7.5.1: the left side
holds from that state on, in the state of the right side no longer. The thesis' other form for effects,
`EXEC until (phi until not EXEC)`, is not used: in the state that ends the action its right side holds whatever phi is.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple, TypeAlias

from dyknow.kpl.syntax.printing import print_formula
from dyknow.model.sample import Value
from dyknow.planning.domains import model
from dyknow.planning.domains.model import Application, Declarations, Expression
from dyknow.planning.domains.sorts import free_variables
from dyknow.planning.execution.formulas import ConditionWriter, executing
from dyknow.planning.execution.links import CausalLink, causal_links
from dyknow.planning.execution.timeline import ExpectedAction, Schemas, expected_actions
from dyknow.planning.search.compiling import labels_of
from dyknow.planning.search.control import closed
from dyknow.planning.search.grounding import FALSE, TRUE
from dyknow.planning.search.plans import MissionPlan
from dyknow.reasoning.formulas import tree

MonitorKind: TypeAlias = Literal["global", "precondition", "prevail", "effect", "duration", "link", "operator"]
_ENDS_WITH_ACTION = frozenset({"precondition", "prevail", "effect", "duration"})


@dataclass(frozen=True, slots=True)
class PlanMonitor:
    """A formula that is monitored from the start of an action on, or of the plan.

    Attributes:
        step: number of the action, from 1 on; 0 is the whole plan.
        about: its origin, for messages.
        recovery: the recovery operator for a violation, if the domain names one.
        bound: objects and numbers by the names that the recovery may use.
    """

    step: int
    kind: MonitorKind
    about: str
    formula: tree.Formula = field(repr=False)
    recovery: str | None = None
    bound: Mapping[str, Value] = field(default_factory=dict)

    @property
    def text(self) -> str:
        return print_formula(self.formula)

    @property
    def labels(self) -> frozenset[str]:
        return labels_of(self.formula)

    @property
    def outlives(self) -> bool:
        """Whether it may be undecided when its action has ended (thesis 7.6.2)."""
        return self.kind not in _ENDS_WITH_ACTION

    def as_json(self) -> dict[str, Any]:
        record = {"step": self.step, "kind": self.kind, "about": self.about, "formula": self.text}
        return record | ({"recovery": self.recovery} if self.recovery else {})


def plan_monitors(declared: Declarations, plan: MissionPlan) -> tuple[PlanMonitor, ...]:
    """The monitors that a plan is executed with: global ones first, then those of each action.

    Args:
        declared: the domain with the problem.
        plan: a plan for it.

    Raises:
        TextError: a condition has no formula.
    """
    return monitors_of(declared, expected_actions(Schemas(declared), plan))


class UnmonitoredCondition(NamedTuple):
    """A condition that is flagged `monitored`, and gives no monitor: all its features are given, and nothing changes
    them.

    Attributes:
        about: the operator; of a global monitor its name.
    """

    place: tree.Place
    about: str
    features: tuple[str, ...]


def unmonitored(declared: Declarations, plan: MissionPlan) -> tuple[UnmonitoredCondition, ...]:
    """The conditions of the actions of a plan, and the global monitors, that are flagged in vain, each once."""
    writer = ConditionWriter(declared)
    found: list[UnmonitoredCondition] = []
    for action in expected_actions(Schemas(declared), plan):
        found += _Generation(writer, action).lost()
    made = {one.about.partition("(")[0] for one in _global(declared, writer)}
    for monitor in declared.monitors:
        if monitor.name not in made:
            found.append(UnmonitoredCondition(monitor.place, monitor.name or "a monitor", _features(monitor.formula)))
    return tuple({each.place: each for each in found}.values())


def _features(formula: Expression) -> tuple[str, ...]:
    return tuple(dict.fromkeys(one.name for one in tree.walk(formula) if isinstance(one, Application) and one.args))


def monitors_of(declared: Declarations, actions: tuple[ExpectedAction, ...]) -> tuple[PlanMonitor, ...]:
    """The same, of actions that have been looked at."""
    writer = ConditionWriter(declared)
    found = list(_global(declared, writer))
    links = causal_links(actions, declared)
    found += [_link(writer, one) for one in links if one.producer is None]
    for action in actions:
        found += _Generation(writer, action).monitors()
        found += [_link(writer, one) for one in links if one.producer is action]
    return tuple(found)


def _global(declared: Declarations, writer: ConditionWriter) -> Iterator[PlanMonitor]:
    """One monitor for each combination of objects of a global formula."""
    for monitor in declared.monitors:
        formula = closed(monitor.formula, free_variables(monitor.formula, declared))
        for part, env, is_always in writer.instances(formula):
            ground = writer.written(part, env, {})
            if ground != TRUE:
                bound = {name: one.value for name, one in env.items() if isinstance(one, tree.Const)}
                shown = f"{monitor.name}({', '.join(map(str, bound.values()))})" if bound else monitor.name
                whole = tree.Always(ground) if is_always else ground
                yield PlanMonitor(0, "global", shown, whole, monitor.recovery, bound)


def _link(writer: ConditionWriter, link: CausalLink) -> PlanMonitor:
    """The monitor of a causal link; from the initial state its first part is left out."""
    holds = writer.equals(link.feature, link.value)
    used = link.consumer_flag
    until_used: tree.Formula = tree.Until(holds, used)
    if link.disturbed_us is not None:
        between = tree.And((tree.Not(used), tree.Eventually(holds, 0, link.disturbed_us)))
        until_used = tree.And((holds, tree.Until(between, tree.And((used, holds)))))
    about = f"{link.feature.label} until {link.consumer.action.shown}"
    if link.producer is None:
        return PlanMonitor(0, "link", about, until_used)
    operator = link.producer.action.operator
    formula = tree.Until(link.producer_flag, until_used)
    return PlanMonitor(link.producer.number, "link", about, formula, operator.recovery, parameters_of(link.producer))


def parameters_of(one: ExpectedAction) -> dict[str, Value]:
    """The parameters of an action by name."""
    return one.action.bound


class _Generation:
    """The monitors of one action."""

    def __init__(self, writer: ConditionWriter, action: ExpectedAction) -> None:
        self._writer, self._action = writer, action
        self._operator = action.action.operator
        self._numbers = dict(action.action.values)
        self._bound = parameters_of(action)
        objects = {name: value for name, value in self._bound.items() if name not in self._numbers}
        self._env = {name: writer.grounder.object(str(value)) for name, value in objects.items()}
        self._exec = executing(self._operator, action.action.objects)

    def monitors(self) -> Iterator[PlanMonitor]:
        flag, ended = self._exec, tree.Not(self._exec)
        for condition in self._operator.preconditions:
            if condition.monitored:
                yield from self._made("precondition", self._written(condition.formula))
        for condition in self._operator.prevail:
            if condition.monitored and (holds := self._written(condition.formula)) != TRUE:
                yield from self._made("prevail", tree.Until(tree.And((flag, holds)), ended))
        for effect in self._operator.effects:
            if effect.monitored:
                yield from self._effects(effect)
        timing = self._operator.timeconstraint
        if timing is not None and timing.monitored and timing.longest is not None:
            longest_ms = self._writer.number(timing.longest, self._env, self._numbers, self._action.before)
            if isinstance(longest_ms, int | float):
                yield from self._made("duration", tree.Until(flag, ended, 0, max(0, round(longest_ms * 1000))))
        for monitor in self._operator.monitors:
            formula = self._writer.written(monitor.formula, self._env, self._numbers, flag)
            yield from self._made("operator", formula, monitor.recovery)

    def lost(self) -> Iterator[UnmonitoredCondition]:
        """Its flagged conditions that give no monitor."""
        for condition in (*self._operator.preconditions, *self._operator.prevail):
            if condition.monitored and self._written(condition.formula) == TRUE:
                yield UnmonitoredCondition(condition.place, self._operator.name, _features(condition.formula))

    def _effects(self, effect: model.Effect) -> Iterator[PlanMonitor]:
        """One monitor for each feature that a flagged effect changes; its condition counts in the first state."""
        writer = self._writer
        for env in writer.grounder.bindings(effect.variables, self._env):
            feature = writer.feature(model.substitute(effect.target, {}), env)
            value = writer.number(effect.value, env, self._numbers, self._action.before)
            formula = self._effect_form(effect, feature, writer.equals(feature, value))
            if effect.condition is not None:
                condition = writer.written(effect.condition, env, self._numbers)
                if condition == FALSE:
                    continue
                formula = formula if condition == TRUE else tree.Implies(condition, formula)
            yield from self._made("effect", formula)

    def _effect_form(self, effect: model.Effect, feature: tree.Feature, holds: tree.Formula) -> tree.Formula:
        action = self._action
        start_ms, end_ms = action.action.start_ms, action.action.end_ms
        at_ms = start_ms + max(1, effect.offset_ms) if effect.anchor == "start" else end_ms + effect.offset_ms
        if any(one.at_ms > at_ms for one in action.changes if one.label == feature.label):
            return tree.Until(self._exec, holds)
        return tree.Until(self._exec, tree.And((tree.Not(self._exec), holds)))

    def _written(self, formula: Expression) -> tree.Formula:
        return self._writer.written(formula, self._env, self._numbers)

    def _made(self, kind: MonitorKind, formula: tree.Formula, recovery: str | None = None) -> Iterator[PlanMonitor]:
        if formula != TRUE:
            about = self._action.action.shown
            yield PlanMonitor(
                self._action.number, kind, about, formula, recovery or self._operator.recovery, self._bound
            )
