"""Recorded states as JSON lines, and formulas checked over them.

One state a line: `{"t_ms": 100, "p": true, "speed[uav1]": 31.2}`; an absent or null feature has no value. A line with
`message` is an event and belongs to the first state at or after its time; a line with `domains` only names the members
of domains from there on: `{"domains": {"uavs": ["uav1"]}}`. States that go back in time, and values that are no numbers,
are left out and counted. Reading is pure: lines in, states out.
"""

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, TypeAlias

from dyknow.documents.json_lines import JsonLine
from dyknow.model.errors import TextError
from dyknow.model.instants import US_PER_MS
from dyknow.model.labels import Label
from dyknow.model.sample import Value
from dyknow.model.values import NO_VALUE
from dyknow.reasoning.formulas.evaluation import NoValuePolicy
from dyknow.reasoning.formulas.tree import Domains, Exists, Feature, Forall, Formula, Variable, walk
from dyknow.reasoning.progression.automaton import Verdict
from dyknow.reasoning.progression.engine import Progressing, make_progression


class TraceState(NamedTuple):
    """One state: its time, values by label, the labels of messages since the state before, and the domains that the
    trace has stated until then.
    """

    valid_us: int
    values: Mapping[str, Value]
    events: tuple[str, ...] = ()
    domains: Domains = {}  # noqa: RUF012 - nobody writes into it


@dataclass(frozen=True, slots=True)
class Trace:
    """States in the order of time.

    Attributes:
        domains: as the trace states them first.
        left_out: states that are not later than the one before, by reason: `out of order`, `duplicate`.
        no_numbers: values that count as none: `NaN`, `infinite`.
        first_lines: where the first of each of these reasons is.
    """

    states: tuple[TraceState, ...]
    domains: Domains = field(default_factory=dict)
    left_out: Counter[str] = field(default_factory=Counter)
    no_numbers: Counter[str] = field(default_factory=Counter)
    first_lines: Mapping[str, int] = field(default_factory=dict)

    @property
    def labels(self) -> tuple[str, ...]:
        """Every label that has a place for a value."""
        return tuple(sorted({label for state in self.states for label in state.values}))

    @property
    def objects(self) -> frozenset[str]:
        """The possible meanings of a name that is no label: all texts among the values."""
        values = {value for state in self.states for value in state.values.values() if isinstance(value, str)}
        return frozenset(values.difference(self.labels))

    @property
    def events(self) -> tuple[str, ...]:
        """Every label of a message."""
        return tuple(sorted({label for state in self.states for label in state.events}))


Outcome: TypeAlias = tuple[Verdict, float | None, int | None]
"""(verdict, t_ms, index): the first state that decided the formula; None while it is undecided."""


def follow_trace(
    formula: Formula,
    states: Sequence[TraceState],
    domains: Domains | None = None,
    no_value: NoValuePolicy = "undecided",
    period_us: int | None = None,
) -> tuple[Outcome, Progressing]:
    """Progress a checked formula through the states until it is decided.

    Returns the outcome, and the formula after the states, which explains its verdict and has its remainder.
    """
    progression = make_progression(formula, period_us, no_value)
    stated: Domains = {}
    known = domains
    for index, state in enumerate(states):
        if state.domains is not stated:
            stated, known = state.domains, {**(domains or {}), **state.domains}
        progression.progress(state.valid_us, state.values, known, state.events)
        if progression.verdict != "undecided":
            t_ms = state.valid_us / US_PER_MS
            return (progression.verdict, int(t_ms) if t_ms == int(t_ms) else t_ms, index), progression
    return ("undecided", None, None), progression


def trace_domains(formula: Formula, trace: Trace) -> dict[str, tuple[str, ...]]:
    """Members of the domains the formula names: as the trace states them, else every object that stands in it where
    the formula puts the variable.
    """
    found: dict[str, tuple[str, ...]] = {name: tuple(members) for name, members in trace.domains.items()}
    labels = [Label.parse(label) for label in {*trace.labels, *trace.events}]
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
    found = _Reader()
    for number, line in enumerate(lines, 1):
        if line.strip():
            found.take(_Line(line, number, file), number)
    return Trace(tuple(found.states), found.first_domains, found.left_out, found.no_numbers, found.first_lines)


class _Reader:
    """The states of the lines so far."""

    def __init__(self) -> None:
        self.states: list[TraceState] = []
        self.first_domains: dict[str, tuple[str, ...]] = {}
        self.left_out, self.no_numbers = Counter[str](), Counter[str]()
        self.first_lines: dict[str, int] = {}
        self._domains: dict[str, tuple[str, ...]] = {}
        self._events: list[tuple[int, str]] = []

    def take(self, line: "_Line", number: int) -> None:
        if "t_ms" not in line.record and "domains" in line.record:
            stated = line.domains()
            self._domains = {**self._domains, **stated}
            self.first_domains = {**stated, **self.first_domains}
            return
        valid_us = line.valid_us()
        if "message" in line.record:
            self._events.append((valid_us, line.message()))
            return
        values = line.values()
        for reason in line.no_numbers:
            self._count(self.no_numbers, reason, number)
        last_us = self.states[-1].valid_us if self.states else None
        if last_us is not None and valid_us <= last_us:
            self._count(self.left_out, "duplicate" if valid_us == last_us else "out of order", number)
            return
        due = tuple(label for at_us, label in self._events if at_us <= valid_us)
        self._events = [event for event in self._events if event[0] > valid_us]
        self.states.append(TraceState(valid_us, values, due, self._domains))

    def _count(self, counter: Counter[str], reason: str, number: int) -> None:
        counter[reason] += 1
        self.first_lines.setdefault(reason, number)


class _Line(JsonLine):
    """One line, checked."""

    def __init__(self, line: str, number: int, file: str) -> None:
        super().__init__(line, number, file, "a state", '{"t_ms": 100, "p": true}', constant=float)
        self.no_numbers: list[str] = []

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
        if isinstance(value, float) and not math.isfinite(value):
            self.no_numbers.append("NaN" if math.isnan(value) else "infinite")
            return NO_VALUE
        return value
