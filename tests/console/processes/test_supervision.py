"""Real child processes, our own: what they say, how they end, and whom `down` may end."""

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest

from dyknow.console.processes.supervision import Fleet, end
from dyknow.model.errors import FederationFailed, WrongCall
from dyknow.runtime.configuration.config import NodeConfig
from dyknow.runtime.configuration.run_directory import ProcessState, Running, read_state, run_directory, write_state
from dyknow.runtime.records import Records

SPEAKS = """
import json, sys, time
open(sys.argv[-1], "w").write(json.dumps({"event": "joined", "unit": 0}) + "\\n")
sys.stdin.read()
time.sleep(60)
"""
STUBBORN = "import signal, sys, time\nsignal.signal(signal.SIGTERM, signal.SIG_IGN)\nopen(sys.argv[-1], 'w').write('{\"up\": 1}\\n')\ntime.sleep(60)\n"
FAILS = "import sys\nsys.exit('cannot bind 127.0.0.1:1')\n"


@pytest.fixture
def fleet(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Fleet]:
    for name, code in (("speaks", SPEAKS), ("stubborn", STUBBORN), ("fails", FAILS)):
        (tmp_path / f"child_{name}.py").write_text(code)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    found = Fleet(tmp_path, lifeline=True)
    yield found
    found.end()


def test_a_platform_is_heard_and_ended_by_its_id(fleet: Fleet) -> None:
    fleet.start("0", "{}", module="child_speaks")
    heard: list[object] = []
    assert fleet.follow(lambda: bool(heard), lambda _unit, said: heard.append(said), timeout_s=20)
    assert heard == [{"event": "joined", "unit": 0}]
    pid = fleet.running["0"].pid
    fleet.end()
    assert not psutil.pid_exists(pid)


def test_platforms_of_one_process_are_heard_and_end_together(fleet: Fleet) -> None:
    fleet.start_together({"0": "{}", "1": "{}"}, module="child_speaks")
    heard: list[str] = []
    assert fleet.follow(lambda: bool(heard), lambda unit, _said: heard.append(unit), timeout_s=20)
    assert heard == ["0"]
    assert fleet.running["0"].pid == fleet.running["1"].pid
    assert fleet.last_words("1") == fleet.last_words("0")
    fleet.end()
    assert fleet.ended().keys() == {"0", "1"}


def test_one_that_does_not_listen_is_killed_after_the_grace(fleet: Fleet) -> None:
    fleet.start("0", "{}", module="child_stubborn")
    heard: list[object] = []
    assert fleet.follow(lambda: bool(heard), lambda _unit, said: heard.append(said), timeout_s=20)
    end(fleet.running.values(), grace_s=0.1)
    assert fleet._children["0"].wait(timeout=5) == -9


def test_one_that_fails_to_start_is_told_with_its_last_words(fleet: Fleet) -> None:
    fleet.start("0", "{}", module="child_fails")
    with pytest.raises(
        FederationFailed, match=r"platform 0 ended with code 1(.|\n)*cannot bind 127\.0\.0\.1:1(.|\n)*0\.log"
    ):
        fleet.follow(lambda: False, lambda _unit, _said: None, timeout_s=20)


def test_one_that_was_given_what_does_not_work_is_a_wrong_call(fleet: Fleet, tmp_path: Path) -> None:
    (tmp_path / "units.py").write_text("raise OSError('no camera')\n")
    config = NodeConfig(unit="3", units=(str(tmp_path / "units.py"),))
    fleet.start("3", config.model_dump_json())
    with pytest.raises(WrongCall, match=r"units\.py:1: OSError: no camera"):
        fleet.follow(lambda: False, lambda _unit, _said: None, timeout_s=30)


def test_a_process_whose_id_is_used_again_is_not_ours(tmp_path: Path) -> None:
    mine = psutil.Process(os.getpid())
    ended, running = Running("0", mine.pid, mine.create_time() - 100.0), Running("1", mine.pid, mine.create_time())
    write_state(tmp_path, ProcessState((ended, running), ("tcp/127.0.0.1:7447",)))
    assert read_state(tmp_path) == ProcessState((running,), ("tcp/127.0.0.1:7447",))


def test_nobody_is_to_be_reached_where_nobody_runs(tmp_path: Path) -> None:
    write_state(tmp_path, ProcessState((Running("0", os.getpid(), 1.0),), ("tcp/127.0.0.1:7447",)))
    assert read_state(tmp_path) == ProcessState()


def test_a_state_file_that_is_torn_or_missing_means_nobody_runs(tmp_path: Path) -> None:
    assert read_state(tmp_path) == ProcessState()
    (tmp_path / "state.json").write_text('{"running": [{"unit"')
    assert read_state(tmp_path) == ProcessState()


def test_a_stopped_process_ends_too(tmp_path: Path) -> None:
    child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
    process = psutil.Process(child.pid)
    process.suspend()
    end([Running("0", child.pid, process.create_time())], grace_s=5)
    assert child.wait(timeout=5) in {-15, -9}


def test_a_process_that_nobody_has_asked_about_yet_keeps_nobody_waiting(tmp_path: Path) -> None:
    child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
    running = Running("0", child.pid, psutil.Process(child.pid).create_time())
    began = time.monotonic()
    end([running], grace_s=20)
    assert time.monotonic() - began < 15, "it has ended, although its entry stays until its parent asks"
    assert running.process() is None
    child.wait(timeout=5)


def test_the_run_directory_is_the_owners_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    found = run_directory("alpha")
    assert found == tmp_path / "dyknow" / "alpha"
    Fleet(found, lifeline=False)
    assert found.stat().st_mode & 0o077 == 0


def test_no_name_of_a_unit_meets_the_file_of_the_processes(fleet: Fleet, tmp_path: Path) -> None:
    running = Running("0", 1, 2.0)
    write_state(tmp_path, ProcessState((running,), ("tcp/127.0.0.1:1",)))
    before = (tmp_path / "state.json").read_text()
    for unit in ("state", "units", "state-json"):
        fleet.start(unit, "{}", module="child_speaks")
    assert fleet.follow(lambda: len(fleet.running) == 3, lambda _unit, _said: None, timeout_s=20)
    assert (tmp_path / "state.json").read_text() == before


def test_records_are_heard_once_each_across_files_that_are_begun_again(fleet: Fleet) -> None:
    fleet.start("0", "{}", module="child_fails")
    assert fleet._children["0"].wait(20) == 1
    say = Records(fleet._units / "0.out", pytest.fail, part_bytes=2_000)
    numbers: list[int] = []
    for at in range(600):
        say({"at": at})
        if at % 37 == 0:
            numbers += [said["at"] for _, said in fleet.heard()]
    numbers += [said["at"] for _, said in fleet.heard()]
    assert numbers == list(range(600))
