"""The needs of a remembered event to become a part of an instance: other events, their windows, the predicates that break both.

All of it is worked out once for each node of a chronicle, as times from the event's own instant on.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias

from dyknow.reasoning.chronicles.definition.compilation import Compiled, CountNode, EventNode
from dyknow.reasoning.chronicles.definition.expansion import Point
from dyknow.reasoning.chronicles.definition.network import UNBOUNDED
from dyknow.reasoning.chronicles.recognition.stores import Key, Store, getter

Bounds: TypeAlias = Sequence[Sequence[int]]
"""By two instants: the most that the second is after the first."""


class Windows(NamedTuple):
    """Earliest and latest time of each instant; -UNBOUNDED and UNBOUNDED if there is none."""

    low: list[int]
    high: list[int]


class Limit(NamedTuple):
    """A predicate with an upper limit whose variables are among those that are known; `key` picks its key from them."""

    limit: CountNode
    key: Callable[[Any], Key]


class Other(NamedTuple):
    """An event that an instance needs besides the one that is looked at; times count from that one's instant.

    Attributes:
        key: picks what of its key is known.
        keys: its keys by their known part; None: the key is known whole.
        own_limits, limits: predicates that it alone gives all variables to, or only both events together.
        first, last: between which it comes.
        awaited: the events besides both.
        reaches: the clocks until which each of these may come, or a late end matters: after the one instant and the other.
        after, before: the most that each instant may be after this event's, and before it.
    """

    node: EventNode
    key: Callable[[Any], Key]
    keys: Mapping[Key, Collection[Key]] | None
    own_limits: tuple[Limit, ...]
    limits: tuple[Limit, ...]
    first: int
    last: int
    awaited: tuple[Point, ...]
    reaches: tuple[tuple[int, int], ...]
    after: tuple[int, ...]
    before: tuple[int, ...]

    def with_windows(self, windows: Windows, time_ms: int) -> Windows:
        """The windows, narrowed by a time of this event's instant."""
        low, high = windows
        return Windows(
            [max(one, time_ms - apart) for one, apart in zip(low, self.before, strict=True)],
            [min(one, time_ms + apart) for one, apart in zip(high, self.after, strict=True)],
        )


class EventNeeds(NamedTuple):
    """Constraints on the events of one node: the windows of all instants from its own on, and what narrows them.

    Attributes:
        reach: the clock until which another event may come, or a late end matters.
        awaited: the other events.
        others: those of them that must have come at some clock.
    """

    node: EventNode
    low: tuple[int, ...]
    high: tuple[int, ...]
    reach: int
    limits: tuple[Limit, ...]
    awaited: tuple[Point, ...]
    others: tuple[Other, ...]

    def windows(self, time_ms: int) -> Windows:
        return Windows([time_ms + one for one in self.low], [time_ms + one for one in self.high])


class Needs:
    """Works it out for the nodes of one chronicle, whose events are in `stores`.

    Attributes:
        limits: predicates with an upper limit that count by their variables alone.
        late_ends: ends of intervals whose events may come after all others.
    """

    def __init__(self, compiled: Compiled, stores: Sequence[Store]) -> None:
        self._compiled, self._stores = compiled, stores
        self.limits = [node for node in compiled.counts if node.maximum is not None and not node.across]
        self.late_ends = [node.end for node in compiled.counts if node.late]

    def of(self, node: EventNode, bounds: Bounds) -> EventNeeds:
        """Of an event of a node; `bounds` are those of its age, or for an initial value those without."""
        at = node.instant
        awaited = self._all_but(node)
        limits = self._known_limits(self._compiled.patterns[node.pattern].variables, ())
        others = (self._other(node, one, bounds) for one in self._compiled.events if one is not node)
        return EventNeeds(
            node,
            tuple(-row[at] for row in bounds),
            tuple(bounds[at]),
            max(self._reaches(bounds[at], awaited), default=-UNBOUNDED),
            limits,
            awaited,
            tuple(one for one in others if one is not None and (limits or one.last < UNBOUNDED // 2)),
        )

    def _all_but(self, *nodes: EventNode) -> tuple[Point, ...]:
        return tuple(
            (one.instant, one.shift_ms) for one in self._compiled.events if all(one is not each for each in nodes)
        )

    def _reaches(self, high: Sequence[int], awaited: Sequence[Point]) -> list[int]:
        """The clock that each event reaches at the latest, and each late end, which matters before it only."""
        ends = [(instant, shift_ms - 1) for instant, shift_ms in self.late_ends]
        return [high[instant] + shift_ms for instant, shift_ms in (*awaited, *ends)]

    def _known_limits(self, mine: Sequence[int], except_: Sequence[int]) -> tuple[Limit, ...]:
        """Limits over variables in `mine`, but not over those in `except_` alone."""
        found = []
        for count in self.limits:
            theirs = self._compiled.patterns[count.pattern].variables
            if set(theirs) <= set(mine) and not (except_ and set(theirs) <= set(except_)):
                found.append(Limit(count, part(mine, theirs)))
        return tuple(found)

    def _other(self, first: EventNode, node: EventNode, from_first: Bounds) -> Other | None:
        mine, theirs = (self._compiled.patterns[one.pattern].variables for one in (first, node))
        bounds, at, shift_ms = self._compiled.bounds, node.instant, node.shift_ms
        shared = [slot for slot in theirs if slot in mine]
        if not shared:
            return None
        awaited, is_known = self._all_but(first, node), len(shared) == len(theirs)
        own = () if is_known else self._known_limits(theirs, mine)
        own_counts = {one.limit for one in own}
        both = () if is_known else self._known_limits((*mine, *theirs), mine)
        return Other(
            node,
            part(mine, theirs if is_known else shared),
            None if is_known else self._stores[node.pattern].index([theirs.index(slot) for slot in shared]),
            own,
            tuple(one for one in both if one.limit not in own_counts),
            shift_ms - from_first[at][first.instant],
            shift_ms + from_first[first.instant][at],
            awaited,
            tuple(
                zip(self._reaches(from_first[first.instant], awaited), self._reaches(bounds[at], awaited), strict=True)
            ),
            tuple(bounds[at]),
            tuple(row[at] for row in bounds),
        )


def part(mine: Sequence[int], theirs: Sequence[int]) -> Callable[[Any], Key]:
    """Picks the key over `theirs` from one over `mine`."""
    if tuple(mine) == tuple(theirs):
        return _itself
    if len(mine) == 1:
        return lambda _key: ()
    return getter([list(mine).index(slot) for slot in theirs])


def _itself(key: Key) -> Key:
    return key
