"""A recording of a federation, read: what is in it, message by message, up to the cut in a file that was cut off.

A file may come from anyone: what is too long, too deep or of another form ends the reading or is passed over, counted.
"""

import json
import struct
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import IO, Any, Final, NamedTuple

from mcap.exceptions import McapError
from mcap.records import Channel, Chunk, DataEnd, Footer, Header, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import StreamReader, breakup_chunk

from dyknow.model.errors import DecodeError, WrongCall
from runtime.recordings.recording_file import ABOUT, LONGEST_MESSAGE, PROFILE

LARGEST_CHUNK: Final = 16_000_000
_DAMAGE = (McapError, ValueError, EOFError, struct.error, RuntimeError, KeyError, MemoryError, OverflowError)


class RecordedMessage(NamedTuple):
    """One message: when it was recorded (federation time), and what it is."""

    at_us: int
    topic: str
    schema: str
    message: Mapping[str, Any]


class FederationRecording:
    """A recording; `messages` may be read any number of times.

    Attributes:
        about: whose it is: federation, clock, since when.
        is_whole: whether the last reading came to the end that its writer made.
        skipped: messages of the last reading that are none of ours.

    Raises:
        WrongCall: there is no such file.
        DecodeError: it is no recording of a federation.
    """

    def __init__(self, path: Path) -> None:
        if not path.is_file():
            raise WrongCall(f"there is no file {path}; check the path.")
        self.path, self.is_whole, self.skipped = path, False, 0
        self.about: Mapping[str, str] = self._read_about()

    def _read_about(self) -> Mapping[str, str]:
        is_ours = False
        for record in self._records():
            if isinstance(record, Header):
                is_ours = record.profile == PROFILE
            elif isinstance(record, Metadata) and record.name == ABOUT and is_ours:
                return dict(record.metadata)
            else:
                break
        raise DecodeError(
            "recording", f"{self.path} is no recording of a federation; dyknow record FILE.mcap makes one"
        )

    def messages(self, wanted: Callable[[str], bool] = lambda _topic: True) -> Iterator[RecordedMessage]:
        """Every message of the topics that are wanted, in the order of the file."""
        schemas: dict[int, str] = {}
        topics: dict[int, tuple[str, str]] = {}
        self.skipped = 0
        for record in self._records():
            if isinstance(record, Schema):
                schemas[record.id] = record.name
            elif isinstance(record, Channel):
                topics[record.id] = record.topic, schemas.get(record.schema_id, "")
            elif isinstance(record, Message):
                topic, schema = topics.get(record.channel_id, ("", ""))
                if not wanted(topic):
                    continue
                message = _parsed(record.data)
                if message is None or not topic:
                    self.skipped += 1
                else:
                    yield RecordedMessage(record.log_time // 1000, topic, schema, message)

    def _records(self) -> Iterator[McapRecord]:
        """The records before the index at the end."""
        self.is_whole, is_begun = False, False
        with self.path.open("rb") as stream:
            records = _StreamedRecords(stream)
            while True:
                try:
                    record = next(records.all)
                except StopIteration:
                    return
                except _DAMAGE as damage:
                    if not is_begun:
                        raise DecodeError("recording", f"{self.path}: {str(damage) or 'it is empty'}") from None
                    return
                if isinstance(record, DataEnd | Footer):
                    self.is_whole = True
                    return
                is_begun = True
                yield record


class _StreamedRecords:
    """The records of a file, chunks unpacked as far as they are as large as ours."""

    def __init__(self, stream: IO[bytes]) -> None:
        reader: Any = StreamReader(stream, emit_chunks=True, record_size_limit=LARGEST_CHUNK)
        self.all = self._unpacked(reader.records)

    def _unpacked(self, records: Iterator[McapRecord]) -> Iterator[McapRecord]:
        for record in records:
            if isinstance(record, Chunk):
                data = _decompressed(record.compression, record.data)
                record.compression, record.data = "", data
                yield from breakup_chunk(record)
            else:
                yield record


def _decompressed(compression: str, data: bytes) -> bytes:
    """Raises ValueError for what is larger than a chunk may be, however small it is packed."""
    if compression == "lz4":
        from lz4.frame import LZ4FrameDecompressor

        unpacked: bytes = LZ4FrameDecompressor().decompress(data, max_length=LARGEST_CHUNK + 1)
    elif compression == "zstd":
        from zstandard import ZstdDecompressor

        with ZstdDecompressor(max_window_size=LARGEST_CHUNK).stream_reader(data) as stream:
            unpacked = stream.read(LARGEST_CHUNK + 1)
    elif compression:
        raise ValueError(f"chunks are packed with {compression:.20}")
    else:
        unpacked = data
    if len(unpacked) > LARGEST_CHUNK:
        raise ValueError(f"a chunk unpacks to more than {LARGEST_CHUNK / 1e6:g} MB")
    return unpacked


def _parsed(data: bytes) -> Mapping[str, Any] | None:
    if len(data) > LONGEST_MESSAGE:
        return None
    try:
        found = json.loads(data)
    except (ValueError, RecursionError):
        return None
    return found if isinstance(found, dict) else None


def mend(recording: FederationRecording, path: Path) -> int:
    """Write what can be read of a recording that was cut off to a new file with an index; its messages.

    Raises:
        WrongCall: the new file is there already, or cannot be made.
    """
    from runtime.recordings.recording_file import RecordingFile

    count = 0
    most = 2 * recording.path.stat().st_size + LARGEST_CHUNK
    with RecordingFile(path, recording.about, lambda: count, most_bytes=most) as whole:
        for at_us, topic, schema, message in recording.messages():
            valid_us = message.get("valid_us")
            whole.add(topic, schema, message, at_us, valid_us if isinstance(valid_us, int) else None)
            count += 1
    return count - whole.lost
