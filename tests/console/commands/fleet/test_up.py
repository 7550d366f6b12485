"""What `up` and `join` say of the platforms that they have started."""

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest

from dyknow.console.command import Call
from dyknow.console.commands.fleet.up import FleetStart, down, tell_notes
from dyknow.console.errors import DONE, NO
from dyknow.console.output.output import Output
from dyknow.runtime.configuration.run_directory import STATE_FILE, ProcessState, Running, write_state
from dyknow.runtime.configuration.settings import Settings

OPEN = "open federation: acts are not signed"


@pytest.fixture
def gathering() -> FleetStart:
    """Of two platforms that say the same."""
    found = FleetStart(["0", "1"])
    for unit in ("0", "1"):
        found.on_heard(unit, {"event": "note", "unit": unit, "text": OPEN, "at_us": 1})
        found.on_heard(unit, {"event": "joined", "unit": unit, "labels": [], "at_us": 2})
        found.on_heard(unit, {"event": "directory", "units": ["0", "1"], "at_us": 3})
    return found


def test_a_note_is_told_once_with_those_whose_it_is(gathering: FleetStart, capsys: pytest.CaptureFixture[str]) -> None:
    assert gathering.all_found()
    gathering.on_heard("1", {"event": "note", "unit": "1", "text": "position ok", "at_us": 4})
    tell_notes(Call(Settings(federation="test"), Output(json_lines=False)), gathering)
    caught = capsys.readouterr()
    assert (caught.out, caught.err) == ("", f"platforms 0, 1: {OPEN}\nplatform 1: position ok\n")


def test_who_rejects_its_specification_is_known_unless_it_waits_for_a_host(gathering: FleetStart) -> None:
    said = {
        "event": "not-specified",
        "file": "a.kpl",
        "said": "a.kpl:1:1: nothing makes x",
        "runs": False,
        "awaits": [],
    }
    gathering.on_heard("0", said)
    gathering.on_heard("1", said | {"awaits": ["x"]})
    assert gathering.rejected == {"0": "a.kpl:1:1: nothing makes x"}


def test_the_notes_of_one_that_starts_alone_need_no_name(capsys: pytest.CaptureFixture[str]) -> None:
    alone = FleetStart(["7"])
    alone.on_heard("7", {"event": "note", "unit": "7", "text": OPEN, "at_us": 1})
    tell_notes(Call(Settings(federation="test"), Output(json_lines=False)), alone)
    assert capsys.readouterr().err == f"{OPEN}\n"


def test_json_lines_hold_no_notes(gathering: FleetStart, capsys: pytest.CaptureFixture[str]) -> None:
    tell_notes(Call(Settings(federation="test", json_lines=True), Output(json_lines=True)), gathering)
    caught = capsys.readouterr()
    assert (caught.out, caught.err) == ("", "")


@pytest.fixture
def child() -> Iterator["subprocess.Popen[bytes]"]:
    found = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
    yield found
    found.kill()
    found.wait(timeout=20)


def _down(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *running: Running) -> int:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    directory = tmp_path / "dyknow" / "test"
    directory.mkdir(parents=True)
    write_state(directory, ProcessState(running))
    code = down(Call(Settings(federation="test"), Output(json_lines=False)))
    assert not (directory / STATE_FILE).exists()
    return code


def test_down_names_who_had_died_before(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    child: "subprocess.Popen[bytes]",
    capsys: pytest.CaptureFixture[str],
) -> None:
    died = Running("0", child.pid, 1.0)
    runs = Running("1", child.pid, psutil.Process(child.pid).create_time())
    assert _down(tmp_path, monkeypatch, died, runs) == DONE
    assert capsys.readouterr().out == "stopped: platforms 1; platform 0 had ended before\n"
    assert child.wait(timeout=20) < 0


def test_down_says_what_it_looked_for_when_nothing_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert _down(tmp_path, monkeypatch) == NO
    assert capsys.readouterr().out == "no platform of federation test runs on this machine\n"
