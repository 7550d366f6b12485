"""A recording has what the platforms had: positions, alarms with their edges, gaps, and no more than its share of one."""

import json
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader

from dyknow.agents.monitoring.alarm_log import AlarmLog
from dyknow.console.command import Call
from dyknow.console.commands.recordings.info import info
from dyknow.console.commands.recordings.record import record
from dyknow.console.errors import DONE, FAILED
from dyknow.console.output.output import Output
from dyknow.federation.messages.contents import Acts, Alarm, MonitorChange
from dyknow.model.errors import WrongCall
from dyknow.runtime.configuration.settings import Settings
from dyknow.runtime.recorder import recorder
from dyknow.runtime.recordings.recorded import FederationRecording
from dyknow.runtime.recordings.recording_file import ABOUT, PROFILE, RecordingFile
from dyknow.runtime.recordings.summary import summary_of
from tests.box import EPOCH, METRE_DEG, Box
from tests.console.commands.recordings.encounter import encounter, in_world
from tests.console.conftest import Lines


@pytest.fixture
def meeting(monkeypatch: pytest.MonkeyPatch) -> Box:
    world = encounter()
    in_world(monkeypatch, world)
    return world


def messages(path: Path, topic: str) -> list[dict[str, Any]]:
    with path.open("rb") as stream:
        return [json.loads(message.data) for _, _, message in make_reader(stream).iter_messages(topics=[topic])]


def test_every_edge_of_every_alarm_is_recorded_as_its_platform_raised_it(
    meeting: Box, call: Call, tmp_path: Path
) -> None:
    assert record(call, tmp_path / "a.mcap", label=["heli-position"], duration="12s") == DONE
    recorded = {(each["id"], each["event"], each["valid_us"]) for each in messages(tmp_path / "a.mcap", "/alarms")}
    raised = {
        (each.id, each.event, each.valid_us)
        for platform in meeting.platforms.values()
        for each in platform.part(AlarmLog).events
    }
    assert recorded == raised
    assert {event for _, event, _ in raised} == {"opened", "closed"}
    levels = {each["message"].split()[-1]: each["level"] for each in messages(tmp_path / "a.mcap", "/log")}
    assert (levels["opened"], levels["closed"]) == (4, 2)


def test_positions_are_where_the_truth_is_with_the_altitude_of_their_time(
    meeting: Box, call: Call, tmp_path: Path
) -> None:
    meeting.vehicle("0").altitude_m = 60.0
    record(call, tmp_path / "a.mcap", label=["heli-position", "heli-altitude"], duration="5s")
    fixes = messages(tmp_path / "a.mcap", "/0/fix")
    assert len(fixes) >= 45
    for fix in fixes[5:]:
        at_us = fix["timestamp"]["sec"] * 1_000_000 + fix["timestamp"]["nsec"] // 1000
        assert fix["latitude"] == pytest.approx(58.0 + 4.0 * (at_us - EPOCH) / 1e6 * METRE_DEG, abs=0.5 * METRE_DEG)
        assert fix["altitude"] == pytest.approx(60.0, abs=0.5)
    (first, *_) = messages(tmp_path / "a.mcap", "/0/pose")
    assert first["pose"]["position"]["x"] == pytest.approx(0.0, abs=1.0)
    entities = [each["entities"][0] for each in messages(tmp_path / "a.mcap", "/scene") if each["entities"]]
    assert {entity["id"] for entity in entities} >= {"platform 0", "platform 1"}


