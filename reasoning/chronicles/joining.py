"""In which order the events of an instance are looked for, once one of them has come (a lazy join).

Nothing is built for events that wait for others. When an event comes that can be the last of an instance, the others
are looked for among those remembered: by the values of variables that are known already, and in the windows that the
minimal network leaves. An event that must be followed by another one starts no search.
"""

from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final, TypeAlias

from reasoning.chronicles.compilation import Compiled, CountNode, EventNode
from reasoning.chronicles.conditions import Condition
from reasoning.chronicles.network import UNBOUNDED
from reasoning.chronicles.stores import MINUS_INFINITY, Bucket, Key, Store, getter

LIMIT_JOINED: Final = 1_000_000
"""So many events, or keys of events, are looked at for one event."""

Environment: TypeAlias = list[Any]
"""Symbols by slot of a bound variable; what is not known yet is whatever was there."""


@dataclass(slots=True)
class Step:
    """Look for the events of one pattern.

    Attributes:
        instant: the instant that they fix; None: only the values of their variables are looked for.
        known: picks the key, or the known part of it, from the environment.
        index: keys by their known part; None: the key is known, or nothing of it.
        fills: (slot, place in the key) of what is learned; place None: the key is the value itself.
        before: instants that have times already.
        conditions: what the environment must satisfy from here on.
    """

    store: Store
    instant: int | None
    shift_ms: int
    known: Callable[[Sequence[Any]], Key]
    index: dict[Key, dict[Key, None]] | None
    fills: tuple[tuple[int, int | None], ...]
    before: tuple[int, ...]
    conditions: tuple[Condition, ...]

    def buckets(self, symbols: Environment) -> Iterator[Bucket]:
        """The events of each key that agrees with the environment, which then holds the values of that key."""
        if not self.fills:
            bucket = self.store.buckets.get(self.known(symbols))
            if bucket is not None:
                yield bucket
            return
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

    def _plan(self, first: EventNode | CountNode) -> Iterator[Step]:
        rest: list[EventNode | CountNode] = [one for one in self._compiled.events if one is not first]
        rest += [one for one in self._compiled.counts if one.binds and one is not first]
        while rest:
            node = min(rest, key=self._cost)
            rest.remove(node)
            yield self._step(node)

    def _cost(self, node: EventNode | CountNode) -> tuple[int, bool, int]:
        """Unknown variables first, then how far the known instants leave it."""
        unknown = len(set(self._compiled.patterns[node.pattern].variables) - self._variables)
        if isinstance(node, CountNode):
            return unknown, True, 0
        bounds = self._compiled.aged
        spread = [bounds[one][node.instant] + bounds[node.instant][one] for one in self._timed]
        return unknown, False, min(spread, default=UNBOUNDED)

    def _step(self, node: EventNode | CountNode) -> Step:
        variables = self._compiled.patterns[node.pattern].variables
        known = [slot for slot in variables if slot in self._variables]
        new = [slot for slot in variables if slot not in self._variables]
        store = self._stores[node.pattern]
        index = store.index([variables.index(slot) for slot in known]) if known and new else None
        self._variables.update(new)
        before = tuple(self._timed)
        if isinstance(node, EventNode):
            self._timed.append(node.instant)
        return Step(
            store,
            node.instant if isinstance(node, EventNode) else None,
            node.shift_ms if isinstance(node, EventNode) else 0,
            getter(known),
            index,
            _fills(new, variables),
            before,
            self._ready_conditions(),
        )

    def _ready_conditions(self) -> tuple[Condition, ...]:
        names = {self._compiled.variables[slot] for slot in self._variables}
        ready = tuple(one for one in self._waiting if one.variables <= names)
        self._waiting = [one for one in self._waiting if one not in ready]
        return ready

    def found(self, key: Key, time_ms: int) -> Iterator[tuple[Environment, list[int]]]:
        """Symbols by slot and times by instant of everything that an event of this key and time completes.

        Both lists are filled anew for the next one.
        """
        self._joined = 0
        symbols: Environment = [None] * len(self._compiled.variables)
        times = [0] * self._compiled.size
        for slot, place in self._fills:
            symbols[slot] = key if place is None else key[place]
        if self._instant is not None:
            times[self._instant] = shifted(time_ms, self._shift_ms)
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
        for bucket in step.buckets(symbols):
            self._joined += 1
            if self._joined >= LIMIT_JOINED:
                return
            if step.conditions and not self._holds(step.conditions, symbols):
                continue
            if step.instant is None:
                yield from self._extend(depth + 1, symbols, times)
                continue
            for time_ms in self._times(bucket, step, times):
                self._joined += 1
                if self._joined >= LIMIT_JOINED:
                    return
                times[step.instant] = shifted(time_ms, step.shift_ms)
                yield from self._extend(depth + 1, symbols, times)

    def _times(self, bucket: Bucket, step: Step, times: Sequence[int]) -> Sequence[int]:
        """Times of events that the known instants leave room for."""
        low, high, instant = -UNBOUNDED, UNBOUNDED, step.instant or 0
        for one in step.before:
            time = times[one]
            bounds = self._compiled.bounds if time == MINUS_INFINITY else self._compiled.aged
            after, before = bounds[one][instant], bounds[instant][one]
            if after < UNBOUNDED and time + after < high:
                high = time + after
            if before < UNBOUNDED and time - before > low:
                low = time - before
        found = bucket.times
        near = found[bisect_left(found, low + step.shift_ms) : bisect_right(found, high + step.shift_ms)]
        if found[0] == MINUS_INFINITY and (not near or near[0] != found[0]) and self._initial_fits(times, step):
            near = [MINUS_INFINITY, *near]
        return list(dict.fromkeys(near)) if step.store.plural else near

    def _initial_fits(self, times: Sequence[int], step: Step) -> bool:
        """Whether an initial value, which has no age, may stand at this step's instant."""
        instant, bounds = step.instant or 0, self._compiled.bounds
        tried = [MINUS_INFINITY if at == instant else time for at, time in enumerate(times)]
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


def shifted(time_ms: int, shift_ms: int) -> int:
    """Time of the instant whose event, shifted, has the time given."""
    return MINUS_INFINITY if time_ms == MINUS_INFINITY else time_ms - shift_ms


def _fills(slots: Sequence[int], variables: Sequence[int]) -> tuple[tuple[int, int | None], ...]:
    """Where the values of slots stand in a key of these variables."""
    return tuple((slot, None if len(variables) == 1 else variables.index(slot)) for slot in slots)


def can_be_last(compiled: Compiled, node: EventNode) -> bool:
    """Whether no other event must come after the node's, so that it may be the one that completes an instance."""
    return all(
        compiled.bounds[other.instant][node.instant] + node.shift_ms - other.shift_ms >= 0 for other in compiled.events
    )
