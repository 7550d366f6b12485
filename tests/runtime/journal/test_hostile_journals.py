"""Journals from anyone: whatever a field of an event holds, the journal replays, or is refused at that message in a sentence."""

import json
import os
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from random import Random
from types import NoneType, UnionType
from typing import Any, get_args, get_origin, get_type_hints

import msgpack
import pytest
from mcap.writer import CompressionType, Writer

from dyknow import NO_VALUE
from dyknow.agents.effects import Event
from dyknow.model.errors import DecodeError, DyknowError
from dyknow.model.instants import LATEST_US
from dyknow.proxies.recordings.journal_file import (
    ABOUT,
    CLOCK_EPOCH,
    CLOCK_SPEED,
    EVENT,
    TIME,
    Stepped,
    decode_event,
    encode_event,
    read_about,
    read_journal,
)
from dyknow.proxies.recordings.mcap_log import JournalRecording
from dyknow.proxies.recordings.mcap_records import MAGIC, Unread
from dyknow.runtime.configuration.config import NodeConfig
from dyknow.runtime.journal.recorded_runs import recorded_streams
from tests.federation.mutants import NASTY, Raw

FULL = bool(os.environ.get("DYKNOW_FULL"))
ENCOUNTER = Path(__file__).parent / "encounter.mcap"
VALUES: list[Any] = [
    *(each for each in NASTY if not isinstance(each, Raw)),
    (), ((),), (1, 2), ("x", 1), (("a", "b"),), (("x",) * 3,), NO_VALUE, "x" * 70_000, "\0", "[" * 5000, LATEST_US, LATEST_US + 1, -LATEST_US,
    1e30, 1e39, 2**62,
]  # fmt: skip
TYPES: dict[Any, set[type]] = {
    int: {int}, float: {int, float}, bool: {bool}, str: {str}, bytes: {bytes}, NoneType: {NoneType},
}  # fmt: skip


@cache
def recorded() -> tuple[Stepped, ...]:
    return tuple(each for each in read_journal(ENCOUNTER) if isinstance(each, Stepped))


def example(hint: Any, name: str = "") -> Any:
    """Some value of a field."""
    if get_origin(hint) is tuple:
        parts = get_args(hint)
        return (example(parts[0]),) if parts[-1] is ... else tuple(map(example, parts))
    if isinstance(hint, UnionType):
        return example(get_args(hint)[0], name)
    if hasattr(hint, "_fields"):
        return hint(*(example(each, field) for field, each in get_type_hints(hint).items()))
    plain = {
        int: 1_795_000_000_000_000 if name.endswith("_us") else 1,
        float: 1.0,
        bool: True,
        str: "x",
        bytes: b"x",
        Any: 1.0,
    }
    return plain.get(hint, {})


@cache
def events() -> tuple[Any, ...]:
    """An event of each kind, of those that were recorded, where there are some."""
    kinds: dict[Any, Any] = {kind: example(kind) for kind in get_args(Event)}
    kinds |= {("Reported", type(each.event.report)): each.event for each in recorded() if hasattr(each.event, "report")}
    kinds |= {type(each.event): each.event for each in recorded() if each.event is not None}
    return tuple(kinds.values())


def changed(value: Any) -> Iterator[tuple[Any, str, Any, Any]]:
    """(The value with one field changed, at any depth; the field; its annotation; what it has)."""
    hints = get_type_hints(type(value)) if hasattr(value, "_fields") else {}
    for at, each in enumerate(value):
        name, hint = list(hints.items())[at] if hints else ("", None)

        def put(inner: Any, at: int = at) -> Any:
            parts = (*value[:at], inner, *value[at + 1 :])
            return type(value)(*parts) if hasattr(value, "_fields") else parts

        yield from ((put(nasty), name, hint, nasty) for nasty in VALUES)
        if isinstance(each, tuple):
            yield from ((put(inner), *rest) for inner, *rest in changed(each))


def _packed(event: Any) -> bytes | None:
    try:
        return encode_event(event)
    except (TypeError, ValueError, OverflowError):  # no bytes say that
        return None


