"""B20: orders to keep apart in an hour of flight in which no vehicle comes near another; each round has seeds of its own."""

from collections.abc import Iterator
from contextlib import contextmanager
from itertools import islice

from bench.needless.__main__ import AN_HOUR, an_hour
from bench.needless.passing import GEOMETRIES, passed, seeds
from bench.rows import Figures, Limit, Options, Side

TITLE = "harmless passings (lanes 50 m apart, hovering aside, crossing behind, above): orders to keep apart in an hour"
BARS = (Limit("orders_an_hour", AN_HOUR),)
_FLIGHTS = 20


@contextmanager
def sides(options: Options) -> Iterator[dict[str, Side]]:
    numbers = seeds()

    def measured() -> Figures:
        flights = max(options.size(len(GEOMETRIES), 1), round(_FLIGHTS * options.effort))
        found = [passed(seed) for seed in islice(numbers, flights)]
        return {
            "orders_an_hour": an_hour(found),
            "hours": sum(each.flown_s for each in found) / 3600.0,
            "least_m": min(each.least_m for each in found),
        }

    yield {"ours": measured}
