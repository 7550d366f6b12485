"""The experiments of thesis 5.5, from the specifications it prints, and the same wiring as plain calls.

A delay is that of the thesis, of n streams the highest, which is that of the stream that is served last; over the
samples it is the median, not the average: a shared machine takes the processor away now and then. Total delay: available at the client minus valid time. Channel delay: from the put, by the source or, in
Figure 5.11, by the unit, to the client.
"""

import random
import time
from collections.abc import Callable, Mapping
from functools import partial
from statistics import correlation, linear_regression, median
from typing import NamedTuple, Protocol

from bench.instants import grid, wait_until
from bench.rows import Figures
from dyknow import Label, Network, Sample
from dyknow.kpl import Hooks, Instance, parse_specification
from dyknow.kpl.syntax.specification import FromSource, GeneratorDeclaration, Refinement, StreamDeclaration
from dyknow.network.prototypes import prototypes_in, value_unit

PERIOD_MS = 100


class Experiment(NamedTuple):
    """One figure: what is varied, and the specification for each value of it."""

    figure: str
    varied: str
    points: tuple[int, ...]
    text: Callable[[int], str]


def fluent_streams(n: int, generator: str = "gen", period_ms: int = PERIOD_MS) -> str:
    """`n` streams of one generator."""
    return "".join(f"stream strm{i} = {generator} with sample every {period_ms}\n" for i in range(1, n + 1))


def of_one_source(n: int) -> str:
    return "source int src\nstrmgen gen = src\n" + fluent_streams(n)


def of_sources(n: int, m: int = 19) -> str:
    """`m` streams of `n` sources, in turn."""
    made = "".join(f"source int src{i}\nstrmgen gen{i} = src{i}\n" for i in range(1, n + 1))
    return made + _in_turn(n, m)


def of_units(n: int, m: int = 30) -> str:
    """`m` streams: one to each of `n` units, the others from them, in turn."""
    made = "".join(f"strmgen gen{i} = CU(gen with sample every {PERIOD_MS})\n" for i in range(1, n + 1))
    return f"source int src\ncompunit int CU(int)\nstrmgen gen = src\n{made}" + _in_turn(n, m - n)


def _in_turn(n: int, m: int) -> str:
    return "".join(f"stream strm{i + 1} = gen{i % n + 1} with sample every {PERIOD_MS}\n" for i in range(m))


STREAMS = (1, *range(5, 51, 5))
EXPERIMENTS = (
    Experiment("5.7", "streams", STREAMS, of_one_source),
    Experiment("5.9", "sources", tuple(range(1, 20, 2)), of_sources),
    Experiment("5.11", "units", tuple(range(1, 16, 2)), of_units),
)


class Running(Protocol):
    """One experiment at one point, set up: every source puts a sample, and `found` says who got it when."""

    def put(self, valid_us: int) -> None: ...
    def found(self) -> list["Delivery"]: ...


class Delivery(NamedTuple):
    stream: str
    valid_us: int
    put_ns: int
    at_ns: int


