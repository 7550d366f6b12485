import queue
import random
import threading
import time
from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from dyknow.model.errors import DecodeError, TextError
from dyknow.navigation.vehicle import (
    AccelerationReport,
    AttitudeReport,
    PositionReport,
    Report,
    StatusReport,
    VelocityReport,
)
from dyknow.proxies.recordings.formats import open_recording
from dyknow.proxies.recordings.recording import Recording
from dyknow.proxies.recordings.replay import Replay, schedule
from tests.proxies import logs
from tests.strategies import examples

FORMATS = {
    "new.bin": logs.dataflash(),
    "old.bin": logs.dataflash(micros=False),
    "flight.tlog": logs.tlog(),
    "new.ulg": logs.ulog(),
    "old.ulg": logs.ulog(degrees=False),
}
EPOCH_US = 1_700_000_000_000_000


@pytest.fixture(params=sorted(FORMATS))
def name(request) -> str:
    return request.param


@pytest.fixture
def recording(name, tmp_path) -> Recording:
    return written(tmp_path, name, FORMATS[name])


def written(tmp_path: Path, name: str, data: bytes) -> Recording:
    path = tmp_path / name
    path.write_bytes(data)
    return open_recording(path)


def fixes(recording: Recording) -> list[PositionReport]:
    return [report for _, report in recording.reports() if isinstance(report, PositionReport)]


def test_every_format_gives_the_same_flight(name, recording) -> None:
    found = fixes(recording)
    missing = 5 if name.endswith(".bin") else 0
    assert len(found) == 50 - missing
    assert [f.latitude_deg for f in found] == pytest.approx([logs.latitude(k) for k in range(missing, 50)], abs=1e-9)
    assert all(f.altitude_m == pytest.approx(510.0) and f.longitude_deg == pytest.approx(8.0) for f in found)
    assert [b.valid_us - a.valid_us for a, b in pairwise(found)] == [logs.STEP_US] * (len(found) - 1)
    assert recording.first_position_us == found[0].valid_us
    assert recording.problems == []
    speeds = {r.north_m_s for _, r in recording.reports() if isinstance(r, VelocityReport)}
    assert speeds == {5.0} if not name.endswith(".tlog") else {1.2}


