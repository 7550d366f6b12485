"""The journal's file format: MCAP, so that other tools open it, with our events in msgpack and samples in JSON.

    topic     encoding  message
    event     msgpack   an event that reached the node; log time = node clock when it was handed over
    time      (empty)   the node was stepped by time
    shown     msgpack   what the stopwatch showed in the step of the entry before this one, in microseconds
    lost      msgpack   how many entries before this one could not be kept
    x/...     json      a sample of a stream: {"valid_us", "available_us", "value" or fields}; log time = available time

Entries are in the order in which the node saw them. A file that was cut off by a crash reads up to the cut. One may come from
anyone: each field of an event is of the type that its kind declares, or the file is refused there (`event_fields.py`).
"""

from collections.abc import Iterator, Mapping
from enum import Enum
from pathlib import Path
from typing import Any, Final, NamedTuple, TypeAlias, get_args

import msgpack
from mcap.records import Channel, Header, Message, Metadata

from dyknow import NO_VALUE, Predicted, Quality, Sample
from dyknow.agents.effects import (
    Computed,
    Event,
    Fed,
    FedTogether,
    HostEvent,
    Impaired,
    LeaveRequested,
    Pressed,
    Reported,
    SearchNews,
    SearchOver,
    Specify,
    Waited,
)
from dyknow.federation.transport import WireEvent
from dyknow.model.errors import DecodeError
from dyknow.model.instants import MAX_DURATION_US
from dyknow.navigation.fences import FenceArea, FenceKind
from dyknow.navigation.heard_aircraft import HeardAircraft
from dyknow.navigation.mission_plans import MissionItem, MissionStep
from dyknow.navigation.vehicle import ImageDetection, LinkLossAction, Report
from dyknow.network.process import Outcome
from dyknow.proxies.recordings.event_fields import made, shown
from dyknow.proxies.recordings.mcap_records import McapItem, McapRecords, Unread
from dyknow.proxies.recordings.packed_lengths import check_lengths

EVENT, TIME, SHOWN, LOST, SAMPLES = "event", "time", "shown", "lost", "x/"
ABOUT = "node"
CLOCK_EPOCH, CLOCK_SPEED, STOPWATCH = "clock_epoch_us", "clock_speed", "stopwatch"
"""A journal's entries about the federation's clock, of reports and samples; entries have the node's clock."""
REMEDY: Final = "a platform whose settings name a `journal` writes one"
MOST_DEPTH: Final = 24
"""Named tuples and tuples inside one another."""
_SHORT: Final = 1024
"""Bytes of an event that needs no look at its lengths before it is unpacked."""
_NAMED, _TUPLE, _NO_VALUE, _WORD = 1, 2, 3, 4
_NAMES: dict[type[Any], str] = {LeaveRequested: "Leave"}
"""Events that a journal names otherwise than the code does: journals outlive names of classes."""
_KINDS: dict[str, type[Any]] = {
    _NAMES.get(kind, kind.__name__): kind
    for kind in (
        *get_args(WireEvent),
        *get_args(Report),
        ImageDetection,
        FenceArea,
        HeardAircraft,
        MissionItem,
        *get_args(HostEvent),
        Reported,
        LeaveRequested,
        Specify,
        Fed,
        FedTogether,
        Waited,
        Pressed,
        Impaired,
        Computed,
        SearchNews,
        SearchOver,
        Outcome,
        Sample,
        Quality,
        Predicted,
    )
}
_EVENTS = frozenset(get_args(Event))
_WORDS: dict[str, type[Enum]] = {kind.__name__: kind for kind in (LinkLossAction, FenceKind, MissionStep)}
"""Enumerations that fields of events have."""


class Stepped(NamedTuple):
    """The node got `event` at `now_us`; None: it was stepped by time. Its stopwatch showed `shown`."""

    now_us: int
    event: Event | None
    shown: tuple[int, ...] = ()


class Lost(NamedTuple):
    """The journal could not keep `entries` here: the rest does not replay exactly."""

    now_us: int
    entries: int


Entry: TypeAlias = Stepped | Lost | Unread


def encode_event(event: Any) -> bytes:
    """Named tuples by name, tuples as such; raises TypeError or ValueError for values that no event holds."""
    packed: bytes = msgpack.packb(event, strict_types=True, default=_extended)
    return packed


def _extended(value: Any) -> msgpack.ExtType:
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        return msgpack.ExtType(_NAMED, encode_event([_NAMES.get(type(value), type(value).__name__), *value]))
    if isinstance(value, tuple):
        return msgpack.ExtType(_TUPLE, encode_event(list(value)))
    if value is NO_VALUE:
        return msgpack.ExtType(_NO_VALUE, b"")
    if type(value).__name__ in _WORDS:
        return msgpack.ExtType(_WORD, encode_event([type(value).__name__, value.value]))
    raise TypeError(f"{type(value).__name__} is no part of an event")


