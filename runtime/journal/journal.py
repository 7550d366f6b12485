"""The node's journal: its events with their times, so that a replay has the same effects.

The node thread only leaves entries in a bounded queue; a thread of the journal's own encodes and writes them. When the
disk is too slow entries are dropped and counted, and the node continues.
"""

import json
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import IO, Any, Generic, Self, TypeVar

import msgpack
from mcap.writer import CompressionType, Writer

from dyknow.model.sample import Sample
from dyknow.model.values import NO_VALUE
from dyknow.proxies.recordings.journal_file import (
    ABOUT,
    EVENT,
    LOST,
    SAMPLES,
    SHOWN,
    TIME,
    Entry,
    Stepped,
    encode_event,
)
from dyknow.runtime.clock import ReplayedStopwatch, Stopwatch
from dyknow.runtime.loop import SteppedNode

F = TypeVar("F")

_WAITING = 20_000
_FLUSH_S = 1.0
_CHUNK = 262_144
_Write = Callable[["_Part"], None]


class Journal:
    """Writes `path`, then `path` with .1, .2 ... before the ending: parts of `part_bytes`, the newest `parts` kept.

    Args:
        path: the first part; an existing file is replaced.
        about: whose journal it is; every part begins with it.
        part_bytes: a part that is larger is ended.
        parts: how many stay; older ones are deleted. A replay begins with the very first.
    """

    def __init__(self, path: Path, about: Mapping[str, str], *, part_bytes: int = 256_000_000, parts: int = 4) -> None:
        self._path, self._about, self._part_bytes, self._parts = path, dict(about), part_bytes, max(1, parts)
        self._queue: SimpleQueue[_Write | None] = SimpleQueue()
        self._kept: list[Path] = []
        self._number = 0
        self._lost = self._told = 0
        self._flushed_s = time.monotonic()
        self.unwritable = 0
        self.failed: str | None = None
        path.parent.mkdir(parents=True, exist_ok=True)
        self._part = self._next_part()
        self._thread = threading.Thread(target=self._write, name="journal", daemon=True)
        self._thread.start()

    @property
    def lost(self) -> int:
        """How many entries were dropped because writing could not keep up, or failed."""
        return self._lost

    def on_event(self, event: Any, now_us: int) -> None:
        self._leave(lambda part: part.add(EVENT, now_us, encode_event(event)), now_us)

    def on_time(self, now_us: int) -> None:
        self._leave(lambda part: part.add(TIME, now_us, b""), now_us)

    def on_shown(self, shown: Sequence[int], now_us: int) -> None:
        """Note the stopwatch's readings in the step that was entered last."""
        self._leave(lambda part: part.add(SHOWN, now_us, msgpack.packb(shown)), now_us)

    def on_sample(self, label: str, fields: Sequence[str], sample: Sample) -> None:
        """A sample of a stream of this node; `fields` name the values of a record."""
        self._leave(lambda part: part.add_sample(label, fields, sample), sample.available_us)

    def close(self) -> None:
        """Write what waits and end the file. The second time does nothing."""
        self._queue.put(None)
        self._thread.join()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_raised: object) -> None:
        self.close()

    def _leave(self, write: _Write, now_us: int) -> None:
        if self._queue.qsize() >= _WAITING or self.failed is not None:
            self._lost += 1
            return
        if self._lost != self._told:
            lost, self._told = self._lost - self._told, self._lost
            self._queue.put(lambda part: part.add(LOST, now_us, msgpack.packb(lost)))
        self._queue.put(write)

    def _write(self) -> None:
        """The journal's thread. A full disk ends the journal, not the node."""
        try:
            while (write := self._next()) is not None:
                try:
                    write(self._part)
                except (TypeError, ValueError, OverflowError):
                    self.unwritable += 1
                if self._part.size > self._part_bytes:
                    self._part.end()
                    self._part = self._next_part()
            self._part.end()
        except OSError as failed:
            self.failed = str(failed)

    def _next(self) -> _Write | None:
        """The next entry. A written entry reaches the file within a second, so that a crash loses no more."""
        due_s = self._flushed_s + _FLUSH_S - time.monotonic()
        if due_s > 0:
            with suppress(Empty):
                return self._queue.get(timeout=due_s)
        self._part.flush()
        self._flushed_s = time.monotonic()
        return self._queue.get()

    def _next_part(self) -> "_Part":
        path = self._path.with_suffix(f".{self._number}{self._path.suffix}") if self._number else self._path
        self._number += 1
        self._kept.append(path)
        while len(self._kept) > self._parts:
            self._kept.pop(0).unlink(missing_ok=True)
        return _Part(path, self._about)


