"""Chronicles as data: the language of thesis 8.3, and its meaning (C1-C7).

**Events.** An event is a message `n[a1, ..., ak]` or a change `n[a1, ..., ak]:(v, w)` of an attribute, at a time in
milliseconds. All arguments and values are symbols; `v` is unknown (None) in the first event of an attribute (C2).
The events of one millisecond are a set: the same event twice in it is one event (C1). An event is of an event type
if name, number of arguments and kind agree, every symbol is where the type has that symbol, equal `?variables` hold
equal symbols, and the constraints of its attribute or message hold, those on `?value` for the new value and, unless
it is unknown, for the old one. `?` and `*` hold anything, unknown too; a `?variable` or `*variable` holds symbols only.

**Variables.** A `?variable` that stands in a predicate with n1 >= 1 is *bound*: it has one value in an instance. A
`*variable`, a mere `?`, and a `?variable` that stands in predicates with n1 = 0 only (C4) are *wildcards*: each event
that is counted has its own value there. A constraint on bound variables must hold for an instance; a constraint that
names a wildcard says which events are of the type in each predicate where that wildcard stands (all wildcards of one
constraint must stand together there). In one event a `?variable` that is a wildcard has one value.

**Instants.** `event(T, t)` is `occurs(1, oo, T, (t, t + 1))`, `noevent(T, (a, b))` is `occurs(0, 0, T, (a, b))`. An
instant t is *fixed by events* if a predicate occurs(n1, n2, T, (t + c, t + c + 1)) with n1 >= 1 stands on it; all
others are *free*, `start` and `end` among them (`start <= t <= end` for every instant t named in the chronicle).

**Satisfaction at clock T.** Let s give symbols to the bound variables and u times to all instants. (s, u) is
*settled* at T if the constraints on variables and instants hold and for each predicate occurs(n1, n2, TYPE, (a, b)),
with m the number of events of TYPE under s at times u(a) <= time < u(b), time <= T:

* n1 <= m, and
* n2 = oo, or m <= n2 and the interval has passed: u(b) <= T, or it is empty: u(b) <= u(a).

So at clock T everything before T is final and the events that came at T count; an empty interval holds no event, hence
`noevent(T, (t2 + 1, t3 - 1))` holds if t3 = t2. No later event unsettles a settled instance.

**Instance.** An instance is a chronicle, s, and the times of the instants fixed by events: the free ones are
existential windows (C5). It is recognised at the least T at which some times of its free instants make it settled,
and reported once. All instances are reported, whatever events they share (thesis 8.4: "against all subsets of event
occurrences"). A chronicle without any instant fixed by events
has for each s at first one instance; after it was recognised at T, the next one is settled with all intervals of its
predicates beginning later than T (no event is counted twice). A chronicle without any predicate with n1 >= 1 is
refused: nothing would bring it forth.

**Age.** With a maximum age, any two instants that stand in predicates of an instance differ by at most that much;
an instant that is fixed by an initial value (time -oo, C2) has no age.

**Recognised chronicles as events.** An instance of chronicle c recognised at T is a message `c[parameters]` at T, with
the values of the bound parameters (an unbound parameter is unknown). No chronicle may stand on itself so.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, TypeAlias

from dyknow.reasoning.chronicles.definition.domains import Domain, symbol_text
from dyknow.reasoning.chronicles.definition.times import ComplexConstraint, TimeConstraint, TimePoint


@dataclass(frozen=True, slots=True)
class ChronicleVariable:
    """`?name`, or `*name` if `star`. Without a name it is the mere `?` or `*`, a wildcard that differs from all."""

    name: str = ""
    star: bool = False

    def __str__(self) -> str:
        return f"{'*' if self.star else '?'}{self.name}"


ANY: Final = ChronicleVariable()
VALUE: Final = ChronicleVariable("value")
"""In the constraints of an attribute: its value (8.3.2)."""

Parameter: TypeAlias = ChronicleVariable | str
"""A variable or a symbol."""


@dataclass(frozen=True, slots=True)
class MemberOf:
    """`variable in domain`, or `not in` if not `inside`."""

    variable: ChronicleVariable
    domain: Domain
    inside: bool = True

    def __str__(self) -> str:
        return f"{self.variable} {'' if self.inside else 'not '}in {self.domain}"


@dataclass(frozen=True, slots=True)
class Equal:
    """`variable == parameter`, or `!=` if not `same`."""

    variable: ChronicleVariable
    parameter: Parameter
    same: bool = True

    def __str__(self) -> str:
        return f"{self.variable} {'==' if self.same else '!='} {symbol_text(self.parameter)}"


@dataclass(frozen=True, slots=True)
class Negation:
    operand: "Constraint"

    def __str__(self) -> str:
        return f"not {self.operand}"


@dataclass(frozen=True, slots=True)
class Conjunction:
    operands: tuple["Constraint", ...]

    def __str__(self) -> str:
        return f"({' and '.join(map(str, self.operands))})"


@dataclass(frozen=True, slots=True)
class Disjunction:
    operands: tuple["Constraint", ...]

    def __str__(self) -> str:
        return f"({' or '.join(map(str, self.operands))})"


@dataclass(frozen=True, slots=True)
class Implication:
    """`left => right`, also written `if left then right`."""

    left: "Constraint"
    right: "Constraint"

    def __str__(self) -> str:
        return f"{self.left} => {self.right}"


@dataclass(frozen=True, slots=True)
class Iff:
    """`left <=> right`."""

    left: "Constraint"
    right: "Constraint"

    def __str__(self) -> str:
        return f"{self.left} <=> {self.right}"


@dataclass(frozen=True, slots=True)
class Choice:
    """`if condition then one else other`."""

    condition: "Constraint"
    then: "Constraint"
    otherwise: "Constraint"

    def __str__(self) -> str:
        return f"if {self.condition} then {self.then} else {self.otherwise}"


@dataclass(frozen=True, slots=True)
class Use:
    """`near[?a, ?b]`: a constraint declared under a name. The printed grammar declares such and cannot use them."""

    name: str
    arguments: tuple[Parameter, ...]

    def __str__(self) -> str:
        return f"{self.name}[{', '.join(map(symbol_text, self.arguments))}]"


Constraint: TypeAlias = MemberOf | Equal | Negation | Conjunction | Disjunction | Implication | Iff | Choice | Use


@dataclass(frozen=True, slots=True)
class EventType:
    """`n[a1, ..., ak]`, a message or a recognised chronicle, or with `change` the attribute's `n[a1, ..., ak]:(v, w)`.

    The name may carry a stream and its attribute: `cars.link`.
    """

    name: str
    arguments: tuple[Parameter, ...] = ()
    change: tuple[Parameter, Parameter] | None = None

    def __str__(self) -> str:
        arguments = f"[{', '.join(map(symbol_text, self.arguments))}]" if self.arguments else ""
        change = f":({symbol_text(self.change[0])}, {symbol_text(self.change[1])})" if self.change else ""
        return f"{self.name}{arguments}{change}"

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Arguments, old value and new value, in this order."""
        return self.arguments + (self.change or ())


