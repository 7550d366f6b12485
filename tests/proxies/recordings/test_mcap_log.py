from pathlib import Path

import pytest

from dyknow.agents.effects import LeaveRequested, Reported
from dyknow.model.errors import DecodeError
from dyknow.navigation.vehicle import BatteryReport, CommandResult, HomeReport, PositionReport, Report
from dyknow.proxies.recordings.formats import open_recording
from dyknow.proxies.recordings.journal_file import CLOCK_EPOCH, CLOCK_SPEED
from dyknow.proxies.recordings.replay import schedule
from dyknow.runtime.journal.journal import Journal

START_US = 1_700_000_000_000_000
S = 1_000_000


def fix(k: int, step_us: int = 200_000) -> PositionReport:
    return PositionReport(START_US + k * step_us, "GPS", 47.0 + k * 1e-5, 8.0, 510.0, 0.5, None)


def journal(path: Path, reports: list[tuple[Report, int]], **about: str) -> Path:
    """Reports, each with the node time at which it was taken."""
    with Journal(path, {CLOCK_EPOCH: "0", CLOCK_SPEED: "1.0"} | about) as written:
        for report, at_us in reports:
            written.on_event(Reported(at_us - 5, report), at_us)
            written.on_time(at_us + 10)
        written.on_event(LeaveRequested(START_US), START_US)
    return path


def test_what_a_node_was_told_by_its_vehicle_is_a_flight_again(tmp_path) -> None:
    home = HomeReport(START_US - S, 47.0, 8.0, 500.0)
    told: list[tuple[Report, int]] = [
        (home, START_US - S),
        *((fix(k), START_US + k * 200_000 + 3_000) for k in range(50)),
    ]
    recording = open_recording(journal(tmp_path / "flown.mcap", told))
    assert recording.first_position_us == START_US
    assert list(recording.reports()) == [(at_us, report) for report, at_us in told]
    assert list(recording.reports()) == list(recording.reports())
    assert recording.problems == []
    epoch_us = START_US + 1_000 * S
    played = list(schedule(recording, epoch_us, 2 * S))
    assert played[0] == (epoch_us + 3_000, home._replace(valid_us=epoch_us + 3_000)), "what still holds comes first"
    assert played[1] == (epoch_us + 3_000, fix(10)._replace(valid_us=epoch_us))


def test_a_flight_of_a_faster_federation_is_told_in_its_time(tmp_path) -> None:
    at_us = [START_US + k * 20_000 + 300 for k in range(10)]
    path = journal(
        tmp_path / "fast.mcap",
        [(fix(k), at) for k, at in enumerate(at_us)],
        **{CLOCK_EPOCH: str(START_US), CLOCK_SPEED: "10.0"},
    )
    assert [at - r.valid_us for at, r in open_recording(path).reports()] == [3_000] * 10


def test_answers_to_commands_are_not_given_again(tmp_path) -> None:
    told: list[tuple[Report, int]] = [
        (fix(0), START_US),
        (CommandResult(START_US, 7, accepted=True, reason=""), START_US),
        (BatteryReport(START_US, 0.5), START_US),
    ]
    kinds = [type(report) for _, report in open_recording(journal(tmp_path / "flown.mcap", told)).reports()]
    assert kinds == [PositionReport, BatteryReport]


def test_what_the_journal_lost_is_said(tmp_path) -> None:
    path = tmp_path / "gaps.mcap"
    with Journal(path, {CLOCK_EPOCH: "0", CLOCK_SPEED: "1.0"}) as written:
        written.on_event(Reported(START_US, fix(0)), START_US)
        written._lost += 5
        written.on_event(Reported(START_US, fix(1)), START_US)
    recording = open_recording(path)
    assert len(list(recording.reports())) == 2
    assert "5 entries were lost" in recording.problems[0]


def test_every_beginning_of_a_journal_gives_the_beginning_of_its_flight(tmp_path) -> None:
    whole = journal(tmp_path / "flown.mcap", [(fix(k), START_US + k) for k in range(8_000)])
    data, cut = whole.read_bytes(), tmp_path / "cut.mcap"
    told = [report for _, report in open_recording(whole).reports()]
    assert len(told) == 8_000
    for length in range(len(data) // 2, len(data), len(data) // 12):
        cut.write_bytes(data[:length])
        found = [report for _, report in open_recording(cut).reports()]
        assert found == told[: len(found)]
        assert found


@pytest.mark.parametrize(
    ("about", "cause"),
    [
        ({}, "clock"),
        ({CLOCK_EPOCH: "now", CLOCK_SPEED: "1.0"}, "clock"),
        ({CLOCK_EPOCH: "0", CLOCK_SPEED: "-1"}, "clock"),
    ],
)
def test_a_journal_that_does_not_tell_its_clock_is_refused(tmp_path, about, cause) -> None:
    with Journal(tmp_path / "old.mcap", about) as written:
        written.on_event(Reported(START_US, fix(0)), START_US)
    with pytest.raises(DecodeError, match=cause):
        open_recording(tmp_path / "old.mcap")


@pytest.mark.parametrize("data", [b"", b"hello, I am no journal" * 50, b"\x89MCAP0\r\n" + b"\x00" * 100])
def test_what_is_no_journal_is_refused_when_it_is_opened(tmp_path, data) -> None:
    (tmp_path / "text.mcap").write_bytes(data)
    with pytest.raises(DecodeError):
        open_recording(tmp_path / "text.mcap")


def test_a_journal_without_a_vehicle_holds_no_position(tmp_path) -> None:
    with pytest.raises(DecodeError, match="holds no position"):
        open_recording(journal(tmp_path / "none.mcap", []))
