"""A chronicle with everything it names written out: included chronicles, named and complex constraints, domains.

The result has one flat list of predicates over instants that are numbered, constraints over variables, and
differences between instants. Names of an included chronicle are its own: `overtake_2.t1`, `?overtake_2.road`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Final, TypeAlias

from dyknow.model.errors import ChronicleError
from dyknow.reasoning.chronicles.definition import model
from dyknow.reasoning.chronicles.definition.conditions import Binding, Condition, Conditions, resolved
from dyknow.reasoning.chronicles.definition.network import Difference, chained
from dyknow.reasoning.chronicles.definition.times import (
    ConstraintUse,
    Distance,
    Interval,
    TimeConstraint,
    TimeOrder,
    TimePoint,
)

LIMIT_INSTANTS: Final = 100
LIMIT_STATEMENTS: Final = 1000
LIMIT_DEPTH: Final = 50
"""Of one chronicle with all it includes; chronicles and constraints refer to each other at most so deep."""

CLOCK: Final = "0"
"""The instant 0 of the clock, for `t in [0, 1000]`; no instant of a text is called so."""

Point: TypeAlias = tuple[int, int]
"""(number of the instant, shift in ms)."""

Scope: TypeAlias = Mapping[str, Point]
"""Instants of an included text that are points of the whole."""


@dataclass(frozen=True, slots=True)
class Count:
    """occurs(minimum, maximum, type, (begin, end)); maximum None is oo.

    Attributes:
        declared: the constraints that the attribute or message declares for its events, over positions: `?0`, `?1`, ...
        said: its text.
    """

    minimum: int
    maximum: int | None
    type: model.EventType
    begin: Point
    end: Point
    declared: tuple[Condition, ...]
    said: str


@dataclass(slots=True)
class Expanded:
    """A chronicle written out."""

    name: str
    parameters: tuple[model.Parameter, ...]
    instants: list[str] = field(default_factory=list)
    counts: list[Count] = field(default_factory=list)
    conditions: list[Condition] = field(default_factory=list)
    differences: list[Difference] = field(default_factory=list)
    statements: int = 0


def expand(chronicle: model.Chronicle, file: model.ChronicleFile) -> Expanded:
    """Write a chronicle out.

    Raises:
        ChronicleError: something is named that is not declared, with another number of arguments, or in a circle;
            or all of it is larger than the limits of this module.
    """
    expanded = Expanded(chronicle.name, chronicle.parameters)
    _Expansion(file, expanded).body(chronicle, "", {}, {}, 0)
    return expanded


class _Expansion:
    def __init__(self, file: model.ChronicleFile, into: Expanded) -> None:
        self._into = into
        self._chronicles, self._complex = file.chronicles, file.complex_constraints
        self._conditions = Conditions(file)
        self._declared: dict[str, model.Attribute | model.Message] = {**file.attributes, **file.messages}
        self._numbers: dict[str, int] = {}
        self._inclusions = 0

    def body(self, chronicle: model.Chronicle, prefix: str, binding: Binding, scope: Scope, depth: int) -> None:
        """The statements of a chronicle whose parameters are bound and some of whose instants are given."""
        if depth > LIMIT_DEPTH:
            raise ChronicleError(f"chronicle {chronicle.name} is included by itself; it would have no end")
        names: set[str] = set(chronicle.instants)
        for statement in chronicle.statements:
            self._one_more()
            names.update(_instants_of(statement))
            self._statement(statement, prefix, binding, scope, depth)
        self._ends(names, prefix, scope)

    def _one_more(self) -> None:
        self._into.statements += 1
        if self._into.statements > LIMIT_STATEMENTS:
            raise ChronicleError(f"chronicle {self._into.name} comes to more than {LIMIT_STATEMENTS} statements")

    def _ends(self, names: set[str], prefix: str, scope: Scope) -> None:
        """Start <= t <= end for every instant t of this text and of those it includes, if it speaks of start or end."""
        inside = [(name, (at, 0)) for name, at in self._numbers.items() if name.startswith(prefix) and name != CLOCK]
        inside += [(name, scope[name]) for name in sorted(names & scope.keys())]
        for end in ("start", "end"):
            if end not in names and end not in scope:
                continue
            mine = self._point(TimePoint(end), prefix, scope)
            for name, other in inside:
                if other != mine:
                    order = ("<=",) if end == "start" else (">=",)
                    self._into.differences += chained(order, (mine, other), f"{end} {order[0]} {name}")

    def _statement(self, statement: model.Statement, prefix: str, binding: Binding, scope: Scope, depth: int) -> None:
        into = self._into
        if isinstance(statement, model.Predicate):
            self._count(statement, prefix, binding, scope)
        elif isinstance(statement, TimeConstraint):
            self._times(statement, str(statement), prefix, scope, depth)
        elif isinstance(statement, model.Instants):
            for name in statement.names:
                self._point(TimePoint(name), prefix, scope)
        elif isinstance(statement, model.Variables):
            if statement.domain is not None:
                for variable in statement.variables:
                    member = model.MemberOf(variable, statement.domain)
                    into.conditions.append(self._conditions.condition(member, prefix, binding))
        elif isinstance(statement, model.Inclusion):
            self._include(statement, prefix, binding, scope, depth)
        else:
            into.conditions.append(self._conditions.condition(statement, prefix, binding))

    def _include(self, inclusion: model.Inclusion, prefix: str, binding: Binding, scope: Scope, depth: int) -> None:
        chronicle = self._chronicles.get(inclusion.name)
        if chronicle is None:
            raise ChronicleError(f"{inclusion}: no chronicle is called {inclusion.name}")
        self._inclusions += 1
        inner = f"{prefix}{inclusion.name}_{self._inclusions}."
        arguments = [resolved(one, prefix, binding) for one in inclusion.arguments]
        if inclusion.arguments and len(arguments) != len(chronicle.parameters):
            raise ChronicleError(f"{inclusion}: {inclusion.name} has {len(chronicle.parameters)} parameters")
        bound: dict[str, model.Parameter] = {}
        for mine, theirs in zip(chronicle.parameters, arguments, strict=False):
            if isinstance(mine, str):
                if theirs not in {mine, model.ANY}:
                    raise ChronicleError(f"{inclusion}: {inclusion.name} is declared for {mine} there")
            elif theirs != model.ANY:
                bound[str(mine)] = theirs
        given: dict[str, Point] = {}
        for at, (label, point) in enumerate(inclusion.points):
            if label is None and at >= len(chronicle.instants):
                raise ChronicleError(f"{inclusion}: {inclusion.name} has {len(chronicle.instants)} instants")
            name = chronicle.instants[at] if label is None else label
            if name not in {*chronicle.instants, "start", "end"}:
                raise ChronicleError(f"{inclusion}: {name} is no temporal parameter of {inclusion.name}")
            given[name] = self._point(point, prefix, scope)
        self.body(chronicle, inner, bound, given, depth + 1)

    def _count(self, predicate: model.Predicate, prefix: str, binding: Binding, scope: Scope) -> None:
        type_ = self.type(predicate.type, prefix, binding)
        minimum, maximum = (1, None) if isinstance(predicate, model.Event) else (0, 0)
        if isinstance(predicate, model.Event):
            begin = self._point(predicate.at, prefix, scope)
            end = (begin[0], begin[1] + 1)
        else:
            begin = self._point(predicate.begin, prefix, scope)
            end = self._point(predicate.end, prefix, scope)
        if isinstance(predicate, model.Occurs):
            minimum, maximum = predicate.minimum, predicate.maximum
        if minimum < 0 or (maximum is not None and maximum < minimum):
            raise ChronicleError(
                f"{predicate}: no number is at least {minimum} and at most {maximum}; take 0 <= n1 <= n2"
            )
        said = str(predicate)
        self._into.counts.append(Count(minimum, maximum, type_, begin, end, self._demanded(type_), said))
        if minimum:
            self._into.differences += chained(("<",), (begin, end), said)

    def type(self, type_: model.EventType, prefix: str, binding: Binding) -> model.EventType:
        """An event type in the names of the whole; its number of arguments is checked against its declaration."""
        declared = self._declared.get(type_.name) or self._chronicles.get(type_.name)
        if declared is not None and len(declared.parameters) != len(type_.arguments):
            raise ChronicleError(f"{type_}: {type_.name} is declared with {len(declared.parameters)} arguments")
        if declared is not None and isinstance(declared, model.Attribute) is (type_.change is None):
            kind = (
                "an attribute: write (old, new) after it" if type_.change is None else "no attribute: it has no values"
            )
            raise ChronicleError(f"{type_}: {type_.name} is {kind}")
        arguments = tuple(resolved(one, prefix, binding) for one in type_.arguments)
        change = type_.change and (
            resolved(type_.change[0], prefix, binding),
            resolved(type_.change[1], prefix, binding),
        )
        return replace(type_, arguments=arguments, change=change)

    def _demanded(self, type_: model.EventType) -> tuple[Condition, ...]:
        """The declared constraints of an event's arguments and new value, and of its old one unless unknown."""
        declared = self._declared.get(type_.name)
        if declared is None:
            return ()
        places: dict[str, model.Parameter] = {
            str(one): model.ChronicleVariable(str(at)) for at, one in enumerate(declared.parameters)
        }
        arity, found = len(declared.parameters), list[Condition]()
        for constraint in declared.constraints:
            new = self._conditions.condition(
                constraint, "", {**places, str(model.VALUE): model.ChronicleVariable(str(arity + 1))}
            )
            old = self._conditions.condition(
                constraint, "", {**places, str(model.VALUE): model.ChronicleVariable(str(arity))}
            )
            found.append(new)
            if f"?{arity}" in old.variables:
                found.append(_unless_unknown(old, f"?{arity}"))
        return tuple(found)

    def _point(self, point: TimePoint, prefix: str, scope: Scope) -> Point:
        """The number of an instant and a shift; a point with an interval has an instant of its own."""
        given = scope.get(point.instant)
        if given is None:
            number, shift_ms = self._number(prefix + point.instant), 0
        else:
            number, shift_ms = given
        low, high = point.shift.low_ms, point.shift.high_ms
        if low is not None and low == high:
            return number, shift_ms + low
        own = self._number(f"{prefix}{point.instant}~{len(self._numbers)}")
        self._between((number, shift_ms), (own, 0), point.shift, str(point))
        return own, 0

    def _number(self, name: str) -> int:
        if name not in self._numbers:
            if len(self._numbers) >= LIMIT_INSTANTS:
                raise ChronicleError(f"chronicle {self._into.name} comes to more than {LIMIT_INSTANTS} instants")
            self._numbers[name] = len(self._numbers)
            self._into.instants.append(name)
        return self._numbers[name]

    def _between(self, from_: Point, to: Point, interval: Interval, said: str) -> None:
        shift_ms = to[1] - from_[1]
        if interval.high_ms is not None:
            self._into.differences.append(Difference(from_[0], to[0], interval.high_ms - shift_ms, said))
        if interval.low_ms is not None:
            self._into.differences.append(Difference(to[0], from_[0], shift_ms - interval.low_ms, said))

    def _times(self, constraint: TimeConstraint, said: str, prefix: str, scope: Scope, depth: int) -> None:
        if isinstance(constraint, TimeOrder):
            points = [self._point(point, prefix, scope) for point in constraint.points]
            self._into.differences += chained(constraint.operators, points, said)
        elif isinstance(constraint, Distance):
            to = self._point(TimePoint(constraint.to), prefix, scope)
            if constraint.from_ is None:
                self._between((self._number(CLOCK), 0), to, constraint.interval, said)
            else:
                self._between(self._point(TimePoint(constraint.from_), prefix, scope), to, constraint.interval, said)
        else:
            self._complex_use(constraint, said, prefix, scope, depth)

    def _complex_use(self, use: ConstraintUse, said: str, prefix: str, scope: Scope, depth: int) -> None:
        declared = self._complex.get(use.name)
        if declared is None:
            raise ChronicleError(f"{use}: no time constraint is called {use.name}")
        if len(declared.parameters) != len(use.points):
            raise ChronicleError(f"{use}: {use.name} has {len(declared.parameters)} instants")
        if depth > LIMIT_DEPTH:
            raise ChronicleError(f"time constraint {use.name} is used by itself; it would have no end")
        points = [self._point(point, prefix, scope) for point in use.points]
        inner, given = prefix, scope
        if declared.parameters:
            inner, given = f"{prefix}{use.name}.", dict(zip(declared.parameters, points, strict=True))
        for constraint in declared.constraints:
            self._one_more()
            self._times(constraint, f"{said}: {constraint}", inner, given, depth + 1)


def _unless_unknown(condition: Condition, old: str) -> Condition:
    return replace(condition, test=lambda found: found[old] is None or condition.test(found))


def _instants_of(statement: model.Statement) -> set[str]:
    """The instants that a statement names."""
    if isinstance(statement, model.Event):
        return {statement.at.instant}
    if isinstance(statement, model.NoEvent | model.Occurs):
        return {statement.begin.instant, statement.end.instant}
    if isinstance(statement, model.Instants):
        return set(statement.names)
    if isinstance(statement, TimeOrder | ConstraintUse):
        return {point.instant for point in statement.points}
    if isinstance(statement, Distance):
        return {statement.to, *(() if statement.from_ is None else (statement.from_,))}
    if isinstance(statement, model.Inclusion):
        return {point.instant for _, point in statement.points}
    return set()
