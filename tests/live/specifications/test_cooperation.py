"""Two UAVs over one road, live: one name for one car, one picture, and an overtake that neither of them sees whole."""

import os
import subprocess
import time
from pathlib import Path

import pytest

from tests.live.command_line.command import Dyknow, lines

pytestmark = pytest.mark.live
EXAMPLES = Path(__file__).parents[3] / "examples" / "cooperation"
PATIENCE_S = 150.0
TRACKS, DETECTS = 1, 2
"""The platforms in the east: one tracks cars, one has detectors alone."""
LEVELS = ("events", "relations", "states", "percepts") if os.environ.get("DYKNOW_FULL") else ("states",)
PLATFORMS = ("west", "east", "percepts") if "percepts" in LEVELS else ("west", "east")


def test_an_overtake_from_one_area_into_the_next_is_recognised_whatever_is_shared_and_that_changes_while_it_runs(
    dyknow: Dyknow,
) -> None:
    """Time runs four times faster: an overtake every four seconds."""
    for unit, spec in enumerate(PLATFORMS):
        options = "--spec", str(EXAMPLES / f"{spec}.kpl"), "--units", str(EXAMPLES / "cars.py")
        dyknow.start("join", "--unit", str(unit), *options, "--speed", "4", "--epoch", "2026-01-01T00:00:00Z", "--json")
    if len(PLATFORMS) > DETECTS:
        share(dyknow, DETECTS, "none")
    share(dyknow, TRACKS, LEVELS[0])
    events = dyknow.start("events", "--follow", "--json")
    symbols: dict[str, str] = {}
    told: set[str] = set()
    for level in LEVELS:
        sharing, other = (DETECTS, TRACKS) if level == "percepts" else (TRACKS, DETECTS)
        if level != LEVELS[0]:
            share(dyknow, other, "none")
            share(dyknow, sharing, level)
        pair = recognised(events, f"and {level} of {sharing}", symbols, told)
        fast, slow = (int(symbols[name].removeprefix("w")) for name in pair)
        assert (fast % 2, slow - fast) == (0, 1), "the fast car is the first of a round"
    assert {"appeared", "arrived"} <= told
    assert dyknow.run("objects")


def share(dyknow: Dyknow, unit: int, level: str) -> None:
    """That platform shares so with platform 0 from now on; what it offers is known a while after it has come."""
    until = time.monotonic() + PATIENCE_S
    while "agree" not in dyknow.raw("delegate", "share", f"level={level}", f"unit={unit}", "--to", "0", code=None)[0]:
        assert time.monotonic() < until


def recognised(events: "subprocess.Popen[str]", because: str, symbols: dict[str, str], told: set[str]) -> list[str]:
    """The cars of the next overtake that platform 0 recognises from that; `symbols` gets what 0 itself called each that it named, `told` all kinds of events."""
    until = time.monotonic() + PATIENCE_S
    for each in lines(events):
        told.add(each["event"])
        if each["event"] == "appeared" and each["unit"] == 0:
            symbols[each["to"]] = each["because"].partition(" ")[0]
        if each["event"] == "recognised" and each["unit"] == 0 and each["because"].endswith(because):
            return str(each["to"]).removeprefix("passes[").removesuffix("]").split(", ")
        assert time.monotonic() < until
    raise AssertionError(f"no overtake is recognised {because}")
