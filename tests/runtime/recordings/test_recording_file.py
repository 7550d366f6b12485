"""A recording survives a kill up to the last second, is bounded, replaces nothing, and may come from anyone."""

import multiprocessing
import os
import random
import re
import resource
import time
from collections import Counter
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from dyknow.federation.transport import AskEnded
from dyknow.model.errors import DecodeError, WrongCall
from dyknow.proxies.recordings.journal_file import Stepped, read_about, read_journal
from dyknow.proxies.recordings.mcap_records import LARGEST_CHUNK
from dyknow.runtime.journal.journal import Journal
from dyknow.runtime.recordings import foxglove
from dyknow.runtime.recordings.recorded import FederationRecording, mend
from dyknow.runtime.recordings.recording_file import ABOUT, FLUSH_US, LONGEST_MESSAGE, PROFILE, SAMPLE, RecordingFile
from dyknow.runtime.recordings.summary import summary_of

KILLS = 200 if os.environ.get("DYKNOW_FULL") else 10
AT_ONCE = 5
LATE_S = 0.4
FORK = multiprocessing.get_context("fork")
ABOUT_IT = {"federation": "test"}


def now_us() -> int:
    return time.monotonic_ns() // 1000


def sample(at_us: int, **more: Any) -> dict[str, Any]:
    return {"unit": "0", "label": "heli-altitude", "valid_us": at_us, "available_us": at_us, **more}


def filled(path: Path, samples: int = 100) -> Path:
    with RecordingFile(path, ABOUT_IT, now_us) as file:
        for at in range(samples):
            file.add("/0/heli-altitude", SAMPLE, sample(at * 100_000, value={"altitude_m": 1.0}), at * 100_000)
    return path


def _record_until_killed(path: Path, ready: Connection) -> None:
    with RecordingFile(path, ABOUT_IT, now_us) as file:
        ready.send(True)
        while True:
            file.add("/0/heli-altitude", SAMPLE, sample(now_us(), text=os.urandom(20).hex()), now_us())
            file.on_time()
            time.sleep(0.002)


def _killed(path: Path, after_s: float) -> Callable[[], int]:
    """Record in a process that is killed after a while; a function that waits for that, and says when it was."""
    mine, its = FORK.Pipe()
    process = FORK.Process(target=_record_until_killed, args=(path, its))
    process.start()
    assert mine.poll(20)
    until_us = now_us() + round(after_s * 1e6)

    def end() -> int:
        time.sleep(max(0, until_us - now_us()) / 1e6)
        process.kill()
        killed_us = now_us()
        process.join()
        return killed_us

    return end


def test_what_is_killed_while_it_records_leaves_a_file_that_opens_and_lacks_at_most_the_last_second(
    tmp_path: Path,
) -> None:
    choose = random.Random(17)
    for begun in range(0, KILLS, AT_ONCE):
        paths = [tmp_path / f"{begun + at}.mcap" for at in range(AT_ONCE)]
        for path, end in [(path, _killed(path, choose.uniform(0.0, 1.5))) for path in paths]:
            killed_us = end()
            recording = FederationRecording(path)
            newest_us = max((each.message["valid_us"] for each in recording.messages()), default=None)
            assert not recording.is_whole
            if newest_us is None:
                assert path.stat().st_mtime > 0
            else:
                assert killed_us - newest_us < FLUSH_US + LATE_S * 1e6
            assert mend(recording, path.with_suffix(".whole.mcap")) == sum(1 for _ in recording.messages())
            with path.with_suffix(".whole.mcap").open("rb") as stream:
                assert make_reader(stream).get_summary() is not None


def _journal_until_killed(path: Path) -> None:
    with Journal(path, ABOUT_IT) as journal:
        while True:
            journal.on_event(AskEnded(1, 2), now_us())
            time.sleep(0.002)


def _record_from_the_start(path: Path) -> None:
    mine, its = FORK.Pipe()
    _record_until_killed(path, its)
    mine.close()


