"""Formulas over states: the tree every other module of this room works on (thesis 7.5.1).

Nodes are frozen and compare by content; where they stood in a text (`place`) is carried for messages and never
compared. Times are microseconds. A formula has no free variables once it is read: an object is either a name (text)
or a `Variable` bound by a quantifier further up.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cache, partial
from typing import Any, Final, NamedTuple, TypeAlias

from dyknow.model.errors import TextError, UnknownLabel

LIMIT_NODES: Final = 50_000
"""A formula that expands to more nodes than this over its domains is refused."""
LIMIT_TEMPORAL: Final = 6
"""Most temporal operators inside one another: the remainder of a formula grows steeply with them."""


class Place(NamedTuple):
    """Where a node stood: line and column from 1, width in characters, offsets into the text."""

    line: int = 1
    column: int = 1
    width: int = 1
    start: int = 0
    end: int = 0


NOWHERE = Place()


@dataclass(frozen=True, slots=True)
class Node:
    """Anything with a place."""

    place: Place = field(default=NOWHERE, compare=False, repr=False, kw_only=True)


@dataclass(frozen=True, slots=True)
class Const(Node):
    """A truth value, a number, or a text (an object or a string); `quoted` tells a string from an object."""

    value: bool | int | float | str
    quoted: bool = False


@dataclass(frozen=True, slots=True)
class Duration(Node):
    """A time with its suffix, such as `10s`; also what a bare number turns into next to a duration (milliseconds)."""

    us: int


@dataclass(frozen=True, slots=True)
class Variable(Node):
    """An object variable, bound by a quantifier further up."""

    name: str


Object: TypeAlias = str | Variable


@dataclass(frozen=True, slots=True)
class Feature(Node):
    """A feature of objects, `speed[u]`, or one attribute of an object state, `cars.link[c]`.

    Without objects it may, until checked, also be a constant or an object (`MAX_SPEED`, `car1`).
    """

    name: str
    objects: tuple[Object, ...] = ()
    attribute: str | None = None

    @property
    def stem(self) -> str:
        """The name, with the attribute if there is one."""
        return f"{self.name}.{self.attribute}" if self.attribute else self.name

    @property
    def label(self) -> str:
        """As it is printed; without variables it is the key of the feature in a state."""
        return label_text(self.stem, self.objects)


def label_text(stem: str, objects: Iterable[Object] = ()) -> str:
    """The text of a label, `xy_dist[0, 1]`, as `dyknow.Label` prints it: how states name their features."""
    inside = ", ".join(one if isinstance(one, str) else one.name for one in objects)
    return f"{stem}[{inside}]" if inside else stem


@dataclass(frozen=True, slots=True)
class Now(Node):
    """The valid time of the state, a duration since the epoch."""


@dataclass(frozen=True, slots=True)
class Since(Node):
    """The time since the feature last changed; its first value is a change."""

    feature: Feature


@dataclass(frozen=True, slots=True)
class Occurred(Node):
    """True in the states to which an event with this label belongs."""

    event: Feature


@dataclass(frozen=True, slots=True)
class Negate(Node):
    operand: "Formula"


@dataclass(frozen=True, slots=True)
class Abs(Node):
    operand: "Formula"


@dataclass(frozen=True, slots=True)
class Arithmetic(Node):
    """`operator` is one of + - * /."""

    operator: str
    left: "Formula"
    right: "Formula"


@dataclass(frozen=True, slots=True)
class Compare(Node):
    """`operator` is one of < <= = != >= >."""

    operator: str
    left: "Formula"
    right: "Formula"


@dataclass(frozen=True, slots=True)
class Not(Node):
    operand: "Formula"


@dataclass(frozen=True, slots=True)
class And(Node):
    parts: tuple["Formula", ...]


@dataclass(frozen=True, slots=True)
class Or(Node):
    parts: tuple["Formula", ...]


@dataclass(frozen=True, slots=True)
class Implies(Node):
    left: "Formula"
    right: "Formula"


Term: TypeAlias = Const | Duration | Variable | Feature | Now | Since | Occurred | Negate | Abs | Arithmetic
"""Terms: nodes with a value in a state."""
Bound: TypeAlias = int | Term
"""Microseconds; until checked also a term of times and constants."""


@dataclass(frozen=True, slots=True)
class Until(Node):
    """`left until[lo,hi] right` (7.5.1): right in some state of [t+lo, t+hi], left in every state of [t, there)."""

    left: "Formula"
    right: "Formula"
    lo_us: Bound = 0
    hi_us: Bound | None = None


@dataclass(frozen=True, slots=True)
class Always(Node):
    """The operand holds in every state of [t+lo, t+hi]; `hi_us` None is no end."""

    operand: "Formula"
    lo_us: Bound = 0
    hi_us: Bound | None = None


@dataclass(frozen=True, slots=True)
class Eventually(Node):
    """The operand holds in some state of [t+lo, t+hi]; `hi_us` None is no end."""

    operand: "Formula"
    lo_us: Bound = 0
    hi_us: Bound | None = None


DomainSet: TypeAlias = str | tuple[Object, ...]
"""A named domain, or its members listed."""


@dataclass(frozen=True, slots=True)
class Domain(Node):
    """The first set without the others: `units - {self}`."""

    base: DomainSet
    minus: tuple[DomainSet, ...] = ()


@dataclass(frozen=True, slots=True)
class Forall(Node):
    variable: str
    domain: Domain
    body: "Formula"
    growing: bool = False


@dataclass(frozen=True, slots=True)
class Exists(Node):
    variable: str
    domain: Domain
    body: "Formula"
    growing: bool = False


Formula: TypeAlias = Term | Compare | Not | And | Or | Implies | Until | Always | Eventually | Forall | Exists
TEMPORAL = (Until, Always, Eventually)
Domains: TypeAlias = Mapping[str, Iterable[str]]
"""The members of each named domain at one time."""


def children(node: Any) -> Iterator[Any]:
    """The nodes directly inside `node`."""
    for name in _parts(node.__class__):
        inside = getattr(node, name)
        if isinstance(inside, Node):
            yield inside
        elif isinstance(inside, tuple):
            yield from (one for one in inside if isinstance(one, Node))


@cache
def _parts(kind: type) -> tuple[str, ...]:
    """Names of the fields that make a node, its place left out."""
    return tuple(each.name for each in fields(kind) if each.name != "place")


def walk(formula: Any) -> Iterator[Any]:
    """Every node of the formula, outside first; needs no recursion."""
    waiting = [formula]
    while waiting:
        node = waiting.pop()
        yield node
        waiting.extend(children(node))


def is_temporal(formula: Formula) -> bool:
    """Whether more than one state can matter."""
    return any(isinstance(node, TEMPORAL) for node in walk(formula))


def deepest_temporal(formula: Formula) -> tuple[int, Place]:
    """How many temporal operators stand inside one another, and where the innermost of them is."""
    deepest, waiting = (0, Place()), [(formula, 0)]
    while waiting:
        node, depth = waiting.pop()
        if isinstance(node, TEMPORAL):
            depth += 1
            deepest = max(deepest, (depth, node.place), key=lambda one: one[0])
        waiting.extend((child, depth) for child in children(node))
    return deepest


def too_deep(depth: int) -> str:
    """The error of a formula of that depth, more than `LIMIT_TEMPORAL`."""
    return f"{depth} temporal operators stand inside one another, {LIMIT_TEMPORAL} are allowed"


def instantiate(body: Formula, variable: str, member: Object) -> Formula:
    """`body` with `member`, an object or another variable, for the variable; quantifiers that bind its name keep theirs."""
    found: Formula = _put(body, variable, member)
    return found


def _put(node: Any, variable: str, member: Object) -> Any:
    if isinstance(node, Variable):
        if node.name != variable:
            return node
        return member if isinstance(member, Variable) else Const(member, place=node.place)
    changed: dict[str, Any] = {}
    shadowed = isinstance(node, Forall | Exists) and node.variable == variable
    for name in _parts(node.__class__):
        inside = getattr(node, name)
        if shadowed and name == "body":
            continue
        if isinstance(inside, Node):
            new: Any = _put(inside, variable, member)
        elif isinstance(inside, tuple):
            new = _put_each(inside, variable, member)
        else:
            continue
        if new is not inside:
            changed[name] = new
    return replace(node, **changed) if changed else node


def _put_each(inside: tuple[Any, ...], variable: str, member: Object) -> tuple[Any, ...]:
    """Objects become the member's name, formulas are rewritten, nested sets are entered."""
    new: list[Any] = []
    for one in inside:
        if isinstance(one, tuple):
            new.append(_put_each(one, variable, member))
        elif isinstance(one, Variable):
            new.append(member if one.name == variable else one)
        elif isinstance(one, Node):
            new.append(_put(one, variable, member))
        else:
            new.append(one)
    return inside if all(a is b for a, b in zip(inside, new, strict=True)) else tuple(new)


