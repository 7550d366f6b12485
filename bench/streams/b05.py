"""B5: in-process delivery through a policy, one core."""

import gc
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from bench.rows import Figures, Limit, Options, Ratio, Side
from dyknow import Label, Network, Policy, Sample, Sort
from dyknow.kpl import Hooks, Instance, parse_specification

TITLE = "one core, delivery to one consumer (bare: make a sample and call a function; call: the call alone)"
BARS = (
    Limit("ns_per_sample", 1e9 / 500e3, ours="any update"),
    Limit("ns_per_sample", 1e9 / 300e3, ours="sample every"),
    Ratio("ns_per_sample", 4.0, ours="any update", peer="bare"),
    Ratio("ns_per_sample", 4.0, ours="sample every", peer="bare"),
)
PERIOD_US = 1000
_LABEL = Label("gen")


@contextmanager
def sides(options: Options) -> Iterator[dict[str, Side]]:
    count = round(50_000 * options.effort)
    yield {
        "call": lambda: _timed(_call, count),
        "bare": lambda: _timed(_bare, count),
        "any update": lambda: _timed(_network("any update"), count),
        "sample every": lambda: _timed(_network("sample every 1"), count),
        "kpl any update": lambda: _timed(_specified("any update"), count),
        "kpl sample every": lambda: _timed(_specified("sample every 1"), count),
    }


Feed = Callable[[range], None]


def _timed(feed: Feed, count: int) -> Figures:
    gc.collect()
    began_ns = time.process_time_ns()
    feed(range(0, count * PERIOD_US, PERIOD_US))
    used_ns = time.process_time_ns() - began_ns
    return {"ns_per_sample": used_ns / count, "per_s": count * 1e9 / used_ns}


def _call(times: range) -> None:
    def consumer(available_us: int, valid_us: int, value: object) -> None:
        pass

    for now_us in times:
        consumer(now_us, now_us, 1)


def _bare(times: range) -> None:
    for now_us in times:
        _consumer(Sample(now_us, now_us, 1))


def _network(policy: str) -> Feed:
    network = Network()
    network.add_source(_LABEL, Sort("int", is_open=True))
    network.connect(_LABEL, Policy.parse(policy), _consumer)

    def feed(times: range) -> None:
        push = network.push
        for now_us in times:
            push(_LABEL, Sample(now_us, now_us, 1))

    return feed


def _specified(policy: str) -> Feed:
    instance = Instance(Network(), hooks=Hooks(on_output=_on_output))
    instance.add(parse_specification(f"source int src\nstrmgen gen = src\nstream out = gen with {policy}\n"), 0)

    def feed(times: range) -> None:
        push = instance.push
        for now_us in times:
            push("src", Sample(now_us, now_us, 1))

    return feed


def _consumer(_sample: Sample) -> None:
    pass


def _on_output(_name: str, _sample: Sample) -> None:
    pass
