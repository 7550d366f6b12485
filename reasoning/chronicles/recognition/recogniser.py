"""Recognition of many chronicles over one stream of events, online (thesis 8.4).

The clock is in ms and moves with the events and with `on_time`. Instances are returned by the call that made them
certain, with the clock of that: when an event comes, instances that were due before it are reported first. A recognised
chronicle is an event of others at that clock (8.2).
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Final, TypeAlias

from dyknow.model.errors import ChronicleError
from dyknow.reasoning.chronicles.definition.compilation import Compiled, Pattern, compile_chronicle
from dyknow.reasoning.chronicles.definition.model import ChronicleFile
from dyknow.reasoning.chronicles.definition.times import LIMIT_MS
from dyknow.reasoning.chronicles.recognition.expectation import LIMIT_TRIED, Partial, partial_instances
from dyknow.reasoning.chronicles.recognition.matching import ChronicleInstance, Matcher, RecognitionLimits
from dyknow.reasoning.chronicles.recognition.stores import MINUS_INFINITY, Key, Values, getter

LIMIT_SELECTIONS: Final = 4096
"""Combinations of symbols, per event name, whose selection is remembered."""

Targets: TypeAlias = tuple[tuple[Matcher, tuple[int, ...], tuple[Pattern, ...] | None], ...]
"""Matchers, numbers of patterns, and these if an event must be compared with more than their symbols."""


class _Dispatch:
    """Which patterns an event of one name may be of, by the symbols at the places where any of them has one."""

    def __init__(self) -> None:
        self._targets: list[tuple[Matcher, int, Pattern]] = []
        self._symbols = getter(())
        self._selected: dict[Key, Targets] = {}

    def add(self, matcher: Matcher, index: int, pattern: Pattern) -> None:
        self._targets.append((matcher, index, pattern))
        places = {place for _, _, one in self._targets for place, _ in one.constants}
        self._symbols, self._selected = getter(sorted(places)), {}

    def targets(self, values: Values) -> Targets:
        """Matchers with their patterns whose symbols are those of the event."""
        symbols = self._symbols(values)
        found = self._selected.get(symbols)
        if found is None:
            found = self._select(values)
            if len(self._selected) >= LIMIT_SELECTIONS:
                self._selected.clear()
            self._selected[symbols] = found
        return found

    def _select(self, values: Values) -> Targets:
        by_matcher: dict[Matcher, list[tuple[int, Pattern]]] = {}
        for matcher, index, pattern in self._targets:
            if all(values[place] == symbol for place, symbol in pattern.constants):
                by_matcher.setdefault(matcher, []).append((index, pattern))
        return tuple(
            (matcher, tuple(at for at, _ in found), tuple(one for _, one in found) if _more(found) else None)
            for matcher, found in by_matcher.items()
        )


Events: TypeAlias = list[tuple[_Dispatch, Values]]


class Recogniser:
    """Recognises chronicles; stepped by events in the order of time.

    Attributes:
        clock_ms: the latest time that was seen; None before the first.
        ignored: events that were not taken, by reason: out of order, no change, beyond the clock's range.
        events: how many were taken.
    """

    def __init__(self, chronicles: Iterable[Compiled], limits: RecognitionLimits | None = None) -> None:
        self._matchers = [Matcher(one, limits or RecognitionLimits()) for one in chronicles]
        self._by_name = {matcher.compiled.name: matcher for matcher in self._matchers}
        self.clock_ms: int | None = None
        self.ignored: Counter[str] = Counter()
        self.events = 0
        self._deadline_ms: int | None = None
        self._changes: dict[tuple[str, int], _Dispatch] = {}
        self._messages: dict[tuple[str, int], _Dispatch] = {}
        self._heard: set[str] = set()
        for matcher in self._matchers:
            for index, pattern in enumerate(matcher.compiled.patterns):
                kind = self._changes if pattern.change else self._messages
                kind.setdefault((pattern.name, pattern.arity), _Dispatch()).add(matcher, index, pattern)
                if pattern.name in self._by_name and not pattern.change:
                    self._heard.add(pattern.name)
        self._refuse_circles()

    @classmethod
    def of(
        cls,
        file: ChronicleFile,
        names: Iterable[str] | None = None,
        *,
        max_age_ms: int | None = None,
        limits: RecognitionLimits | None = None,
    ) -> "Recogniser":
        """The chronicles of a file, or those named together with those that are events of them.

        Raises:
            ChronicleError: a name is not declared, or a chronicle cannot be recognised (`compile_chronicle`).
        """
        wanted, compiled = list(file.chronicles if names is None else names), dict[str, Compiled]()
        for name in wanted:  # grows by the chronicles that these use
            if name not in file.chronicles:
                known = ", ".join(file.chronicles) or "none"
                raise ChronicleError(f"no chronicle is called {name}; declared: {known}")
            if name not in compiled:
                compiled[name] = compile_chronicle(file.chronicles[name], file, max_age_ms)
                wanted += [
                    one.name for one in compiled[name].patterns if not one.change and one.name in file.chronicles
                ]
        return cls(compiled.values(), limits)

    def _refuse_circles(self) -> None:
        """A chronicle that is an event of itself would never be done."""
        below = {
            name: {one.name for one in matcher.compiled.patterns if not one.change and one.name in self._by_name}
            for name, matcher in self._by_name.items()
        }
        while free := [name for name, others in below.items() if not others]:
            for name in free:
                del below[name]
            for others in below.values():
                others.difference_update(free)
        if below:
            raise ChronicleError(
                f"chronicles that are events of themselves: {', '.join(sorted(below))}; break the circle"
            )

    @property
    def deadline_ms(self) -> int | None:
        """When something will be reported, or given up, if no event comes before; None: nothing waits for the clock."""
        return self._deadline_ms

    def on_change(
        self, at_ms: int, name: str, arguments: tuple[str, ...], old: str | None, new: str
    ) -> list[ChronicleInstance]:
        """An attribute changes its value: `name[arguments]:(old, new)`. Old None: unknown (C2).

        A value since ever has the time `MINUS_INFINITY`; it may come at any clock, but what it would have completed
        before is not found: let initial values come first.
        """
        if old == new:
            self.ignored["no change"] += 1
            return []
        told = self._advance(at_ms)
        if told is None:
            return []
        self.events += 1
        dispatch = self._changes.get((name, len(arguments)))
        if dispatch is not None:
            values = (*arguments, old, new)
            targets = dispatch.targets(values)
            if targets:
                self._deliver(targets, values, at_ms, told)
        return told

    def on_message(self, at_ms: int, name: str, arguments: tuple[str, ...]) -> list[ChronicleInstance]:
        """A message `name[arguments]` comes."""
        told = self._advance(at_ms)
        if told is None:
            return []
        self.events += 1
        dispatch = self._messages.get((name, len(arguments)))
        if dispatch is not None:
            self._deliver(dispatch.targets(arguments), arguments, at_ms, told)
        return told

    def on_time(self, now_ms: int) -> list[ChronicleInstance]:
        """The clock is at `now_ms`: everything before has come. A clock that goes back is ignored."""
        if self.clock_ms is not None and now_ms < self.clock_ms:
            return []
        return self._advance(now_ms) or []

    def _advance(self, at_ms: int) -> list[ChronicleInstance] | None:
        """Move the clock; returns the instances due by then. None if the time cannot be taken."""
        clock_ms = self.clock_ms
        if clock_ms is None or at_ms > clock_ms:
            if not -LIMIT_MS <= at_ms <= LIMIT_MS:
                return self._extreme(at_ms)
            told = [] if self._deadline_ms is None or self._deadline_ms > at_ms else self._due(at_ms)
            self.clock_ms = at_ms
            return told
        return [] if at_ms == clock_ms else self._extreme(at_ms)

    def _extreme(self, at_ms: int) -> list[ChronicleInstance] | None:
        if at_ms == MINUS_INFINITY:
            return []
        beyond = not -LIMIT_MS <= at_ms <= LIMIT_MS
        self.ignored["beyond the clock's range" if beyond else "out of order"] += 1
        return None

    def _due(self, at_ms: int) -> list[ChronicleInstance]:
        """Step the clock to each deadline until `at_ms`: an instance recognised at one may be an event there."""
        told: list[ChronicleInstance] = []
        while self._deadline_ms is not None and self._deadline_ms <= at_ms:
            self.clock_ms = due_ms = self._deadline_ms
            for matcher in self._matchers:
                if (mine := matcher.deadline_ms) is not None and mine <= due_ms:
                    found = matcher.on_time(due_ms)
                    told += found
                    self._spread(self._events_of(matcher, found), due_ms, told)
            self._deadline_ms = self._earliest()
        return told

    def _earliest(self) -> int | None:
        return min((due for one in self._matchers if (due := one.deadline_ms) is not None), default=None)

    def _deliver(self, targets: Targets, values: Values, at_ms: int, told: list[ChronicleInstance]) -> None:
        clock_ms = at_ms if self.clock_ms is None or at_ms != MINUS_INFINITY else self.clock_ms
        if more := self._hand(targets, values, at_ms, clock_ms, told):
            self._spread(more, clock_ms, told)

    def _spread(self, events: Events, clock_ms: int, told: list[ChronicleInstance]) -> None:
        """Chronicles that are recognised are events, by which others may be recognised: layer by layer."""
        while events:
            events = [
                one
                for dispatch, values in events
                for one in self._hand(dispatch.targets(values), values, clock_ms, clock_ms, told)
            ]

    def _hand(
        self, targets: Targets, values: Values, at_ms: int, clock_ms: int, told: list[ChronicleInstance]
    ) -> Events:
        """Give an event to all matchers that wait for it; the events that what they recognise is."""
        more: Events = []
        for matcher, indexes, patterns in targets:
            matching: Sequence[int] = indexes
            if patterns is not None:
                matching = [at for at, pattern in zip(indexes, patterns, strict=True) if _is_of(pattern, values)]
                if not matching:
                    continue
            found = matcher.on_event(matching, values, at_ms, clock_ms)
            if matcher.waits and matcher.deadline_ms != self._deadline_ms:
                self._deadline_ms = self._earliest()
            if found:
                told += found
                more += self._events_of(matcher, found)
        return more

    def _events_of(self, matcher: Matcher, found: list[ChronicleInstance]) -> Events:
        """Recognised instances as events of other chronicles, once for the same parameters."""
        if matcher.compiled.name not in self._heard:
            return []
        events = dict.fromkeys(matcher.parameters(instance) for instance in found)
        dispatch = self._messages.get((matcher.compiled.name, len(matcher.compiled.parameters)))
        return [] if dispatch is None else [(dispatch, values) for values in events]

    @property
    def chronicles(self) -> tuple[Compiled, ...]:
        """The chronicles of this recogniser."""
        return tuple(matcher.compiled for matcher in self._matchers)

    @property
    def attributes(self) -> frozenset[tuple[str, int]]:
        """Attributes whose changes are waited for: (name, number of arguments)."""
        return frozenset(self._changes)

    @property
    def messages(self) -> frozenset[tuple[str, int]]:
        """Messages that are waited for, recognised chronicles apart: (name, number of arguments)."""
        return frozenset(one for one in self._messages if one[0] not in self._by_name)

    def tidy(self) -> None:
        """Forget all that no instance needs; it is also done now and then."""
        for matcher in self._matchers:
            matcher.sweep(MINUS_INFINITY if self.clock_ms is None else self.clock_ms)

    def partial_instances(
        self, limit: int = 1000, chronicle: str | None = None, tried: int = LIMIT_TRIED
    ) -> Iterator[Partial]:
        """Partial instances, chronicle by chronicle: the matched events, and the latest clock at which each is given
        up.

        Args:
            limit: most that are made.
            chronicle: of this one alone.
            tried: sets of events that are tried for each chronicle, at most.
        """
        clock_ms = MINUS_INFINITY if self.clock_ms is None else self.clock_ms
        left = limit
        for matcher in self._matchers:
            if chronicle not in {None, matcher.compiled.name}:
                continue
            for partial in partial_instances(matcher, clock_ms, left, tried):
                left -= 1
                yield partial

    @property
    def needed(self) -> tuple[str, ...]:
        """Names of the attributes and messages without which some chronicle cannot be recognised."""
        found: set[str] = set()
        for one in (matcher.compiled for matcher in self._matchers):
            nodes = [node.pattern for node in one.events] + [node.pattern for node in one.counts if node.minimum]
            found.update(one.patterns[pattern].name for pattern in nodes)
        return tuple(sorted(found - self._by_name.keys()))

    @property
    def is_complete(self) -> bool:
        """Whether no limit has cut anything off."""
        return not any(one.incomplete for one in self._matchers)

    @property
    def incomplete(self) -> Mapping[str, Counter[str]]:
        """Chronicles whose limits have cut something off, with how often by reason; {} is: nothing is missing (C6)."""
        return {name: one.incomplete for name, one in self._by_name.items() if one.incomplete}

    @property
    def live(self) -> int:
        """Events that are remembered, and instances that wait for the clock or for counts."""
        return sum(matcher.live for matcher in self._matchers)

    @property
    def live_of_one_binding(self) -> int:
        """The most events of one pattern and binding that are remembered now."""
        return max((matcher.live_of_one_binding for matcher in self._matchers), default=0)


def _more(patterns: Iterable[tuple[int, Pattern]]) -> bool:
    """Whether an event must be compared with more than the symbols of the patterns: arguments of changes are known."""
    return any(
        pattern.equal or pattern.conditions or not pattern.change or pattern.arity in pattern.known
        for _, pattern in patterns
    )


def _is_of(pattern: Pattern, values: Values) -> bool:
    """Whether an event with the pattern's symbols is of the pattern in all else."""
    for place in pattern.known:
        if values[place] is None:
            return False
    for left, right in pattern.equal:
        if values[left] != values[right]:
            return False
    for condition, places in pattern.conditions:
        if not condition.test({name: values[place] for name, place in places}):
            return False
    return True