@dataclass(frozen=True, slots=True)
class Occurs:
    """`occurs(minimum, maximum, type, (begin, end))`: the number of events in [begin, end[; maximum None is oo."""

    minimum: int
    maximum: int | None
    type: EventType
    begin: TimePoint
    end: TimePoint

    def __str__(self) -> str:
        most = "oo" if self.maximum is None else self.maximum
        return f"occurs({self.minimum}, {most}, {self.type}, ({self.begin}, {self.end}))"


@dataclass(frozen=True, slots=True)
class Event:
    """`event(type, at)`."""

    type: EventType
    at: TimePoint

    def __str__(self) -> str:
        return f"event({self.type}, {self.at})"


@dataclass(frozen=True, slots=True)
class NoEvent:
    """`noevent(type, (begin, end))`."""

    type: EventType
    begin: TimePoint
    end: TimePoint

    def __str__(self) -> str:
        return f"noevent({self.type}, ({self.begin}, {self.end}))"


Predicate: TypeAlias = Occurs | Event | NoEvent


@dataclass(frozen=True, slots=True)
class Variables:
    """`variable ?y, *z in domain`."""

    variables: tuple[ChronicleVariable, ...]
    domain: Domain | None = None

    def __str__(self) -> str:
        inside = "" if self.domain is None else f" in {self.domain}"
        return f"variable {', '.join(map(str, self.variables))}{inside}"


