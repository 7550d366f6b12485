"""Recorded states as JSON lines, and formulas checked over them.

One state a line: `{"t_ms": 100, "p": true, "speed[uav1]": 31.2}`; an absent or null feature has no value. A line with
`message` is an event and belongs to the first state at or after its time; a line with `domains` only names the members
of domains: `{"domains": {"uavs": ["uav1"]}}`. Reading is pure: lines in, states out.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, TypeAlias

from dyknow.errors import TextError
from dyknow.instants import US_PER_MS
from dyknow.labels import Label
from dyknow.sample import Value
from dyknow.values import NO_VALUE
from reasoning.engine import Progressing, make_progression
from reasoning.evaluation import NoValuePolicy
from reasoning.formulas import Domains, Exists, Feature, Forall, Formula, Variable, walk
from reasoning.json_lines import JsonLine
from reasoning.progression import Verdict


class TraceState(NamedTuple):
    """One state: its time, values by label, and the labels of messages since the state before."""

    valid_us: int
    values: Mapping[str, Value]
    events: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Trace:
    """States in the order of time; `domains` as the trace states them."""

    states: tuple[TraceState, ...]
    domains: Domains = field(default_factory=dict)

    @property
    def labels(self) -> tuple[str, ...]:
        """Every label that occurs."""
        return tuple(sorted({label for state in self.states for label in state.values}))


Outcome: TypeAlias = tuple[Verdict, float | None, int | None]
"""(verdict, t_ms, index): the first state that decided the formula; None while it is undecided."""


def check_trace(
    formula: Formula,
    states: Sequence[TraceState],
    domains: Domains | None = None,
    no_value: NoValuePolicy = "undecided",
    period_us: int | None = None,
) -> Outcome:
    """Progress a checked formula through the states until it is decided."""
    return follow_trace(formula, states, domains, no_value, period_us)[0]


def follow_trace(
    formula: Formula,
    states: Sequence[TraceState],
    domains: Domains | None = None,
    no_value: NoValuePolicy = "undecided",
    period_us: int | None = None,
) -> tuple[Outcome, Progressing]:
    """As `check_trace`, and the formula as the states leave it, which can tell why it was decided and what is left."""
    progression = make_progression(formula, period_us, no_value)
    for index, state in enumerate(states):
        progression.progress(state.valid_us, state.values, domains, state.events)
        if progression.verdict != "undecided":
            t_ms = state.valid_us / US_PER_MS
            return (progression.verdict, int(t_ms) if t_ms == int(t_ms) else t_ms, index), progression
    return ("undecided", None, None), progression


def trace_domains(formula: Formula, trace: Trace) -> dict[str, tuple[str, ...]]:
    """Members of the domains the formula names: as the trace states them, else every object that stands in it where
    the formula puts the variable.
    """
    found: dict[str, tuple[str, ...]] = {name: tuple(members) for name, members in trace.domains.items()}
    labels = [Label.parse(label) for label in trace.labels]
    for node in walk(formula):
        if isinstance(node, Forall | Exists):
            named = [one for one in (node.domain.base, *node.domain.minus) if isinstance(one, str)]
            members = _standing(node, labels)
            for name in named:
                if name not in trace.domains:
                    found[name] = tuple(sorted({*found.get(name, ()), *members}))
    return found


def _standing(quantifier: Forall | Exists, labels: list[Label]) -> set[str]:
    places = {
        (node.name if node.attribute is None else f"{node.name}.{node.attribute}", at)
        for node in walk(quantifier.body)
        if isinstance(node, Feature)
        for at, one in enumerate(node.objects)
        if isinstance(one, Variable) and one.name == quantifier.variable
    }
    return {one for label in labels for at, one in enumerate(label.objects) if (label.feature, at) in places}


def read_trace(lines: Iterable[str], file: str = "") -> Trace:
    """States from JSON lines; blank lines are skipped.

    Raises:
        TextError: with the line and the repair, at the first line that is no state.
    """
    states: list[TraceState] = []
    domains: dict[str, tuple[str, ...]] = {}
    events: list[tuple[int, str]] = []
    for number, line in enumerate(lines, 1):
        if not line.strip():
            continue
        reader = _Line(line, number, file)
        if "t_ms" not in reader.record and "domains" in reader.record:
            domains.update(reader.domains())
            continue
        valid_us = reader.valid_us()
        if "message" in reader.record:
            events.append((valid_us, reader.message()))
            continue
        if states and valid_us <= states[-1].valid_us:
            raise reader.error(
                "this state is not later than the one before", "sort the lines by t_ms, one state a time"
            )
        due = tuple(label for at_us, label in events if at_us <= valid_us)
        events = [event for event in events if event[0] > valid_us]
        states.append(TraceState(valid_us, reader.values(), due))
    return Trace(tuple(states), domains)


class _Line(JsonLine):
    """One line, checked."""

    def __init__(self, line: str, number: int, file: str) -> None:
        super().__init__(line, number, file, "a state", '{"t_ms": 100, "p": true}')

    def valid_us(self) -> int:
        return round(self.time_ms() * US_PER_MS)

    def message(self) -> str:
        return self._label(self.record["message"])

    def domains(self) -> dict[str, tuple[str, ...]]:
        found = self.record["domains"]
        if not isinstance(found, dict) or not all(isinstance(members, list) for members in found.values()):
            raise self.error("domains are lists of objects by name", '{"domains": {"uavs": ["uav1", "uav2"]}}')
        return {name: tuple(str(one) for one in members) for name, members in found.items()}

    def values(self) -> dict[str, Value]:
        return {self._label(key): self._value(key, value) for key, value in self.record.items() if key != "t_ms"}

    def _label(self, text: Any) -> str:
        if not isinstance(text, str):
            raise self.error("a message is a label", '{"t_ms": 100, "message": "landed[uav1]"}')
        try:
            return str(Label.parse(text))
        except TextError as error:
            raise self.error(error.message, '"speed[uav1]": 31.2') from None

    def _value(self, key: str, value: Any) -> Value:
        if value is None:
            return NO_VALUE
        if isinstance(value, list | dict):
            raise self.error(f"{key} is neither a number, a truth value, nor a text", '"speed[uav1]": 31.2')
        return value
