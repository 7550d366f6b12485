"""Nobody is left running: however a command ends, what it started ends too."""

import json
import os
import signal
import subprocess

import pytest

from tests.live.command_line.command import PATIENCE_S, Dyknow, gone, lines

pytestmark = pytest.mark.live


def _started(dyknow: Dyknow, *more: str) -> tuple["subprocess.Popen[str]", list[int]]:
    up = dyknow.start("up", "2", "--scenario", "hover", "--json", *more)
    ready = next(lines(up))
    return up, list(ready["pids"].values())


def test_an_interrupted_up_ends_its_platforms_and_exits_130(dyknow: Dyknow) -> None:
    up, pids = _started(dyknow)
    up.send_signal(signal.SIGINT)
    out, _ = up.communicate(timeout=PATIENCE_S)
    assert up.returncode == 130
    assert json.loads(out.splitlines()[-1]) == {"event": "stopped", "units": [0, 1]}
    assert gone(pids, within_s=5.0)


def test_a_killed_up_takes_its_platforms_with_it(dyknow: Dyknow) -> None:
    up, pids = _started(dyknow)
    up.kill()
    up.wait(timeout=PATIENCE_S)
    assert gone(pids)


def test_up_ends_by_itself_after_its_duration(dyknow: Dyknow) -> None:
    up, pids = _started(dyknow, "--duration", "4s")
    out, err = up.communicate(timeout=PATIENCE_S)
    assert up.returncode == 0, err
    said = [json.loads(line) for line in out.splitlines()]
    assert {(line["unit"], line["code"]) for line in said if line["event"] == "ended"} == {(0, 0), (1, 0)}
    assert gone(pids, within_s=5.0)


def test_down_ends_an_up_that_stayed(dyknow: Dyknow) -> None:
    up, pids = _started(dyknow)
    assert dyknow.run("down") == [{"event": "stopped", "units": [0, 1]}]
    assert up.wait(timeout=PATIENCE_S) == 130
    assert gone(pids, within_s=5.0)


def test_a_platform_that_dies_is_told_and_the_other_stays_and_leads_its_task_on(dyknow: Dyknow) -> None:
    up, pids = _started(dyknow)
    waiting = dyknow.start("delegate", "monitor-proximity", "--to", "0", "--wait", "--json")
    told = lines(waiting)
    while "proximity-warn" not in (said := next(told)).get("content", ""):
        assert said["unit"] == 0
    os.kill(pids[0], signal.SIGKILL)
    assert next(lines(up)) == {"event": "ended", "unit": 0, "code": -9}
    _, err = waiting.communicate(timeout=PATIENCE_S)
    assert waiting.returncode == 3
    assert "platform 0 is gone" in err
    assert "Platform 1 continues the task" in err
    assert [task["unit"] for task in dyknow.run("tasks")] == [1]
    for _ in range(2):
        # A command is not in the federation before half a second is over.
        assert {line["unit"]: line["state"] for line in dyknow.run("ls")} == {0: "gone", 1: "alive"}
    assert {line["unit"]: "error" in line for line in dyknow.run("query", "battery")} == {0: True, 1: False}
    up.send_signal(signal.SIGTERM)
    assert up.wait(timeout=PATIENCE_S) == 130
    assert gone(pids, within_s=5.0)
