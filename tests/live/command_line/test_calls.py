"""Over processes: a stream at a cost is called for, an area is divided, and both go on when a platform is killed."""

import json
from itertools import takewhile
from pathlib import Path

import pytest

import dyknow as library
from tests.live.command_line.command import Dyknow, lines

pytestmark = pytest.mark.live
EXAMPLES = Path(__file__).parents[3] / "examples"


def test_what_one_that_is_killed_had_taken_on_the_next_takes_over(dyknow: Dyknow) -> None:
    sniffer = str(EXAMPLES / "labels" / "sniffer.py")
    processes = {}
    for unit, name in enumerate(("cheap", "sure", "dear")):
        spec = str(EXAMPLES / "offers" / f"{name}.kpl")
        processes[unit] = dyknow.start("join", "--unit", str(unit), "--spec", spec, "--units", sniffer, "--json")
    for process in processes.values():
        next(line for line in lines(process) if line["event"] == "specified")
    dyknow.until("ls", state="alive")
    area = str(EXAMPLES / "areas" / "field.geojson")
    [agreed] = dyknow.run("delegate", "divide-area", f"area={area}", "--to", "0")
    assert agreed["performative"] == "agree"
    pieces = dyknow.until("query", "assigned-area", label="assigned-area")
    assert {piece["unit"]: round(piece["value"]["share"], 3) for piece in pieces} == {0: 0.333, 1: 0.333, 2: 0.333}

    with library.connect(dyknow.federation) as fed, fed.call("gas-level", every="500ms", min_certainty=0.8) as items:
        before = list(takewhile(lambda item: not hasattr(item, "value"), items))
        assert [item.unit for item in before if item.event == "taken"] == ["1"]
        assert [item.unit for item in before if item.event == "refused"] == ["0"]
        processes[1].kill()
        failed = next(item for item in items if getattr(item, "event", "") == "failed")
        sample = next(item for item in items if getattr(item, "unit", "") == "2" and hasattr(item, "value"))
        assert (failed.unit, sample.label) == ("1", "gas-level")
    shares = {0: 0.5, 2: 0.5}
    while {piece["unit"]: round(piece["value"]["share"], 3) for piece in pieces if "value" in piece} != shares:
        pieces = dyknow.run("query", "assigned-area", code=None)
    out, _ = dyknow.raw("call", "gas-level", "--every", "500ms", "--min-certainty", "0.8", "--count", "1", "--json")
    assert {json.loads(line)["unit"] for line in out.splitlines() if "value" in json.loads(line)} == {2}
    dyknow.run("cancel", agreed["conversation"])