def _allowed(hint: Any) -> set[type]:
    """The types of a value that has this annotation; none: others are possible, too."""
    parts = get_args(hint) if isinstance(hint, UnionType) else (hint,)
    return set().union(*(TYPES[part] for part in parts)) if all(part in TYPES for part in parts) else set()


def test_each_field_of_each_event_is_of_its_type_or_there_is_no_event() -> None:
    refused = read = 0
    for event in events():
        for other, name, hint, nasty in changed(event):
            data = _packed(other)
            if data is None:
                continue
            try:
                found = decode_event(data)
            except DecodeError as wrong:
                assert len(str(wrong)) < 400
                assert "\n" not in str(wrong)
                refused += 1
            else:
                read += 1
                assert type(found) is type(event)
                allowed = _allowed(hint)
                assert not allowed or type(nasty) in allowed, f"{type(event).__name__}.{name}: {nasty!r:.60}"
                assert not (name.endswith("_us") and type(nasty) is int) or abs(nasty) <= LATEST_US
    print(json.dumps({"events": len(events()), "fields refused": refused, "read": read}))
    assert refused > read > 100


@pytest.mark.parametrize("event", events(), ids=lambda event: type(event).__name__)
def test_fields_too_many_or_too_few_and_what_is_no_event_are_refused(event: Any) -> None:
    name, *fields = msgpack.unpackb(
        encode_event(event), ext_hook=lambda _code, data: msgpack.unpackb(data, ext_hook=msgpack.ExtType)
    )
    for wrong in ([name], [name, *fields, 1], [name, fields], [*fields, name], [name.lower(), *fields], []):
        with pytest.raises(DecodeError):
            decode_event(msgpack.packb(msgpack.ExtType(1, msgpack.packb(wrong))))
    if hasattr(event, "report"):
        with pytest.raises(DecodeError, match="no event of a platform but a"):
            decode_event(encode_event(event.report))


def write(path: Path, about: dict[str, str], entries: list[tuple[str, int, bytes]]) -> None:
    with path.open("wb") as file:
        writer: Any = Writer(file, compression=CompressionType.LZ4)
        writer.start(profile="dyknow", library="dyknow")
        writer.add_metadata(ABOUT, about)
        channels = {topic: writer.register_channel(topic, "msgpack", 0) for topic in {each for each, _, _ in entries}}
        for topic, now_us, data in entries:
            writer.add_message(channels[topic], now_us * 1000, data, now_us * 1000)
        writer.finish()


def outcome(path: Path) -> str:
    """What replaying and reading a journal comes to: no other error than of ours, each a sentence with the file's name."""
    said = ""
    for read in (recorded_streams, lambda path: list(JournalRecording(path).reports())):
        try:
            read(path)
        except DyknowError as wrong:
            said = str(wrong)
            assert str(path) in said
            assert "\n" not in said
            assert len(said) < 600
    return said


def _entries() -> list[tuple[str, int, bytes]]:
    """The beginning of what was recorded, and every eighth of the rest."""
    return [
        (TIME, each.now_us, b"") if each.event is None else (EVENT, each.now_us, encode_event(each.event))
        for number, each in enumerate(recorded())
        if number < 200 or number % 8 == 0
    ]


@pytest.mark.timeout(3600)
def test_a_journal_with_a_hostile_event_replays_or_is_refused_in_a_sentence(tmp_path: Path) -> None:
    about, entries, path = dict(read_about(ENCOUNTER)), _entries(), tmp_path / "hostile.mcap"
    cases = [
        (type(event).__name__, data) for event in events() for other, *_ in changed(event) if (data := _packed(other))
    ]
    readable = [(kind, data) for kind, data in cases if _is_read(data)]
    draw = Random(26)
    drawn = [*readable, *draw.sample(cases, 400)] if FULL else [*draw.sample(readable, 9), *draw.sample(cases, 6)]
    refused = 0
    for number, (kind, data) in enumerate(drawn):
        at = draw.randrange(100, 300)
        write(path, about, [*entries[:at], (EVENT, entries[at][1], data), *entries[at:]])
        said = outcome(path)
        if said and not _is_read(data):
            assert f"message {at + 1} (event)" in said
        assert bool(said) or _is_read(data), (number, kind)
        refused += bool(said)
    print(json.dumps({"journals": len(drawn), "refused": refused, "replayed": len(drawn) - refused}))


