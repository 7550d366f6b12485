"""A recording of a federation, read: its messages, up to the cut in a file that was cut off.

A file may come from anyone: a message that is too long, too deep or of another form ends the reading or is passed over,
counted.
"""

import json
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple

from mcap.records import Channel, Header, Message, Metadata, Schema

from dyknow.model.errors import DecodeError, WrongCall
from dyknow.proxies.recordings.mcap_records import LARGEST_CHUNK, DataEnd, McapItem, McapRecords, Unread
from dyknow.runtime.recordings.recording_file import ABOUT, LONGEST_MESSAGE, PROFILE

REMEDY: Final = "dyknow record FILE.mcap makes one"


class RecordedMessage(NamedTuple):
    """One message, with the time of its recording (federation time)."""

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
        unread: the rest that the last reading left, since the file is cut off or damaged.

    Raises:
        WrongCall: there is no such file.
        DecodeError: it is no recording of a federation.
    """

    def __init__(self, path: Path) -> None:
        if not path.is_file():
            raise WrongCall(f"there is no file {path}; check the path.")
        self.path, self.is_whole, self.skipped = path, False, 0
        self.unread: Unread | None = None
        self.about: Mapping[str, str] = self._read_about()

    def _read_about(self) -> Mapping[str, str]:
        is_ours = True
        for record in self._records():
            if isinstance(record, Header) and record.profile == PROFILE:
                continue
            if isinstance(record, Metadata) and record.name == ABOUT:
                return dict(record.metadata)
            is_ours = False
            break
        why = ": nothing is in it: it was cut off as it was made" if is_ours else " is no recording of a federation"
        raise DecodeError("recording", f"{self.path}{why}; {REMEDY}")

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

    @property
    def unread_text(self) -> str:
        """The unread rest, in words; empty if there is none."""
        return "" if self.unread is None else f"{self.path}, {self.unread}"

    def _records(self) -> Iterator[McapItem]:
        """The records before the index at the end; raises DecodeError where there is more in it than is read."""
        self.is_whole, self.unread = False, None
        for record in McapRecords(self.path, "recording", REMEDY):
            if isinstance(record, DataEnd):
                self.is_whole = True
                return
            if isinstance(record, Unread):
                self.unread = record
                return
            yield record


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
    from dyknow.runtime.recordings.recording_file import RecordingFile

    count = 0
    most = 2 * recording.path.stat().st_size + LARGEST_CHUNK
    with RecordingFile(path, recording.about, lambda: count, most_bytes=most) as whole:
        for at_us, topic, schema, message in recording.messages():
            valid_us = message.get("valid_us")
            whole.add(topic, schema, message, at_us, valid_us if isinstance(valid_us, int) else None)
            count += 1
    return count - whole.lost