@pytest.mark.parametrize("write", [_record_from_the_start, _journal_until_killed])
def test_what_is_killed_as_it_is_made_opens_or_says_that_nothing_is_in_it(
    write: Callable[[Path], None], tmp_path: Path
) -> None:
    choose, outcomes = random.Random(18), Counter[str]()
    for number in range(KILLS):
        path = tmp_path / f"{number}.mcap"
        process = FORK.Process(target=write, args=(path,))
        process.start()
        until_us = now_us() + 20_000_000
        while not path.exists() and now_us() < until_us:
            pass
        time.sleep(choose.choice([0.0, 0.0002, 0.001, 0.01]))
        process.kill()
        process.join()
        try:
            if write is _journal_until_killed:
                assert read_about(path) == ABOUT_IT
                outcomes["opened"] += all(isinstance(one, Stepped) for one in read_journal(path))
            else:
                recording = FederationRecording(path)
                outcomes["opened"] += recording.about == ABOUT_IT and list(recording.messages()) is not None
        except DecodeError as empty:
            assert re.search("the file is empty|nothing is in it", str(empty))
            outcomes["empty"] += 1
    print(dict(outcomes))
    assert outcomes.total() == KILLS


def test_the_file_is_never_larger_than_asked_and_what_is_in_it_has_an_index(tmp_path: Path) -> None:
    most = 400_000
    with RecordingFile(tmp_path / "a.mcap", ABOUT_IT, now_us, most_bytes=most) as file:
        at = 0
        while file.ended is None:
            at += 1
            file.add(f"/{at % 50}/x", SAMPLE, sample(at, text=os.urandom(200).hex()), at)
            if not at % 7:
                file.flush()
    assert "as large as it may be" in str(file.ended)
    assert not file.has_failed
    assert most / 2 < file.path.stat().st_size <= most
    with file.path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.message_count == at
    assert not file.add("/0/x", SAMPLE, sample(1), 1)


def _fill_the_disk(path: Path, said: Connection) -> None:
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))
    with RecordingFile(path, ABOUT_IT, now_us) as file:
        for at in range(3000):
            file.add("/0/x", SAMPLE, sample(at, text=os.urandom(100).hex()), at)
            if not at % 50:
                file.flush()
    said.send((file.has_failed, file.ended, file.lost))


def test_a_full_disk_ends_the_recording_is_said_once_and_what_was_written_can_be_read(tmp_path: Path) -> None:
    mine, its = FORK.Pipe()
    process = FORK.Process(target=_fill_the_disk, args=(tmp_path / "a.mcap", its))
    process.start()
    assert mine.poll(20)
    has_failed, why, lost = mine.recv()
    process.join()
    assert has_failed
    assert "cannot be written any further" in why
    assert lost > 2000
    recording = FederationRecording(tmp_path / "a.mcap")
    assert 100 < sum(1 for _ in recording.messages()) < 1000
    assert not recording.is_whole


def test_nothing_that_is_there_is_replaced_also_not_through_a_link(tmp_path: Path) -> None:
    (tmp_path / "mine").write_text("mine")
    (tmp_path / "link.mcap").symlink_to(tmp_path / "mine")
    (tmp_path / "ahead.mcap").symlink_to(tmp_path / "new")
    for name in ("mine", "link.mcap", "ahead.mcap"):
        with pytest.raises(WrongCall, match="is there already"):
            RecordingFile(tmp_path / name, ABOUT_IT, now_us)
    with pytest.raises(WrongCall, match="cannot be written"):
        RecordingFile(tmp_path / "no" / "a.mcap", ABOUT_IT, now_us)
    assert (tmp_path / "mine").read_text() == "mine"
    assert not (tmp_path / "new").exists()


def test_what_is_too_long_or_no_json_is_counted(tmp_path: Path) -> None:
    with RecordingFile(tmp_path / "a.mcap", ABOUT_IT, now_us) as file:
        for message in ({"text": "x" * LONGEST_MESSAGE}, {"value": float("nan")}, {"value": object()}):
            assert not file.add("/0/x", SAMPLE, message, 0)
        assert file.lost == 3
        assert file.add("/0/x", SAMPLE, sample(-5), -5, -5)


