"""Three simulated UAVs, started detached, and every command that asks them something."""

import json
import os
import signal
from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest

from tests.live.command_line.command import Dyknow

pytestmark = pytest.mark.live


@pytest.fixture(scope="module")
def dyknow(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Dyknow]:
    found = Dyknow(tmp_path_factory.mktemp("run"))
    try:
        [ready] = found.run("up", "3", "--scenario", "hover", "--seed", "5", "--detach")
        assert ready["event"] == "ready"
        assert ready["units"] == [0, 1, 2]
        assert all(psutil.pid_exists(pid) for pid in ready["pids"].values())
        yield found
    finally:
        found.close()


def test_ls_shows_all_three_alive_with_their_labels_and_clocks(dyknow: Dyknow) -> None:
    found = dyknow.until("ls", state="alive", clock="synchronised")  # one machine, one clock; how sure, load decides
    assert [line["unit"] for line in found] == [0, 1, 2]
    for line in found:
        assert {"heli-position", "heli-altitude", "heli-velocity", "battery"} <= {e["label"] for e in line["labels"]}
        assert abs(line["offset_us"]) <= line["bound_us"]


def test_ls_is_readable_in_80_columns(dyknow: Dyknow) -> None:
    for options in ((), ("-l",)):
        out, _ = dyknow.raw("ls", *options)
        assert all(len(line) <= 80 for line in out.splitlines())
    assert "heli-position" in out, "no label is cut"


def test_a_second_up_names_what_runs_and_starts_nothing(dyknow: Dyknow) -> None:
    [running] = dyknow.run("up", "2", "--detach")
    assert running == {"event": "running", "units": [0, 1, 2]}
    out, _ = dyknow.raw("up", "3")
    assert "run already" in out


def test_a_name_that_is_taken_is_refused(dyknow: Dyknow) -> None:
    _, err = dyknow.raw("join", "--unit", "1", "--mavlink", "udpin:127.0.0.1:0", code=2)
    assert "there is a platform 1" in err


def test_queries_latest_at_and_between(dyknow: Dyknow) -> None:
    [at] = dyknow.until("query", "heli-altitude", "--unit", "1", "--at", "-1s")
    latest = dyknow.run("query", "heli-altitude")
    assert {line["unit"] for line in latest} == {0, 1, 2}
    assert all(55 < line["value"]["altitude_m"] < 65 for line in latest)
    assert all(at["valid_us"] <= line["valid_us"] - 800_000 for line in latest)
    between = dyknow.run("query", "heli-altitude", "--unit", "2", "--between", "-2s", "-1s")
    assert len(between) in {10, 11}
    assert [line["valid_us"] for line in between] == sorted(line["valid_us"] for line in between)


def test_what_is_not_there_is_an_answer_of_no(dyknow: Dyknow) -> None:
    _, err = dyknow.raw("query", "heli-positon", code=1)
    assert "Did you mean 'heli-position'" in err
    _, err = dyknow.raw("query", "battery", "--unit", "7", code=1)
    assert "7" in err
    assert Dyknow(dyknow.directory).run("ls", code=1) == [], "another federation is another world"


def test_watch_prints_samples_of_a_policy(dyknow: Dyknow) -> None:
    found = dyknow.run("watch", "heli-velocity", "--unit", "0", "--every", "200ms", "--count", "4")
    times = [line["valid_us"] for line in found]
    assert len(times) == 4
    assert all(time % 200_000 == times[0] % 200_000 for time in times)


def test_watch_has_what_is_valid_in_a_duration_and_ends_with_it(dyknow: Dyknow) -> None:
    found = dyknow.run("watch", "heli-velocity", "--unit", "0", "--every", "100ms", "--from", "+500ms", "--to", "+2s")
    times = [line["valid_us"] for line in found]
    assert all(time % 100_000 == 0 for time in times)
    assert 0 < times[-1] - times[0] <= 1_500_000
    _, err = dyknow.raw("watch", "heli-velocity", "--to", "-3s", code=2)
    assert "dyknow query --between has what was" in err


def test_a_task_is_delegated_listed_watched_and_cancelled(dyknow: Dyknow) -> None:
    [agreed] = dyknow.run("delegate", "monitor-proximity", "--to", "0")
    assert agreed["performative"] == "agree"
    monitors = dyknow.until("monitors", inputs="fresh")
    assert {line["by"] for line in monitors} == {0, 1, 2}
    assert {line["shows"] for line in monitors} == {"ok"}
    [task] = [line for line in dyknow.run("tasks") if line["task"] == "monitor-proximity"]
    assert task["conversation"] == agreed["conversation"]
    acts = dyknow.run("acts")
    assert any(line["act"] and "(monitor-proximity)" in line["act"] for line in acts)
    assert dyknow.run("cancel", agreed["conversation"])[-1]["performative"] == "inform"
    for _ in range(10):
        started = dyknow.start("monitors", "--json")
        if started.wait(timeout=30) == 1:
            break
    assert dyknow.run("monitors", code=1) == []
    assert dyknow.run("tasks", code=1) == []


