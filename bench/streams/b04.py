"""B4: the experiments of thesis 5.5 in one instance, as its specifications say."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from bench.rows import Limit, Options, Side
from bench.streams.experiments import EXPERIMENTS, ByCalls, InInstance, Running, measured

TITLE = "Figures 5.7, 5.9 and 5.11 in one instance, 10 Hz (calls: the same wiring as lists of functions)"
BARS = (
    Limit("slope_total_5.7_us", 5.0),
    Limit("slope_total_5.9_us", 10.0),
    Limit("slope_total_5.11_us", 10.0),
)
COMPARED = tuple(f"{kind}_{each.figure}_n{each.points[-1]}_us" for each in EXPERIMENTS for kind in ("total", "channel"))


@contextmanager
def sides(options: Options) -> Iterator[dict[str, Side]]:
    samples = max(2, round(20 * options.effort))

    def side(kind: Callable[[str], Running]) -> Side:
        running = {(each.figure, n): kind(each.text(n)) for each in EXPERIMENTS for n in each.points}
        return lambda: measured(running, samples)

    yield {"calls": side(ByCalls), "ours": side(InInstance)}
