"""Events on disk, one JSON object a line, and how they are given to a recogniser.

`{"t_ms": 100, "attribute": "link[car1]", "from": "l1", "to": "no_link"}` is a change, whose `from` is null for the first
value (C2); `{"t_ms": 100, "message": "in_crossing[car1, x2]"}` is a message; `{"t_ms": 100}` alone says that everything
before has come. `"t_ms": "-oo"` is a value that has always been (8.4). Reading is pure: lines in, events out.
"""

import math
from collections.abc import Iterable, Iterator
from typing import Any, Final, NamedTuple

from dyknow.documents.json_lines import JsonLine
from dyknow.model.errors import TextError
from dyknow.model.labels import Label
from dyknow.reasoning.chronicles.recognition.changes import symbol
from dyknow.reasoning.chronicles.recognition.matching import ChronicleInstance
from dyknow.reasoning.chronicles.recognition.recogniser import Recogniser
from dyknow.reasoning.chronicles.recognition.stores import MINUS_INFINITY

_CHANGE: Final = '{"t_ms": 100, "attribute": "link[car1]", "from": "l1", "to": "no_link"}'
_MESSAGE: Final = '{"t_ms": 100, "message": "in_crossing[car1, x2]"}'
_REMEMBERED: Final = 100_000
_LONGEST: Final = 512


class RecordedEvent(NamedTuple):
    """The event in a line.

    Attributes:
        at_ms: floored to the chronicles' clock (C1); `MINUS_INFINITY` for a value that has always been.
        label: None if only the clock moves.
        change: old value, None if unknown, and new value; None for a message.
        line: its number.
    """

    at_ms: int
    label: Label | None
    change: tuple[str | None, str] | None
    line: int

    def told_to(self, recogniser: Recogniser) -> list[ChronicleInstance]:
        """Step a recogniser by it; returns the recognised instances."""
        if self.label is None:
            return recogniser.on_time(self.at_ms)
        if self.change is None:
            return recogniser.on_message(self.at_ms, *self.label)
        return recogniser.on_change(self.at_ms, *self.label, *self.change)


def read_events(lines: Iterable[str], file: str = "") -> Iterator[RecordedEvent]:
    """Events from JSON lines, in the order of the lines; blank lines are skipped.

    Raises:
        TextError: with the line and the repair, at the first line that is no event.
    """
    labels: dict[str, Label] = {}
    for number, line in enumerate(lines, 1):
        if line.strip():
            yield _Line(line, number, file).event(number, labels)


class _Line(JsonLine):
    def __init__(self, line: str, number: int, file: str) -> None:
        super().__init__(line, number, file, "an event", _CHANGE)

    def event(self, number: int, labels: dict[str, Label]) -> RecordedEvent:
        record = self.record
        if "message" in record:
            self._only("t_ms", "message", example=_MESSAGE)
            return RecordedEvent(self._at_ms(), self._label("message", labels), None, number)
        if "attribute" in record:
            self._only("t_ms", "attribute", "from", "to", example=_CHANGE)
            label = self._label("attribute", labels)
            return RecordedEvent(self._at_ms(), label, (self._value("from"), self._new()), number)
        self._only("t_ms", example=f"{_CHANGE} or {_MESSAGE}")
        return RecordedEvent(self._at_ms(), None, None, number)

    def _only(self, *keys: str, example: str) -> None:
        other = next((key for key in self.record if key not in keys), None)
        if other is not None:
            raise self.error(f"{other[:40]!r} is nothing that an event has", example)

    def _at_ms(self) -> int:
        return MINUS_INFINITY if self.record.get("t_ms") == "-oo" else math.floor(self.time_ms())

    def _label(self, key: str, labels: dict[str, Label]) -> Label:
        text = self.record[key]
        found = labels.get(text) if isinstance(text, str) else None
        if found is None:
            if not isinstance(text, str):
                raise self.error(f"{key} is a label, a text", '"link[car1]"')
            try:
                found = Label.parse(text)
            except TextError as error:
                raise self.error(f"{key}: {error.message}", '"link[car1]"') from None
            if len(labels) >= _REMEMBERED:
                labels.clear()
            labels[text] = found
        return found

    def _value(self, key: str) -> str | None:
        if key not in self.record:
            raise self.error(f"a change has {key!r}", f"{_CHANGE}, or from: null for the first value")
        value: Any = self.record[key]
        if value is None:
            return None
        found = symbol(value)
        if found is None:
            raise self.error(f"{key!r} is neither a text, a whole number, nor a truth value", _CHANGE)
        if len(found) > _LONGEST:
            raise self.error(f"{key!r} has {len(found)} characters, {_LONGEST} are allowed", _CHANGE)
        return found

    def _new(self) -> str:
        value = self._value("to")
        if value is None:
            raise self.error("an attribute changes to a value", f"{_CHANGE}; give what is no value a name, as here")
        return value
