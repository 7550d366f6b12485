"""Which remembered events can still be part of an instance that is not told yet.

For one event the minimal network gives windows for all other instants, and predicates that have failed already narrow
them: a `noevent` that begins no later than h has been broken by an event at b >= h, so its end is not after b. If no
window reaches the present, or one has passed without an event in it, the event is dead: it is dominated by those that
came later. Whatever is not decided so is kept; forgetting never loses an instance.
"""

from bisect import bisect_left, bisect_right
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any, NamedTuple

from reasoning.chronicles.compilation import Compiled, CountNode, EventNode
from reasoning.chronicles.joining import shifted
from reasoning.chronicles.network import UNBOUNDED
from reasoning.chronicles.stores import MINUS_INFINITY, Key, Store, getter


class Windows(NamedTuple):
    """Earliest and latest time of each instant; -UNBOUNDED and UNBOUNDED if there is none."""

    low: list[int]
    high: list[int]


class _Beside(NamedTuple):
    """A predicate or event whose variables are among those of an event: its events are found by that event's key."""

    node: Any
    key: Callable[[Any], Key]


class Retention:
    """Decides for one chronicle, whose events are in `stores`, and whose complete instances that wait in `waiting`."""

    def __init__(self, compiled: Compiled, stores: Sequence[Store], waiting: Collection[Any]) -> None:
        self._compiled, self._stores, self._waiting = compiled, stores, waiting
        self._events: list[list[EventNode]] = [
            [node for node in compiled.events if node.pattern == pattern] for pattern in range(len(stores))
        ]
        self._counts: list[list[CountNode]] = [
            [node for node in compiled.counts if node.pattern == pattern] for pattern in range(len(stores))
        ]
        limits = [node for node in compiled.counts if node.maximum is not None and not node.across]
        self._limits = {node: self._beside(node, limits) for node in compiled.events}
        self._others = {
            node: self._beside(node, [one for one in compiled.events if one != node]) for node in compiled.events
        }
        self._last = [(node.instant, node.shift_ms) for node in compiled.events]
        self._last += [node.end for node in compiled.counts if node.late or node.maximum is not None]
        self._late_ends = [node.end for node in compiled.counts if node.late]
        self._oldest: dict[int, int] = {}

    def _beside(self, event: EventNode, nodes: Sequence[Any]) -> list[_Beside]:
        mine = self._compiled.patterns[event.pattern].variables
        found = []
        for node in nodes:
            theirs = self._compiled.patterns[node.pattern].variables
            if set(theirs) <= set(mine):
                found.append(_Beside(node, _part(mine, theirs)))
        return found

    def look(self, clock_ms: int, waiting: Sequence[Sequence[int]]) -> None:
        """Before all keys are looked through: how old each fixed instant of what lives may be."""
        for instant in range(len(self._compiled.fixed)):
            ages = [times[instant] for times in waiting]
            for node in self._compiled.events:
                if node.instant == instant:
                    oldest = self._stores[node.pattern].oldest_ms
                    ages.append(clock_ms if oldest is None else shifted(oldest, node.shift_ms))
            self._oldest[instant] = min(ages)

    def kept(self, pattern: int, key: Key, clock_ms: int) -> list[bool]:
        """For each event of a key whether it is still needed."""
        times = self._stores[pattern].buckets[key].times
        since = min((self._since(node, key, clock_ms) for node in self._counts[pattern]), default=UNBOUNDED)
        events = self._events[pattern]
        return [
            time >= since or any(self._alive(node, key, shifted(time, node.shift_ms), clock_ms) for node in events)
            for time in times
        ]

    def _since(self, node: CountNode, key: Key, clock_ms: int) -> int:
        """The earliest event that a predicate may still have to count."""
        start, shift_ms = node.begin
        for bounds in (self._compiled.bounds, self._compiled.aged):
            reach = max(bounds[start][instant] + shift for instant, shift in self._last)
            if reach < UNBOUNDED // 2 and (bounds is self._compiled.bounds or not self._has_initial()):
                return clock_ms - reach + shift_ms
        return self._start(node, start, key, clock_ms) + shift_ms

    def _has_initial(self) -> bool:
        return any(store.oldest_ms == MINUS_INFINITY for store in self._stores)

    def _start(self, count: CountNode, start: int, key: Key, clock_ms: int) -> int:
        """The earliest time that the begin of an interval can have, by what is remembered."""
        latest = -UNBOUNDED
        mine = self._compiled.patterns[count.pattern].variables
        for node in self._compiled.events:
            apart = self._compiled.bounds[start][node.instant]
            if apart >= UNBOUNDED:
                continue
            theirs = self._compiled.patterns[node.pattern].variables
            if set(theirs) <= set(mine) and not self._waiting:
                bucket = self._stores[node.pattern].buckets.get(_part(mine, theirs)(key))
                oldest = clock_ms if bucket is None else shifted(bucket.times[0], node.shift_ms)
            else:
                oldest = self._oldest.get(node.instant, MINUS_INFINITY)
            latest = max(latest, min(oldest, clock_ms) - apart)
        return latest

    def _alive(self, node: EventNode, key: Key, time_ms: int, clock_ms: int) -> bool:
        """Whether an event may become a part of an instance that is not complete yet."""
        windows = self.windows({node.instant: time_ms})
        if windows is None:
            return False
        for count, part in self._limits[node] * 2:  # what one narrows, another may narrow further
            bucket = self._stores[count.pattern].buckets.get(part(key))
            if bucket is not None:
                self._narrow(windows, count, bucket.times)
        low, high = windows
        for other, part in self._others[node]:
            if high[other.instant] + other.shift_ms < clock_ms:
                bucket = self._stores[other.pattern].buckets.get(part(key))
                if bucket is None or not self._holds(bucket.times, other, low, high):
                    return False
        if any(low[other.instant] > high[other.instant] for other in self._compiled.events):
            return False
        if any(high[one.instant] + one.shift_ms >= clock_ms for one in self._compiled.events if one is not node):
            return True
        return any(high[instant] + shift > clock_ms for instant, shift in self._late_ends)

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
            bounds = self._compiled.bounds if time == MINUS_INFINITY else self._compiled.aged
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


def _part(mine: Sequence[int], theirs: Sequence[int]) -> Callable[[Any], Key]:
    """Picks the key over `theirs` from one over `mine`."""
    if tuple(mine) == tuple(theirs):
        return lambda key: key
    if len(mine) == 1:
        return lambda _key: ()
    return getter([list(mine).index(slot) for slot in theirs])