def _is_read(data: bytes) -> bool:
    try:
        decode_event(data)
    except DecodeError:
        return False
    return True


CONFIG = NodeConfig(unit="7").model_dump_json()
ABOUTS: dict[str, tuple[dict[str, str], str]] = {
    "no configuration": ({"config": ""}, "does not say what it is of"),
    "a list": ({"config": "[]"}, "does not say what it is of"),
    "deep": ({"config": "[" * 100_000}, "does not say what it is of"),
    "types": ({"config": '{"unit": [], "period_ms": "x"}'}, "does not say what it is of"),
    "an epoch of digits": ({CLOCK_EPOCH: "9" * 5000}, "does not tell its federation's clock"),
    "a large epoch": ({CLOCK_EPOCH: "9" * 400}, "no clock has"),
    "not a number": ({CLOCK_SPEED: "nan"}, "no clock has"),
    "a small speed": ({CLOCK_SPEED: "1e-300"}, "no clock has"),
    "a large speed": ({CLOCK_SPEED: "1e300"}, "no clock has"),
    "units": ({"config": NodeConfig(unit="7", units=("evil.py",)).model_dump_json()}, "give --units evil.py, if you trust it"),
    "an extension": ({"config": NodeConfig(unit="7", extensions=("evil",)).model_dump_json()}, "give --extension evil"),
}  # fmt: skip


@pytest.mark.parametrize("case", ABOUTS)
def test_what_a_journal_says_of_its_platform_is_checked_and_runs_no_code(
    case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "evil.py").write_text(f"open({str(tmp_path / 'ran')!r}, 'w')")
    changes, why = ABOUTS[case]
    write(tmp_path / "7.mcap", {"config": CONFIG, CLOCK_EPOCH: "0", CLOCK_SPEED: "1.0", **changes}, [(TIME, 1, b"")])
    with pytest.raises(DyknowError) as refused:
        recorded_streams(tmp_path / "7.mcap")
    assert why in str(refused.value)
    assert str(tmp_path / "7.mcap") in str(refused.value)
    assert "\n" not in str(refused.value)
    assert not (tmp_path / "ran").exists()


def test_what_is_not_read_of_a_journal_is_stated_with_its_place(tmp_path: Path) -> None:
    path, told = tmp_path / "7.mcap", list[Unread]()
    write(path, {"config": CONFIG, CLOCK_EPOCH: "0", CLOCK_SPEED: "1.0"}, [(TIME, 1, b"")])
    whole = path.read_bytes()
    end = whole.index(b"\x0f\x04\0\0\0\0\0\0\0")  # the data's end
    for more, why in (
        (
            b"\x06\xff\xff\xff\xff\xff\xff\xff\x3f" + bytes(90),
            "a record of 4611686018427387903 bytes begins where 90 follow",
        ),
        (b"\x05\x08", "a record begins there and is cut off"),
        (b"\x04\x03\0\0\0\0\0\0\0abc" + bytes(50), "the record there is damaged"),
    ):
        path.write_bytes(whole[:end] + more)
        [*entries, unread] = read_journal(path)
        assert len(entries) == 1
        assert isinstance(unread, Unread)
        assert (unread.offset, unread.size) == (end, len(more))
        assert why in str(unread)
        told.clear()
        recorded_streams(path, on_unread=told.append)
        assert told == [unread]
        recording = JournalRecording(path)
        assert list(recording.reports()) == []
        assert recording.problems == [f"{path}, {unread}"]
    path.write_bytes(whole[:end])
    assert not any(isinstance(each, Unread) for each in read_journal(path)), "nothing is left"
    assert whole.startswith(MAGIC)