def test_a_file_of_another_kind_is_refused_with_what_makes_one(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_bytes(b"")
    (tmp_path / "b.mcap").write_bytes(b"no recording")
    with (tmp_path / "c.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros2")
        writer.finish()
    for name in "abc":
        with pytest.raises(DecodeError):
            FederationRecording(tmp_path / f"{name}.mcap")
    with pytest.raises(WrongCall, match="there is no file"):
        FederationRecording(tmp_path / "d.mcap")


@given(cut=st.floats(0, 1), flipped=st.lists(st.tuples(st.floats(0, 0.999), st.integers(1, 255)), max_size=3))
def test_a_damaged_file_is_read_to_the_damage_or_refused(
    tmp_path_factory: pytest.TempPathFactory, cut: float, flipped: list[tuple[float, int]]
) -> None:
    place = tmp_path_factory.mktemp("damaged")
    data = bytearray(filled(place / "whole.mcap", 30).read_bytes())
    for at, bits in flipped:
        data[int(at * len(data))] ^= bits
    (place / "a.mcap").write_bytes(data[: int(cut * len(data))])
    try:
        recording = FederationRecording(place / "a.mcap")
    except DecodeError:
        return
    assert summary_of(recording).kinds.total() <= 30


@pytest.mark.parametrize("compression", [CompressionType.LZ4, CompressionType.ZSTD])
def test_a_chunk_that_unpacks_to_far_more_than_ours_is_refused(tmp_path: Path, compression: CompressionType) -> None:
    with (tmp_path / "a.mcap").open("wb") as stream:
        writer: Any = Writer(stream, compression=compression, chunk_size=10 * LARGEST_CHUNK)
        writer.start(profile=PROFILE)
        writer.add_metadata(ABOUT, ABOUT_IT)
        channel = writer.register_channel("/0/x", "json", writer.register_schema(SAMPLE, "jsonschema", b"{}"))
        for at in range(3):
            writer.add_message(channel, at, bytes(LARGEST_CHUNK), at)
        writer.finish()
    assert (tmp_path / "a.mcap").stat().st_size < LARGEST_CHUNK
    recording = FederationRecording(tmp_path / "a.mcap")
    with pytest.raises(DecodeError, match=r"byte \d+: a chunk unpacks to more than 4 MB; dyknow record"):
        list(recording.messages())
    assert not recording.is_whole


def test_a_summary_of_hostile_messages_is_bounded_and_counts_what_it_leaves_out(tmp_path: Path) -> None:
    hostile: list[dict[str, Any]] = [
        {"unit": 5, "label": "x", "valid_us": 1},
        {"unit": "0", "label": "x", "valid_us": 10**30},
        {"unit": "0", "label": "x", "valid_us": "now"},
        {},
    ]
    with RecordingFile(tmp_path / "a.mcap", ABOUT_IT, now_us) as file:
        for message in hostile:
            file.add("/0/x", SAMPLE, message, 0)
        for at in range(5000):
            file.add("/0/x", SAMPLE, {"unit": f"u{at}", "label": "x", "valid_us": at}, at)
    found = summary_of(FederationRecording(file.path))
    assert len(found.streams) == 4096
    assert found.skipped == 4 + 5000 - 4096


def test_our_messages_have_the_fields_that_foxglove_knows() -> None:
    messages = pytest.importorskip("foxglove.messages", reason="foxglove-sdk is not installed")

    def names(schema: Any) -> set[str]:
        found = set(schema.get("properties", ()))
        for part in schema.get("properties", {}).values():
            found |= names(part.get("items", part))
        return found

    for name, ours in foxglove._SCHEMAS.items():
        known: bytes = getattr(messages, name.removeprefix("foxglove.")).get_schema().data
        lacking = [field for field in names(ours) - {"sec", "nsec"} if field.encode() not in known]
        assert lacking == [], name


def test_what_is_not_read_of_a_damaged_file_is_stated_with_its_place(tmp_path: Path) -> None:
    whole = filled(tmp_path / "whole.mcap").read_bytes()
    end = whole.index(b"\x0f\x04\0\0\0\0\0\0\0")  # the data's end
    path = tmp_path / "a.mcap"
    for more, why in (
        (b"\x05" + b"\xff" * 7 + b"\0" + bytes(20), "begins where 20 follow"),
        (b"\x06\0", "is cut off"),
        (b"", ""),
    ):
        path.write_bytes(whole[:end] + more)
        recording = FederationRecording(path)
        found = summary_of(recording)
        assert found.kinds.total() == 100
        assert not found.is_whole
        assert why in found.unread
        assert found.unread.startswith(f"{path}, byte {end}: ") if more else not found.unread
        assert found.unread.endswith(f"{len(more)} bytes from there to the end are not read") if more else True
        assert summary_of(FederationRecording(tmp_path / "whole.mcap")).unread == ""
