"""Two UAVs over one road, live: one name for one car, one picture, and an overtake that neither of them sees whole."""

import time
from pathlib import Path
from typing import Any

import pytest

from tests.live.command_line.command import Dyknow

pytestmark = pytest.mark.live
EXAMPLES = Path(__file__).parents[3] / "examples" / "cooperation"
PATIENCE_S = 150.0


def test_an_overtake_from_one_area_into_the_next_is_recognised_whatever_is_shared_and_that_changes_while_it_runs(
    dyknow: Dyknow,
) -> None:
    """Time runs four times faster: an overtake every four seconds."""
    for unit, area in (("0", "west"), ("1", "east")):
        spec, units = str(EXAMPLES / f"{area}.kpl"), str(EXAMPLES / "cars.py")
        dyknow.start(
            "join",
            "--unit",
            unit,
            "--spec",
            spec,
            "--units",
            units,
            "--json",
            "--speed",
            "4",
            "--epoch",
            "2026-01-01T00:00:00Z",
        )
    for level in ("events", "relations", "states"):
        share(dyknow, level)
        one = recognised(dyknow, level)
    fast, slow = one["to"].removeprefix("passes[").removesuffix("]").split(", ")
    rows = {each["symbol"]: each for each in dyknow.run("objects")}
    for name, colour in ((fast, "red"), (slow, "blue")):
        tracks = rows[name]["tracks"]
        assert rows[name]["colour"] == colour
        assert tracks
    told = {each["event"] for each in dyknow.run("events")}
    assert {"appeared", "lost", "reacquired", "arrived"} <= told


def share(dyknow: Dyknow, level: str) -> None:
    """Platform 1 shares that with platform 0 from now on."""
    until = time.monotonic() + PATIENCE_S
    while "agree" not in dyknow.raw("delegate", "share", f"level={level}", "unit=1", "--to", "0", code=None)[0]:
        assert time.monotonic() < until


def recognised(dyknow: Dyknow, level: str) -> dict[str, Any]:
    """The first overtake that platform 0 recognises of what platform 1 shares at that level."""
    until = time.monotonic() + PATIENCE_S
    while True:
        for each in dyknow.run("events", code=None):
            if each["event"] == "recognised" and each["unit"] == 0 and f"{level} of 1" in each["because"]:
                return each
        assert time.monotonic() < until, f"no overtake is recognised from {level}"
