"""Prediction: the partial instances of a chronicle, as the thesis lists them (8.4), made when they are asked for.

A partial instance is a set of remembered events, at least one, that may still become an instance: they agree with
each other and with the network, no predicate has failed for good, and every other event may still come.
"""

from bisect import bisect_left
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain, islice
from typing import Any, Final, NamedTuple

from dyknow.reasoning.chronicles.definition.compilation import EventNode
from dyknow.reasoning.chronicles.definition.network import UNBOUNDED
from dyknow.reasoning.chronicles.recognition.matching import Matcher, told_time

LIMIT_TRIED: Final = 100_000
"""Sets of events tried for one question."""


class Partial(NamedTuple):
    """A partial instance.

    Attributes:
        bindings: symbols of the variables known so far.
        instants: times of the instants that have their event, ms.
        missing: the predicates, as written in the chronicle, whose events are missing, or whose interval is not over.
        dies_ms: the clock at which it is given up if nothing comes, at the latest; None: never.
    """

    chronicle: str
    bindings: Mapping[str, str]
    instants: Mapping[str, int]
    missing: tuple[str, ...]
    dies_ms: int | None


def partial_instances(matcher: Matcher, clock_ms: int, limit: int, tried: int = LIMIT_TRIED) -> Iterator[Partial]:
    """Instances of one chronicle that wait, then the sets of events that may become one; at most `limit`, of `tried` sets."""
    open_ = _Enumeration(matcher, clock_ms, tried).partials({}, {}, 0)
    yield from islice(chain(_complete(matcher, clock_ms), open_), limit)


def _complete(matcher: Matcher, clock_ms: int) -> Iterator[Partial]:
    """Instances all of whose events are there, and that are not settled."""
    compiled = matcher.compiled
    for waiting in matcher.waiting():
        symbols = dict(enumerate(waiting.symbols))
        times = {at: waiting.times[at] for at in range(len(compiled.fixed))}
        windows = matcher.retention.windows(times)
        if windows is None or (not compiled.fixed and waiting.after_ms == clock_ms):
            continue
        missing, dies_ms = list[str](), UNBOUNDED
        for count in compiled.counts:
            end = windows.high[count.end[0]] + count.end[1]
            found = bisect_left(matcher.counted(count, waiting.symbols), end)
            if found < count.minimum:
                dies_ms = min(dies_ms, end)
            if found < count.minimum or (count.maximum is not None and end > clock_ms):
                missing.append(count.said)
        yield _partial(matcher, symbols, times, missing, dies_ms)


def _partial(
    matcher: Matcher, symbols: Mapping[int, Any], times: Mapping[int, int], missing: list[str], dies_ms: int
) -> Partial:
    compiled = matcher.compiled
    return Partial(
        compiled.name,
        {compiled.variables[slot]: symbol for slot, symbol in sorted(symbols.items())},
        {compiled.fixed[instant]: told_time(time) for instant, time in sorted(times.items())},
        tuple(dict.fromkeys(missing)),
        None if dies_ms >= UNBOUNDED else dies_ms,
    )


class _Enumeration:
    """Each event is matched by one of those remembered, or left open."""

    def __init__(self, matcher: Matcher, clock_ms: int, most: int) -> None:
        self._matcher, self._clock_ms, self._most = matcher, clock_ms, most
        self._events = matcher.compiled.events
        self._tried = 0

    def partials(
        self, symbols: dict[int, Any], times: dict[int, int], at: int, open_: tuple[EventNode, ...] = ()
    ) -> Iterator[Partial]:
        """Continue with the event at `at`; those in `open_` are left open."""
        self._tried += 1
        if self._tried > self._most:
            return
        if at == len(self._events):
            if open_ and times and (partial := self._made(symbols, times, open_)) is not None:
                yield partial
            return
        node = self._events[at]
        yield from self.partials(symbols, times, at + 1, (*open_, node))
        for found, time in self._matching(node, symbols):
            if times.get(node.instant, time) == time:
                known = {**times, node.instant: time}
                if self._matcher.retention.windows(known) is not None:
                    yield from self.partials({**symbols, **found}, known, at + 1, open_)

    def _matching(self, node: EventNode, symbols: Mapping[int, Any]) -> Iterator[tuple[dict[int, Any], int]]:
        variables = self._matcher.compiled.patterns[node.pattern].variables
        for key, bucket in self._matcher.remembered(node.pattern):
            values = (key,) if len(variables) == 1 else key
            found = dict(zip(variables, values, strict=True))
            if all(symbols.get(slot, value) == value for slot, value in found.items()):
                for time in dict.fromkeys(bucket.times):
                    yield found, time - node.shift_ms

    def _made(self, symbols: Mapping[int, Any], times: Mapping[int, int], open_: Sequence[EventNode]) -> Partial | None:
        """The partial instance, if every open event may still come and nothing has failed for good."""
        matcher, clock_ms = self._matcher, self._clock_ms
        windows = matcher.retention.narrowed(times, symbols)
        names = {matcher.compiled.variables[slot]: symbol for slot, symbol in symbols.items()}
        conditions = (one for one in matcher.compiled.conditions if one.variables <= names.keys())
        if windows is None or not all(one.test(names) for one in conditions):
            return None
        missing, dies_ms = list[str](), UNBOUNDED
        for node in open_:
            latest = windows.high[node.instant] + node.shift_ms
            if latest < clock_ms:
                return None
            missing.append(node.said)
            dies_ms = min(dies_ms, latest + 1)
        return _partial(matcher, symbols, times, missing, dies_ms)
