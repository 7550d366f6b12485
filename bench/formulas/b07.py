"""B7: chronicle recognition, the overtake of thesis 8.3.13 over 20 cars, and five events in any order."""

import gc
import random
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from bench.formulas.partial_instances import PartialInstances
from bench.formulas.traffic import Change, changes, overtake
from bench.rows import Figures, Limit, Options, Side
from dyknow.reasoning.chronicles import (
    ANY,
    Chronicle,
    ChronicleFile,
    Distance,
    Event,
    EventType,
    Interval,
    Recogniser,
    TimePoint,
    compile_chronicle,
)

TITLE = (
    "overtakes among 20 cars, events per s (short: the first events, as many as the naive one can take; five: k = 5)"
)
BARS = (
    Limit("ns_per_event", 1e9 / 100e3, ours="overtake"),
    Limit("ns_per_event", 1e9 / 100e3, ours="overtake max age"),
)
CARS = 20
MAX_AGE_MS = 600_000
WINDOW_MS = 1000


@contextmanager
def sides(options: Options) -> Iterator[dict[str, Side]]:
    many = list(changes(CARS, round(50_000 * options.effort)))
    short = many[: round(1500 * options.effort)]
    five, file = list(_any_order(round(100 * options.effort))), _five()
    yield {
        "overtake": lambda: _ours(overtake(), many),
        "overtake max age": lambda: _ours(overtake(), many, MAX_AGE_MS),
        "short": lambda: _ours(overtake(), short),
        "short naive": lambda: _naive(overtake(), short),
        "five": lambda: _ours(file, five),
        "five naive": lambda: _naive(file, five),
    }


def _five() -> ChronicleFile:
    """Five events within a second; five of each are expected in it."""
    events = tuple(Event(EventType(f"a{number}", (), (ANY, "true")), TimePoint(f"t{number}")) for number in range(1, 6))
    return ChronicleFile((Chronicle("five", (), (), (*events, Distance("end", "start", Interval(0, WINDOW_MS)))),))


def _any_order(count: int) -> Iterator[Change]:
    rng = random.Random(1)
    now_ms = 0
    for _ in range(count):
        now_ms += rng.randrange(1, 2 * WINDOW_MS // 25)
        yield now_ms, f"a{rng.randrange(1, 6)}", (), "false", "true"


def _ours(file: ChronicleFile, events: Sequence[Change], max_age_ms: int | None = None) -> Figures:
    recogniser = Recogniser.of(file, max_age_ms=max_age_ms)
    on_change, found, most = recogniser.on_change, 0, 0
    gc.collect()
    began_ns = time.process_time_ns()
    for number, (at_ms, name, arguments, old, new) in enumerate(events):
        found += len(on_change(at_ms, name, arguments, old, new))
        if not number % 1000:
            most = max(most, recogniser.live)
    used_ns = time.process_time_ns() - began_ns
    return {
        **_speed(used_ns, len(events)),
        "found": found,
        "most live": max(most, recogniser.live),
        "of one binding": recogniser.live_of_one_binding,
        "cut off": len(recogniser.incomplete),
    }


def _naive(file: ChronicleFile, events: Sequence[Change]) -> Figures:
    chronicle = next(iter(file.chronicles.values()))
    peer = PartialInstances(chronicle, compile_chronicle(chronicle, file))
    gc.collect()
    began_ns = time.process_time_ns()
    found = sum(peer.on_change(event) for event in events)
    used_ns = time.process_time_ns() - began_ns
    return {**_speed(used_ns, len(events)), "found": found, "most live": peer.most, "of one binding": 0, "cut off": 0}


def _speed(used_ns: int, events: int) -> Figures:
    return {"ns_per_event": used_ns / events, "per_s": events * 1e9 / used_ns}
