"""Minutes of a town in which cars are slow, queue, and are lost for seconds by the tracker (8.7.4): through which crossing, whereto."""

import json
import os
from collections import Counter

from bench.traffic.town import judged, minute
from dyknow.sim_uavs.roads.layouts import network_of, town
from tests.command import run
from tests.docs.pages import ROOT, environment
from tests.thesis.traffic.written import EXAMPLES

MINUTES, SECONDS = (10, 60.0) if os.environ.get("DYKNOW_FULL") else (1, 30.0)
MORE = """
stream turns_right = chronicle[turn_right_in_crossing]
stream turns_back = chronicle[turn_back_in_crossing]
"""
STREAMS = {"turns_left", "turns_right", "turns_back", "goes_straight"}


def recognised(made, roads, folder):
    """The ways of reported passages, and when."""
    (folder / "town.geojson").write_text(json.dumps(roads), "utf-8")
    for name in ("town.py", "turns.chr", "overtakes.chr"):
        (folder / name).write_text((EXAMPLES / name).read_text("utf-8"), "utf-8")
    (folder / "monitoring.kpl").write_text((EXAMPLES / "monitoring.kpl").read_text("utf-8") + MORE, "utf-8")
    (folder / "feed.jsonl").write_text("".join(f"{json.dumps(each)}\n" for each in made.lines), "utf-8")
    done = run(
        ["kpl", "run", str(folder / "monitoring.kpl"), "--units", str(folder / "town.py"),
         "--feed", str(folder / "feed.jsonl"), "--json"],
        environment(folder), ROOT,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    records = [each for each in map(json.loads, done.stdout.splitlines()) if each.get("stream") in STREAMS]
    return [(tuple(each["value"][0][1:]), each["valid_us"] // 1000) for each in records]


def test_8_7_4_ways_through_crossings_are_recognised_and_no_other(tmp_path):
    roads = town()
    network, total = network_of(roads), Counter()
    for seed in range(MINUTES):
        made = minute(network, seed, 0.5, seconds=SECONDS)
        found = recognised(made, roads, tmp_path)
        wrong, missed, clear = judged(made, found, network.names)
        total.update(reported=len(found), false=len(wrong), clear=clear, missed=len(missed))
        print(seed, len(found), wrong, missed, clear)
    assert total["clear"] >= 8 * MINUTES
    assert total["false"] <= 0.02 * total["reported"]
    assert total["missed"] <= 0.05 * total["clear"]
