"""The records of a platform process: JSON lines on standard output, or in a file that is bounded. It ends no platform.

Each line is one event, and has a level.

A full disk, a closed terminal or a reader that has gone cost records, which are counted and reported once.
"""

import json
import os
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

LEVELS: Final = ("debug", "info", "warning", "error")
_LEVEL_OF: Final[Mapping[str, str]] = {
    "directory": "debug", "not-specified": "warning", "alarm-opened": "warning", "lost": "warning", "halted": "error",
}  # fmt: skip
PART_BYTES = 4_000_000
"""How large the file becomes before it is renamed, with `.1` after its name, and begun again: twice that is kept."""
AGAIN_US = 10_000_000
"""How long after a note the same note is taken for news again."""
NOTES = 64
"""Notes that are compared, and how many of different texts there may be at once."""
REFILL_US = 500_000
"""How soon there may be one more."""


def level_of(record: Mapping[str, Any]) -> str:
    """How much a record matters: its own level, else that of its event."""
    own = record.get("level")
    return str(own) if own in LEVELS else _LEVEL_OF.get(str(record.get("event")), "info")


def is_at_least(record: Mapping[str, Any], level: str) -> bool:
    """Whether it matters so much, or more."""
    return LEVELS.index(level_of(record)) >= LEVELS.index(level)


class Records:
    """Takes one JSON object after the other; from any thread.

    Args:
        path: the file; None: standard output.
        on_failed: called with why nothing can be written, once until something can be again.
    """

    def __init__(self, path: Path | None, on_failed: Callable[[str], None], *, part_bytes: int = PART_BYTES) -> None:
        self._path, self._on_failed, self._part_bytes = path, on_failed, part_bytes
        self._descriptor = 1 if path is None else _opened(path)
        self._lock = threading.Lock()
        self._size = self.lost = 0
        self._is_torn = self._has_failed = False

    def __call__(self, record: Mapping[str, Any]) -> None:
        with self._lock:
            why = self._write(record)
        if why is not None and not self._has_failed:
            self._has_failed = True
            self._on_failed(why)

    def _write(self, record: Mapping[str, Any]) -> str | None:
        """Write a line, whole or counted as lost; returns why it was lost."""
        line = json.dumps({**record, "level": level_of(record)}).encode() + b"\n"
        if self.lost:
            told = {
                "event": "note",
                "level": "error",
                "text": f"{self.lost} records before this one could not be written",
            }
            line = json.dumps(told).encode() + b"\n" + line
        if self._is_torn:
            line = b"\n" + line
        try:
            if self._path is not None and self._size + len(line) > self._part_bytes:
                self._begin_again(self._path)
            left = memoryview(line)
            while left:
                written = os.write(self._descriptor, left)
                self._size += written
                self._is_torn = True
                left = left[written:]
        except OSError as wrong:
            self.lost += 1
            return f"records of this platform cannot be written: {wrong.strerror}"
        self._is_torn = self._has_failed = False
        self.lost = 0
        return None

    def _begin_again(self, path: Path) -> None:
        new = path.with_name(f"{path.name}.new")
        before, self._descriptor = self._descriptor, _opened(new)
        os.close(before)
        self._size, self._is_torn = 0, False
        path.replace(path.with_name(f"{path.name}.1"))
        new.replace(path)


class NoteLimit:
    """Which notes are worth saying: the same one not again soon, and not many different ones at once."""

    def __init__(self) -> None:
        self._said_us: dict[str, int] = {}
        self._repeated: dict[str, int] = {}
        self._left, self._refilled_us = NOTES, 0
        self.left_out = 0
        self._lock = threading.Lock()

    def lines(self, text: str, now_us: int) -> list[str]:
        """The lines to write for one note: none, itself, and how many were left out before it."""
        with self._lock:
            said_us = self._said_us.get(text)
            if said_us is not None and now_us < said_us + AGAIN_US:
                self._repeated[text] = self._repeated.get(text, 0) + 1
                return []
            gained = max(0, now_us - self._refilled_us) // REFILL_US
            if gained:
                self._left, self._refilled_us = min(NOTES, self._left + gained), now_us
            if not self._left:
                self.left_out += 1
                return []
            return self._taken(text, now_us)

    def _taken(self, text: str, now_us: int) -> list[str]:
        self._left -= 1
        self._said_us.pop(text, None)
        self._said_us[text] = now_us
        if len(self._said_us) > NOTES:
            oldest = next(iter(self._said_us))
            del self._said_us[oldest]
            self._repeated.pop(oldest, None)
        repeated, left_out, self.left_out = self._repeated.pop(text, 0), self.left_out, 0
        before = [f"{left_out} other notes were left out: there were too many at once"] if left_out else []
        return [*before, f"{text} ({repeated} times more since the last)" if repeated else text]


def _opened(path: Path) -> int:
    return os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
