"""Which remembered events can still be part of an instance that is not reported yet.

For one event the minimal network gives windows for all other instants, and predicates that have failed already narrow
them: a `noevent` that begins no later than h has been broken by an event at b >= h, so its end is not after b. If no
window reaches the present, or one has passed without an event in it, the event is dead: it is dominated by those that
came later. Events without such a proof are kept; forgetting never loses an instance.
"""

from bisect import bisect_left, bisect_right
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any, NamedTuple

from reasoning.chronicles.definition.compilation import Compiled, CountNode, EventNode
from reasoning.chronicles.definition.network import UNBOUNDED
from reasoning.chronicles.recognition.stores import MINUS_INFINITY, SINCE_EVER, Key, Store, getter


class Windows(NamedTuple):
    """Earliest and latest time of each instant; -UNBOUNDED and UNBOUNDED if there is none."""

    low: list[int]
    high: list[int]


class _Limit(NamedTuple):
    """A predicate with an upper limit whose variables are among those that are known; `key` picks its key from them."""

    limit: CountNode
    key: Callable[[Any], Key]


class Doom(NamedTuple):
    """An event at b that breaks a `noevent` after events of the same key, once for all of these.

    Attributes:
        pattern: of the events that are doomed, those at b - `begin_ms` and before; nothing else needs them.
        part: picks their key from that of the event that breaks.
        end_ms: they are dead when the clock is beyond b + `end_ms`.
    """

    pattern: int
    part: Callable[[Any], Key]
    begin_ms: int
    end_ms: int


class _Other(NamedTuple):
    """An event that an instance needs besides the one that is looked at.

    Attributes:
        key: picks what of its key is known.
        keys: its keys by their known part; None: the whole key is known.
        limits: predicates that both events together give all variables to.
    """

    node: EventNode
    key: Callable[[Any], Key]
    keys: Mapping[Key, Collection[Key]] | None
    limits: tuple[_Limit, ...]


class _Asked(NamedTuple):
    """Constraints on the events of one node: offsets of the windows of all instants, and what narrows them."""

    node: EventNode
    low: tuple[int, ...]
    high: tuple[int, ...]
    low_initial: tuple[int, ...]
    high_initial: tuple[int, ...]
    limits: tuple[_Limit, ...]
    others: tuple[_Other, ...]


