"""B19: drawn flights in the simulated world, judged by the true positions; each round has seeds of its own."""

from collections.abc import Iterator
from contextlib import contextmanager
from itertools import count, islice

from bench.campaign.running import run
from bench.campaign.tables import LATE_FACTOR, MEDIAN_FACTOR, quantile
from bench.rows import Figures, Limit, Options, Side

TITLE = "a campaign in the simulated world: pairs below 10 m, vehicles that do not arrive, time over time alone"
_BROKEN = ("breaches", "untold", "stuck", "violations")
BARS = (
    *(Limit(metric, 0.0) for metric in _BROKEN),
    Limit("factor", MEDIAN_FACTOR),
    Limit("factor_95", LATE_FACTOR),
    Limit("cpu_s_a_run", 10.0),
)
_SEEDS = 20
_SHORT = 2
"""The seed of a flight that is soon over."""


@contextmanager
def sides(options: Options) -> Iterator[dict[str, Side]]:
    numbers = count(options.size(1, _SHORT))

    def measured() -> Figures:
        runs = [run(seed) for seed in islice(numbers, max(1, round(_SEEDS * options.effort)))]
        factors = [factor for each in runs for factor in each.factors]
        figures = {metric: float(sum(len(getattr(each, metric)) for each in runs)) for metric in _BROKEN}
        return figures | {
            "factor": quantile(factors, 0.5),
            "factor_95": quantile(factors, 0.95),
            "cpu_s_a_run": sum(each.cpu_s for each in runs) / len(runs),
        }

    yield {"ours": measured}
