"""A unit that takes long, on a running platform: it delays itself, and nothing else (3.2, 5.4.3).

Everything is measured in what the samples carry: the federation's own times.
"""

import signal
from pathlib import Path

import pytest

from tests.live.command_line.command import Dyknow, lines

pytestmark = pytest.mark.live
SLEEP_US = 4_000_000
UNITS = """
import itertools
import time
from dyknow import source, value_unit

def every(period_us):
    def read(from_us):
        for n in itertools.count(from_us // period_us + 1):
            yield period_us * n, n
    return read

fast_ticks, seconds = source("number", "FastTicks")(every(20_000)), source("number", "Seconds")(every(1_000_000))

@value_unit("number", "number")
def Sleeping(number):
    time.sleep(4.0)
    return number

@value_unit("number", "number")
def Endless(number):
    while True:
        time.sleep(1.0)

@value_unit("number", "number")
def Failing(number):
    raise OSError("no such camera")
"""
SPECIFICATION = """
strmgen fast = FastTicks
strmgen tick = Seconds
strmgen slow = Sleeping(tick)
strmgen never = Endless(tick)
strmgen none = Failing(tick)
stream fast_ticks = fast
stream slow_ticks = slow
stream punctual = slow with max delay 100
stream never_ticks = never
stream no_ticks = none
"""


def delay_us(sample):
    return sample["available_us"] - sample["valid_us"]


def test_a_unit_that_sleeps_delays_itself_alone(dyknow: Dyknow, tmp_path: Path) -> None:
    (tmp_path / "units.py").write_text(UNITS, encoding="utf-8")
    (tmp_path / "slow.kpl").write_text(SPECIFICATION, encoding="utf-8")
    joined = dyknow.start(
        "join", "--unit", "0", "--spec", str(tmp_path / "slow.kpl"), "--units", str(tmp_path / "units.py"), "--json"
    )
    said, slept = [], 0
    for line in lines(joined):
        said.append(line)
        slept += line.get("stream") == "slow_ticks" and line["event"] == "sample"
        if slept == 1:
            assert [member["unit"] for member in dyknow.run("ls") if member.get("state") == "alive"] == [0]
            slept = 2
        if slept >= 5:
            break
    assert joined.poll() is None, joined.communicate()
    samples = [each for each in said if each["event"] == "sample"]
    slow = [each for each in samples if each["stream"] == "slow_ticks"]
    assert all(SLEEP_US <= delay_us(each) <= 2 * SLEEP_US for each in slow)
    assert not [each for each in samples if each["stream"] in {"punctual", "never_ticks", "no_ticks"}]

    begins_us, ends_us = slow[0]["available_us"], slow[-1]["available_us"]
    fast = [each for each in samples if each["stream"] == "fast_ticks" and begins_us < each["valid_us"] < ends_us]
    delays_us = sorted(map(delay_us, fast))
    assert len(fast) > 0.9 * (ends_us - begins_us) / 20_000
    assert delays_us[len(fast) * 99 // 100 - 1] < SLEEP_US / 20, (
        "a call on the platform's thread would be seen in half of them"
    )

    notes = " ".join(each["text"] for each in said if each["event"] == "note")
    assert "no such camera" in notes
    assert "until now 1" in notes
    [graph] = dyknow.run("kpl", "graph", "--unit", "0")
    nodes = {node["name"]: node for node in graph["nodes"]}
    assert nodes["slow"]["made_by"] == "Sleeping in a worker"
    assert nodes["slow"]["delay_us"] >= SLEEP_US
    joined.send_signal(signal.SIGINT)
    assert joined.wait(30) == 130, "a unit that never returns hinders no end"
