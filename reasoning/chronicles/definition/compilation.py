"""Chronicles compiled: event patterns, the minimal network of their instants, and in which order to join events.

Which events fix instants, which predicates only count, which event can be the last one of an instance: all of it is
decided here, once (thesis 8.4). The words are those of the model: bound variables, wildcards, fixed and free instants.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

from dyknow.model.errors import ChronicleError
from dyknow.reasoning.chronicles.definition.conditions import Condition
from dyknow.reasoning.chronicles.definition.expansion import CLOCK, Count, Expanded, Point, expand
from dyknow.reasoning.chronicles.definition.model import Chronicle, ChronicleFile, ChronicleVariable, Parameter
from dyknow.reasoning.chronicles.definition.network import UNBOUNDED, Difference, minimal_network

LIMIT_COUNT: Final = 10**6
"""No predicate asks for more events than this."""


@dataclass(frozen=True, slots=True)
class Pattern:
    """Which events a predicate speaks of, and what of them is remembered.

    Positions are those of the event's arguments, then its old and its new value.

    Attributes:
        constants: (position, symbol) that an event must have.
        equal: pairs of positions that must hold the same symbol.
        known: positions that must not be unknown.
        key: positions of the bound variables, `variables` in the same order.
        conditions: conditions on the event alone, with the position of each variable.
        plural: whether several events of one time and key are distinguished, because they are counted.
    """

    name: str
    arity: int
    change: bool
    constants: tuple[tuple[int, str], ...]
    equal: tuple[tuple[int, int], ...]
    known: tuple[int, ...]
    key: tuple[int, ...]
    variables: tuple[int, ...]
    conditions: tuple[tuple[Condition, tuple[tuple[str, int], ...]], ...]
    plural: bool


@dataclass(frozen=True, slots=True)
class EventNode:
    """An event that fixes `instant`: it occurs at the instant's time + `shift_ms`."""

    pattern: int
    instant: int
    shift_ms: int
    said: str


@dataclass(frozen=True, slots=True)
class CountNode:
    """A predicate whose events are counted in [begin, end[.

    Attributes:
        across: conditions on its wildcards and on bound variables of other predicates, with the wildcards' positions.
        late: its events may come with or after the last event that fixes an instant.
        binds: it has variables that no event node has.
    """

    pattern: int
    minimum: int
    maximum: int | None
    begin: Point
    end: Point
    across: tuple[tuple[Condition, tuple[tuple[str, int], ...]], ...]
    late: bool
    binds: bool
    said: str


@dataclass(frozen=True, slots=True)
class Compiled:
    """A chronicle ready to be recognised.

    Attributes:
        variables: bound variables (`?car1`) in the order of their slots; `parameters` are slots, symbols, or None.
        fixed: names of the instants fixed by events: instants 0 ... len(fixed)-1. Behind them come the free instants
            that stand in predicates, and last the zero of the clock, if a constraint mentions it: `clock`.
        bounds: minimal network of these instants; `aged`: the same with the maximum age.
        conditions: on bound variables of several patterns.
        begins: where the intervals of all predicates begin.
        unbounded: the predicates whose events may have to be remembered for ever, as written; empty if time or a
            maximum age bounds all of them.
    """

    name: str
    variables: tuple[str, ...]
    parameters: tuple[int | str | None, ...]
    fixed: tuple[str, ...]
    size: int
    clock: int | None
    bounds: tuple[tuple[int, ...], ...]
    aged: tuple[tuple[int, ...], ...]
    patterns: tuple[Pattern, ...]
    events: tuple[EventNode, ...]
    counts: tuple[CountNode, ...]
    conditions: tuple[Condition, ...]
    begins: tuple[Point, ...]

    @property
    def unbounded(self) -> tuple[str, ...]:
        """Events that time alone never makes too old to matter; `noevent` may still say so."""
        last = [node.instant for node in self.events]
        return tuple(
            node.said for node in self.events if any(self.aged[node.instant][other] >= UNBOUNDED for other in last)
        ) + tuple(node.said for node in self.counts if not last and self.aged[node.begin[0]][node.end[0]] >= UNBOUNDED)


