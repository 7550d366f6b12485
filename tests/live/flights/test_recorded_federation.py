"""A recording is played as a federation, and recorded again until that is killed: its alarms keep their edges."""

import os
import time
from pathlib import Path
from typing import Any

import pytest

from dyknow.runtime.recordings.recorded import FederationRecording
from dyknow.runtime.recordings.summary import RecordingSummary, summary_of
from tests.console.commands.recordings.encounter import EXAMPLE
from tests.live.command_line.command import Dyknow, lines

pytestmark = pytest.mark.live
PATIENCE_S = 60.0
SPEED = 2  # slow enough for a recorder on a busy machine to be there before the first alarm closes


def edges(found: RecordingSummary, moved_us: int = 0) -> set[tuple[Any, ...]]:
    return {
        (event, each.monitor, each.by, each.units, valid_us - moved_us)
        for each in found.alarms.values()
        for event, valid_us in each.edges
    }


def until(path: Path, wanted: int, within_s: float = PATIENCE_S) -> RecordingSummary:
    """The recording that is being written, once it has that many edges of alarms and samples of both."""
    end_s = time.monotonic() + within_s
    while True:
        found = summary_of(FederationRecording(path))
        if len(edges(found)) >= wanted and len(found.streams) >= 6:
            return found
        assert time.monotonic() < end_s, (len(edges(found)), len(found.streams))
        time.sleep(0.2)


def test_what_is_played_raises_the_same_alarms_and_a_recorder_that_is_killed_has_them(
    dyknow: Dyknow, tmp_path: Path
) -> None:
    original = summary_of(FederationRecording(EXAMPLE))
    recorder = dyknow.start("record", str(tmp_path / "again.mcap"), "--json")
    assert recorder.stderr is not None
    assert "the recording begins with the first" in recorder.stderr.readline()
    played = dyknow.start("replay", str(EXAMPLE), "--speed", str(SPEED), "--stay", "--json")
    begun = next(lines(played))
    assert (begun["event"], begun["units"]) == ("playing", [0, 1])
    assert next(lines(recorder))["event"] == "recording"
    until(tmp_path / "again.mcap", len(edges(original)))
    recorder.kill()
    recorder.wait()
    again = summary_of(FederationRecording(tmp_path / "again.mcap"))
    assert edges(again, begun["shift_us"]) == edges(original)
    assert not again.is_whole
    assert again.skipped == 0
    (told,) = dyknow.run("info", str(tmp_path / "again.mcap"), "--mended", str(tmp_path / "whole.mcap"))
    assert told["whole"] is False
    assert dyknow.run("info", str(tmp_path / "whole.mcap"))[0]["whole"] is True
    (latest, *_) = dyknow.run("query", "heli-altitude", "--unit", "1")
    assert 55 < latest["value"]["altitude_m"] < 65
    assert "there is a platform 0 in federation" in dyknow.raw("replay", str(EXAMPLE), code=2)[1]
    dyknow.run("down")
    assert played.wait(PATIENCE_S) in {0, 130}


@pytest.mark.full
@pytest.mark.parametrize("speed", [1, 10])
def test_ten_minutes_of_crossing_with_a_fault_a_minute_come_back_with_equal_edges(
    dyknow: Dyknow, tmp_path: Path, speed: int
) -> None:
    minutes = int(os.environ.get("DYKNOW_MINUTES", "10"))
    dyknow.run("up", "3", "--scenario", "crossing", "--detach")
    dyknow.run("delegate", "monitor-proximity", "--to", "0")
    path = tmp_path / "crossing.mcap"
    recorder = dyknow.start("record", str(path), "--duration", f"{minutes}min", "--json")
    for minute, fault in zip(range(minutes), ["silence", "packet-loss=30", "gps-loss"] * minutes, strict=False):
        begun_s = time.monotonic()
        dyknow.run("fault", str(minute % 3), fault, "--for", "5s")
        time.sleep(max(0.0, 60 - (time.monotonic() - begun_s)))
    assert [*lines(recorder)][-1]["event"] == "recorded"
    dyknow.run("down")
    original = summary_of(FederationRecording(path))
    assert edges(original)
    again = dyknow.start("record", str(tmp_path / "again.mcap"), "--json")
    played = dyknow.start("replay", str(path), "--speed", str(speed), "--stay", "--json")
    begun = next(lines(played))
    until(tmp_path / "again.mcap", len(edges(original)), 60 * minutes / speed + PATIENCE_S)
    again.terminate()
    assert [*lines(again)][-1]["event"] == "recorded"
    assert edges(summary_of(FederationRecording(tmp_path / "again.mcap")), begun["shift_us"]) == edges(original)
