"""Nothing that happens to what a platform writes ends it, and each loss is counted and reported."""

import errno
import json
import os
from pathlib import Path
from typing import Any

import pytest

from dyknow.runtime import records
from dyknow.runtime.records import AGAIN_US, LEVELS, NOTES, NoteLimit, Records, is_at_least, level_of


def written(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in path.read_text().splitlines() if line]


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EPIPE, errno.EIO, errno.EFBIG, errno.EBADF])
def test_what_cannot_be_written_is_reported_once_and_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    failures: list[str] = []
    say = Records(tmp_path / "0.out", failures.append)
    write = os.write
    say({"event": "joined"})

    def broken(_descriptor: int, _line: object) -> int:
        raise OSError(number, os.strerror(number))

    for _ in range(2):
        monkeypatch.setattr(records.os, "write", broken)
        for at in range(5):
            say({"event": "note", "at": at})
        assert say.lost == 5
        monkeypatch.setattr(records.os, "write", write)
        say({"event": "ended"})
    assert failures == [f"records of this platform cannot be written: {os.strerror(number)}"] * 2
    lost = {"event": "note", "level": "error", "text": "5 records before this one could not be written"}
    joined, ended = ({"event": event, "level": "info"} for event in ("joined", "ended"))
    assert written(tmp_path / "0.out") == [joined, lost, ended, lost, ended]


def test_a_line_that_was_torn_by_a_full_disk_spoils_no_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    say, write, calls = Records(tmp_path / "0.out", lambda _why: None), os.write, iter(range(9))

    def half(descriptor: int, line: memoryview) -> int:
        if next(calls):
            raise OSError(errno.ENOSPC, "full")
        return write(descriptor, line[:7])

    monkeypatch.setattr(records.os, "write", half)
    say({"event": "torn"})
    monkeypatch.setattr(records.os, "write", write)
    say({"event": "whole"})
    torn, lost, whole = (tmp_path / "0.out").read_text().splitlines()
    assert (torn, json.loads(whole)) == ('{"event', {"event": "whole", "level": "info"})
    assert json.loads(lost)["text"].startswith("1 records")


def test_the_device_that_is_always_full(monkeypatch: pytest.MonkeyPatch) -> None:
    failures: list[str] = []
    monkeypatch.setattr(records, "_opened", lambda path: os.open(path, os.O_WRONLY))
    say = Records(Path("/dev/full"), failures.append)
    for _ in range(100):
        say({"event": "note"})
    assert (say.lost, len(failures)) == (100, 1)


def test_the_file_is_bounded_and_its_last_parts_are_whole(tmp_path: Path) -> None:
    path = tmp_path / "0.out"
    say = Records(path, pytest.fail, part_bytes=10_000)
    for at in range(5_000):
        say({"event": "note", "at": at})
    assert sorted(each.name for each in tmp_path.iterdir()) == ["0.out", "0.out.1"]
    assert all(each.stat().st_size <= 10_000 for each in tmp_path.iterdir())
    kept = [each["at"] for part in (tmp_path / "0.out.1", path) for each in written(part)]
    assert kept == list(range(5_000 - len(kept), 5_000))
    assert len(kept) > 300


def test_the_same_note_is_written_again_only_after_a_while_with_its_count() -> None:
    limit = NoteLimit()
    lines = [line for at in range(4_000) for line in limit.lines("another platform is called 0", at * 2_000)]
    assert lines == ["another platform is called 0"]
    assert limit.lines("another platform is called 0", AGAIN_US) == [
        "another platform is called 0 (3999 times more since the last)"
    ]


def test_notes_of_many_texts_are_limited_and_what_is_left_out_is_counted() -> None:
    limit = NoteLimit()
    lines = [line for at in range(4_000) for line in limit.lines(f"note {at}", 1_000_000)]
    assert lines == [f"note {at}" for at in range(len(lines))]
    assert len(lines) == NOTES
    assert limit.lines("later", 9_000_000) == [
        f"{4_000 - NOTES} other notes were left out: there were too many at once",
        "later",
    ]
    assert len(limit._said_us) <= NOTES


@pytest.mark.parametrize(
    ("record", "level"),
    [
        ({"event": "directory"}, "debug"),
        ({"event": "joined"}, "info"),
        ({"event": "note", "text": "the port is taken", "level": "warning"}, "warning"),
        ({"event": "alarm-opened"}, "warning"),
        ({"event": "alarm-closed"}, "info"),
        ({"event": "halted"}, "error"),
        ({"event": "note", "level": "\x1b[2J"}, "info"),
        ({"event": ["x"]}, "info"),
    ],
)
def test_each_record_has_a_level_and_is_shown_from_that_level_on(record: dict[str, Any], level: str) -> None:
    assert level_of(record) == level
    assert [each for each in LEVELS if is_at_least(record, each)] == [*LEVELS[: LEVELS.index(level) + 1]]
