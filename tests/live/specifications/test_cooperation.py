"""Two UAVs over one road, live: one name for one car, one picture, and an overtake that neither of them sees whole."""

import os
import time
from pathlib import Path
from typing import Any

import pytest

from tests.live.command_line.command import Dyknow

pytestmark = pytest.mark.live
FULL = bool(os.environ.get("DYKNOW_FULL"))
EXAMPLES = Path(__file__).parents[3] / "examples" / "cooperation"
PATIENCE_S = 150.0


@pytest.mark.parametrize("level", ["events", *(("relations", "states") if FULL else ())])
def test_an_overtake_from_one_area_into_the_next_is_recognised(dyknow: Dyknow, level: str) -> None:
    for unit, area in (("0", "west"), ("1", "east")):
        spec, units = str(EXAMPLES / f"{area}.kpl"), str(EXAMPLES / "cars.py")
        dyknow.start("join", "--unit", unit, "--spec", spec, "--units", units, "--json")
    until = time.monotonic() + PATIENCE_S
    share = "delegate", "share", f"level={level}", "unit=1", "--to", "0"
    while "agree" not in dyknow.raw(*share, code=None)[0]:
        assert time.monotonic() < until
    one = recognised(dyknow, level)
    fast, slow = one["to"].removeprefix("passes[").removesuffix("]").split(", ")
    rows = {each["symbol"]: each for each in dyknow.run("objects")}
    for name, colour in ((fast, "red"), (slow, "blue")):
        tracks = rows[name]["tracks"]
        assert rows[name]["colour"] == colour
        assert tracks
    told = {each["event"] for each in dyknow.run("events")}
    assert {"appeared", "lost", "reacquired", "arrived"} <= told


def recognised(dyknow: Dyknow, level: str) -> dict[str, Any]:
    """The first overtake that platform 0 recognises of what platform 1 shares at that level."""
    until = time.monotonic() + PATIENCE_S
    while True:
        for each in dyknow.run("events", code=None):
            if each["event"] == "recognised" and each["unit"] == 0 and f"{level} of 1" in each["because"]:
                return each
        assert time.monotonic() < until, f"no overtake is recognised from {level}"
