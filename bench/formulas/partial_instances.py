"""The peer of b07: a recogniser that keeps every partial instance, as thesis 8.4 describes it.

"Each time a new event is received it is checked against all the partial instances to see if it matches any previously
unmatched event. If that is the case, then a copy of the instance is created": with the event in it, its constraints
propagated. An instance ends when an event can no more come in time, which a broken `noevent` may be why. It knows what the
chronicles of the benchmark need: event and noevent between instants that events fix.
"""

from collections.abc import Sequence
from typing import NamedTuple

from bench.formulas.traffic import Change
from dyknow.reasoning.chronicles import ANY, ChronicleVariable, Compiled, Event, EventType, NoEvent
from dyknow.reasoning.chronicles.definition.model import Chronicle


class _Partial(NamedTuple):
    """Symbols by variable, times by instant; `low` and `high` are the windows of all instants."""

    symbols: dict[str, str]
    times: dict[int, int]
    low: tuple[int, ...]
    high: tuple[int, ...]


_FAR = 1 << 60


class PartialInstances:
    """Recognises one chronicle; `most` is how many partial instances there ever were at one time."""

    def __init__(self, chronicle: Chronicle, compiled: Compiled) -> None:
        self._events = [one for one in chronicle.statements if isinstance(one, Event)]
        self._absent = [one for one in chronicle.statements if isinstance(one, NoEvent)]
        self._number = {name: at for at, name in enumerate(compiled.fixed)}
        self._bounds = compiled.bounds
        size = len(compiled.fixed)
        self.partials = [_Partial({}, {}, (-_FAR,) * size, (_FAR,) * size)]
        self.most = 1

    def on_change(self, change: Change) -> int:
        """An event; how many instances it completes."""
        at_ms = change[0]
        kept: list[_Partial] = []
        found = 0
        for partial in self.partials:
            if not self._lives(partial, at_ms):
                continue
            partial = self._narrowed(partial, change)  # noqa: PLW2901 -- it is the same instance
            kept.append(partial)
            for event in self._events:
                grown = self._with(partial, event, change)
                if grown is None:
                    continue
                if len(grown.times) == len(self._events):
                    found += 1
                else:
                    kept.append(grown)
        self.partials = kept
        self.most = max(self.most, len(kept))
        return found

    def _lives(self, partial: _Partial, at_ms: int) -> bool:
        return all(high >= at_ms for instant, high in enumerate(partial.high) if instant not in partial.times)

    def _with(self, partial: _Partial, event: Event, change: Change) -> _Partial | None:
        instant, at_ms = self._number[event.at.instant], change[0]
        if instant in partial.times or not partial.low[instant] <= at_ms <= partial.high[instant]:
            return None
        symbols = _matched(event.type, change, partial.symbols)
        if symbols is None:
            return None
        row = self._bounds[instant]
        low = tuple(max(old, at_ms - self._bounds[other][instant]) for other, old in enumerate(partial.low))
        high = tuple(min(old, at_ms + row[other]) for other, old in enumerate(partial.high))
        return _Partial(symbols, {**partial.times, instant: at_ms}, low, high)

    def _narrowed(self, partial: _Partial, change: Change) -> _Partial:
        """After an event that a noevent forbids the end of its interval has come, or comes now."""
        high = partial.high
        for absent in self._absent:
            begin, end = self._number[absent.begin.instant], self._number[absent.end.instant]
            begun = partial.times.get(begin)
            if begun is None or begun > change[0] or end in partial.times or high[end] <= change[0]:
                continue
            symbols = _matched(absent.type, change, partial.symbols)
            if symbols is not None and symbols.keys() == partial.symbols.keys():
                high = tuple(min(old, change[0] + self._bounds[end][other]) for other, old in enumerate(high))
        return partial if high is partial.high else partial._replace(high=high)


def _matched(type_: EventType, change: Change, symbols: dict[str, str]) -> dict[str, str] | None:
    """The symbols with those of the event; None if it is not of the type."""
    _, name, arguments, old, new = change
    if name != type_.name or len(arguments) != len(type_.arguments):
        return None
    found = dict(symbols)
    values: Sequence[str | None] = (*arguments, old, new)
    for parameter, value in zip(type_.parameters, values, strict=True):
        if isinstance(parameter, ChronicleVariable) and parameter != ANY:
            if value is None or found.setdefault(parameter.name, value) != value:
                return None
        elif isinstance(parameter, str) and parameter != value:
            return None
    return found
