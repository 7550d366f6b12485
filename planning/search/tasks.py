"""A domain and a problem together: objects by type, features, and the initial state."""

from typing import Any

from dyknow.model.sample import Value
from dyknow.model.values import NO_VALUE
from dyknow.planning.domains import model
from dyknow.planning.domains.model import Application, Declarations, Expression
from dyknow.planning.domains.types import Types
from dyknow.reasoning.formulas import tree
from dyknow.reasoning.formulas.tree import label_text


class PlanningTask:
    """A domain with a problem.

    Attributes:
        values: of every label that was met, in the state that is looked at; the initial one at first.
        fluents: features that operators or later observations change, or that are sensed; the others are constants.
        events: observations after the initial state: (milliseconds, label, value), in order of time.
    """

    def __init__(self, found: Declarations) -> None:
        self.declared = found
        self.types = Types(found)
        self.features = {one.name: one for one in found.features}
        self.derived = {one.name: one for one in found.derived}
        self.constants: dict[str, Any] = dict(model.CONSTANTS)
        for constant in found.constants:
            self.constants[constant.name] = self.constant(constant.value)
        written = {each.target.name for one in found.operators for each in one.effects}
        self._changed = written | {one.target.name for one in found.init if one.at_ms > 0}
        self.fluents = self._changed | {one.name for one in found.sensed}
        self.values: dict[str, Value] = {}
        events = []
        for one in found.init:
            label = label_text(one.target.name, tuple(str(self.constant(arg)) for arg in one.target.args))
            if one.at_ms > 0:
                events.append((one.at_ms, label, self.constant(one.value)))
            else:
                self.values[label] = self.constant(one.value)
        for _, label, _ in events:
            self.value_of(self.features[label.partition("[")[0]], label)
        self.events = tuple(sorted(events, key=lambda event: event[0]))

    def value_of(self, feature: model.FeatureDeclaration, label: str) -> Value | None:
        """The value of a label, from its default if it is met for the first time; None if there is none."""
        value = self.values.get(label)
        if value is None:
            if feature.default is not None:
                value = self.values[label] = self.constant(feature.default)
            elif feature.sort == model.BOOLEAN:
                value = self.values[label] = False
        return value

    def default_of(self, label: str) -> Value:
        """The value of a label without an initial one: its default, false of a boolean that operators change, or no value."""
        name = label.partition("[")[0]
        feature = self.features.get(name)
        if feature is None or (feature.default is None and name not in self._changed):
            return NO_VALUE
        value = self.value_of(feature, label)
        return NO_VALUE if value is None else value

    def constant(self, expression: Expression) -> Any:
        """The value of an expression of constants, numbers and objects; None if it is none."""
        match expression:
            case tree.Const(value):
                return value
            case tree.Duration(us):
                return us / 1000
            case tree.Negate(operand):
                inside = self.constant(operand)
                return None if inside is None else -inside
            case tree.Arithmetic(sign, left, right):
                return calculated(sign, self.constant(left), self.constant(right))
            case Application(name, ()):
                return self.constants.get(name, name)
        return None


def calculated(sign: str, left: Any, right: Any) -> Any:
    """The result of + - * / on two numbers; None if there is none."""
    if isinstance(left, str | bool) or isinstance(right, str | bool) or left is None or right is None:
        return None
    if sign == "/":
        return left / right if right else None
    return left + right if sign == "+" else left - right if sign == "-" else left * right
