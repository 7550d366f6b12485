"""Questions and requests of every kind to running platforms: samples by number, a history that is reset,
whether something is true, what is to be done when it becomes true."""

from itertools import pairwise
from pathlib import Path

import pytest

import dyknow as library
from tests.live.command_line.command import Dyknow, lines

pytestmark = pytest.mark.live
EXAMPLES = Path(__file__).parents[3] / "examples" / "labels"


def test_samples_are_asked_for_by_number_from_the_command_line_and_a_program(dyknow: Dyknow) -> None:
    dyknow.run("up", "2", "--scenario", "hover", "--detach")
    dyknow.until("query", "heli-altitude", "--at", "-2s", label="heli-altitude")
    first = dyknow.run("query", "heli-altitude", "--slice", "0", "9", "--unit", "1")
    assert len(first) == 10
    assert [b["valid_us"] - a["valid_us"] for a, b in pairwise(first)] == [100_000] * 9
    last = dyknow.run("query", "heli-altitude", "--last", "5")
    assert sorted(each["unit"] for each in last) == [0] * 5 + [1] * 5
    assert min(each["valid_us"] for each in last) > first[0]["valid_us"]
    [nth] = dyknow.run("query", "altitude[self]", "--nth", "3", "--unit", "0")
    assert nth["unit"] == 0
    assert [each["unit"] for each in dyknow.run("query", "heli-altitude", "--nth", "0", "--via", "1")].count(1) == 1
    _, err = dyknow.raw("query", "heli-altitude", "--last", "5", "--nth", "3", code=2)
    assert "--last and --nth ask for different samples" in err
    [refused, _] = dyknow.run("query", "heli-altitude", "--nth", "100000", code=1)
    assert "is not held" in refused["error"]

    with library.connect(dyknow.federation) as fed:
        samples = fed.query("heli-altitude", unit=1, slice=(0, 9))
        assert [each.valid_us for each in samples] == [each["valid_us"] for each in first]
        assert len(fed.query("heli-altitude", last=5)) == 10
        [earlier] = fed.query("heli-altitude", unit=0, nth=3)
        assert earlier.valid_us > nth["valid_us"]


def test_the_history_of_a_declared_stream_is_reset_and_that_of_the_vehicle_is_not(dyknow: Dyknow) -> None:
    dyknow.run("up", "1", "--scenario", "hover", "--detach")
    dyknow.run("kpl", "add", "stream low = altitude[self]", "--unit", "0")
    [answer] = dyknow.run("delegate", "reset", "stream=altitude[self]", "--to", "0", code=1)
    assert answer["performative"] == "refuse"
    assert "altitude[self] is not declared by the specification of 0" in answer["content"]
    spec, units = str(EXAMPLES / "gas.kpl"), str(EXAMPLES / "sniffer.py")
    sensor = dyknow.start("join", "--unit", "7", "--spec", spec, "--units", units, "--json")
    next(line for line in lines(sensor) if line["event"] == "specified")
    dyknow.run("kpl", "add", "stream seen = gas[self]", "--unit", "7")
    next(line for line in lines(sensor) if line["event"] == "sample")
    before = dyknow.run("query", "gas[self]", "--last", "100", "--unit", "7")
    assert before
    answers = dyknow.run("delegate", "reset", "stream=gas[self]", "--to", "7")
    assert answers[0]["performative"] == "agree"
    after = dyknow.until("query", "gas[self]", "--last", "100", "--unit", "7", label="gas[self]")
    assert after[0]["valid_us"] > before[-1]["valid_us"]
    [refused] = dyknow.run("query", "gas[self]", "--at", str(before[0]["valid_us"]), "--unit", "7", code=1)
    assert "before the first gas[7] that is held" in refused["error"]
    with library.connect(dyknow.federation) as fed:
        task = fed.delegate("reset", stream="gas[self]", to=7)
        list(task.events)
        assert task.state == "done"


def test_a_request_waits_for_its_condition_and_what_is_not_done_so_is_refused(dyknow: Dyknow) -> None:
    dyknow.run("up", "2", "--scenario", "hover", "--detach")
    [verdict] = dyknow.run("check", "altitude[self] > 0", "--unit", "0")
    assert verdict["verdict"] == "true"
    [verdict] = dyknow.run("check", "altitude[self] > 9000", "--unit", "0", code=1)
    assert verdict["verdict"] == "false"
    acts = [each["act"] for each in dyknow.run("acts", "--unit", "0") if each["act"]]
    assert any(act.startswith("(query-if ") for act in acts)

    asked = ("delegate", "create-monitor", "name=energy", "--to", "0")
    late = dyknow.run(*asked, "--when", "altitude[self] > 9000", "--for", "1s", "--wait", code=3)
    assert [each["performative"] for each in late] == ["agree", "failure"]
    assert "was not true within 1 s" in late[1]["content"]
    [waits] = dyknow.run(*asked, "--when", "altitude[self] > 9000")
    [task] = dyknow.run("tasks")
    assert (task["task"], task["conversation"]) == ("when", waits["conversation"])
    assert task["state"] == "create-monitor when altitude[self] > 9000"
    dyknow.run("cancel", waits["conversation"])
    dyknow.run("tasks", code=1)
    dyknow.run(*asked, "--when", "altitude[self] > 0")
    dyknow.until("tasks", task="create-monitor", state="running")
    told = dyknow.run("monitors")  # and how many are unknown, while it has only begun
    assert {each["monitor"] for each in told if "monitor" in each} == {"energy"}
    [refused] = dyknow.run("delegate", "land", "--to", "0", "--when", "altitude[self] > 0", code=1)
    assert refused["performative"] == "refuse"
    assert "on a condition, unattended: expected a request" in refused["content"]
    _, err = dyknow.raw(*asked, "--when", "altitude[self] >", code=2)
    assert "expected" in err
    _, err = dyknow.raw(*asked, "--when", "altitude[self] > 0", "--for", "2h", code=2)
    assert "an hour at most" in err

    with library.connect(dyknow.federation) as fed:
        multicast = {"semantic_labels": ("battery",), "sample_period": "1s", "delay": "1s", "to_units": ("0",)}
        task = fed.delegate("create-multicast", to=1, when=("altitude[self] > 0", "1min"), **multicast)
        assert next(iter(task.events)).head == "done"
    asked = [each["act"] for each in dyknow.run("acts", "--unit", "1") if each["act"]]
    assert any(act.startswith("(request-when ") for act in asked)
