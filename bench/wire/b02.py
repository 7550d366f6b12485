"""B2: how many federated samples go through in a second."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial

from bench.rows import Options, Ratio, Side
from bench.wire.pairs import EDGE, OURS, RAW, pairs

TITLE = "sustained rate of federated samples, 100 B"
BARS = (Ratio("rate_per_s", 0.5, at_least=True),)


@contextmanager
def sides(options: Options) -> Iterator[dict[str, Side]]:
    with pairs("b02", {"raw": RAW, "edge": EDGE, "ours": OURS}) as found:
        yield {side: partial(pair.flooded, options.effort) for side, pair in found.items()}
