"""Lane changes, cars that cut in, follow too closely, and turn back on a link: what happened in drives from seeds is recognised, and no more."""

import json
import os
from collections import Counter

import pytest

from bench.traffic.situations import drawn, lines
from tests.command import run
from tests.docs.pages import ROOT, environment
from tests.thesis.traffic.written import EXAMPLES

STREAMS = {
    "lane_changes": "lane_change", "cuts_in": "cuts_in", "too_close": "follows_too_closely", "u_turns": "u_turn"
}  # fmt: skip
SEEDS = range(120 if os.environ.get("DYKNOW_FULL") else 5)


def recognised(seed, sd_m, folder):
    feed = folder / "seen.jsonl"
    feed.write_text("".join(f"{json.dumps(each)}\n" for each in lines(drawn(seed), seed, sd_m)), "utf-8")
    done = run(
        ["kpl", "run", str(EXAMPLES / "manoeuvres.kpl"), "--feed", str(feed), "--json"], environment(folder), ROOT
    )
    assert done.returncode == 0, done.stderr
    records = [each for each in map(json.loads, done.stdout.splitlines()) if each.get("stream") in STREAMS]
    return Counter((STREAMS[each["stream"]], *map(str, each["value"][0])) for each in records)


@pytest.mark.parametrize("seed", SEEDS)
def test_what_happens_is_recognised_once_and_nothing_else(seed, tmp_path):
    assert recognised(seed, (0.0, 0.5, 1.0)[seed % 3], tmp_path) == Counter(drawn(seed).happens)


def test_the_drives_have_each_manoeuvre_and_its_near_miss():
    every = [drawn(seed) for seed in range(50)]
    names = Counter(each[0] for situation in every for each in situation.happens)
    assert set(names) == set(STREAMS.values())
    assert min(names.values()) >= 3
    for kind in (0, 2, 3):
        assert {bool(each.happens) for each in every[kind::5]} == {True, False}
