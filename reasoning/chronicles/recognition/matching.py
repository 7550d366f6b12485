"""The recogniser of one chronicle: remembered events, joins, and instances that wait for the clock.

An event is remembered if a predicate speaks of it; if it can be the last one, a join finds what it completes. Such a
set of events is an instance at once, never, or waits: for the end of an interval with an upper limit, or for events
that are still to be counted. Only such complete sets of events are objects; everything else is times in lists.
"""

from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from heapq import heappop, heappush
from typing import Any, Final, NamedTuple, TypeAlias

from dyknow.reasoning.chronicles.definition.compilation import Compiled, CountNode, EventNode
from dyknow.reasoning.chronicles.recognition.joining import Plan, can_be_last
from dyknow.reasoning.chronicles.recognition.retention import Retention
from dyknow.reasoning.chronicles.recognition.stores import (
    MINUS_INFINITY,
    SINCE_EVER,
    Bucket,
    Key,
    Store,
    Values,
    getter,
)
from dyknow.reasoning.chronicles.recognition.witness import Witness

SWEEP_AFTER: Final = 1024
"""New events that are remembered before all keys are examined, or as many as remained last time, whichever is more."""

LIMIT_DOOMED: Final = 100_000
"""Most events that are known beforehand to be forgotten; the others are found when there are too many of a key."""

Identity: TypeAlias = tuple[tuple[Any, ...], tuple[int, ...]]


@dataclass(frozen=True, slots=True)
class RecognitionLimits:
    """Hard caps; events beyond them are counted as incomplete (C6). Those of events hold after each tidying: there may
    be twice as many before.
    """

    events: int = 1_000_000
    events_of_one_binding: int = 10_000
    waiting: int = 100_000
    found_at_once: int = 10_000


class ChronicleInstance(NamedTuple):
    """A chronicle that was recognised.

    Attributes:
        bindings: symbols of its bound variables, `?car1`.
        instants: times of the instants that events fix, ms; an initial value's is `MINUS_INFINITY`.
        recognised_ms: the clock at which it was settled.
    """

    chronicle: str
    bindings: Mapping[str, str]
    instants: Mapping[str, int]
    recognised_ms: int


@dataclass(eq=False, slots=True)
class Waiting:
    """All events that fix instants are there, and something is still to be counted, or to be passed.

    Attributes:
        next_ms: when it is looked at again.
        after_ms: of a chronicle without fixed instants: when it was recognised last.
    """

    symbols: tuple[Any, ...]
    times: tuple[int, ...]
    next_ms: int | None = None
    after_ms: int | None = None
    keys: list[tuple[int, Key]] = field(default_factory=list)


