"""Two red cars, one of them wanted: over live processes and MAVLink the vehicle looks again from elsewhere, and says which it is."""

import time
from pathlib import Path

import pytest

from tests.live.command_line.command import Dyknow

pytestmark = [pytest.mark.live, pytest.mark.full]
RECOVERY = Path(__file__).parents[3] / "examples" / "recovery"
PATIENCE_S = 150.0
WANTED = 'colour[suspect] = "red" and mark[suspect]'


def test_the_vehicle_flies_to_where_the_mark_is_seen_and_the_car_that_has_it_is_anchored(dyknow: Dyknow) -> None:
    parked = ("--spec", str(RECOVERY / "parked.kpl"), "--units", str(RECOVERY / "parked.py"))
    dyknow.run("up", "1", "--scenario", "traffic", "--speed", "4", *parked, "--detach")
    want = ("delegate", "want", "symbol=suspect", "type=parked", f"description={WANTED}", "recover=yes", "--to", "0")
    assert "agree" in str(dyknow.run(*want))
    until = time.monotonic() + PATIENCE_S
    while True:
        listed = dyknow.run("mission", "status", code=None)
        if listed and listed[0]["phase"] == "anchored":
            break
        assert time.monotonic() < until, listed
    done = listed[0]["actions"]
    assert done[0].startswith("halted: case 2")
    assert any(each.startswith("plan: case 2, 9 hypotheses: ((move v1) (look-at ") for each in done)
    assert "flies: (move v2)" in done
    looks = [each for each in done if each.startswith("observed: ")]
    assert all(each.endswith("shows f") for each in looks[:-1]) and looks[-1].endswith("shows t")
    assert done[-1].startswith("anchored")
    assert "it was decided that it is this one" in str(dyknow.run("explain", "suspect"))
    (task,) = dyknow.run("tasks")
    dyknow.run("cancel", task["conversation"])
    assert dyknow.run("tasks", code=None) == []
