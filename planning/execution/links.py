"""Causal links of a plan (thesis 7.7): an effect of one action that another one needs, and that none between changes."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from dyknow.model.sample import Value
from dyknow.planning.domains.model import Application, Declarations, Expression
from dyknow.planning.execution.formulas import executing
from dyknow.planning.execution.timeline import ExpectedAction
from dyknow.reasoning.formulas import tree


@dataclass(frozen=True, slots=True)
class CausalLink:
    """A feature keeps its value from the end of the producer, None is the initial state, to the start of the consumer.

    Attributes:
        disturbed_us: how long actions between may undo it.
    """

    producer: ExpectedAction | None
    consumer: ExpectedAction
    feature: tree.Feature
    value: Value
    disturbed_us: int | None
    is_numbered: bool

    @property
    def producer_flag(self) -> tree.Feature:
        assert self.producer is not None  # noqa: S101 - the initial state has no flag
        return executing(self.producer.action.operator, self.producer.action.objects)

    @property
    def consumer_flag(self) -> tree.Feature:
        """The flag of the consumer, with its number if an action before it in the plan has the same flag."""
        flag = executing(self.consumer.action.operator, self.consumer.action.objects)
        return tree.Feature(flag.name, (*flag.objects, str(self.consumer.number))) if self.is_numbered else flag


def causal_links(actions: tuple[ExpectedAction, ...], declared: Declarations) -> tuple[CausalLink, ...]:
    """For each monitored effect the link to the last action that needs it before the feature changes again.

    That link implies those to the actions before. A value of the initial state that a monitored effect could have made,
    and that is more than false, is linked in the same way: it is what an earlier plan has left.
    """
    monitored: dict[str, list[Expression]] = {}
    for each in (effect for one in declared.operators for effect in one.effects if effect.monitored):
        monitored.setdefault(each.target.name, []).append(each.value)
    disturbed = {one.name: one.disturbed_us for one in declared.features}
    found = []
    for producer, label, value in _produced(actions, monitored):
        consumer = _last_consumer(actions, producer, label)
        if consumer is None:
            continue
        name, _, rest = label.partition("[")
        feature = tree.Feature(name, tuple(rest.rstrip("]").split(", ")) if rest else ())
        between = actions[_position(actions, producer) : _position(actions, consumer) - 1]
        is_numbered = any(one.action.shown == consumer.action.shown for one in between)
        found.append(CausalLink(producer, consumer, feature, value, disturbed.get(name), is_numbered))
    return tuple(found)


def _produced(
    actions: tuple[ExpectedAction, ...], monitored: Mapping[str, list[Expression]]
) -> Iterator[tuple[ExpectedAction | None, str, Value]]:
    """Monitored features with the values that they have initially, and that actions give them in the end."""
    if actions:
        for label, value in actions[0].before.items():
            values = monitored.get(label.partition("[")[0], ())
            if value is not False and any(_could_be(one, value) for one in values):
                yield None, label, value
    for one in actions:
        flagged = {each.target.name for each in one.action.operator.effects if each.monitored}
        last = {each.label: each.value for each in one.changes}
        yield from ((one, label, value) for label, value in last.items() if label.partition("[")[0] in flagged)


def _could_be(expression: Expression, value: Value) -> bool:
    """Whether an effect with this value may have made it."""
    match expression:
        case tree.Const(number):
            return bool(number == value)
        case Application(name, ()) if isinstance(value, str):
            return name == value
    return not isinstance(value, bool)


def _last_consumer(
    actions: tuple[ExpectedAction, ...], producer: ExpectedAction | None, label: str
) -> ExpectedAction | None:
    """The last action that reads the label before one changes it; an action that changes it reads it first."""
    found, end_ms = None, 0 if producer is None else producer.action.end_ms
    for one in actions[_position(actions, producer) :]:
        if label in one.instance.reads and one.action.start_ms >= end_ms:
            found = one
        if label in one.written:
            return found
    return found


def _position(actions: tuple[ExpectedAction, ...], one: ExpectedAction | None) -> int:
    """How many actions there are up to this one."""
    return 0 if one is None else one.number - actions[0].number + 1
