"""Which instances of chronicles rest on a prediction: one of their events is a change of something that was not seen then."""

from collections import deque
from collections.abc import Iterable, Iterator
from typing import Final, TypeAlias

from dyknow.model.sample import Predicted, oldest
from dyknow.reasoning.chronicles import ChronicleInstance
from dyknow.reasoning.chronicles.definition.compilation import Compiled, Pattern

MOST_EVENTS: Final = 4096
"""Different events whose times are remembered."""
MOST_TIMES: Final = 16

_Event: TypeAlias = tuple[str, tuple[str | None, ...]]
"""Name and arguments; of a change its old and its new value, too."""


class PredictedEvents:
    """Remembers predicted events, and finds those of an instance.

    An event that fixes an instant is found by its time; of a counted event the latest is taken.
    """

    def __init__(self, compiled: Iterable[Compiled]) -> None:
        self._compiled = {each.name: each for each in compiled}
        self._events: dict[_Event, deque[tuple[int, Predicted | None]]] = {}

    def on_event(self, at_ms: int, name: str, arguments: tuple[str | None, ...], prediction: Predicted | None) -> None:
        """Note an event; a measured one matters only where the same was predicted before."""
        event = name, arguments
        times = self._events.pop(event, None)
        if times is None:
            if prediction is None:
                return
            times = deque(maxlen=MOST_TIMES)
            while len(self._events) >= MOST_EVENTS:
                del self._events[next(iter(self._events))]
        times.append((at_ms, prediction))
        if any(each is not None for _, each in times):
            self._events[event] = times

    def of(self, instance: ChronicleInstance) -> Predicted | None:
        """The oldest prediction on which an instance rests; it counts as an event of others itself."""
        compiled = self._compiled.get(instance.chronicle)
        if compiled is None or not self._events:
            return None
        found = oldest(self._predictions(compiled, instance))
        parameters = tuple(
            instance.bindings.get(compiled.variables[one]) if isinstance(one, int) else one
            for one in compiled.parameters
        )
        self.on_event(instance.recognised_ms, compiled.name, parameters, found)
        return found

    def _predictions(self, compiled: Compiled, instance: ChronicleInstance) -> Iterator[Predicted | None]:
        for node in compiled.events:
            at_ms = instance.instants[compiled.fixed[node.instant]] + node.shift_ms
            for times in self._times(compiled, compiled.patterns[node.pattern], instance):
                yield from (prediction for time_ms, prediction in times if time_ms == at_ms)
        for count in compiled.counts:
            if count.minimum:
                for times in self._times(compiled, compiled.patterns[count.pattern], instance):
                    before = [prediction for time_ms, prediction in times if time_ms <= instance.recognised_ms]
                    yield from before[-count.minimum :]

    def _times(
        self, compiled: Compiled, pattern: Pattern, instance: ChronicleInstance
    ) -> Iterator[deque[tuple[int, Predicted | None]]]:
        """The times of the events that match a pattern with the variables of an instance."""
        for (name, values), times in self._events.items():
            if name == pattern.name and len(values) > max((*pattern.key, -1)) and _matches(pattern, values):
                symbols = [instance.bindings.get(compiled.variables[each]) for each in pattern.variables]
                if all(symbol is None or values[at] == symbol for at, symbol in zip(pattern.key, symbols, strict=True)):
                    yield times


def _matches(pattern: Pattern, values: tuple[str | None, ...]) -> bool:
    has_constants = all(at < len(values) and values[at] == symbol for at, symbol in pattern.constants)
    return has_constants and all(values[one] == values[other] for one, other in pattern.equal)