def compile_chronicle(chronicle: Chronicle, file: ChronicleFile, max_age_ms: int | None = None) -> Compiled:
    """Compile a chronicle of a file.

    Raises:
        ChronicleError: its times contradict each other (the message names them), something it names is not
            declared, or it has no predicate that asks for an event.
    """
    expanded = expand(chronicle, file)
    return _Compilation(expanded, max_age_ms).compiled()


class _Compilation:
    def __init__(self, expanded: Expanded, max_age_ms: int | None) -> None:
        self._expanded = expanded
        self._counts = [one for one in expanded.counts if one.minimum or one.maximum is not None]
        if not any(one.minimum for one in self._counts):
            raise ChronicleError(f"chronicle {expanded.name} asks for no event; write event(...) or occurs(1, oo, ...)")
        for one in self._counts:
            if max(one.minimum, one.maximum or 0) > LIMIT_COUNT:
                raise ChronicleError(f"{one.said}: counts go up to {LIMIT_COUNT}")
        self._bound = _bound_variables(self._counts, expanded.parameters)
        self._slots = {name: slot for slot, name in enumerate(self._bound)}
        self._instants()
        try:
            self._networks(max_age_ms)
        except ChronicleError as error:
            raise ChronicleError(f"chronicle {expanded.name}: {error}") from None
        self._patterns: dict[Pattern, int] = {}

    def _instants(self) -> None:
        """Number the instants that matter: fixed ones, free ones in predicates, the clock."""
        fixed = [one.begin[0] for one in self._counts if _is_event(one)]
        ends = [point[0] for one in self._expanded.counts for point in (one.begin, one.end)]
        names = self._expanded.instants
        clock = self._clock = [at for at, name in enumerate(names) if name == CLOCK]
        self._fixed = tuple(dict.fromkeys(at for at in fixed if at not in clock))
        self._kept = (*self._fixed, *dict.fromkeys(at for at in ends if at not in (*self._fixed, *clock)), *clock)
        self._place = {at: place for place, at in enumerate(self._kept)}
        self._in_predicates = tuple(dict.fromkeys(at for at in ends if at not in clock))

    def _networks(self, max_age_ms: int | None) -> None:
        size, differences = len(self._expanded.instants), self._expanded.differences
        self._bounds = self._projected(size, differences)
        if max_age_ms is None:
            self._aged = self._bounds
            return
        said, first, last = f"max_age {max_age_ms} ms", size, size + 1
        aged = [*differences, Difference(first, last, max_age_ms, said)]
        for at in self._in_predicates:
            aged += [Difference(at, first, 0, said), Difference(last, at, 0, said)]
        self._aged = self._projected(size + 2, aged)

    def _projected(self, size: int, differences: Sequence[Difference]) -> tuple[tuple[int, ...], ...]:
        """The minimal network is exact on any part of its instants."""
        bounds = minimal_network(size, differences).bounds
        return tuple(tuple(bounds[i][j] for j in self._kept) for i in self._kept)

    def compiled(self) -> Compiled:
        conditions = self._expanded.conditions
        wild = {name for one in conditions for name in one.variables if name not in self._slots}
        homes: dict[int, list[Condition]] = {at: [] for at in range(len(conditions))}
        nodes = [self._node(one, conditions, homes, wild) for one in self._counts]
        for at, condition in enumerate(conditions):
            if not homes[at] and condition.variables & wild:
                names = ", ".join(sorted(condition.variables & wild))
                raise ChronicleError(
                    f"chronicle {self._expanded.name}: {condition.said}: {names} stands in no one event"
                )
        joins = tuple(one for at, one in enumerate(conditions) if not homes[at])
        events = tuple(dict.fromkeys(node for node, _ in nodes if node is not None))
        counts = tuple(dict.fromkeys(count for _, count in nodes if count is not None))
        return Compiled(
            self._expanded.name,
            self._bound,
            tuple(self._parameter(one) for one in self._expanded.parameters),
            tuple(self._expanded.instants[at] for at in self._fixed),
            len(self._kept),
            self._place[self._clock[0]] if self._clock else None,
            self._bounds,
            self._aged,
            tuple(self._patterns),
            events,
            tuple(self._placed(count, events) for count in counts),
            joins,
            tuple(dict.fromkeys((self._place[one.begin[0]], one.begin[1]) for one in self._expanded.counts)),
        )

    def _parameter(self, parameter: Parameter) -> int | str | None:
        return parameter if isinstance(parameter, str) else self._slots.get(str(parameter))

    def _node(
        self, count: Count, conditions: Sequence[Condition], homes: Mapping[int, list[Condition]], wild: set[str]
    ) -> tuple[EventNode | None, CountNode | None]:
        """The compiled predicate: an event that fixes its instant, a counted one, or both."""
        places = _places(count)
        across: list[tuple[Condition, tuple[tuple[str, int], ...]]] = []
        alone: list[Condition] = []
        for at, condition in enumerate(conditions):
            wildcards = condition.variables & wild
            if not condition.variables or not wildcards <= places.keys():
                continue
            if condition.variables <= places.keys():
                alone.append(condition)
                if wildcards or count.minimum:
                    homes[at].append(condition)
            elif wildcards:
                across.append((condition, tuple((name, places[name][0]) for name in sorted(wildcards))))
                homes[at].append(condition)
        is_event, simple = _is_event(count), count.minimum == 1 and count.maximum is None and not across
        plural = bool(across) or count.minimum > 1 or bool(count.maximum)
        pattern = self._pattern(count, places, alone, plural)
        begin, end = (self._place[count.begin[0]], count.begin[1]), (self._place[count.end[0]], count.end[1])
        event = EventNode(pattern, begin[0], begin[1], count.said) if is_event and begin[0] < len(self._fixed) else None
        if event is not None and simple:
            return event, None
        node = CountNode(
            pattern, count.minimum, count.maximum, begin, end, tuple(across), late=False, binds=False, said=count.said
        )
        return event, node

    def _pattern(
        self,
        count: Count,
        places: Mapping[str, tuple[int, ...]],
        alone: Sequence[Condition],
        plural: bool,
    ) -> int:
        type_ = count.type
        bound = sorted((self._slots[name], at[0]) for name, at in places.items() if name in self._slots)
        conditions = [(one, tuple((name, places[name][0]) for name in sorted(one.variables))) for one in alone]
        conditions += [(one, tuple((name, int(name[1:])) for name in sorted(one.variables))) for one in count.declared]
        pattern = Pattern(
            type_.name,
            len(type_.arguments),
            type_.change is not None,
            tuple((at, one) for at, one in enumerate(type_.parameters) if isinstance(one, str)),
            tuple((at[0], other) for name, at in places.items() if not name.startswith("*") for other in at[1:]),
            tuple(sorted(at for found in places.values() for at in found)),
            tuple(at for _, at in bound),
            tuple(slot for slot, _ in bound),
            tuple(conditions),
            plural,
        )
        return self._patterns.setdefault(pattern, len(self._patterns))

    def _placed(self, count: CountNode, events: Sequence[EventNode]) -> CountNode:
        """A count with properties that depend on all events: whether its own may come last, and bind variables."""
        patterns = tuple(self._patterns)
        bound = {slot for event in events for slot in patterns[event.pattern].variables}
        end, shift = count.end
        late = all(self._bounds[event.instant][end] + shift - 1 - event.shift_ms >= 0 for event in events) and bool(
            count.minimum
        )
        binds = bool(count.minimum) and not bound.issuperset(patterns[count.pattern].variables)
        return replace(count, late=late, binds=binds)


def _is_event(count: Count) -> bool:
    """Whether a predicate fixes its instant: it asks for an event in [t, t + 1[."""
    return count.minimum > 0 and count.begin[0] == count.end[0] and count.end[1] == count.begin[1] + 1


def _bound_variables(counts: Sequence[Count], parameters: Sequence[Parameter]) -> tuple[str, ...]:
    """Parameters of the chronicle first, in their order."""
    found = dict.fromkeys(
        str(one)
        for count in counts
        if count.minimum
        for one in count.type.parameters
        if isinstance(one, ChronicleVariable) and one.name and not one.star
    )
    first = [str(one) for one in parameters if str(one) in found]
    return tuple(dict.fromkeys([*first, *found]))


def _places(count: Count) -> dict[str, tuple[int, ...]]:
    """Where each named variable stands in an event."""
    places: dict[str, tuple[int, ...]] = {}
    for at, one in enumerate(count.type.parameters):
        if isinstance(one, ChronicleVariable) and one.name:
            places[str(one)] = (*places.get(str(one), ()), at)
    return places
