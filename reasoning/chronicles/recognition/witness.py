"""Whether an instance is settled: counts in its intervals, and times for the instants that no event fixes (C5).

The words are those of the model: an instance is settled at clock T if there are times for its free instants such that
every count is within its limits and every upper limit's interval has passed. Between two counted events an instant's
place has no influence, so the search tries which events an interval contains; that choice constrains the instants by
differences again, and the minimal network says whether these can be met, and when at the earliest.
"""

from bisect import bisect_left
from collections.abc import Callable, Sequence
from typing import Final, NamedTuple, TypeAlias

from dyknow.reasoning.chronicles.definition.compilation import Compiled, CountNode
from dyknow.reasoning.chronicles.definition.expansion import Point
from dyknow.reasoning.chronicles.definition.network import UNBOUNDED, TemporalNetwork
from dyknow.reasoning.chronicles.recognition.stores import MINUS_INFINITY, SINCE_EVER

LIMIT_TRIALS: Final = 2_000
"""Choices of counted events tried for one instance at one clock."""

Place: TypeAlias = tuple[int, int]
"""(node of the search, 0 for the origin; time to add)."""

Times: TypeAlias = Callable[[CountNode], Sequence[int]]
"""The times of the events that a predicate counts, ascending, at most the clock."""


class WitnessOutcome(NamedTuple):
    """The state of an instance at a clock.

    Attributes:
        settled: it is an instance, now.
        next_ms: when to look again if none of the events comes that it waits for; None: never.
        dead: no event and no time will make it one.
        complete: False if there were more choices than LIMIT_TRIALS: it is given up, and might be an instance.
    """

    settled: bool = False
    next_ms: int | None = None
    dead: bool = False
    complete: bool = True


SETTLED: Final = WitnessOutcome(settled=True)
DEAD: Final = WitnessOutcome(dead=True)


class Witness:
    """Decides for instances of one chronicle."""

    def __init__(self, compiled: Compiled) -> None:
        self._compiled = compiled
        self._known = (*range(len(compiled.fixed)), *(() if compiled.clock is None else (compiled.clock,)))
        fixed = {*self._known}
        self._fixed = tuple(one for one in compiled.counts if one.begin[0] in fixed and one.end[0] in fixed)
        self._open = tuple(one for one in compiled.counts if one not in self._fixed)
        places = dict.fromkeys(point[0] for one in self._open for point in (one.begin, one.end))
        self._begins = () if compiled.events else compiled.begins
        places.update(dict.fromkeys(point[0] for point in self._begins))
        self._free = tuple(place for place in places if place not in fixed)

    def outcome(
        self, instants: Sequence[int], counted: Times, clock_ms: int, after_ms: int | None = None
    ) -> WitnessOutcome:
        """Look at an instance.

        Args:
            instants: times by number of the instant; those of free ones are not looked at.
            counted: the events that have come.
            clock_ms: until when they have.
            after_ms: its intervals must begin later; None: they need not.
        """
        next_ms, waits_ms = clock_ms, None
        for node in self._fixed:
            begin, end = instants[node.begin[0]] + node.begin[1], instants[node.end[0]] + node.end[1]
            times = counted(node)
            number = max(0, bisect_left(times, end) - bisect_left(times, begin))
            if node.maximum is not None:
                if number > node.maximum:
                    return DEAD
                if begin < end:
                    next_ms = max(next_ms, end)
            if number < node.minimum:
                if end <= clock_ms:
                    return DEAD
                waits_ms = end if waits_ms is None else min(waits_ms, end)
        if waits_ms is not None or next_ms > clock_ms:
            return WitnessOutcome(next_ms=next_ms if waits_ms is None else waits_ms)
        if not self._open:
            return SETTLED
        return _Search(self._open, counted, clock_ms).outcome(
            self._network(instants, after_ms), self._numbers(instants)
        )

    def _numbers(self, instants: Sequence[int]) -> list[Place]:
        """By instant: a free one is a node of the search, one with a time is the origin plus that time."""
        found = [(0, time) for time in instants]
        for number, place in enumerate(self._free, 1):
            found[place] = (number, 0)
        return found

    def _network(self, instants: Sequence[int], after_ms: int | None) -> TemporalNetwork | None:
        """The free instants around the origin 0, with the windows that the fixed ones leave them."""
        compiled, free = self._compiled, self._free
        network = TemporalNetwork(len(free) + 1)
        places = self._numbers(instants)
        for number, place in enumerate(free, 1):
            for other, other_place in enumerate(free, 1):
                if not network.add(number, other, compiled.aged[place][other_place]):
                    return None
            for one in self._known:
                bounds = compiled.bounds if instants[one] < SINCE_EVER else compiled.aged
                high, low = bounds[one][place], bounds[place][one]
                if high < UNBOUNDED and not network.add(0, number, instants[one] + high):
                    return None
                if low < UNBOUNDED and not network.add(number, 0, low - instants[one]):
                    return None
        if after_ms is not None:
            for instant, shift_ms in self._begins:
                number, add = places[instant]
                if not network.add(number, 0, add + shift_ms - after_ms - 1):
                    return None
        return network