class Retention:
    """Decides for one chronicle, whose events are in `stores`, and whose complete instances that wait in `waiting`."""

    def __init__(self, compiled: Compiled, stores: Sequence[Store], waiting: Collection[Any]) -> None:
        self._compiled, self._stores, self._waiting = compiled, stores, waiting
        self._limits = [node for node in compiled.counts if node.maximum is not None and not node.across]
        self._counts: list[list[CountNode]] = [
            [node for node in compiled.counts if node.pattern == pattern] for pattern in range(len(stores))
        ]
        self._last = [(node.instant, node.shift_ms) for node in compiled.events]
        self._last += [node.end for node in compiled.counts if node.late or node.maximum is not None]
        self._late_ends = [node.end for node in compiled.counts if node.late]
        self._reach = [
            (self._reaching(compiled.bounds, instant), self._reaching(compiled.aged, instant))
            for instant in range(compiled.size)
        ]
        self._oldest: dict[int, int] = {}
        self._events: list[list[_Asked]] = [
            [self._asked(node) for node in compiled.events if node.pattern == pattern] for pattern in range(len(stores))
        ]

    def dooms(self, pattern: int) -> tuple[Doom, ...]:
        """The dooms of events of a pattern."""
        return tuple(
            doom
            for count in self._limits
            if count.pattern == pattern and count.maximum == 0
            for asked in self._events
            if len(asked) == 1 and (doom := self._doom(count, asked[0].node)) is not None
        )

    def _doom(self, count: CountNode, node: EventNode) -> Doom | None:
        patterns, bounds = self._compiled.patterns, self._compiled.bounds
        theirs, mine = patterns[node.pattern].variables, patterns[count.pattern].variables
        if count.begin[0] != node.instant or set(theirs) != set(mine) or self._counts[node.pattern]:
            return None
        end, shift_ms = count.end
        last = [(one.instant, one.shift_ms) for one in self._compiled.events if one is not node] + self._late_ends
        reach = max((bounds[end][instant] + shift for instant, shift in last), default=UNBOUNDED)
        if reach >= UNBOUNDED // 2:
            return None
        return Doom(node.pattern, _part(mine, theirs), count.begin[1] - node.shift_ms, reach - shift_ms)

    def _asked(self, node: EventNode) -> _Asked:
        compiled, at = self._compiled, node.instant
        aged, bounds = compiled.aged, compiled.bounds
        mine = compiled.patterns[node.pattern].variables
        others = tuple(self._other(mine, one) for one in compiled.events if one is not node)
        return _Asked(
            node,
            tuple(-aged[other][at] for other in range(compiled.size)),
            tuple(aged[at]),
            tuple(-bounds[other][at] for other in range(compiled.size)),
            tuple(bounds[at]),
            self._known_limits(mine, ()),
            tuple(one for one in others if one is not None),
        )

    def _known_limits(self, mine: Sequence[int], except_: Sequence[int]) -> tuple[_Limit, ...]:
        """Limits over variables in `mine`, but not over those in `except_` alone."""
        found = []
        for count in self._limits:
            theirs = self._compiled.patterns[count.pattern].variables
            if set(theirs) <= set(mine) and not (except_ and set(theirs) <= set(except_)):
                found.append(_Limit(count, _part(mine, theirs)))
        return tuple(found)

    def _other(self, mine: Sequence[int], node: EventNode) -> _Other | None:
        theirs = self._compiled.patterns[node.pattern].variables
        shared = [slot for slot in theirs if slot in mine]
        if len(shared) == len(theirs):
            return _Other(node, _part(mine, theirs), None, ())
        if not shared:
            return None
        index = self._stores[node.pattern].index([theirs.index(slot) for slot in shared])
        return _Other(node, _part(mine, shared), index, self._known_limits((*mine, *theirs), mine))

    def _reaching(self, bounds: Sequence[Sequence[int]], start: int) -> int:
        """The most that may pass from an instant until the last thing an instance waits for."""
        return max((bounds[start][instant] + shift for instant, shift in self._last), default=UNBOUNDED)

    def look(self, clock_ms: int, waiting: Sequence[Sequence[int]]) -> None:
        """Before all keys are looked through: how old each fixed instant of what lives may be."""
        for instant in range(len(self._compiled.fixed)):
            ages = [times[instant] for times in waiting]
            for node in self._compiled.events:
                if node.instant == instant:
                    oldest = self._stores[node.pattern].oldest_ms
                    ages.append(clock_ms if oldest is None else oldest - node.shift_ms)
            self._oldest[instant] = min(ages)

    def kept(self, pattern: int, key: Key, clock_ms: int) -> list[bool]:
        """Whether each event of a key is still needed; one at the clock's time is, to recognise a repeat."""
        times = self._stores[pattern].buckets[key].times
        since = min((self._since(node, key, clock_ms) for node in self._counts[pattern]), default=clock_ms)
        since = min(since, clock_ms)
        events = self._events[pattern]
        return [
            time >= since or any(self._alive(one, key, time - one.node.shift_ms, clock_ms) for one in events)
            for time in times
        ]

    def _since(self, node: CountNode, key: Key, clock_ms: int) -> int:
        """The earliest event that a predicate may still have to count."""
        start, shift_ms = node.begin
        reach, aged = self._reach[start]
        if reach < UNBOUNDED // 2:
            return clock_ms - reach + shift_ms
        since = self._start(node, start, key, clock_ms)
        if aged < UNBOUNDED // 2 and not self._has_initial():
            since = max(since, clock_ms - aged)
        return since + shift_ms

    def _has_initial(self) -> bool:
        """Whether an event that an interval may begin with has no age."""
        return any(store.initial for store in self._stores)

    def _start(self, count: CountNode, start: int, key: Key, clock_ms: int) -> int:
        """The earliest possible begin of an interval, by the remembered events."""
        latest = -UNBOUNDED
        mine = self._compiled.patterns[count.pattern].variables
        for node in self._compiled.events:
            apart = self._compiled.bounds[start][node.instant]
            if apart >= UNBOUNDED:
                continue
            theirs = self._compiled.patterns[node.pattern].variables
            if set(theirs) <= set(mine) and not self._waiting:
                bucket = self._stores[node.pattern].buckets.get(_part(mine, theirs)(key))
                oldest = clock_ms if bucket is None else bucket.times[0] - node.shift_ms
            else:
                oldest = self._oldest.get(node.instant, MINUS_INFINITY)
            latest = max(latest, min(oldest, clock_ms) - apart)
        return latest

    def _alive(self, asked: _Asked, key: Key, time_ms: int, clock_ms: int) -> bool:
        """Whether an event may become a part of an instance that is not complete yet."""
        initial = time_ms < SINCE_EVER
        low = [time_ms + one for one in (asked.low_initial if initial else asked.low)]
        high = [time_ms + one for one in (asked.high_initial if initial else asked.high)]
        windows = Windows(low, high)
        for count, part in asked.limits * 2:  # a count narrowed by one limit may be narrowed further by another
            bucket = self._stores[count.pattern].buckets.get(part(key))
            if bucket is not None:
                self._narrow(windows, count, bucket.times)
        if not self._awaits(windows, (asked.node,), clock_ms):
            return False
        for other in asked.others:
            node = other.node
            if high[node.instant] + node.shift_ms < clock_ms and not self._has(asked, other, key, windows, clock_ms):
                return False
        return True

    def _awaits(self, windows: Windows, known: Sequence[EventNode], clock_ms: int) -> bool:
        """Whether all windows are left, and that of an event that is not known reaches the present."""
        low, high = windows
        reaches = False
        for node in self._compiled.events:
            instant = node.instant
            if low[instant] > high[instant]:
                return False
            reaches = reaches or (high[instant] + node.shift_ms >= clock_ms and not any(node is one for one in known))
        return reaches or any(high[instant] + shift > clock_ms for instant, shift in self._late_ends)

    def _has(self, asked: _Asked, other: _Other, key: Key, windows: Windows, clock_ms: int) -> bool:
        """Whether an event that must have come has come, and both together are alive."""
        buckets, known = self._stores[other.node.pattern].buckets, other.key(key)
        if other.keys is None:
            bucket = buckets.get(known)
            return bucket is not None and self._holds(bucket.times, other.node, *windows)
        return any(self._pair(asked, other, key, one, windows, clock_ms) for one in other.keys.get(known, ()))

    def _pair(self, asked: _Asked, other: _Other, mine: Key, theirs: Key, windows: Windows, clock_ms: int) -> bool:
        """Whether one of the events of a key is alive together with the event that has the windows."""
        bucket, node = self._stores[other.node.pattern].buckets[theirs], other.node
        if not self._holds(bucket.times, node, *windows):
            return False
        if not other.limits or bucket.times[0] == MINUS_INFINITY:
            return True
        both = (*_several(mine, asked.node, self._compiled), *_several(theirs, node, self._compiled))
        first = bisect_left(bucket.times, windows.low[node.instant] + node.shift_ms)
        last = bisect_right(bucket.times, windows.high[node.instant] + node.shift_ms)
        for time in reversed(bucket.times[first:last]):
            narrowed = Windows(windows.low[:], windows.high[:])
            self._set(narrowed, node.instant, time - node.shift_ms)
            for count, part in other.limits:
                found = self._stores[count.pattern].buckets.get(part(both))
                if found is not None:
                    self._narrow(narrowed, count, found.times)
            if self._awaits(narrowed, (asked.node, node), clock_ms):
                return True
        return False

    def _set(self, windows: Windows, instant: int, time_ms: int) -> None:
        """Give an instant its time, and narrow the others by it."""
        low, high = windows
        bounds = self._compiled.bounds
        for other in range(self._compiled.size):
            high[other] = min(high[other], time_ms + bounds[instant][other])
            low[other] = max(low[other], time_ms - bounds[other][instant])

    @staticmethod
    def _holds(times: Sequence[int], node: EventNode, low: Sequence[int], high: Sequence[int]) -> bool:
        """Whether one of the times is in the window of the event's instant; initial values always may be."""
        first = bisect_left(times, low[node.instant] + node.shift_ms)
        last = bisect_right(times, high[node.instant] + node.shift_ms)
        return first < last or times[0] == MINUS_INFINITY

    def windows(self, known: Mapping[int, int]) -> Windows | None:
        """Windows of all instants if some have times; None if these contradict the network."""
        size = self._compiled.size
        low, high = [-UNBOUNDED] * size, [UNBOUNDED] * size
        times = dict(known)
        if self._compiled.clock is not None:
            times[self._compiled.clock] = 0
        for instant, time in times.items():
            bounds = self._compiled.bounds if time < SINCE_EVER else self._compiled.aged
            for other in range(size):
                after, before = bounds[instant][other], bounds[other][instant]
                if after < UNBOUNDED and time + after < high[other]:
                    high[other] = time + after
                if before < UNBOUNDED and time - before > low[other]:
                    low[other] = time - before
        if any(not low[instant] <= time <= high[instant] for instant, time in times.items()):
            return None
        return Windows(low, high)

    def narrowed(self, times: Mapping[int, int], symbols: Mapping[int, Any]) -> Windows | None:
        """Windows if some instants have times and some variables symbols; None if a predicate has failed for good."""
        windows = self.windows(times)
        if windows is None:
            return None
        for count in self._compiled.counts * 2:
            variables = self._compiled.patterns[count.pattern].variables
            if count.maximum is not None and not count.across and symbols.keys() >= set(variables):
                key = symbols[variables[0]] if len(variables) == 1 else tuple(symbols[slot] for slot in variables)
                bucket = self._stores[count.pattern].buckets.get(key)
                if bucket is not None:
                    self._narrow(windows, count, bucket.times)
        return None if any(low > high for low, high in zip(*windows, strict=True)) else windows

    def _narrow(self, windows: Windows, count: CountNode, times: Sequence[int]) -> None:
        """An interval that holds too many events ends before the first that is too many, or begins after the last."""
        low, high = windows
        (begin, begin_shift), (end, end_shift) = count.begin, count.end
        most = count.maximum or 0
        at = bisect_left(times, high[begin] + begin_shift) + most
        if at < len(times) and times[at] - end_shift < high[end]:
            latest = times[at] - end_shift
            for other, apart in enumerate(self._compiled.bounds[end]):
                if apart < UNBOUNDED and latest + apart < high[other]:
                    high[other] = latest + apart
        at = bisect_left(times, low[end] + end_shift) - 1 - most
        if at >= 0 and times[at] - begin_shift + 1 > low[begin]:
            earliest = times[at] - begin_shift + 1
            for other in range(self._compiled.size):
                apart = self._compiled.bounds[other][begin]
                if apart < UNBOUNDED and earliest - apart > low[other]:
                    low[other] = earliest - apart


def _several(key: Key, node: EventNode, compiled: Compiled) -> tuple[Any, ...]:
    """A key as a tuple also if it is a single value."""
    single: tuple[Any, ...] = (key,)
    return single if len(compiled.patterns[node.pattern].variables) == 1 else tuple(key)


def _part(mine: Sequence[int], theirs: Sequence[int]) -> Callable[[Any], Key]:
    """Picks the key over `theirs` from one over `mine`."""
    if tuple(mine) == tuple(theirs):
        return _itself
    if len(mine) == 1:
        return lambda _key: ()
    return getter([list(mine).index(slot) for slot in theirs])


def _itself(key: Key) -> Key:
    return key