def test_streams_and_monitors_are_ended_by_their_names(dyknow: Dyknow) -> None:
    stream = ("create-multicast", "semantic-labels=heli-altitude", "sample-period=500ms", "delay=1s", "to-units=1")
    for begin, end in (
        (stream, ("stop-multicast", "semantic-labels=heli-altitude", "to-units=1")),
        (("create-monitor", "name=proximity"), ("remove-monitor", "name=proximity")),
    ):
        assert dyknow.run("delegate", *begin, "--to", "0")[0]["performative"] == "agree"
        [task] = dyknow.until("tasks", state="running")
        assert task["task"] == begin[0]
        ended = dyknow.run("delegate", *end, "--to", "0", "--wait")
        assert [line["performative"] for line in ended] == ["agree", "inform"]
        assert dyknow.run("tasks", code=1) == []
    refused = dyknow.run("delegate", "remove-monitor", "name=proximity", "--to", "0", code=1)
    assert refused[0]["performative"] == "refuse"


def test_a_fault_is_felt_and_passes(dyknow: Dyknow) -> None:
    [told] = dyknow.run("fault", "1", "battery-low=15", "--for", "60s")
    assert (told["unit"], told["fault"]) == (1, "battery-low=15")
    dyknow.until("query", "battery", "--unit", "1", value={"fraction": pytest.approx(0.15, abs=0.02)})
    _, err = dyknow.raw("fault", "1", "gps-los", code=2)
    assert "gps-loss" in err


def test_a_formula_is_checked_on_a_platform(dyknow: Dyknow) -> None:
    assert dyknow.run("check", "always height[self] < 20", "--unit", "0", code=1)[0]["verdict"] == "false"


def _pid(dyknow: Dyknow, unit: str) -> int:
    state = json.loads((dyknow.directory / "dyknow" / dyknow.federation / "state.json").read_text())
    return next(int(entry["pid"]) for entry in state["running"] if entry["unit"] == unit)


def test_a_frozen_platform_is_listed_as_missed_and_named_by_a_query(dyknow: Dyknow) -> None:
    pid = _pid(dyknow, "1")
    os.kill(pid, signal.SIGSTOP)
    try:
        for _ in range(3):
            states = {line["unit"]: line["state"] for line in dyknow.run("ls")}
            assert states.pop(1) in {"suspect", "gone"}, "gone once the others have missed it for 2.5 s"
            assert states == {0: "alive", 2: "alive"}
            answers = dyknow.run("query", "heli-position", "--timeout", "1s")
            assert {line["unit"]: "error" in line for line in answers} == {0: False, 1: True, 2: False}
    finally:
        os.kill(pid, signal.SIGCONT)
    dyknow.until("ls", state="alive")
    assert {line["unit"] for line in dyknow.run("query", "heli-position") if "value" in line} == {0, 1, 2}


def test_a_killed_platform_is_gone_at_once_and_the_rest_goes_on(dyknow: Dyknow) -> None:
    os.kill(_pid(dyknow, "2"), signal.SIGKILL)
    states: dict[str, str] = {}
    for _ in range(3):
        # The others suspect it when its token is withdrawn, and miss it half a second later; a command may come between.
        states = {line["unit"]: line["state"] for line in dyknow.run("ls")}
        assert (states[0], states[1]) == ("alive", "alive")
        assert states[2] in {"suspect", "gone"}
    assert states[2] == "gone"
    answers = dyknow.run("query", "heli-position")
    assert {line["unit"]: "error" in line for line in answers} == {0: False, 1: False, 2: True}


def test_up_starts_the_platform_that_died_as_it_was_and_names_those_that_run(dyknow: Dyknow) -> None:
    before = {unit: _pid(dyknow, unit) for unit in ("0", "1")}
    [ready] = dyknow.run("up", "3", "--only", "2", "--detach")
    assert (ready["event"], ready["units"], ready["present"]) == ("ready", [2], [0, 1])
    assert [line["unit"] for line in dyknow.until("ls", state="alive")] == [0, 1, 2]
    assert {unit: _pid(dyknow, unit) for unit in ("0", "1")} == before, "down finds them as before"
    configuration = (dyknow.directory / "dyknow" / dyknow.federation / "units" / "2.json").read_text()
    assert json.loads(configuration)["vehicle"]["scenario"] == "hover", "not the scenario of this call"
    [altitude] = dyknow.run("query", "heli-altitude", "--unit", "2")
    assert altitude["unit"] == 2


def test_down_ends_them_and_says_so_and_then_there_is_nothing(dyknow: Dyknow, tmp_path: Path) -> None:
    [stopped] = dyknow.run("down")
    assert stopped == {"event": "stopped", "units": [0, 1, 2]}
    assert dyknow.run("down", code=1) == [{"event": "stopped", "units": []}]
