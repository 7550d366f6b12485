"""Many events for many cars: memory stays where it is, and what is recognised is told at the earliest clock."""

import os
from collections.abc import Callable, Iterable
from pathlib import Path

import pytest

from bench.formulas.traffic import Change, changes, overtake, turns
from dyknow.kpl.syntax.chronicles import parse_chronicles
from dyknow.reasoning.chronicles import ChronicleFile, Recogniser
from tests.thesis.reasoning.test_chronicles import BEHIND_THEN_IN_FRONT, LEFT_TURN, PREDICTED

CARS = 50
SIZES = [pytest.param(20_000, id="fiftieth"), pytest.param(1_000_000, id="bar", marks=pytest.mark.full)]
ALLOWED_KB = 8 * 1024
PAGE_KB = os.sysconf("SC_PAGE_SIZE") // 1024


def resident_kb() -> int:
    return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1]) * PAGE_KB


def relations(count: int) -> Iterable[Change]:
    for at_ms, name, arguments, old, new in changes(CARS, count):
        yield at_ms, name if name == "road" else f"car_relations.{name}", arguments, old, new


RUNS: dict[str, tuple[ChronicleFile, Callable[[int], Iterable[Change]]]] = {
    "overtakes of 8.3.13": (overtake(), lambda count: changes(CARS, count)),
    "overtakes of 8.7.5": (parse_chronicles(BEHIND_THEN_IN_FRONT), relations),
    "both turns of 8.7.4": (parse_chronicles(LEFT_TURN + PREDICTED), lambda count: turns(CARS, round(1.3 * count))),
}


@pytest.mark.timeout(1_200)
@pytest.mark.parametrize("count", SIZES)
@pytest.mark.parametrize("run", RUNS)
def test_memory_stays_where_it_is_and_all_is_told_at_the_earliest_clock(run: str, count: int) -> None:
    """All intervals of these chronicles end with their events: the last event that fixes an instant settles them."""
    file, events = RUNS[run]
    engine = Recogniser.of(file)
    told, most, after_kb = 0, 0, 0
    for number, event in enumerate(events(count), 1):
        for instance in engine.on_change(*event):
            told += 1
            assert instance.recognised_ms == event[0] == max(instance.instants.values())
        if number == count // 10:
            after_kb = resident_kb()
        if not number % 1_000:
            most = max(most, engine.live)
    assert engine.events >= count
    assert told > count / 1_000
    assert not engine.incomplete
    assert not engine.ignored
    assert most < 4 * 8192
    assert engine.live_of_one_binding <= 2 * 16
    assert resident_kb() - after_kb < ALLOWED_KB