def domain_members(domain: Domain, domains: Domains) -> tuple[str, ...]:
    """The members of a domain, in the order given, each once.

    Raises:
        UnknownLabel: if a named set is not among `domains`.
    """
    left_out = {one for each in domain.minus for one in _members(each, domains)}
    return tuple(dict.fromkeys(one for one in _members(domain.base, domains) if one not in left_out))


def _members(found: DomainSet, domains: Domains) -> Iterable[str]:
    if isinstance(found, str):
        if found not in domains:
            raise UnknownLabel(found, tuple(sorted(domains)))
        return domains[found]
    return (one if isinstance(one, str) else one.name for one in found)


def split_growing(formula: Formula) -> tuple[str, Domain, Formula] | None:
    """Take `always forall x in D growing: phi` apart, so that each member can have a monitor of its own.

    Returns:
        (variable, domain, body), where `instantiate(body, variable, member)` is `always phi` of that member;
        None if the formula has another form.
    """
    if not isinstance(formula, Always) or formula.lo_us != 0 or formula.hi_us is not None:
        return None
    inner = formula.operand
    if not isinstance(inner, Forall) or not inner.growing:
        return None
    return inner.variable, inner.domain, Always(inner.body, place=formula.place)


def required_labels(formula: Formula, domains: Domains | None = None) -> tuple[str, ...]:
    """Labels of every feature the formula reads, quantifiers expanded over `domains`; events are not features.

    Raises:
        UnknownLabel: if a quantifier ranges over a domain that `domains` lacks.
        TextError: if the formula expands to more than `LIMIT_NODES` nodes.
    """
    return tuple(sorted({node.label for node in _expanded(formula, domains or {}) if isinstance(node, Feature)}))


