"""Declarations come and go under a thousand streams at 10 Hz; those that stay get what they would have got."""

import random
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass

import pytest

from dyknow import Network, Sample, value_unit
from dyknow.kpl import Hooks, Instance, parse_specification
from dyknow.model.errors import TextErrors
from dyknow.network.prototypes import prototypes_in
from dyknow.runtime.loop import BATCH
from tests.satisfaction import satisfied

PERIOD_US = 100_000
START_US = 1_000_000
SOURCES, STREAMS = 100, 10
CHANGES = 10
"""In each period."""
TAKES_US = 10
"""For one sample."""
PROFILES = [pytest.param(6, id="tenth"), pytest.param(60, id="bar", marks=pytest.mark.full)]
POLICIES = (
    "any update",
    "sample every 100",
    "sample every 100, max delay 20",
    "sample every 200, max delay 100",
    "any change",
    "max delay 10",
    "strict order",
    "sample every 100, max delay 30, from 1000, use most recent",
    "sample every 50, use linear",
    "monotone order, from 2000 to 4000",
)


@value_unit("int", "int")
def copied(value: int) -> int:
    return value


@value_unit("int", "int", "int")
def added(one: int, other: int) -> int:
    return one + other


def specification(source: int) -> str:
    """One source and ten streams, one of them over a chain of two units."""
    streams = "".join(
        f"stream strm{source}_{i} = gen{source} with {policy}\n" for i, policy in enumerate(POLICIES[:-1])
    )
    return (
        f"source int src{source}\nstrmgen gen{source} = src{source}\n{streams}"
        f"strmgen first{source} = copied(gen{source} with max delay 50)\n"
        f"strmgen second{source} = copied(first{source} with {POLICIES[-1]})\n"
        f"stream strm{source}_{STREAMS - 1} = second{source}\n"
    )


def visitor(number: int, draw: random.Random) -> list[str]:
    """What comes and goes: streams, units, states and monitors over what stays, and sources of its own."""
    one, other = draw.sample(range(SOURCES), 2)
    period = draw.choice((50, 100, 300))
    policy = "sample every 100, max delay 50"
    return draw.choice(
        [
            [f"stream more{number} = gen{one} with sample every {period}, max delay 100"],
            [f"stream more{number} = second{one}", f"stream less{number} = first{other} with any change"],
            [
                f"strmgen sum{number} = added(gen{one}, first{other} with sample every {period})",
                f"stream more{number} = sum{number} with from 1000",
            ],
            [
                f"strmgen both{number} = state(gen{one} with {policy}, gen{other} with {policy})",
                f"stream more{number} = both{number}",
            ],
            [f"monitor calm{number} = always gen{one} < 5 with sample every 100"],
            [
                f"source int new{number}",
                f"strmgen own{number} = new{number}",
                f"stream more{number} = own{number}",
            ],
        ]
    )


def begun() -> tuple[Instance, dict[str, list[Sample]]]:
    found: dict[str, list[Sample]] = {}
    hooks = Hooks(on_output=lambda name, sample: found.setdefault(name, []).append(sample))
    instance = Instance(Network(history=64), prototypes=prototypes_in([copied, added]), hooks=hooks)
    declared = [each for source in range(SOURCES) for each in parse_specification(specification(source))]
    instance.add(declared, START_US)
    return instance, found


class Visits:
    """Adds what is not there and removes what is, at random."""

    def __init__(self, instance: Instance, seed: int) -> None:
        self._instance, self._draw = instance, random.Random(seed)
        self._there: list[tuple] = []
        self.changes = self.refused = 0

    def change(self, now_us: int) -> None:
        self.changes += 1
        if len(self._there) > self._draw.randrange(20):
            self._instance.remove(self._there.pop(self._draw.randrange(len(self._there))), now_us)
            return
        declared = parse_specification("\n".join(visitor(self.changes, self._draw)))
        try:
            self._instance.add(declared, now_us)
            self._there.append(declared)
        except TextErrors:
            self.refused += 1  # it would begin before what is held

    def leave(self, now_us: int) -> None:
        self._instance.remove([each for declared in self._there for each in declared], now_us)