def test_dataflash_time_is_utc_with_its_leap_seconds(tmp_path) -> None:
    for name in ("new.bin", "old.bin"):
        first_us = written(tmp_path, name, FORMATS[name]).first_position_us
        assert time.strftime("%Y-%m-%d %H:%M:%S", time.gmtime(first_us // 1_000_000)) == "2015-11-18 11:59:44"
        attitude = next(r for _, r in open_recording(tmp_path / name).reports() if isinstance(r, AttitudeReport))
        assert attitude[2:] == pytest.approx((0.0174533, -0.0349066, 1.5707963), abs=1e-6)
        force = next(r for _, r in open_recording(tmp_path / name).reports() if isinstance(r, AccelerationReport))
        assert force[2:] == pytest.approx((0.5, 0.0, -9.8), abs=1e-6)


def test_px4_time_is_utc_and_a_second_receiver_is_not_mixed_in(tmp_path) -> None:
    recording = written(tmp_path, "new.ulg", FORMATS["new.ulg"])
    assert recording.first_position_us == logs.START_US
    attitude = next(r for _, r in recording.reports() if isinstance(r, AttitudeReport))
    assert attitude[2:] == pytest.approx((0.0, 0.0, 1.5707963), abs=1e-6)


def test_the_first_position_and_from_are_played_at_the_epoch(recording) -> None:
    played = [(at, r) for at, r in schedule(recording, EPOCH_US, 2_000_000) if isinstance(r, PositionReport)]
    original = fixes(recording)
    assert played[0][0] == EPOCH_US
    assert played[0][1].valid_us == EPOCH_US
    assert played[0][1].latitude_deg == original[10].latitude_deg
    assert len(played) == len(original) - 10


def test_what_still_holds_comes_first_and_what_is_past_does_not(tmp_path) -> None:
    recording = written(tmp_path, "flight.tlog", FORMATS["flight.tlog"])
    played = list(schedule(recording, EPOCH_US, 3_500_000))
    assert isinstance(played[0][1], StatusReport), "the heartbeat of second three"
    assert played[0][1].valid_us == played[0][0] >= EPOCH_US
    joined = list(schedule(recording, EPOCH_US, 0, since_us=EPOCH_US + 4_000_000))
    assert all(at >= EPOCH_US + 4_000_000 for at, _ in joined)


def test_every_beginning_of_a_file_gives_the_beginning_of_its_flight(name, tmp_path) -> None:
    data, whole = FORMATS[name], fixes(written(tmp_path, name, FORMATS[name]))
    path = tmp_path / f"cut-{name}"
    for length in range(len(data) // 2, len(data), 37):
        path.write_bytes(data[:length])
        recording = open_recording(path)
        found = fixes(recording)
        assert found == whole[: len(found)]
        assert len(whole) - len(found) <= (len(data) - length) // 40 + 1, "nothing before the cut is lost"


@pytest.mark.parametrize("junk", [b"\x00" * 100, b"\xff" * 700, bytes(range(256)) * 3])
def test_damage_in_the_middle_is_passed_over_and_named(name, junk, tmp_path) -> None:
    data, whole = FORMATS[name], fixes(written(tmp_path, name, FORMATS[name]))
    middle = len(data) // 2
    recording = written(tmp_path, f"hurt-{name}", data[:middle] + junk + data[middle:])
    found = fixes(recording)
    assert [f for f in whole if f in found] == found, "nothing invented"
    assert found[:20] == whole[:20]
    assert len(found) > len(whole) - 8
    assert any(f"hurt-{name}, byte" in problem for problem in recording.problems)


def test_a_file_that_ends_in_rubbish_says_where_after_all_that_was_good(tmp_path) -> None:
    for name in ("flight.tlog", "new.bin", "new.ulg"):
        recording = written(tmp_path, f"end-{name}", FORMATS[name] + b"\x01\x00\x00" * 400)
        found = []
        with pytest.raises(
            DecodeError, match=r"byte \d+: no (records|messages) from here to the end; the flight up to"
        ):
            found.extend(report for _, report in recording.reports() if found.append(report) is None)
        assert sum(isinstance(each, PositionReport) for each in found) >= 45


@given(st.sampled_from(sorted(FORMATS)), st.integers(0, 2**32))
@example("new.bin", 612712)
@settings(max_examples=examples(120), deadline=None)
def test_mutants_are_read_or_refused_with_a_place(tmp_path_factory, name, seed) -> None:
    rng, data = random.Random(seed), bytearray(FORMATS[name])
    for _ in range(rng.randint(1, 30)):
        data[rng.randrange(len(data))] = rng.randrange(256)
    path = tmp_path_factory.getbasetemp() / f"mutant-{name}"
    path.write_bytes(bytes(data))
    try:
        for _ in open_recording(path).reports():
            pass
    except DecodeError as refused:
        assert "byte" in str(refused)


@pytest.mark.parametrize(
    ("name", "data", "cause"),
    [
        ("empty.tlog", b"", "the file is empty"),
        ("text.bin", b"hello, I am no log" * 50, "begins with the bytes A3 95"),
        ("text.ulg", b"hello, I am no log" * 50, "begins with the bytes ULog"),
        ("text.tlog", b"hello, I am no log" * 50, "no records"),
        ("ground.tlog", logs.tlog()[:40], "holds no position"),
    ],
)
def test_what_is_no_recording_is_refused_when_it_is_opened(name, data, cause, tmp_path) -> None:
    with pytest.raises(DecodeError, match=cause):
        written(tmp_path, name, data)


def test_an_unknown_ending_and_a_missing_file_are_the_callers_mistake(tmp_path) -> None:
    with pytest.raises(TextError, match=r"\.tlog, \.bin, \.ulg or \.mcap"):
        open_recording(tmp_path / "flight.csv")
    with pytest.raises(TextError, match="no such recording"):
        open_recording(tmp_path / "flight.tlog")


class Stepped:
    """A clock that stands until the test moves it, and a replay's view of it."""

    def __init__(self, now_us: int) -> None:
        self._now_us = now_us

    def now_us(self) -> int:
        return self._now_us

    def at(self, now_us: int) -> None:
        self._now_us = now_us


def played(recording: Recording, clock: Stepped, **options) -> tuple[Replay, "queue.Queue[Report]", threading.Event]:
    box: queue.Queue[Report] = queue.Queue()
    ended = threading.Event()
    replay = Replay(recording, EPOCH_US, 0, box.put, clock.now_us, on_end=lambda _problem: ended.set(), **options)
    replay.start()
    return replay, box, ended


def test_a_replay_posts_everything_and_says_that_it_ended(recording) -> None:
    replay, box, ended = played(recording, Stepped(EPOCH_US), speed=1000.0)
    assert ended.wait(10)
    assert replay.problem == ""
    posted = [box.get_nowait() for _ in range(box.qsize())]
    assert [r for r in posted if isinstance(r, PositionReport)] == [
        r for _, r in schedule(recording, EPOCH_US) if isinstance(r, PositionReport)
    ]


def test_a_replay_that_joins_late_begins_where_the_others_are(recording) -> None:
    _, box, ended = played(recording, Stepped(EPOCH_US + 5_000_000), speed=1000.0)
    assert ended.wait(10)
    assert box.get_nowait().valid_us >= EPOCH_US + 4_000_000, "at most a second behind"


def test_a_replay_can_be_stopped_while_it_waits(recording) -> None:
    replay, box, ended = played(recording, Stepped(EPOCH_US - 3_600_000_000))
    replay.stop()
    assert ended.wait(5)
    assert box.qsize() == 0


def test_a_damaged_recording_is_played_up_to_the_damage_and_the_reason_is_kept(tmp_path) -> None:
    recording = written(tmp_path, "hurt.tlog", FORMATS["flight.tlog"] + b"\x01\x00\x00" * 400)
    replay, box, ended = played(recording, Stepped(EPOCH_US), speed=1000.0)
    assert ended.wait(10)
    assert "no records from here to the end" in replay.problem
    assert sum(isinstance(box.get_nowait(), PositionReport) for _ in range(box.qsize())) == 50


def test_an_impossible_speed_is_refused(recording) -> None:
    with pytest.raises(ValueError, match="speed"):
        Replay(recording, EPOCH_US, 0, print, lambda: 0, speed=0.0)