class _Part:
    """One file."""

    def __init__(self, path: Path, about: Mapping[str, str]) -> None:
        self._file: IO[bytes] = path.open("wb")
        self._writer: Any = Writer(self._file, chunk_size=_CHUNK, compression=CompressionType.LZ4)
        self._writer.start(profile="dyknow", library="dyknow")
        self._writer.add_metadata(ABOUT, dict(about))
        self._file.flush()
        self._channels: dict[str, int] = {}
        self._schema: int | None = None

    @property
    def size(self) -> int:
        return self._file.tell()

    def add(self, topic: str, now_us: int, data: bytes, encoding: str = "msgpack", schema: int = 0) -> None:
        channel = self._channels.get(topic)
        if channel is None:
            channel = self._channels[topic] = self._writer.register_channel(topic, encoding, schema)
        self._writer.add_message(channel, now_us * 1000, data, now_us * 1000)

    def add_sample(self, label: str, fields: Sequence[str], sample: Sample) -> None:
        if self._schema is None:
            self._schema = self._writer.register_schema("dyknow.Sample", "jsonschema", b'{"type": "object"}')
        said = {"valid_us": sample.valid_us, "available_us": sample.available_us, **_values(fields, sample.value)}
        self.add(
            f"{SAMPLES}{label}", sample.available_us, json.dumps(said, default=_void).encode(), "json", self._schema
        )

    def flush(self) -> None:
        self._writer.flush()

    def end(self) -> None:
        self._writer.finish()
        self._file.close()


def _void(_value: object) -> None:
    """A value that JSON has no word for: `no_value` inside a record."""


def _values(fields: Sequence[str], value: Any) -> dict[str, Any]:
    if value is NO_VALUE:
        return {"value": None}
    return dict(zip(fields, value, strict=False)) if fields and isinstance(value, tuple) else {"value": value}


class Journalled(Generic[F]):
    """A node whose events are written down before it gets them. Step it in place of `node`."""

    def __init__(self, node: SteppedNode[Any, F], journal: Journal, stopwatch: Stopwatch | None = None) -> None:
        self.node, self._journal, self._stopwatch = node, journal, stopwatch

    @property
    def deadline_us(self) -> int | None:
        return self.node.deadline_us

    def on_event(self, event: Any, now_us: int) -> Iterable[F]:
        self._journal.on_event(event, now_us)
        effects = self.node.on_event(event, now_us)
        self._note_shown(now_us)
        return effects

    def on_time(self, now_us: int) -> Iterable[F]:
        self._journal.on_time(now_us)
        effects = self.node.on_time(now_us)
        self._note_shown(now_us)
        return effects

    def _note_shown(self, now_us: int) -> None:
        shown = () if self._stopwatch is None else self._stopwatch.taken()
        if shown:
            self._journal.on_shown(shown, now_us)


def replayed(
    entries: Iterable[Entry], node: SteppedNode[Any, F], stopwatch: ReplayedStopwatch | None = None
) -> Iterator[tuple[int, list[F]]]:
    """Step a fresh `node` through a journal: (now_us, its effects), one pair per entry.

    Entries that the journal lost are passed over; where there are any, effects may differ from then on.
    """
    for entry in entries:
        if isinstance(entry, Stepped):
            if stopwatch is not None:
                stopwatch.expect(entry.shown)
            stepped = node.on_time(entry.now_us) if entry.event is None else node.on_event(entry.event, entry.now_us)
            yield entry.now_us, list(stepped)
