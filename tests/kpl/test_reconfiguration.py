"""Declarations come and go under a thousand streams at 10 Hz; those that stay get what they would have got."""

import random
from functools import partial

import pytest

from dyknow import Network, Sample, value_unit
from dyknow.errors import TextErrors
from dyknow.prototypes import prototypes_in
from kpl import Hooks, Instance, parse_specification

PERIOD_US = 100_000
START_US = 1_000_000
SOURCES, STREAMS = 100, 10
CHANGES = 10
"""In each period."""
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


def pass_time(network: Network, until_us: int) -> None:
    while (due_us := network.deadline_us) is not None and due_us <= until_us:
        network.on_time(max(due_us, network.now_us))


def run(instance: Instance, seconds: int, between: partial | None) -> None:
    apart_us = PERIOD_US // CHANGES
    next_us = START_US
    for now_us, source, valid_us in arrivals(seconds):
        while between is not None and next_us <= now_us:
            pass_time(instance.network, next_us)
            between(next_us)
            next_us += apart_us
        pass_time(instance.network, now_us)
        instance.push(f"src{source}", valid_us, valid_us // PERIOD_US // 3, now_us)
    pass_time(instance.network, START_US + (seconds + 1) * 1_000_000)


@pytest.mark.parametrize("seconds", PROFILES)
def test_no_sample_of_an_untouched_stream_is_lost_or_late_while_declarations_come_and_go(seconds: int) -> None:
    quiet, expected = begun()
    run(quiet, seconds, None)
    busy, found = begun()
    visits = Visits(busy, 3)
    run(busy, seconds, partial(visits.change))
    visits.leave(busy.network.now_us)
    assert visits.changes > seconds * 90 > visits.refused > 0
    untouched = {name: samples for name, samples in found.items() if name.startswith("strm")}
    assert len(untouched) == SOURCES * STREAMS
    assert untouched == expected
    for name, proxy in busy.streams.items():
        assert proxy.policy.satisfied_by(untouched[name]), name
        assert proxy.adapter.dropped == quiet.streams[name].adapter.dropped, name
    assert busy.network.labels() == quiet.network.labels()
    assert busy.specification == quiet.specification