def arrivals(seconds: int) -> list[tuple[int, int, int]]:
    """(arrival, source, valid time) of all samples, by arrival: most punctual, some late, some lost."""
    draw = random.Random(7)
    found = []
    for tick in range(seconds * 1_000_000 // PERIOD_US):
        for source in range(SOURCES):
            late_us = draw.choice((0, 0, 0, 500, 5_000, 15_000, 25_000, 60_000, 120_000))
            if draw.random() > 0.02:
                valid_us = START_US + tick * PERIOD_US
                found.append((valid_us + late_us + source, source, valid_us))
    return sorted(found)


@dataclass
class Node:
    """The node's loop with a clock of its own: inputs first, then timers; it may stand still for a while."""

    instance: Instance
    between: Callable[[int], None] | None
    stands_still_us: int = 0
    now_us: int = START_US

    def run(self, seconds: int) -> None:
        waiting = deque(arrivals(seconds))
        end_us = START_US + (seconds + 2) * 1_000_000
        change_us = START_US if self.between else end_us
        stop_us = START_US + seconds * 500_000 if self.stands_still_us else end_us
        while self.now_us < end_us:
            more = self._take(waiting)
            due_us = self._timers() or end_us
            if more:
                continue
            if self.between is not None and change_us <= self.now_us:
                self.between(self.now_us)
                change_us = self.now_us + PERIOD_US // CHANGES
                due_us = self.instance.network.deadline_us or end_us
            if stop_us <= self.now_us:
                self.now_us, stop_us = self.now_us + self.stands_still_us, end_us
            else:
                arrival_us = waiting[0][0] if waiting else end_us
                self.now_us = max(self.now_us, min(arrival_us, due_us, change_us, stop_us))

    def _take(self, waiting: deque[tuple[int, int, int]]) -> bool:
        """What came, at most a batch; whether more may wait."""
        taken = 0
        while taken < BATCH and waiting and waiting[0][0] <= self.now_us:
            _, source, valid_us = waiting.popleft()
            self.instance.push(f"src{source}", Sample(self.now_us, valid_us, valid_us // PERIOD_US // 3))
            self.now_us += TAKES_US
            taken += 1
        return taken == BATCH

    def _timers(self) -> int | None:
        """What is due; when something will be."""
        network = self.instance.network
        due_us = network.deadline_us
        if due_us is None or due_us > self.now_us:
            return due_us
        network.on_time(self.now_us)
        return network.deadline_us


@pytest.mark.parametrize("seconds", PROFILES)
def test_no_sample_of_an_untouched_stream_is_lost_or_late_while_declarations_come_and_go(seconds: int) -> None:
    changes, refused = same_with_and_without_changes(seconds)
    assert changes > seconds * 90 > refused > 0


@pytest.mark.parametrize("stands_still_us", [100_000, pytest.param(500_000, marks=pytest.mark.full), 1_000_000])
def test_what_a_node_that_stood_still_during_a_change_delivers_satisfies_its_policy(stands_still_us: int) -> None:
    """What waited until it was later than its policy allows is dropped as late and counted, and nothing else is."""
    same_with_and_without_changes(1, stands_still_us)


def same_with_and_without_changes(seconds: int, stands_still_us: int = 0) -> tuple[int, int]:
    """How often declarations changed, and how often that was refused."""
    quiet, expected = begun()
    Node(quiet, None, stands_still_us).run(seconds)
    busy, found = begun()
    visits = Visits(busy, 3)
    Node(busy, visits.change, stands_still_us).run(seconds)
    visits.leave(busy.network.now_us)
    untouched = {name: samples for name, samples in found.items() if name.startswith("strm")}
    assert untouched == expected
    pushed = Counter(f"src{source}" for _, source, _ in arrivals(seconds))
    for name, proxy in busy.streams.items():
        policy, dropped = proxy.policy, proxy.adapter.dropped
        assert satisfied(policy, expected.get(name, ())), name
        assert dropped == quiet.streams[name].adapter.dropped, name
        assert policy.max_delay_us is not None or not dropped["late"], name
        if policy.approximation == "none" and proxy.label.feature.startswith("gen"):
            assert len(expected.get(name, ())) + dropped.total() == pushed[f"src{proxy.label.feature[3:]}"], name
    assert len(busy.streams) == SOURCES * STREAMS
    assert busy.network.labels() == quiet.network.labels()
    assert busy.specification == quiet.specification
    return visits.changes, visits.refused
