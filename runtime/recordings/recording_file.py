"""The file of a recording: MCAP, bounded in size, whose chunks reach the file within a second.

    topic            schema              a message is
    /UNIT/LABEL      dyknow.Sample       a sample of a platform's stream
    /UNIT/fix        foxglove.LocationFix, /UNIT/pose foxglove.PoseInFrame: where a platform was
    /alarms          dyknow.Alarm        an edge of an alarm
    /monitors        dyknow.Monitor      a monitor as it is listed, or a change of whether it is known
    /acts            dyknow.Act          a speech act as it passed an interface agent
    /directory       dyknow.Platform     a platform as it describes itself, or that it is gone
    /tasks           dyknow.Task         a delegated task as it is listed
    /imports         dyknow.Imports      the streams that a platform receives, as it lists them
    /missions        dyknow.Missions     the missions that a platform leads, as it lists them
    /flights         dyknow.Flights      where a platform will fly, and within what, as it says
    /lost            dyknow.Lost         what could not be kept, and why
    /log             foxglove.Log        all that in words; /scene foxglove.SceneUpdate: in a picture

All are JSON. Log times are federation time, when it reached the recorder; publish times are valid times.
"""

import json
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import IO, Any, Final, Self

from mcap.writer import CompressionType, Writer

from dyknow.model.errors import WrongCall
from dyknow.runtime.recordings.foxglove import schema_of

PROFILE: Final = "dyknow-federation"
ABOUT: Final = "federation"
"""The metadata that says whose recording it is."""
SAMPLE, ALARM, MONITOR, ACT, PLATFORM, TASK, IMPORTS, MISSIONS, FLIGHTS, LOST = (
    f"dyknow.{name}"
    for name in ("Sample", "Alarm", "Monitor", "Act", "Platform", "Task", "Imports", "Missions", "Flights", "Lost")
)
FLUSH_US: Final = 500_000
MOST_BYTES: Final = 100_000_000
"""How large a file becomes unless something else is asked for."""
LONGEST_MESSAGE, MOST_CHANNELS = 65_536, 4096
_CHUNK = 262_144
_PER_MESSAGE, _PER_CHANNEL, _INDEX, _LEFT = 128, 10, 1024, 65_536
"""Bytes that the format adds to each message, in the index of a chunk for each channel, at the end of every file, and kept free."""


class RecordingFile:
    """Takes messages; ends by itself when it is as large as it may be, or the disk is full.

    Args:
        path: a new file; an existing file is not written to, nor is the target of a link.
        about: whose recording it is.
        now_us: the clock by which it is flushed.
        most_bytes: how large the file may become, its index included.

    Attributes:
        ended: why it takes no more, or None.
        has_failed: whether that was not asked for.
        lost: messages that were not kept.

    Raises:
        WrongCall: the file is there already, or cannot be made.
    """

    def __init__(
        self, path: Path, about: Mapping[str, str], now_us: Callable[[], int], *, most_bytes: int = MOST_BYTES
    ) -> None:
        self.path, self.lost, self.has_failed = path, 0, False
        self.ended: str | None = None
        self._now_us, self._most_bytes = now_us, most_bytes
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self._file = _new_file(path)
        self._writer: Any = Writer(self._file, chunk_size=_CHUNK, compression=CompressionType.LZ4)
        self._written = self._waiting = 0
        self._index = _INDEX
        self._flushed_us = now_us()
        self._safely(lambda: self._writer.start(profile=PROFILE, library="dyknow"))
        self._safely(lambda: self._writer.add_metadata(ABOUT, dict(about)))
        self.flush()

    @property
    def size(self) -> int:
        """Bytes of the file, at most, once it is closed."""
        return self._written + self._waiting + self._index

    def add(self, topic: str, schema: str, message: Mapping[str, Any], at_us: int, valid_us: int | None = None) -> int:
        """Keep a message; its bytes, 0 if it is not kept: too long, no JSON, or of one topic too many."""
        try:
            data = json.dumps(message, separators=(",", ":"), allow_nan=False).encode()
        except (TypeError, ValueError, RecursionError):
            data = b""
        is_kept = 0 < len(data) <= LONGEST_MESSAGE and (topic in self._channels or len(self._channels) < MOST_CHANNELS)
        if self.ended is not None or not is_kept:
            self.lost += 1
            return 0
        log_ns = max(0, at_us) * 1000
        publish_ns = log_ns if valid_us is None else max(0, valid_us) * 1000
        channel = self._channel(topic, schema)
        self._safely(lambda: self._writer.add_message(channel, log_ns, data, publish_ns))
        self._waiting += len(data) + _PER_MESSAGE
        if self.size > self._most_bytes:
            self.flush()
        return len(data)

    def _channel(self, topic: str, schema: str) -> int:
        if schema not in self._schemas:
            self._schemas[schema] = self._writer.register_schema(schema, "jsonschema", schema_of(schema))
            self._index += 2 * len(schema_of(schema)) + _PER_MESSAGE
        if topic not in self._channels:
            self._channels[topic] = self._writer.register_channel(topic, "json", self._schemas[schema])
            self._index += 2 * (len(topic) + _PER_MESSAGE)
        return self._channels[topic]

    def on_time(self) -> None:
        """Have what was taken reach the file, twice a second."""
        if self._now_us() - self._flushed_us >= FLUSH_US:
            self.flush()

    def flush(self) -> None:
        """Have what was taken reach the file; end it where it is as large as it may be."""
        if self.ended is not None:
            return
        chunks = 1 + self._waiting // _CHUNK
        self._safely(self._writer.flush)
        if self.ended is None:
            self._index += chunks * (_PER_MESSAGE + _PER_CHANNEL * len(self._channels)) if self._waiting else 0
            self._written, self._waiting, self._flushed_us = self._file.tell(), 0, self._now_us()
            if self.size + _LEFT > self._most_bytes:
                self._end(f"{self.path} is as large as it may be, {self._most_bytes / 1e6:g} MB")

    def close(self) -> None:
        """Write the index and end the file. The second time does nothing."""
        if self.ended is None:
            self._end("closed")

    def _end(self, why: str) -> None:
        self._safely(self._writer.finish)
        self._safely(self._file.close)
        self.ended = self.ended or why

    def _safely(self, write: Callable[[], object]) -> None:
        """A full disk ends the recording, and nothing else."""
        if self.has_failed:
            return
        try:
            write()
        except OSError as full:
            self.has_failed, self.ended = True, f"{self.path} cannot be written any further: {full.strerror or full}"
            with suppress(OSError):
                self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_raised: object) -> None:
        self.close()


def _new_file(path: Path) -> IO[bytes]:
    try:
        return path.open("xb")
    except FileExistsError:
        raise WrongCall(f"{path} is there already; a recording replaces nothing: choose another name.") from None
    except OSError as wrong:
        raise WrongCall(f"{path} cannot be written: {wrong.strerror or wrong}; choose another place.") from None
