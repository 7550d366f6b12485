"""Records of an MCAP file from anyone, one by one, at a bounded cost: a small file cannot unpack to a large one.

Chunks are unpacked one at a time. A file of our own unpacks to a few times its size; a file that unpacks to more than
`UNPACKED_FREE` and `MOST_RATIO` times the bytes read is refused, with the place.
"""

import os
import struct
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import Any, Final, NamedTuple, TypeAlias

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Header, Message, Metadata, Schema

from dyknow.model.errors import DecodeError
from dyknow.proxies.files.named_files import opened_file

MAGIC: Final = b"\x89MCAP0\r\n"
LARGEST_CHUNK: Final = 4_000_000
"""Most bytes of a record, and of an unpacked chunk; ours have 262 144 and one message."""
LARGEST_TEXT: Final = 262_144
"""Bytes of a record that is no chunk and no message."""
MOST_NAMES: Final = 8192
"""Channels and schemas of a file, each."""
UNPACKED_FREE: Final = 4_000_000
MOST_RATIO: Final = 32
_HEAD = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<HIQQ")
_OTHERS: Final[dict[int, Any]] = {
    Opcode.HEADER: Header, Opcode.SCHEMA: Schema, Opcode.CHANNEL: Channel, Opcode.METADATA: Metadata,
}  # fmt: skip
_ENDS: Final = (Opcode.DATA_END, Opcode.FOOTER)
_DAMAGE: Final = (McapError, ValueError, EOFError, struct.error, RuntimeError, MemoryError, OverflowError)


class DataEnd(NamedTuple):
    """The data ended as their writer had it."""


class Unread(NamedTuple):
    """The file does not end as a writer ends it: `size` bytes from `offset` on are not read, and why."""

    offset: int
    size: int
    why: str

    def __str__(self) -> str:
        return f"byte {self.offset}: {self.why}; {self.size} bytes from there to the end are not read"


McapItem: TypeAlias = Header | Schema | Channel | Metadata | Message | DataEnd | Unread


class McapRecords:
    """The records of one file, up to the cut in one that was cut off, and no further than the index at its end.

    The last item, `Unread`, describes the rest after a cut or damage.

    Args:
        what: the expected kind of file, for messages: `journal`, `recording`.
        remedy: given where it is none.

    Raises:
        DecodeError: while read: it is empty, is no MCAP file, or has more in it than is read.
    """

    def __init__(self, path: Path, what: str, remedy: str) -> None:
        self._path, self._what, self._remedy = path, what, remedy
        self._unpacked = self._channels = self._schemas = 0

    def __iter__(self) -> Iterator[McapItem]:
        with opened_file(self._path) as stream:
            size = os.fstat(stream.fileno()).st_size
            self._check_beginning(stream.read(len(MAGIC)))
            while (offset := stream.tell()) < size:
                head = stream.read(_HEAD.size)
                if len(head) < _HEAD.size:
                    yield Unread(offset, size - offset, "a record begins there and is cut off")
                    return
                kind, length = _HEAD.unpack(head)
                if kind in _ENDS:
                    yield DataEnd()
                    return
                if length > (rest := size - offset - _HEAD.size):
                    why = (
                        f"a record of {length} bytes begins where {rest} follow: it is cut off, or its length is wrong"
                    )
                    yield Unread(offset, size - offset, why)
                    return
                if kind not in _OTHERS and kind not in {Opcode.CHUNK, Opcode.MESSAGE}:
                    stream.seek(length, os.SEEK_CUR)
                    continue
                self._check_length(kind, length, offset)
                try:
                    yield from self._read(kind, stream.read(length), offset)
                except _DAMAGE:
                    yield Unread(offset, size - offset, "the record there is damaged")
                    return

    def _check_beginning(self, magic: bytes) -> None:
        if not magic:
            raise self._wrong(0, "the file is empty: it was cut off as it was made")
        if magic != MAGIC:
            was_cut = MAGIC.startswith(magic)
            cause = "nothing is in it: it was cut off as it was made" if was_cut else "it is no MCAP file"
            raise self._wrong(0, cause)

    def _check_length(self, kind: int, length: int, offset: int) -> None:
        most = LARGEST_TEXT if kind in _OTHERS else LARGEST_CHUNK
        if length > most:
            raise self._wrong(offset, f"a record of {length} bytes, at most {most} are read")

    def _wrong(self, offset: int, cause: str) -> DecodeError:
        return DecodeError(self._what, f"{self._path}, byte {offset}: {cause}; {self._remedy}")

    def _read(self, kind: int, data: bytes, offset: int) -> Iterator[McapItem]:
        if kind == Opcode.CHUNK:
            yield from self._chunk(Chunk.read(_stream(data)), offset)
        else:
            yield self._one(kind, data, offset)

    def _chunk(self, chunk: Chunk, offset: int) -> Iterator[McapItem]:
        data = self._decompressed(chunk, offset)
        self._unpacked += len(data)
        if self._unpacked > UNPACKED_FREE + MOST_RATIO * (offset + len(chunk.data)):
            raise self._wrong(offset, f"the file unpacks to more than {MOST_RATIO} times its size")
        at = 0
        while at < len(data):
            kind, length = _HEAD.unpack_from(data, at)
            at += _HEAD.size
            if length > len(data) - at:
                raise ValueError("a record is longer than its chunk")
            if kind in _OTHERS or kind == Opcode.MESSAGE:
                self._check_length(kind, length, offset)
                yield self._one(kind, data[at : at + length], offset)
            at += length

    def _one(self, kind: int, data: bytes, offset: int) -> McapItem:
        if kind == Opcode.MESSAGE:
            channel, sequence, log_ns, publish_ns = _MESSAGE.unpack_from(data)
            return Message(channel, log_ns, data[_MESSAGE.size :], publish_ns, sequence)
        self._channels += kind == Opcode.CHANNEL
        self._schemas += kind == Opcode.SCHEMA
        if max(self._channels, self._schemas) > MOST_NAMES:
            raise self._wrong(offset, f"more than {MOST_NAMES} channels or schemas")
        found: McapItem = _OTHERS[kind].read(_stream(data))
        return found

    def _decompressed(self, chunk: Chunk, offset: int) -> bytes:
        most, packed = LARGEST_CHUNK + 1, chunk.data
        if chunk.compression == "lz4":
            from lz4.frame import LZ4FrameDecompressor

            data: bytes = LZ4FrameDecompressor().decompress(packed, max_length=most)
        elif chunk.compression == "zstd":
            from zstandard import ZstdDecompressor, ZstdError

            try:
                with ZstdDecompressor(max_window_size=2 * most).stream_reader(packed) as stream:
                    data = stream.read(most)
            except ZstdError as wrong:
                raise ValueError(str(wrong)) from None
        elif chunk.compression:
            raise self._wrong(offset, f"a chunk is packed with {chunk.compression:.20}; lz4 and zstd are read")
        else:
            data = packed
        if len(data) > LARGEST_CHUNK:
            raise self._wrong(offset, f"a chunk unpacks to more than {LARGEST_CHUNK / 1e6:g} MB")
        return data


def _stream(data: bytes) -> ReadDataStream:
    return ReadDataStream(BytesIO(data))