def event_labels(formula: Formula, domains: Domains | None = None) -> tuple[str, ...]:
    """Labels of every event the formula asks for, with `occurred`; raises the same."""
    events = {node.event.label for node in _expanded(formula, domains or {}) if isinstance(node, Occurred)}
    return tuple(sorted(events))


def _expanded(formula: Formula, domains: Domains) -> Iterator[Any]:
    """Every node of the formula, its quantifiers expanded over their domains; those inside events are not given."""
    waiting: list[Callable[[], Any]] = [lambda: formula]
    left = LIMIT_NODES
    while waiting:
        for node in _unquantified(waiting.pop()()):
            left -= 1
            if left < 0:
                raise too_large()
            yield node
            if isinstance(node, Forall | Exists):
                members = domain_members(node.domain, domains)
                waiting += [partial(instantiate, node.body, node.variable, one) for one in members]


def _unquantified(formula: Any) -> Iterator[Any]:
    """Every node outside the bodies of quantifiers, and outside events."""
    waiting = [formula]
    while waiting:
        node = waiting.pop()
        yield node
        if not isinstance(node, Forall | Exists | Occurred):
            waiting.extend(children(node))


def too_large() -> TextError:
    """The error for a formula that grows beyond `LIMIT_NODES` over its domains."""
    return TextError(
        f"the formula expands to more than {LIMIT_NODES} parts over its domains",
        repair="quantify over fewer objects, or nest fewer quantifiers",
    )