def decode_event(data: bytes) -> Event:
    """The event; raises DecodeError for anything but one of our events, field by field."""
    event = _decoded(data, 0)
    if type(event) not in _EVENTS:
        raise DecodeError("journal", f"no event of a platform but {shown(event)}")
    found: Event = event
    return found


def _decoded(data: bytes, depth: int) -> Any:
    """Unpack a value, and packed values inside it by this again, at most `MOST_DEPTH` deep."""
    try:
        if len(data) > _SHORT:
            check_lengths(data)
        return msgpack.unpackb(data, ext_hook=lambda code, inner: _restored(code, inner, depth + 1))
    except (ValueError, TypeError, KeyError, IndexError, OverflowError, RecursionError) as malformed:
        raise DecodeError("journal", f"no event: {malformed!s:.120}") from None


def _restored(code: int, data: bytes, depth: int) -> Any:
    if code == _NO_VALUE:
        return NO_VALUE
    if depth > MOST_DEPTH:
        raise ValueError(f"nested deeper than {MOST_DEPTH}")
    values = _decoded(data, depth)
    if type(values) is not list:
        raise ValueError("no list of fields")
    if code == _WORD:
        name, word = values
        return _WORDS[name](word)
    if code != _NAMED:
        return tuple(values)
    kind = _KINDS.get(values[0]) if values and isinstance(values[0], str) else None
    if kind is None:
        raise DecodeError("journal", f"no kind of event is called {shown(values[0] if values else None)}")
    return made(kind, values[1:])


def read_about(path: Path) -> Mapping[str, str]:
    """The journal's metadata about its node: the first record in the file.

    Raises:
        DecodeError: it is not a journal.
    """
    for record in _records(path):
        if isinstance(record, Metadata) and record.name == ABOUT:
            found: Mapping[str, str] = record.metadata
            return found
        if not isinstance(record, Header):
            raise DecodeError("journal", f"{path} does not say whose it is; {REMEDY}")
    raise DecodeError("journal", f"{path}: nothing is in it: it was cut off as it was made; {REMEDY}")


def read_journal(path: Path) -> Iterator[Entry]:
    """Every entry, in the order in which the node saw them; up to the cut in a file that was cut off, and then what is unread.

    Raises:
        DecodeError: it is not a journal, or a message of it is no entry, and which.
    """
    stepped: Stepped | None = None
    for entry in _entries(path):
        if isinstance(entry, _Shown):
            stepped = None if stepped is None else stepped._replace(shown=entry.shown)
            continue
        if stepped is not None:
            yield stepped
        stepped = entry if isinstance(entry, Stepped) else None
        if stepped is None:
            yield entry
    if stepped is not None:
        yield stepped


class _Shown(NamedTuple):
    """The readings of the stopwatch in the step before."""

    shown: tuple[int, ...]


def _entries(path: Path) -> "Iterator[Entry | _Shown]":
    topics: dict[int, str] = {}
    number = 0
    for record in _records(path):
        if isinstance(record, Unread):
            yield record
        elif isinstance(record, Channel):
            topics[record.id] = record.topic
        elif isinstance(record, Message):
            number += 1
            topic = topics.get(record.channel_id, "")
            try:
                entry = _entry(topic, record.log_time // 1000, record.data)
            except DecodeError as wrong:
                cause = str(wrong).removeprefix("journal: ")
                raise DecodeError("journal", f"{path}, message {number} ({topic}): {cause}; {REMEDY}") from None
            if entry is not None:
                yield entry


def _entry(topic: str, now_us: int, data: bytes) -> "Entry | _Shown | None":
    match topic:
        case "event":
            return Stepped(now_us, decode_event(data))
        case "time":
            return Stepped(now_us, None)
        case "shown":
            return _Shown(_numbers(data))
        case "lost":
            return Lost(now_us, sum(_numbers(data)))
    return None


def _numbers(data: bytes) -> tuple[int, ...]:
    """One whole number, or a list of some."""
    found = _decoded(data, MOST_DEPTH)
    numbers = tuple(found) if isinstance(found, list) else (found,)
    if not all(type(number) is int and 0 <= number <= MAX_DURATION_US for number in numbers):
        raise DecodeError("journal", f"whole numbers from 0 on are expected, got {shown(found)}")
    return numbers


def _records(path: Path) -> Iterator[McapItem]:
    return iter(McapRecords(path, "journal", REMEDY))
