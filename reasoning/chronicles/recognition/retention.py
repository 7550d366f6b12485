"""Which remembered events can still be part of an instance that is not reported yet.

For one event the minimal network gives windows for all other instants, and predicates that have failed already narrow
them: a `noevent` that begins no later than h has been broken by an event at b >= h, so its end is not after b. If no
window reaches the present, or one has passed without an event in it, the event is dead: it is dominated by those that
came later. Events without such a proof are kept; forgetting never loses an instance.
"""

from bisect import bisect_left, bisect_right
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any, NamedTuple

from dyknow.reasoning.chronicles.definition.compilation import Compiled, CountNode, EventNode
from dyknow.reasoning.chronicles.definition.expansion import Point
from dyknow.reasoning.chronicles.definition.network import UNBOUNDED
from dyknow.reasoning.chronicles.recognition.needs import EventNeeds, Needs, Other, Windows, part
from dyknow.reasoning.chronicles.recognition.stores import MINUS_INFINITY, SINCE_EVER, Key, Store


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


class Retention:
    """Decides for one chronicle, whose events are in `stores`, and whose complete instances that wait in `waiting`."""

    def __init__(self, compiled: Compiled, stores: Sequence[Store], waiting: Collection[Any]) -> None:
        self._compiled, self._stores, self._waiting = compiled, stores, waiting
        of_nodes = Needs(compiled, stores)
        self._counts: list[list[CountNode]] = [
            [node for node in compiled.counts if node.pattern == pattern] for pattern in range(len(stores))
        ]
        self._limits = of_nodes.limits
        self._instants = tuple(node.instant for node in compiled.events)
        self._last = [(node.instant, node.shift_ms) for node in compiled.events]
        self._last += [node.end for node in compiled.counts if node.late or node.maximum is not None]
        self._late_ends = of_nodes.late_ends
        self._reach = [
            (self._reaching(compiled.bounds, instant), self._reaching(compiled.aged, instant))
            for instant in range(compiled.size)
        ]
        self._oldest: dict[int, int] = {}
        self._events = [
            [
                (of_nodes.of(node, compiled.aged), of_nodes.of(node, compiled.bounds))
                for node in compiled.events
                if node.pattern == pattern
            ]
            for pattern in range(len(stores))
        ]
        """By pattern: the needs of an event of each node, and of an initial value, which has no age."""

    def dooms(self, pattern: int) -> tuple[Doom, ...]:
        """The dooms of events of a pattern."""
        return tuple(
            doom
            for count in self._limits
            if count.pattern == pattern and count.maximum == 0
            for needs in self._events
            if len(needs) == 1 and (doom := self._doom(count, needs[0][0].node)) is not None
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
        return Doom(node.pattern, part(mine, theirs), count.begin[1] - node.shift_ms, reach - shift_ms)

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
        since = clock_ms
        for node in self._counts[pattern]:
            since = min(since, self._since(node, key, clock_ms))
        events, alive = self._events[pattern], self._alive
        kept = []
        for time in times:
            keep = time >= since
            if not keep:
                for needs, initial in events:
                    at_ms = time - needs.node.shift_ms
                    if alive(initial if at_ms < SINCE_EVER else needs, key, at_ms, clock_ms):
                        keep = True
                        break
            kept.append(keep)
        return kept

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
                bucket = self._stores[node.pattern].buckets.get(part(mine, theirs)(key))
                oldest = clock_ms if bucket is None else bucket.times[0] - node.shift_ms
            else:
                oldest = self._oldest.get(node.instant, MINUS_INFINITY)
            latest = max(latest, min(oldest, clock_ms) - apart)
        return latest

    def _alive(self, needs: EventNeeds, key: Key, time_ms: int, clock_ms: int) -> bool:
        """Whether an event may become a part of an instance that is not complete yet."""
        if time_ms + needs.reach < clock_ms:
            return False
        windows = None
        if needs.limits:
            windows = needs.windows(time_ms)
            for count, key_of in needs.limits * 2:  # a count narrowed by one limit may be narrowed further by another
                bucket = self._stores[count.pattern].buckets.get(key_of(key))
                if bucket is not None:
                    self._narrow(windows, count, bucket.times)
            if not self._awaits(windows, needs.awaited, clock_ms):
                return False
        for other in needs.others:
            if windows is None:
                first, last = time_ms + other.first, time_ms + other.last
            else:
                instant, shift_ms = other.node.instant, other.node.shift_ms
                first, last = windows.low[instant] + shift_ms, windows.high[instant] + shift_ms
            if last < clock_ms and not self._has(needs, other, key, time_ms, first, last, windows, clock_ms):
                return False
        return True

    def _awaits(self, windows: Windows, awaited: Sequence[Point], clock_ms: int) -> bool:
        """Whether all windows are left, and that of an event that is awaited reaches the present."""
        low, high = windows
        for instant in self._instants:
            if low[instant] > high[instant]:
                return False
        for instant, shift_ms in awaited:
            if high[instant] + shift_ms >= clock_ms:
                return True
        return any(high[instant] + shift > clock_ms for instant, shift in self._late_ends)

    def _has(
        self,
        needs: EventNeeds,
        other: Other,
        key: Key,
        time_ms: int,
        first: int,
        last: int,
        windows: Windows | None,
        clock_ms: int,
    ) -> bool:
        """Whether an event that must have come has come, between these times, and both together are alive.

        Initial values always may be.
        """
        buckets, known = self._stores[other.node.pattern].buckets, other.key(key)
        if other.keys is None:
            bucket = buckets.get(known)
            if bucket is None:
                return False
            times = bucket.times
            return times[0] == MINUS_INFINITY or bisect_left(times, first) < bisect_right(times, last)
        for theirs in other.keys.get(known, ()):
            times = buckets[theirs].times
            if times[0] == MINUS_INFINITY:
                return True
            begin, end = bisect_left(times, first), bisect_right(times, last)
            if begin < end:
                broken = self._broken(needs, other, key, theirs)
                if broken is None:
                    return True
                if not broken and windows is None:
                    latest_ms = times[end - 1] - other.node.shift_ms
                    for mine_ms, their_ms in other.reaches:
                        if time_ms + mine_ms >= clock_ms and latest_ms + their_ms >= clock_ms:
                            return True
                elif self._pair(other, times[begin:end], broken, windows or needs.windows(time_ms), clock_ms):
                    return True
        return False

    def _broken(
        self, needs: EventNeeds, other: Other, mine: Key, theirs: Key
    ) -> list[tuple[CountNode, Sequence[int]]] | None:
        """The counts of predicates with all their variables from both events; None: no predicate has."""
        if not other.own_limits and not other.limits:
            return None
        stores, found = self._stores, list[tuple[CountNode, Sequence[int]]]()
        for count, key_of in other.own_limits:
            bucket = stores[count.pattern].buckets.get(key_of(theirs))
            if bucket is not None:
                found.append((count, bucket.times))
        if other.limits:
            both = (*_several(mine, needs.node, self._compiled), *_several(theirs, other.node, self._compiled))
            for count, key_of in other.limits:
                bucket = stores[count.pattern].buckets.get(key_of(both))
                if bucket is not None:
                    found.append((count, bucket.times))
        return found

    def _pair(
        self,
        other: Other,
        times: Sequence[int],
        broken: Sequence[tuple[CountNode, Sequence[int]]],
        windows: Windows,
        clock_ms: int,
    ) -> bool:
        """Whether the other event at one of the times is alive together with the event that has the windows."""
        for time in reversed(times):
            narrowed = other.with_windows(windows, time - other.node.shift_ms)
            for count, counted in broken:
                self._narrow(narrowed, count, counted)
            if self._awaits(narrowed, other.awaited, clock_ms):
                return True
        return False

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
