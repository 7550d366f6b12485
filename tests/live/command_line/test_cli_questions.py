"""Questions and requests of every kind to running platforms: samples by number, a history that is reset."""

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