class _Search:
    """Tries which events each interval takes in, depth first, for the earliest clock that settles all of them."""

    def __init__(self, nodes: Sequence[CountNode], counted: Times, clock_ms: int) -> None:
        self._nodes, self._times, self._clock_ms = nodes, [counted(node) for node in nodes], clock_ms
        self._best: int | None = None
        self._trials = 0
        self._points: Sequence[Place] = ()

    def outcome(self, network: TemporalNetwork | None, points: Sequence[Place]) -> WitnessOutcome:
        if network is None:
            return DEAD
        self._points = points
        self._try(network, range(len(self._nodes)), ())
        complete = self._trials < LIMIT_TRIALS
        if self._best is not None and self._best <= self._clock_ms:
            return SETTLED
        if not complete:
            return WitnessOutcome(dead=True, complete=False)
        waits = [self._latest(network, node) for node in self._nodes if node.minimum]
        hopes = [one for one in waits if one is None or one > self._clock_ms]
        if self._best is None and not hopes:
            return DEAD
        if self._best is not None:
            return WitnessOutcome(next_ms=self._best)
        ends = [one for one in hopes if one is not None]
        return WitnessOutcome(next_ms=None if len(ends) < len(hopes) else max(ends))

    def _latest(self, network: TemporalNetwork, node: CountNode) -> int | None:
        """The latest end of a predicate's interval; None if there is none."""
        number, add = self._at(node.end)
        high = network.bounds[0][number]
        return None if high >= UNBOUNDED else high + add

    def _try(self, network: TemporalNetwork, left: Sequence[int], ends: tuple[Place, ...]) -> None:
        """Continue with the predicates in `left`; the intervals at `ends` must have passed for the choices so far."""
        self._trials += 1
        settled_ms = max((_earliest(network, end) for end in ends), default=self._clock_ms)
        settled_ms = max(settled_ms, self._clock_ms)
        if self._trials >= LIMIT_TRIALS or (self._best is not None and settled_ms >= self._best):
            return
        if not left:
            self._best = settled_ms
            return
        windows = {at: self._near(network, at) for at in left}
        chosen = min(left, key=lambda at: windows[at][1] - windows[at][0] - self._nodes[at].minimum)
        node, rest = self._nodes[chosen], [at for at in left if at != chosen]
        begin, end = self._at(node.begin), self._at(node.end)
        if not node.minimum:
            tried = network.copy()
            if tried.add(begin[0], end[0], begin[1] - end[1]):  # it ends where it begins, or before
                self._try(tried, rest, ends)
        first, last = windows[chosen]
        near = self._times[chosen][first:last]
        for at in range(len(near) - node.minimum + 1):
            if self._trials >= LIMIT_TRIALS or (self._best is not None and self._best <= self._clock_ms):
                return
            tried = network.copy()
            if _takes_in(tried, node, near, at, begin, end):
                self._try(tried, rest, ends if node.maximum is None else (*ends, end))
            else:
                self._trials += 1

    def _near(self, network: TemporalNetwork, at: int) -> tuple[int, int]:
        """Which events can be in a predicate's interval: first and behind the last."""
        node, times = self._nodes[at], self._times[at]
        begin, end = self._at(node.begin), self._at(node.end)
        high = network.bounds[0][end[0]]
        first = bisect_left(times, _earliest(network, begin))
        return first, len(times) if high >= UNBOUNDED else max(first, bisect_left(times, high + end[1]))

    def _at(self, point: Point) -> Place:
        number, add = self._points[point[0]]
        return number, add + point[1]


def _earliest(network: TemporalNetwork, place: Place) -> int:
    low = network.bounds[place[0]][0]
    return 2 * MINUS_INFINITY if low >= UNBOUNDED else place[1] - low


def _takes_in(
    network: TemporalNetwork, node: CountNode, times: Sequence[int], at: int, begin: Place, end: Place
) -> bool:
    """The interval begins between the events at - 1 and at, and takes in as many from there as it should."""
    ok = True
    if node.maximum is not None:
        if at:
            ok = network.add(begin[0], 0, begin[1] - times[at - 1] - 1)
        if at + node.maximum < len(times):
            ok = ok and network.add(0, end[0], times[at + node.maximum] - end[1])
    if node.minimum:
        ok = ok and network.add(0, begin[0], times[at] - begin[1])
        ok = ok and network.add(end[0], 0, end[1] - times[at + node.minimum - 1] - 1)
    return ok
