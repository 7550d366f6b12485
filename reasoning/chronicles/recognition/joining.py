"""In which order the events of an instance are looked for, once one of them has come (a lazy join).

Nothing is built for events that wait for others. When an event comes that can be the last of an instance, the others
are looked for among those remembered: by the values of variables that are known already, and in the windows that the
minimal network leaves. An event that must be followed by another one starts no search.
"""

from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple, TypeAlias

from dyknow.reasoning.chronicles.definition.compilation import Compiled, CountNode, EventNode
from dyknow.reasoning.chronicles.definition.conditions import Condition
from dyknow.reasoning.chronicles.definition.expansion import Point
from dyknow.reasoning.chronicles.definition.network import UNBOUNDED
from dyknow.reasoning.chronicles.recognition.stores import MINUS_INFINITY, SINCE_EVER, Bucket, Key, Store, getter

LIMIT_JOINED: Final = 1_000_000
"""Events, or keys of events, examined for one event."""

Environment: TypeAlias = list[Any]
"""Symbols by slot of a bound variable; the content of a slot without a known symbol is meaningless."""


class Guard(NamedTuple):
    """A predicate with an upper limit whose instants have times and whose variables have symbols."""

    store: Store
    key: Callable[[Sequence[Any]], Key]
    maximum: int
    begin: Point
    end: Point


@dataclass(slots=True)
class JoinStep:
    """Look for the events of one pattern.

    Attributes:
        instant: the instant that they fix; None: only the values of their variables are looked for.
        known: picks the key, or the known part of it, from the environment.
        index: keys by their known part; None: the key is known, or nothing of it.
        fills: (slot, place in the key) of new symbols; place None: the key is the value itself.
        before: instants that have times already.
        windows: (instant that has a time, most after it, most before it), and the same for one since ever.
        conditions: conditions on the environment from here on.
        guards: predicates that can be looked at from here on; a limit that is exceeded ends the search here.
    """

    store: Store
    instant: int | None
    shift_ms: int
    known: Callable[[Sequence[Any]], Key]
    index: dict[Key, dict[Key, None]] | None
    fills: tuple[tuple[int, int | None], ...]
    before: tuple[int, ...]
    windows: tuple[tuple[int, int, int, int, int], ...]
    conditions: tuple[Condition, ...]
    guards: tuple[Guard, ...]

    def buckets(self, symbols: Environment) -> Iterator[Bucket]:
        """The events of each key that agrees with the environment, which then holds the values of that key."""
        keys = self.store.buckets if self.index is None else self.index.get(self.known(symbols), ())
        for key in list(keys):
            for slot, place in self.fills:
                symbols[slot] = key if place is None else key[place]
            yield self.store.buckets[key]


