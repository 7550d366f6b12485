"""Questions and requests of every kind to running platforms: samples by number."""

from itertools import pairwise

import pytest

import dyknow as library
from tests.live.command_line.command import Dyknow

pytestmark = pytest.mark.live


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
