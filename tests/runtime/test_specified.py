"""The feed of a platform's specification: one line is one instant, on the way to a node and in it."""

import queue
from collections.abc import Callable
from pathlib import Path

from dyknow.agents.config import PlatformConfig
from dyknow.agents.effects import FedTogether, Specify
from dyknow.compunits import catalogue
from dyknow.proxies.recordings.journal_file import decode_event, encode_event
from dyknow.runtime.specified import Specified
from dyknow.sim_uavs.world.world import World

S = 1_000_000
SPEC = """\
source number one
source number other
strmgen a = one
strmgen b = other
stream first = a
stream second = b
compunit number Difference(number, number)
strmgen d = Difference(a, b)
stream apart = d
"""
FEED = """\
{"t_ms": 0, "one": 1, "other": 1}
{"t_ms": 100, "one": 2, "other": 2}
{"t_ms": 100, "at_ms": 150, "one": 3}
{"t_ms": 200, "one": 4, "other": 4}
"""
DIFFERENCE = """\
from dyknow import value_unit

@value_unit("number", "number", "number")
def Difference(one, other):
    return one - other
"""


def ticking(first_us: int) -> Callable[[], int]:
    """A clock that shows the first instant until the feed begins, and then 7 us more at each look, when all of it is due."""
    shown = iter([first_us, first_us, *range(100 * S, 100 * S + 70_000, 7)])
    return lambda: next(shown)


def events(tmp_path: Path) -> list[FedTogether]:
    """What the feed posts; the specification itself comes first."""
    (spec := tmp_path / "two.kpl").write_text(SPEC, encoding="utf-8")
    (feed := tmp_path / "two.jsonl").write_text(FEED, encoding="utf-8")
    posted: queue.SimpleQueue[Specify | FedTogether] = queue.SimpleQueue()
    clock = ticking(S // 3)
    specified = Specified(spec, feed, posted.put, lambda _note: None, clock, lambda now_us: now_us)
    specified.start()
    found = [posted.get(timeout=10) for _ in range(5)]
    specified.stop()
    assert isinstance(found[0], Specify)
    return [each for each in found if isinstance(each, FedTogether)]


def test_what_a_line_of_a_feed_brings_is_one_event_of_one_time(tmp_path):
    found = events(tmp_path)
    sources = [[each.source for each in event.samples] for event in found]
    assert sources == [["one", "other"], ["one", "other"], ["one"], ["one", "other"]]
    assert [{each.valid_us % S for each in event.samples} for event in found] == [{0}, {100_000}, {100_000}, {200_000}]
    assert all({each.at_us for each in event.samples} == {event.at_us} for event in found)
    assert [decode_event(encode_event(event)) for event in found] == found


def test_a_platform_takes_it_as_one_instant(tmp_path):
    (module := tmp_path / "difference.py").write_text(DIFFERENCE, encoding="utf-8")
    world = World(1, truth_us=None)
    world.add("0", PlatformConfig("0", 0, catalogue=catalogue([str(module)]).offered))
    world.specify("0", SPEC, "two.kpl")
    world.run_for(0.001)
    node = world.nodes["0"]
    for event in events(tmp_path):
        world.run_for(0.01)
        world._reach(node, event._replace(at_us=world.now_us))
    told = [record for record in node.results if record["event"] == "sample"]
    by_stream = {name: [each for each in told if each["stream"] == name] for name in ("first", "second", "apart")}
    assert [each["value"] for each in by_stream["apart"]] == [0, 0, 1, 0]
    together = [each["available_us"] for each in by_stream["first"] if each["value"] != 3]
    assert together == [each["available_us"] for each in by_stream["second"]]
