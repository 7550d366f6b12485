"""B16: declarations come and go in a running instance, and streams that are not touched lose nothing."""

import random
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import count

from bench.instants import wait_until
from bench.rows import Figures, Limit, Options, Side
from bench.wire.raw import latencies
from dyknow import Network, Sample
from dyknow.kpl import Hooks, Instance, parse_specification
from dyknow.kpl.syntax.specification import Declaration
from dyknow.network.prototypes import prototypes_in, value_unit

TITLE = "1000 streams at 10 Hz, `sample every 100, max delay 100`, while declarations come and go as fast as they can"
BARS = (
    Limit("lost", 0.0, ours="changing"),
    Limit("late", 0.0, ours="changing"),
    Limit("worst_ms", 100.0, ours="changing"),
)
SOURCES, STREAMS, PERIOD_US = 100, 10, 100_000
POLICY = "sample every 100, max delay 100"


@value_unit("int", "int")
def copied(value: int) -> int:
    return value


@contextmanager
def sides(options: Options) -> Iterator[dict[str, Side]]:
    periods = max(2, round(40 * options.effort))
    still, changing = Loaded(), Loaded()
    yield {"still": lambda: still.run(periods, changes=False), "changing": lambda: changing.run(periods, changes=True)}


class Loaded:
    """The instance, in a loop as a node's: what is due first, and a change where nothing is.

    A sample for which the loop comes later than its policy's max delay is dropped and counted by the stream: `late`.
    What is neither delivered nor counted is `lost`. The longest change is told by the clock and by what the thread
    computed: the rest of the time something else had the processor.
    """

    def __init__(self) -> None:
        self._found: Counter[str] = Counter()
        self._late_ns: list[int] = []
        self._instance = Instance(Network(), prototypes=prototypes_in([copied]), hooks=Hooks(on_output=self._on_output))
        self._instance.add([each for i in range(SOURCES) for each in parse_specification(_of_source(i))], 0)
        self._visitors: list[Sequence[Declaration]] = []
        self._draw, self._numbers = random.Random(1), count()

    def run(self, periods: int, *, changes: bool) -> Figures:
        self._found.clear()
        self._late_ns.clear()
        took_ns: list[int] = []
        computed_ns: list[int] = []
        late_before = self._late_samples()
        start_us = (time.monotonic_ns() // 1000 // PERIOD_US + 1) * PERIOD_US
        step_us = PERIOD_US // SOURCES
        for each in range(periods * SOURCES):
            due_us = start_us + each * step_us
            while changes and time.monotonic_ns() < due_us * 1000:
                began_ns, began_cpu_ns = time.monotonic_ns(), time.thread_time_ns()
                self._change(began_ns // 1000)
                took_ns.append(time.monotonic_ns() - began_ns)
                computed_ns.append(time.thread_time_ns() - began_cpu_ns)
            wait_until(due_us)
            self._instance.push(f"src{each % SOURCES}", Sample(time.monotonic_ns() // 1000, due_us, 1))
        missing = sum(periods - self._found[f"strm{i}_{j}"] for i in range(SOURCES) for j in range(STREAMS))
        late = self._late_samples() - late_before
        delay = latencies(self._late_ns)
        return {
            "lost": float(missing - late),
            "late": float(late),
            "p50_us": delay["p50_us"],
            "p99_us": delay["p99_us"],
            "worst_ms": max(self._late_ns) / 1e6,
            "changes_per_s": len(took_ns) / (periods * PERIOD_US / 1e6),
            "change_ms": latencies(took_ns)["p50_us"] / 1e3,
            "longest_change_ms": max(took_ns, default=0) / 1e6,
            "most_computed_ms": max(computed_ns, default=0) / 1e6,
        }

    def _late_samples(self) -> int:
        streams = self._instance.streams.items()
        return sum(proxy.adapter.dropped["late"] for name, proxy in streams if name.startswith("strm"))

    def _change(self, now_us: int) -> None:
        if len(self._visitors) > self._draw.randrange(20):
            self._instance.remove(self._visitors.pop(self._draw.randrange(len(self._visitors))), now_us)
            return
        number, one = next(self._numbers), self._draw.randrange(SOURCES)
        made = f"strmgen copy{number} = copied(gen{one} with {POLICY})\nstream more{number} = copy{number}\n"
        declared = parse_specification(made)
        self._instance.add(declared, now_us)
        self._visitors.append(declared)

    def _on_output(self, name: str, sample: Sample) -> None:
        if name.startswith("strm"):
            self._late_ns.append(time.monotonic_ns() - sample.valid_us * 1000)
            self._found[name] += 1


def _of_source(i: int) -> str:
    streams = "".join(f"stream strm{i}_{j} = gen{i} with {POLICY}\n" for j in range(STREAMS))
    return f"source int src{i}\nstrmgen gen{i} = src{i}\n{streams}"