class InInstance:
    """The specification, run."""

    def __init__(self, text: str) -> None:
        self._found: list[Delivery] = []
        self._put_ns = 0

        @value_unit("int", "int", name="CU")
        def copy(value: int) -> int:
            self._put_ns = time.monotonic_ns()
            return value

        self._instance = Instance(Network(), prototypes=prototypes_in([copy]), hooks=Hooks(on_output=self._on_output))
        self._instance.add(parse_specification(text), 0, text)
        self._sources = self._instance.sources()

    def put(self, valid_us: int) -> None:
        for source in self._sources:
            self._put_ns = time.monotonic_ns()
            self._instance.push(source, Sample(self._put_ns // 1000, valid_us, 1))

    def _on_output(self, name: str, sample: Sample) -> None:
        self._found.append(Delivery(name, sample.valid_us, self._put_ns, time.monotonic_ns()))

    def found(self) -> list[Delivery]:
        found, self._found = self._found, []
        return found


class ByCalls:
    """The peer: what the specification wires, as lists of functions; no policies, histories or names."""

    def __init__(self, text: str) -> None:
        self._found: list[Delivery] = []
        self._put_ns = 0
        declared = parse_specification(text)
        made = {each.label: each.made for each in declared if isinstance(each, GeneratorDeclaration)}
        clients: dict[Label, list[Callable[[Sample], None]]] = {label: [] for label in made}
        for each in declared:
            if isinstance(each, StreamDeclaration):
                clients[each.term.label].append(partial(self._on_output, each.name))
        for label, how in made.items():
            if isinstance(how, Refinement):
                clients[how.inputs[0].label].append(partial(self._copy, clients[label]))
        self._sources = [clients[label] for label, how in made.items() if isinstance(how, FromSource)]

    def put(self, valid_us: int) -> None:
        for clients in self._sources:
            self._put_ns = time.monotonic_ns()
            sample = Sample(self._put_ns // 1000, valid_us, 1)
            for client in clients:
                client(sample)

    def _copy(self, clients: list[Callable[[Sample], None]], sample: Sample) -> None:
        self._put_ns = time.monotonic_ns()
        for client in clients:
            client(sample)

    def _on_output(self, name: str, sample: Sample) -> None:
        self._found.append(Delivery(name, sample.valid_us, self._put_ns, time.monotonic_ns()))

    def found(self) -> list[Delivery]:
        found, self._found = self._found, []
        return found


def measured(running: Mapping[tuple[str, int], Running], samples: int) -> Figures:
    """Every experiment puts one sample per period, each at its own time of it."""
    step_us = PERIOD_MS * 1000 // len(running)
    turns = random.Random(1).sample(list(running.values()), len(running))  # what else happens every 100 ms hits any n
    for _, start_us in zip(range(samples), grid(PERIOD_MS * 1000, step_us // 2), strict=False):
        for at, each in enumerate(turns):
            wait_until(start_us + at * step_us)
            each.put(start_us + at * step_us)
    figures: Figures = {}
    for (figure, n), each in running.items():
        figures |= {f"{kind}_{figure}_n{n}_us": delay_us for kind, delay_us in delays(each.found(), samples).items()}
    return figures | slopes(figures)


def delays(found: list[Delivery], samples: int) -> Figures:
    """Of the stream served last, in microseconds; every stream must have had every sample."""
    streams: dict[str, list[Delivery]] = {}
    for each in found:
        streams.setdefault(each.stream, []).append(each)
    if not streams or any(len(got) != samples for got in streams.values()):
        raise ValueError(
            f"not every stream got {samples} samples: { {name: len(got) for name, got in streams.items()} }"
        )
    return {
        "total": max(median(each.at_ns / 1e3 - each.valid_us for each in got) for got in streams.values()),
        "channel": max(median((each.at_ns - each.put_ns) / 1e3 for each in got) for got in streams.values()),
    }


def slopes(figures: Figures) -> Figures:
    """Of each line through the points of a figure: microseconds per n, and the share of the variance it leaves."""
    found: Figures = {}
    for kind in ("total", "channel"):
        for figure in {metric.split("_")[1] for metric in figures if metric.startswith(f"{kind}_")}:
            ns, us = zip(*points(figures, kind, figure), strict=True)
            found[f"slope_{kind}_{figure}_us"] = linear_regression(ns, us).slope
            found[f"unexplained_{kind}_{figure}"] = 1 - correlation(ns, us) ** 2
    return found


def points(figures: Figures, kind: str, figure: str) -> list[tuple[int, float]]:
    """(n, delay in microseconds) of a curve, by n."""
    start = f"{kind}_{figure}_n"
    return sorted(
        (int(metric.removeprefix(start).removesuffix("_us")), value)
        for metric, value in figures.items()
        if metric.startswith(start)
    )
