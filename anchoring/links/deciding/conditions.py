"""The conditions of a link specification, ready to be evaluated over states of two objects, and their context."""

from collections.abc import Callable
from math import inf
from typing import Final, NamedTuple, TypeAlias

from dyknow import NO_VALUE, Label, Value
from dyknow.anchoring.links.deciding.context import ALONE, DOMAIN, ConditionContext, read_state
from dyknow.anchoring.links.deciding.gating import gate_of
from dyknow.anchoring.links.prediction import ObjectPrediction
from dyknow.anchoring.links.specification import ALWAYS_TRUE, DISTANCES, FROM, THRESHOLD, TO, LinkSpecification
from dyknow.anchoring.links.states import ObjectState
from dyknow.reasoning import Progressing, make_progression, required_labels
from dyknow.reasoning.formulas.tree import Exists, Forall, Formula, event_labels, walk

Reading: TypeAlias = Callable[[ObjectState, ObjectPrediction | None], Value]
"""The value of one label: of the state of `from` and the whereabouts of `to`, None where there is no `to`."""
Thresh: TypeAlias = Callable[[ObjectState, ObjectPrediction], float]
"""The value of `thresh` for a state of `from` and the whereabouts of `to`."""


class Ends(NamedTuple):
    """The symbols of both objects; empty: there is no `to`."""

    source: str
    target: str = ""

    def named(self, label: Label) -> Label | None:
        """The label with the symbols put in; None: it speaks of an object that is not there."""
        names = {FROM: self.source, TO: self.target}
        objects = tuple(names.get(one, one) for one in label.objects)
        return label._replace(objects=objects) if all(objects) else None


NO_ENDS: Final = Ends("")


class PairCondition:
    """One formula over `from` and `to`.

    Args:
        name: another name of `from`.
        context: the other objects, and the streams that it may speak of.
        thresh: its value, unless the specification gives it.

    Attributes:
        is_trivial: it is true whatever happens.
    """

    def __init__(
        self,
        formula: Formula,
        specification: LinkSpecification,
        name: str = FROM,
        context: ConditionContext = ALONE,
        thresh: Thresh | None = None,
    ) -> None:
        self.formula = formula
        self._first = make_progression(formula, way="object")
        self.is_trivial = formula == ALWAYS_TRUE
        self.gate = gate_of(formula, specification.threshold.most_m)
        self._specification, self._name, self._context, self._thresh = specification, name, context, thresh
        quantified = [node.domain for node in walk(formula) if isinstance(node, Forall | Exists)]
        self._domains = {one for each in quantified for one in (each.base, *each.minus) if isinstance(one, str)}
        self._is_wide = bool(quantified)
        self._labels = () if quantified else required_labels(formula)
        self._events = () if quantified else event_labels(formula)
        self._readings: dict[str, Reading] = {}
        self._around: dict[str, Label] = {}
        for label in self._labels:
            self._know(label)
        self._far = {label: inf for label in self._labels if _is_distance(Label.parse(label))}

    def start(self) -> Progressing:
        """A new evaluation, before its first state."""
        return self._first.again()

    def step(
        self,
        evaluation: Progressing,
        valid_us: int,
        state: ObjectState,
        other: ObjectPrediction | None = None,
        ends: Ends = NO_ENDS,
    ) -> None:
        """Progress an evaluation through one state of `from`, and of `to` if there is one."""
        if not (self._is_wide or self._events):
            evaluation.progress(valid_us, self.values(state, other, ends))
            return
        domains = {name: self._members(name, ends) for name in self._domains}
        labels = required_labels(self.formula, domains) if self._is_wide else self._labels
        events = event_labels(self.formula, domains) if self._is_wide else self._events
        values = {label: self._value(label, state, other, ends) for label in labels}
        after_us = evaluation.valid_us
        happened = [label for label in events if self._has_occurred(label, ends, after_us, valid_us)]
        evaluation.progress(valid_us, values, domains, happened)

    def values(
        self, state: ObjectState, other: ObjectPrediction | None = None, ends: Ends = NO_ENDS
    ) -> dict[str, Value]:
        """The values of the formula's labels, from the state of `from`, that of `to` if any, and the context."""
        if not self._around:
            return {label: read(state, other) for label, read in self._readings.items()}
        return {label: self._value(label, state, other, ends) for label in self._labels}

    def pass_by(self, evaluation: Progressing, valid_us: int) -> None:
        """Progress it through a state in which both are farther apart than the gate allows."""
        domains = {name: self._context.members(name) for name in self._domains}
        evaluation.progress(valid_us, self._far, domains)

    def _value(self, text: str, state: ObjectState, other: ObjectPrediction | None, ends: Ends) -> Value:
        if text not in self._readings and text not in self._around:
            self._know(text)
        read = self._readings.get(text)
        if read is not None:
            return read(state, other)
        label = ends.named(self._around[text])
        return NO_VALUE if label is None else self._context.value(label, state.valid_us)

    def _know(self, text: str) -> None:
        """Find out where a label is read from."""
        label = Label.parse(text)
        read = self._reading(label)
        if read is None:
            self._around[text] = label
        else:
            self._readings[text] = read

    def _reading(self, label: Label) -> Reading | None:
        """The value from the states of both ends; None: it is read from the context."""
        specification = self._specification
        if _is_distance(label):
            return lambda state, other: NO_VALUE if other is None else state.distance_m(other.nearest(state))
        if label.feature == THRESHOLD and label.objects in {(), (TO,)}:
            threshold, thresh = specification.threshold, self._thresh
            if thresh is not None:
                return lambda state, other: NO_VALUE if other is None else thresh(state, other)
            return lambda _state, other: NO_VALUE if other is None else threshold.of(other.likely)
        if label.objects not in {(FROM,), (self._name,), (TO,)} or label.feature in specification.streams:
            return None
        feature, name = specification.features.get(label.feature), label.feature.rpartition(".")[2]
        read = feature or (lambda state: read_state(name, state))
        if label.objects == (TO,):
            return lambda _state, other: NO_VALUE if other is None else read(other.likely)
        return lambda state, _other: read(state)

    def _members(self, domain: str, ends: Ends) -> tuple[str, ...]:
        """The objects of a domain; both ends by their names in the formula."""
        specification, type_ = self._specification, domain.removesuffix(DOMAIN)
        called = {ends.target: TO} if ends.target and type_ == specification.target else {}
        if type_ == specification.source:
            called[ends.source] = FROM
        return tuple(called.get(one, one) for one in self._context.members(domain))

    def _has_occurred(self, text: str, ends: Ends, after_us: int | None, valid_us: int) -> bool:
        label = ends.named(Label.parse(text))
        return label is not None and self._context.has_occurred(label, after_us, valid_us)


def _is_distance(label: Label) -> bool:
    return label.feature in DISTANCES and sorted(label.objects) == [FROM, TO]