@dataclass(frozen=True, slots=True)
class Instants:
    """`instant t1, t2`."""

    names: tuple[str, ...]

    def __str__(self) -> str:
        return f"instant {', '.join(self.names)}"


@dataclass(frozen=True, slots=True)
class Inclusion:
    """`chronicle c[?x, a](t1, last = t2 + 5)`: the chronicle c as a part of this one.

    Its parameters are replaced by the arguments, its other variables and instants are its own. Its instants named in
    `points` are the points given: by place (label None) its temporal parameters, or by label these, `start` or `end`.
    The grammar of 8.3.5 uses such `TemporalLabeledIndexes` without printing their rule.
    """

    name: str
    arguments: tuple[Parameter, ...] = ()
    points: tuple[tuple[str | None, TimePoint], ...] = ()

    def __str__(self) -> str:
        arguments = f"[{', '.join(map(symbol_text, self.arguments))}]" if self.arguments else ""
        points = ", ".join(str(point) if label is None else f"{label} = {point}" for label, point in self.points)
        return f"chronicle {self.name}{arguments}" + (f"({points})" if points else "")


Statement: TypeAlias = Predicate | Constraint | TimeConstraint | Variables | Instants | Inclusion


@dataclass(frozen=True, slots=True)
class Chronicle:
    """`chronicle name[parameters](instants) { statements }`."""

    name: str
    parameters: tuple[Parameter, ...] = ()
    instants: tuple[str, ...] = ()
    statements: tuple[Statement, ...] = ()


@dataclass(frozen=True, slots=True)
class Attribute:
    """`attribute name[parameters] { constraints }`; the constraints may name `?value`."""

    name: str
    parameters: tuple[Parameter, ...] = ()
    constraints: tuple[Constraint, ...] = ()


@dataclass(frozen=True, slots=True)
class Message:
    """`message name[parameters] { constraints }`."""

    name: str
    parameters: tuple[Parameter, ...] = ()
    constraints: tuple[Constraint, ...] = ()


@dataclass(frozen=True, slots=True)
class DomainDefinition:
    """`domain name = domain`."""

    name: str
    domain: Domain


@dataclass(frozen=True, slots=True)
class NamedConstraint:
    """`constraint name[parameters] { constraints }`: a conjunction on variables under a name."""

    name: str
    parameters: tuple[Parameter, ...]
    constraints: tuple[Constraint, ...]


Declaration: TypeAlias = DomainDefinition | NamedConstraint | ComplexConstraint | Attribute | Message | Chronicle


@dataclass(frozen=True, slots=True)
class ChronicleFile:
    """All declarations of one text, in their order. Attributes and messages that are only used need no declaration."""

    declarations: tuple[Declaration, ...] = ()

    @property
    def domains(self) -> Mapping[str, Domain]:
        return {one.name: one.domain for one in self.declarations if isinstance(one, DomainDefinition)}

    @property
    def chronicles(self) -> Mapping[str, Chronicle]:
        return {one.name: one for one in self.declarations if isinstance(one, Chronicle)}

    @property
    def named_constraints(self) -> Mapping[str, NamedConstraint]:
        return {one.name: one for one in self.declarations if isinstance(one, NamedConstraint)}

    @property
    def complex_constraints(self) -> Mapping[str, ComplexConstraint]:
        return {one.name: one for one in self.declarations if isinstance(one, ComplexConstraint)}

    @property
    def attributes(self) -> Mapping[str, Attribute]:
        return {one.name: one for one in self.declarations if isinstance(one, Attribute)}

    @property
    def messages(self) -> Mapping[str, Message]:
        return {one.name: one for one in self.declarations if isinstance(one, Message)}