class Plan:
    """Finds what completes an instance with an event of one node.

    Attributes:
        pattern: of the event that starts the search.
        with_ms: stores that must hold an event of the same time, or it is not the last.
        exhausted: whether the last search was given up because it looked at LIMIT_JOINED events.
    """

    def __init__(self, compiled: Compiled, stores: Sequence[Store], first: EventNode | CountNode) -> None:
        self._compiled, self._stores = compiled, stores
        self.pattern = first.pattern
        self._instant = first.instant if isinstance(first, EventNode) else None
        self._shift_ms = first.shift_ms if isinstance(first, EventNode) else 0
        variables = compiled.patterns[first.pattern].variables
        self._fills = _fills(variables, variables)
        self._variables = set(variables)
        clock = () if compiled.clock is None else (compiled.clock,)
        self._timed = list(clock) if self._instant is None else [*clock, self._instant]
        self._waiting = list(compiled.conditions)
        self._unguarded = [one for one in compiled.counts if one.maximum is not None and not one.across]
        self._first_conditions = self._ready_conditions()
        self.with_ms = tuple(stores[other.pattern] for other in compiled.events if self._only_together(other))
        self._steps = tuple(self._plan(first))
        self._joined = 0

    @property
    def exhausted(self) -> bool:
        return self._joined >= LIMIT_JOINED

    def _only_together(self, other: EventNode) -> bool:
        """Whether this plan's event, if it comes last, has the time of the other."""
        if self._instant is None:
            return False
        apart = self._compiled.bounds[other.instant][self._instant] + self._shift_ms - other.shift_ms
        return apart == 0 and (other.instant, other.shift_ms) != (self._instant, self._shift_ms)

    def _plan(self, first: EventNode | CountNode) -> Iterator[JoinStep]:
        rest: list[EventNode | CountNode] = [one for one in self._compiled.events if one is not first]
        rest += [one for one in self._compiled.counts if one.binds and one is not first]
        while rest:
            node = min(rest, key=self._cost)
            rest.remove(node)
            yield self._step(node)

    def _cost(self, node: EventNode | CountNode) -> tuple[bool, bool, int, bool, int]:
        """The order of joins: nodes that share no known variable come last, then those that an upper limit makes few
        come first, then unknown variables, and the width of the window.
        """
        variables = set(self._compiled.patterns[node.pattern].variables)
        unknown, apart = len(variables - self._variables), bool(variables) and not variables & self._variables
        if isinstance(node, CountNode):
            return apart, True, unknown, True, 0
        guarded = any(
            node.instant in {guard.begin[0], guard.end[0]} and self._is_ready(guard, variables, node.instant)
            for guard in self._unguarded
        )
        bounds = self._compiled.aged
        spread = [bounds[one][node.instant] + bounds[node.instant][one] for one in self._timed]
        return apart, not guarded, unknown, False, min(spread, default=UNBOUNDED)

    def _is_ready(self, guard: CountNode, variables: set[int], *instants: int) -> bool:
        timed = {*self._timed, *instants}
        mine = set(self._compiled.patterns[guard.pattern].variables)
        return guard.begin[0] in timed and guard.end[0] in timed and mine <= self._variables | variables

    def _step(self, node: EventNode | CountNode) -> JoinStep:
        variables = self._compiled.patterns[node.pattern].variables
        known = [slot for slot in variables if slot in self._variables]
        new = [slot for slot in variables if slot not in self._variables]
        store = self._stores[node.pattern]
        index = store.index([variables.index(slot) for slot in known]) if known and new else None
        self._variables.update(new)
        before, instant = tuple(self._timed), None
        if isinstance(node, EventNode):
            instant = node.instant
            self._timed.append(instant)
        return JoinStep(
            store,
            instant,
            node.shift_ms if isinstance(node, EventNode) else 0,
            getter(known),
            index,
            _fills(new, variables),
            before,
            () if instant is None else tuple(self._windows(instant, before)),
            self._ready_conditions(),
            tuple(self._ready_guards()),
        )

    def _windows(self, instant: int, before: Sequence[int]) -> Iterator[tuple[int, int, int, int, int]]:
        aged, bounds = self._compiled.aged, self._compiled.bounds
        for one in before:
            if min(aged[one][instant], aged[instant][one]) < UNBOUNDED:
                yield one, aged[one][instant], aged[instant][one], bounds[one][instant], bounds[instant][one]

    def _ready_guards(self) -> Iterator[Guard]:
        for guard in list(self._unguarded):
            if self._is_ready(guard, set()):
                self._unguarded.remove(guard)
                key = getter(self._compiled.patterns[guard.pattern].variables)
                yield Guard(self._stores[guard.pattern], key, guard.maximum or 0, guard.begin, guard.end)

    def _ready_conditions(self) -> tuple[Condition, ...]:
        names = {self._compiled.variables[slot] for slot in self._variables}
        ready = tuple(one for one in self._waiting if one.variables <= names)
        self._waiting = [one for one in self._waiting if one not in ready]
        return ready

    def found(self, key: Key, time_ms: int) -> Iterator[tuple[Environment, list[int]]]:
        """Symbols by slot and times by instant of everything that an event of this key and time completes.

        Both lists are refilled for the next one.
        """
        self._joined = 0
        symbols: Environment = [None] * len(self._compiled.variables)
        times = [0] * self._compiled.size
        for slot, place in self._fills:
            symbols[slot] = key if place is None else key[place]
        if self._instant is not None:
            times[self._instant] = time_ms - self._shift_ms
            if self._compiled.clock is not None and not self._in_window(times, self._instant, (self._compiled.clock,)):
                return
        if self._holds(self._first_conditions, symbols):
            yield from self._extend(0, symbols, times)

    def _holds(self, conditions: Sequence[Condition], symbols: Environment) -> bool:
        if not conditions:
            return True
        environment = dict(zip(self._compiled.variables, symbols, strict=True))
        return all(one.test(environment) for one in conditions)

    def _extend(self, depth: int, symbols: Environment, times: list[int]) -> Iterator[tuple[Environment, list[int]]]:
        if depth == len(self._steps):
            yield symbols, times
            return
        step = self._steps[depth]
        if not step.fills:
            bucket = step.store.buckets.get(step.known(symbols))
            if bucket is not None:
                yield from self._matched(bucket, step, depth, symbols, times)
            return
        for bucket in step.buckets(symbols):
            yield from self._matched(bucket, step, depth, symbols, times)

    def _matched(
        self, bucket: Bucket, step: JoinStep, depth: int, symbols: Environment, times: list[int]
    ) -> Iterator[tuple[Environment, list[int]]]:
        """Continue with each event of a key that fits."""
        self._joined += 1
        if self._joined >= LIMIT_JOINED or (step.conditions and not self._holds(step.conditions, symbols)):
            return
        if step.instant is None:
            if not step.guards or _guarded(step.guards, symbols, times):
                yield from self._extend(depth + 1, symbols, times)
            return
        for time_ms in self._times(bucket, step, times):
            self._joined += 1
            if self._joined >= LIMIT_JOINED:
                return
            times[step.instant] = time_ms - step.shift_ms
            if not step.guards or _guarded(step.guards, symbols, times):
                yield from self._extend(depth + 1, symbols, times)

    def _times(self, bucket: Bucket, step: JoinStep, times: Sequence[int]) -> Sequence[int]:
        """Times of events that the known instants leave room for."""
        low, high = -UNBOUNDED, UNBOUNDED
        for one, after, before, after_initial, before_initial in step.windows:
            time = times[one]
            if time < SINCE_EVER:
                after, before = after_initial, before_initial  # noqa: PLW2901 -- what is since ever has no age
            if after < UNBOUNDED and time + after < high:
                high = time + after
            if before < UNBOUNDED and time - before > low:
                low = time - before
        low, high, found = low + step.shift_ms, high + step.shift_ms, bucket.times
        if low <= found[0] and found[-1] <= high:
            near = found
        else:
            near = found[bisect_left(found, low) : bisect_right(found, high)]
            if found[0] == MINUS_INFINITY and (not near or near[0] != found[0]) and self._initial_fits(times, step):
                near = [MINUS_INFINITY, *near]
        return list(dict.fromkeys(near)) if step.store.plural else near

    def _initial_fits(self, times: Sequence[int], step: JoinStep) -> bool:
        """Whether an initial value, which has no age, may stand at this step's instant."""
        instant, bounds = step.instant or 0, self._compiled.bounds
        if instant in step.before:
            return times[instant] == MINUS_INFINITY - step.shift_ms
        tried = [MINUS_INFINITY - step.shift_ms if at == instant else time for at, time in enumerate(times)]
        return self._in_window(tried, instant, step.before, bounds)

    def _in_window(
        self, times: Sequence[int], instant: int, others: Sequence[int], bounds: Sequence[Sequence[int]] | None = None
    ) -> bool:
        bounds = bounds or self._compiled.aged
        return all(
            (bounds[one][instant] >= UNBOUNDED or times[instant] - times[one] <= bounds[one][instant])
            and (bounds[instant][one] >= UNBOUNDED or times[one] - times[instant] <= bounds[instant][one])
            for one in others
        )


def _guarded(guards: Sequence[Guard], symbols: Environment, times: Sequence[int]) -> bool:
    """Whether no limit is exceeded."""
    for guard in guards:
        bucket = guard.store.buckets.get(guard.key(symbols))
        if bucket is not None:
            first = bisect_left(bucket.times, times[guard.begin[0]] + guard.begin[1])
            last = bisect_left(bucket.times, times[guard.end[0]] + guard.end[1])
            if last - first > guard.maximum:
                return False
    return True


def _fills(slots: Sequence[int], variables: Sequence[int]) -> tuple[tuple[int, int | None], ...]:
    """Where the values of slots stand in a key of these variables."""
    return tuple((slot, None if len(variables) == 1 else variables.index(slot)) for slot in slots)


def can_be_last(compiled: Compiled, node: EventNode) -> bool:
    """Whether no other event must come after the node's, so that it may be the one that completes an instance."""
    return all(
        compiled.bounds[other.instant][node.instant] + node.shift_ms - other.shift_ms >= 0 for other in compiled.events
    )
