"""Plans: actions with times, what they cost, and how they are shown."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from dyknow.model.sample import Value
from dyknow.planning.domains.model import Application, Operator
from dyknow.reasoning.formulas.tree import label_text


@dataclass(frozen=True, slots=True)
class PlannedAction:
    """One action of a plan.

    Attributes:
        unit: the unit that does it; without units the first object.
        objects: for the operator's parameters over objects, in their order.
        values: of its parameters over numbers, at the start.
    """

    start_ms: int
    end_ms: int
    unit: str
    shown: str
    operator: Operator
    objects: tuple[str, ...]
    values: tuple[tuple[str, Value], ...]
    cost: float

    @property
    def bound(self) -> dict[str, Value]:
        """The parameters by name."""
        numbers, objects = dict(self.values), iter(self.objects)
        names = [one.name for one in self.operator.parameters]
        return {name: numbers[name] if name in numbers else next(objects) for name in names}

    def as_json(self) -> dict[str, Any]:
        record: dict[str, Any] = {
            "start_s": self.start_ms / 1000,
            "end_s": self.end_ms / 1000,
            "unit": self.unit,
            "action": self.shown,
        }
        if self.values:
            record["values"] = dict(self.values)
        return record


@dataclass(frozen=True, slots=True)
class MissionPlan:
    """Actions in the order of their starts; `unreached` are goals with a weight that it does not reach, `cost` has their weights."""

    actions: tuple[PlannedAction, ...]
    cost: float
    unreached: tuple[str, ...] = ()

    @property
    def end_ms(self) -> int:
        return max((one.end_ms for one in self.actions), default=0)

    def as_json(self) -> Mapping[str, Any]:
        found: dict[str, Any] = {"plan": [one.as_json() for one in self.actions], "cost": self.cost}
        return found | {"unreached": list(self.unreached)} if self.unreached else found

    def as_record(self) -> dict[str, Any]:
        """All of it as plain values, for `plan_of`."""
        rows = [
            [
                one.start_ms, one.end_ms, one.unit, one.shown, one.operator.name, list(one.objects),
                [list(pair) for pair in one.values], one.cost,
            ]
            for one in self.actions
        ]  # fmt: skip
        return {"actions": rows, "cost": self.cost, "unreached": list(self.unreached)}

    def lines(self) -> tuple[str, ...]:
        """One line for each action: start, end, action."""
        return tuple(f"{one.start_ms / 1000:9.1f} s {one.end_ms / 1000:9.1f} s  {one.shown}" for one in self.actions)


def bound_labels(terms: Iterable[Application], bound: Mapping[str, Value]) -> tuple[str, ...]:
    """Labels of features of bound objects."""
    return tuple(label_text(one.name, tuple(str(bound.get(arg.name, arg.name)) for arg in one.args)) for one in terms)


def plan_of(record: Mapping[str, Any], operators: Iterable[Operator]) -> MissionPlan:
    """The plan that `as_record` made the record from."""
    named = {one.name: one for one in operators}
    actions = tuple(
        PlannedAction(
            start_ms,
            end_ms,
            unit,
            shown,
            named[name],
            tuple(objects),
            tuple((each, value) for each, value in values),
            cost,
        )
        for start_ms, end_ms, unit, shown, name, objects, values, cost in record["actions"]
    )
    return MissionPlan(actions, record["cost"], tuple(record["unreached"]))