def test_a_platform_that_is_killed_and_returns_is_recorded_on_and_its_gap_is_told(
    meeting: Box, call: Call, lines: Lines, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    meeting.at(meeting.now_us + 1_000_000, lambda: meeting.kill("1"))
    meeting.at(meeting.now_us + 4_500_000, lambda: meeting.restart("1"))
    record(call, tmp_path / "a.mcap", duration="9s")
    lines()
    assert info(call, tmp_path / "a.mcap") == DONE
    (told,) = lines()
    gaps = {(each["unit"], each["label"]): each["gaps"] for each in told["streams"]}
    ((from_us, to_us),) = gaps[1, "heli-position"]
    assert 3_000_000 < to_us - from_us < 8_000_000
    assert gaps[0, "heli-position"] == []
    assert told["whole"]
    info(Call(Settings(), Output(json_lines=False)), tmp_path / "a.mcap")
    shown = capsys.readouterr().out
    assert "platform 1 is gone" in shown
    assert "platform 1 is back" in shown


def test_what_a_platform_says_of_others_is_not_recorded(meeting: Box, call: Call, tmp_path: Path) -> None:
    record(call, tmp_path / "a.mcap", label=["battery"], duration="1s")
    with RecordingFile(tmp_path / "b.mcap", {}, lambda: meeting.now_us) as file:
        taken = recorder.Recorder(_client(meeting), file)
        lie = Alarm(id="a", event="opened", monitor="m", by="1", units=("1",), valid_us=1, detected_us=1)
        for content in (lie, MonitorChange(event="unknown", monitor="m", by="1", units=("1",), at_us=1), Acts()):
            taken._take("0", content)
        assert taken.counts == {}
        taken._take("1", lie)
        assert taken.counts["dyknow.Alarm"] == 1


def test_of_alarms_of_before_those_are_recorded_whole_that_were_open_during_the_recording(
    meeting: Box, tmp_path: Path
) -> None:
    def edge(name: str, event: Any, at_us: int = 1) -> Alarm:
        return Alarm(id=name, event=event, monitor="m", by="0", units=("0",), valid_us=at_us, detected_us=at_us)

    with RecordingFile(tmp_path / "a.mcap", {}, lambda: meeting.now_us) as file:
        taken = recorder.Recorder(_client(meeting), file, note=lambda _text: None)
        taken._note_once("a note of the recorder is no platform")
        many = [edge(f"old{at}", event) for event in ("opened", "closed") for at in range(30)]
        taken._on_remembered("0", [*many, edge("open", "opened")])
        assert taken.counts["dyknow.Alarm"] == 1
        taken._on_remembered("0", [edge("begun before", "opened"), edge("begun before", "closed", meeting.now_us)])
        assert taken.counts["dyknow.Alarm"] == 3
        assert taken.units == []
    assert summary_of(FederationRecording(file.path)).platforms == {}


def test_one_platform_fills_its_own_share_only_and_what_is_over_is_counted(
    meeting: Box, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recorder, "BYTES_AT_ONCE", 100_000)
    client = _client(meeting)
    with RecordingFile(tmp_path / "a.mcap", {}, client.now_us) as file:
        taken = recorder.Recorder(client, file)
        taken._shares["0"] = recorder._Share(100_000, client.now_us())
        for at in range(1000):
            change = MonitorChange(event="unknown", monitor="m", by="0", units=("0",), at_us=at, which=("x" * 400,))
            taken._take("0", change)
            if not at % 100:
                taken._take("1", MonitorChange(event="unknown", monitor="m", by="1", units=("1",), at_us=at))
        client.wait_for(lambda: False, 1.0)
        taken._take("0", change)
    found = summary_of(FederationRecording(file.path))
    assert file.path.stat().st_size < 300_000
    assert found.unknown["m", "1", ("1",)] == 10
    assert found.unknown["m", "0", ("0",)] + found.lost["0"] // 2 == pytest.approx(1001, abs=2)


def test_a_recording_that_cannot_be_written_fails_and_says_so_once(
    meeting: Box, call: Call, lines: Lines, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    def full(self: RecordingFile) -> None:
        self._safely(lambda: (_ for _ in ()).throw(OSError(28, "No space left on device")))

    monkeypatch.setattr(RecordingFile, "on_time", full)
    assert record(call, tmp_path / "a.mcap", duration="5s") == FAILED
    assert capsys.readouterr().err.count("No space left on device") == 1


def test_words_of_others_are_shown_as_text(call: Call, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    evil = "\x1b]0;owned\x07[bold]\u202e"
    with RecordingFile(tmp_path / "a.mcap", {"federation": evil, "profile": PROFILE, ABOUT: evil}, lambda: 0) as file:
        file.add("/x", "dyknow.Sample", {"unit": evil, "label": evil, "valid_us": 1}, 1)
        file.add("/x", "dyknow.Platform", {"unit": evil, "state": evil}, 1)
        file.add("/x", "dyknow.Task", {"conversation": "c", "task": evil, "unit": evil, "state": evil}, 1)
        alarm = {"monitor": evil, "by": evil, "event": evil, "units": [evil], "valid_us": 1}
        file.add("/x", "dyknow.Alarm", alarm, 1)
    info(Call(Settings(), Output(json_lines=False)), file.path)
    shown, notes = capsys.readouterr()
    assert "\x1b" not in shown + notes
    assert "\u202e" not in shown + notes
    assert "[bold]" in shown
    info(call, file.path)
    assert json.loads(capsys.readouterr().out)["federation"] == evil


def test_a_name_or_a_size_that_is_none_is_a_wrong_call(call: Call, tmp_path: Path) -> None:
    with pytest.raises(WrongCall, match=r"write .*flight\.mcap"):
        record(call, tmp_path / "flight.bag")
    with pytest.raises(WrongCall, match="--most"):
        record(call, tmp_path / "flight.mcap", most="12")


def _client(world: Box) -> Any:
    from dyknow.runtime.client import Client, command_centre

    client = Client(world.client_ports(), command_centre(Settings(), "cc-9"))
    client.settle()
    return client