class Matcher:
    """Recognises one chronicle. Events come in the order of time; times are ms.

    Attributes:
        incomplete: counts of events and instances beyond a limit, by reason.
    """

    def __init__(self, compiled: Compiled, limits: RecognitionLimits) -> None:
        self.compiled = compiled
        self.incomplete: Counter[str] = Counter()
        self._limits = limits
        self._stores = [Store(pattern.plural) for pattern in compiled.patterns]
        self._keys = [getter(pattern.key) for pattern in compiled.patterns]
        self._count_keys = {count: getter(compiled.patterns[count.pattern].variables) for count in compiled.counts}
        self._plans: list[list[Plan]] = [[] for _ in compiled.patterns]
        self._first_plans: list[list[Plan]] = [[] for _ in compiled.patterns]
        for node in compiled.events:
            if can_be_last(compiled, node):
                self._plans[node.pattern].append(Plan(compiled, self._stores, node))
        for count in compiled.counts:
            if count.late and (count.binds or not compiled.events):
                self._first_plans[count.pattern].append(Plan(compiled, self._stores, count))
        self._late = late = tuple(count for count in compiled.counts if count.late)
        self._wakes = [
            bool(self._plans[at] or self._first_plans[at] or any(count.pattern == at for count in late))
            for at in range(len(compiled.patterns))
        ]
        self._witness = Witness(compiled)
        self._doomed: deque[tuple[int, int, Key, int]] = deque(maxlen=LIMIT_DOOMED)
        self._waiting: dict[Identity, Waiting] = {}
        self.retention = Retention(compiled, self._stores, self._waiting)
        self._dooms = [self.retention.dooms(at) for at in range(len(compiled.patterns))]
        self._by_key: dict[tuple[int, Key], dict[Identity, Waiting]] = {}
        self._told: set[Identity] = set()
        self._remembers_told = any(plans for plans in self._first_plans) and bool(compiled.fixed)
        self._heap: list[tuple[int, int, Waiting]] = []
        self._pushed = self._inserted = self._left = 0

    @property
    def deadline_ms(self) -> int | None:
        """When something is settled, or given up, if no event comes before."""
        while self._heap and self._heap[0][2].next_ms != self._heap[0][0]:
            heappop(self._heap)
        return self._heap[0][0] if self._heap else None

    @property
    def waits(self) -> bool:
        """Whether anything may be due at some clock."""
        return bool(self._heap)

    @property
    def live(self) -> int:
        """Events remembered and instances that wait."""
        return sum(store.size for store in self._stores) + len(self._waiting)

    @property
    def live_of_one_binding(self) -> int:
        """The most events of one pattern and binding that are remembered now."""
        return max((len(one.times) for store in self._stores for one in store.buckets.values()), default=0)

    def on_event(self, patterns: Sequence[int], values: Values, time_ms: int, clock_ms: int) -> list[ChronicleInstance]:
        """An event of these patterns came; the clock is at its time (an initial value's is before any clock)."""
        stores, fresh = self._stores, None
        if self._doomed and self._doomed[0][0] < clock_ms:
            self._forget_doomed(clock_ms)
        for pattern in patterns:
            key = self._keys[pattern](values)
            store = stores[pattern]
            new = store.insert(key, time_ms, values)
            if new:
                bucket = store.buckets[key]
                if len(bucket.times) > bucket.limit:
                    self._tidy(pattern, key, clock_ms)
                for doom in self._dooms[pattern]:
                    theirs = doom.part(key)
                    if theirs in stores[doom.pattern].buckets:
                        self._doomed.append((time_ms + doom.end_ms, doom.pattern, theirs, time_ms - doom.begin_ms))
                if self._wakes[pattern]:
                    fresh = fresh or []
                    fresh.append((pattern, key, new))
                self._inserted += 1
        if self._inserted > SWEEP_AFTER and self._inserted > self._left:
            self.sweep(clock_ms)
        return [] if fresh is None else self._completed(fresh, time_ms, clock_ms)

    def _forget_doomed(self, clock_ms: int) -> None:
        """Forget what broken predicates have left no future; an event that comes later never dies much earlier."""
        doomed = self._doomed
        while doomed and doomed[0][0] < clock_ms:
            _, pattern, key, until_ms = doomed.popleft()
            self._stores[pattern].drop(key, until_ms)

    def _completed(self, fresh: Sequence[tuple[int, Key, int]], time_ms: int, clock_ms: int) -> list[ChronicleInstance]:
        told: list[ChronicleInstance] = []
        seen: set[Identity] = set()
        for pattern, key, new in fresh:
            plans = self._plans[pattern] if new == 2 else []
            if self._first_plans[pattern] and self._is_first(pattern, key):
                plans = plans + self._first_plans[pattern]
            for plan in plans:
                if plan.with_ms and any(store.latest_ms != time_ms for store in plan.with_ms):
                    continue
                for symbols, times in plan.found(key, time_ms):
                    if len(seen) >= self._limits.found_at_once:
                        self.incomplete["instances found by one event"] += 1
                        break
                    self._found(symbols, times, clock_ms, seen, told)
                if plan.exhausted:
                    self.incomplete["events joined with one event"] += 1
            if self._late:
                for waiting in list(self._by_key.get((pattern, key), {}).values()):
                    self._look(waiting, clock_ms, told)
        return told

    def _is_first(self, pattern: int, key: Key) -> bool:
        bucket = self._stores[pattern].buckets.get(key)
        return bucket is not None and len(bucket.times) == 1

    def _found(
        self,
        symbols: Sequence[Any],
        times: Sequence[int],
        clock_ms: int,
        seen: set[Identity],
        told: list[ChronicleInstance],
    ) -> None:
        identity = (tuple(symbols), tuple(times))
        if identity in seen or identity in self._waiting or identity in self._told:
            return
        seen.add(identity)
        waiting = Waiting(*identity)
        if not self.compiled.counts:
            told.append(self._instance(waiting, clock_ms))
            return
        self._look(waiting, clock_ms, told)

    def _look(self, waiting: Waiting, clock_ms: int, told: list[ChronicleInstance]) -> None:
        """Decide about an instance at this clock, and when to look again."""
        outcome = self._witness.outcome(
            waiting.times, lambda node: self.counted(node, waiting.symbols), clock_ms, waiting.after_ms
        )
        if not outcome.complete:
            self.incomplete["choices of events to count"] += 1
        if outcome.settled:
            told.append(self._instance(waiting, clock_ms))
            if self.compiled.fixed:
                if self._remembers_told:
                    self._told.add((waiting.symbols, waiting.times))
                self._drop(waiting)
                return
            waiting.after_ms, waiting.next_ms = clock_ms, None
            self._keep(waiting)
        elif outcome.dead and self.compiled.fixed:
            self._drop(waiting)
        else:
            waiting.next_ms = outcome.next_ms
            self._keep(waiting)
            if outcome.next_ms is not None:
                self._pushed += 1
                heappush(self._heap, (outcome.next_ms, self._pushed, waiting))

    def counted(self, node: CountNode, symbols: Sequence[Any]) -> Sequence[int]:
        """Times of the events that a predicate counts for these symbols."""
        bucket = self._stores[node.pattern].buckets.get(self._count_keys[node](symbols))
        if bucket is None:
            return ()
        if not node.across:
            return bucket.times
        environment = dict(zip(self.compiled.variables, symbols, strict=True))
        found = []
        for time, values in zip(bucket.times, bucket.values, strict=True):
            for condition, places in node.across:
                if not condition.test({**environment, **{name: values[place] for name, place in places}}):
                    break
            else:
                found.append(time)
        return found

    def _keep(self, waiting: Waiting) -> None:
        identity = (waiting.symbols, waiting.times)
        if identity in self._waiting:
            return
        if len(self._waiting) >= self._limits.waiting:
            self.incomplete["instances that wait"] += 1
            self._drop(next(iter(self._waiting.values())))
        self._waiting[identity] = waiting
        waiting.keys = [(count.pattern, self._count_keys[count](waiting.symbols)) for count in self._late]
        for key in waiting.keys:
            self._by_key.setdefault(key, {})[identity] = waiting

    def _drop(self, waiting: Waiting) -> None:
        identity = (waiting.symbols, waiting.times)
        waiting.next_ms = None
        self._waiting.pop(identity, None)
        for key in waiting.keys:
            found = self._by_key.get(key, {})
            found.pop(identity, None)
            if not found:
                self._by_key.pop(key, None)
        waiting.keys = []

    def on_time(self, now_ms: int) -> list[ChronicleInstance]:
        """Look at what waits for this clock, or an earlier one. Call it at `deadline_ms`: that is the clock it takes."""
        told: list[ChronicleInstance] = []
        while (due_ms := self.deadline_ms) is not None and due_ms <= now_ms:
            waiting = heappop(self._heap)[2]
            waiting.next_ms = None
            self._look(waiting, due_ms, told)
        return told

    def _instance(self, waiting: Waiting, clock_ms: int) -> ChronicleInstance:
        compiled = self.compiled
        return ChronicleInstance(
            compiled.name,
            dict(zip(compiled.variables, waiting.symbols, strict=True)),
            dict(zip(compiled.fixed, map(told_time, waiting.times), strict=False)),
            clock_ms,
        )

    def parameters(self, instance: ChronicleInstance) -> Values:
        """The arguments of the event that an instance is for other chronicles."""
        names = self.compiled.variables
        return tuple(instance.bindings[names[one]] if isinstance(one, int) else one for one in self.compiled.parameters)

    def _tidy(self, pattern: int, key: Key, clock_ms: int) -> None:
        """Forget events of one key that no instance needs."""
        store = self._stores[pattern]
        kept = self.retention.kept(pattern, key, clock_ms)
        surplus = sum(kept) - self._limits.events_of_one_binding
        if surplus > 0:
            self.incomplete["events of one binding"] += surplus
            for at, keep in enumerate(kept):
                if keep and surplus > 0:
                    kept[at] = False
                    surplus -= 1
        store.keep(key, kept)

    def sweep(self, clock_ms: int) -> None:
        """Forget all that no instance needs."""
        self.retention.look(clock_ms, [waiting.times for waiting in self._waiting.values()])
        for pattern, store in enumerate(self._stores):
            for key in list(store.buckets):
                self._tidy(pattern, key, clock_ms)
        self._forget_told()
        left = sum(store.size for store in self._stores)
        if left > self._limits.events:
            self._cut(left - self._limits.events)
        self._left, self._inserted = sum(store.size for store in self._stores), 0

    def _cut(self, surplus: int) -> None:
        """Forget the oldest events, however much they may matter."""
        times = sorted(time for store in self._stores for one in store.buckets.values() for time in one.times)
        newest = times[surplus - 1]
        for store in self._stores:
            for key, bucket in list(store.buckets.items()):
                kept = [time > newest for time in bucket.times]
                self.incomplete["events"] += len(kept) - sum(kept)
                store.keep(key, kept)

    def _forget_told(self) -> None:
        """Forget reported instances that cannot be found again, since an event or all counted ones are forgotten."""
        if self._told:
            self._told = {one for one in self._told if self._remembered(*one)}
        if not self.compiled.fixed:
            for waiting in list(self._waiting.values()):
                if not any(self.counted(count, waiting.symbols) for count in self._late):
                    self._drop(waiting)

    def _remembered(self, symbols: Sequence[Any], times: Sequence[int]) -> bool:
        for node in self.compiled.events:
            bucket = self._stores[node.pattern].buckets.get(self._event_key(node)(symbols))
            if bucket is None or bucket.times[0] > times[node.instant] + node.shift_ms:
                return False
        return True

    def _event_key(self, node: EventNode) -> Callable[[Sequence[Any]], Key]:
        return getter(self.compiled.patterns[node.pattern].variables)

    def remembered(self, pattern: int) -> Iterator[tuple[Key, Bucket]]:
        """Events of a pattern by key."""
        yield from self._stores[pattern].buckets.items()

    def waiting(self) -> Iterator[Waiting]:
        """Instances whose events are all there."""
        yield from self._waiting.values()


def told_time(time_ms: int) -> int:
    """An instant as it is reported: `MINUS_INFINITY` if an initial value fixes it, however it is shifted."""
    return MINUS_INFINITY if time_ms < SINCE_EVER else time_ms
