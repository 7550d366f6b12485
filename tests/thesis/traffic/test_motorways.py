"""Minutes of a motorway on which cars enter, leave for good, hide, stop and queue (8.7.5): what overtakes what, and no car that is gone."""

import json
import resource
import subprocess
import sys

import pytest

from bench.traffic.manoeuvres import Score, passes, reported, score
from bench.traffic.motorway import minute
from tests.docs.pages import COMMAND, ROOT, environment
from tests.thesis.traffic.written import EXAMPLES

LEAST = 0.95
MOST_S = 10.0
"""Processor time for a minute of 25 cars."""


def recognised(made, folder):
    """The score of a run of overtakes.kpl over a minute, and the processor time that it took, s."""
    feed = folder / "seen.jsonl"
    feed.write_text("".join(f"{json.dumps(line)}\n" for line in made.lines()), "utf-8")
    whole = (EXAMPLES / "overtakes.kpl").read_text("utf-8")
    (folder / "passes.kpl").write_text(whole.partition("stream too_near")[0], "utf-8")
    (folder / "overtakes.chr").write_text((EXAMPLES / "overtakes.chr").read_text("utf-8"), "utf-8")
    before = _used_s()
    call = [sys.executable, "-c", COMMAND, "kpl", "run", str(folder / "passes.kpl"), "--feed", str(feed), "--json"]
    done = subprocess.run(call, env=environment(folder), cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "out of order" not in done.stderr
    took_s = _used_s() - before
    return score(made, reported(map(json.loads, done.stdout.splitlines()), "passed")), took_s


def _used_s():
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def test_8_7_5_overtakes_on_a_motorway_are_recognised_and_no_other(tmp_path):
    made = minute(1, 1.0, seconds=15.0)
    got, _ = recognised(made, tmp_path)
    assert got.clear >= 6
    assert got.precision >= LEAST
    assert got.recall >= LEAST
    assert got.unseen == 0


@pytest.mark.full
def test_8_7_5_overtakes_in_minutes_of_all_kinds(tmp_path):
    total, took_s = Score(), []
    for seed in range(12):
        got, used_s = recognised(minute(seed, (0.0, 0.5, 1.0)[seed % 3]), tmp_path)
        total, took_s = total.plus(got), [*took_s, used_s]
    print(total, total.precision, total.recall, took_s)
    assert total.clear >= 200
    assert total.precision >= LEAST
    assert total.recall >= LEAST
    assert total.unseen == 0
    assert sorted(took_s)[len(took_s) // 2] < MOST_S


def test_the_minutes_have_cars_that_hide_leave_for_good_and_queue():
    made = minute(1, 1.0)
    hidden = {name for cars in made.cars for name, car in cars.items() if not car.is_seen}
    gone = [name for name in made.cars[100] if not any(name in cars for cars in made.cars[300:])]
    stands = sum(car.speed_m_s < 1.0 for cars in made.cars for car in cars.values())
    assert len(hidden) > 10
    assert gone
    assert stands > 100
    assert any(not each.is_clear for each in passes(made))
