"""Events from streams: a primitive event is a change in the value of an attribute (thesis 8.7.3).

Each attribute is a label of a fluent stream of discrete values. Samples arrive in the order of valid time; each one
moves the clock to its millisecond, and is an event if its value differs from the last one of its stream. The first
value is a change from unknown at its valid time, or, for the streams that `initially` names, a value since ever (C2;
8.4): properties of a map have always been so, also if it was read after the first car came. A value that cannot be an
event is counted and changes nothing (C3).
"""

from collections import Counter
from collections.abc import Collection, Mapping
from typing import Final

from dyknow.model.instants import US_PER_MS
from dyknow.model.labels import Label
from dyknow.model.values import NO_VALUE
from dyknow.reasoning.chronicles.recognition.matching import ChronicleInstance
from dyknow.reasoning.chronicles.recognition.recogniser import Recogniser
from dyknow.reasoning.chronicles.recognition.stores import MINUS_INFINITY

LIMIT_STREAMS: Final = 1_000_000
"""Streams whose last value is remembered."""


def symbol(value: object) -> str | None:
    """The symbol that a discrete value is: `true`, `false`, a text, an integer; None for anything else."""
    if isinstance(value, str):
        return value
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int) or (isinstance(value, float) and value.is_integer()):
        return str(int(value))
    return None


class ChangeEvents:
    """Turns samples into events of a recogniser.

    Args:
        initially: whether first values have been so since ever; names: those of the streams `links`, and `links.left` too.

    Attributes:
        ignored: samples that were not taken, by reason: out of order, no value, no symbol.
    """

    def __init__(self, recogniser: Recogniser, *, initially: bool | Collection[str] = False) -> None:
        self.recogniser = recogniser
        self.ignored: Counter[str] = Counter()
        self._initially = initially
        self._last: dict[Label, str] = {}

    def on_sample(self, label: Label, valid_us: int, value: object) -> list[ChronicleInstance]:
        """Take a sample of the stream `label`; returns the instances recognised by it, or due before it."""
        recogniser = self.recogniser
        at_ms = valid_us // US_PER_MS
        if value is NO_VALUE or value is None:
            return self._ignore("no value")
        if recogniser.clock_ms is not None and at_ms < recogniser.clock_ms:
            return self._ignore("out of order")
        new = symbol(value)
        if new is None:
            return self._ignore("no symbol")
        old = self._last.get(label)
        told = recogniser.on_time(at_ms)
        if old == new:
            return told
        if old is None and len(self._last) >= LIMIT_STREAMS:
            return told + self._ignore("more streams than are remembered")
        self._last[label] = new
        since_ms = MINUS_INFINITY if old is None and self._is_since_ever(label.feature) else at_ms
        return told + recogniser.on_change(since_ms, label.feature, label.objects, old, new)

    def forget(self, label: Label) -> None:
        """The stream has ended; when it is there again its first value is a change from unknown."""
        self._last.pop(label, None)

    @property
    def values(self) -> Mapping[Label, str]:
        """The last value of each stream."""
        return self._last

    def _is_since_ever(self, feature: str) -> bool:
        if isinstance(self._initially, bool):
            return self._initially
        return feature in self._initially or feature.rpartition(".")[0] in self._initially

    def _ignore(self, reason: str) -> list[ChronicleInstance]:
        self.ignored[reason] += 1
        return []
