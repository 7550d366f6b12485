"""B1: how long one federated sample takes."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial

from bench.rows import Options, Ratio, Side
from bench.wire.pairs import EDGE, OURS, RAW, pairs

TITLE = "one federated sample, 1 kHz, 100 B (`edge`: without codec, streams and policies)"
BARS = (Ratio("p50_us", 1.2), Ratio("p99_us", 2.0))


@contextmanager
def sides(options: Options) -> Iterator[dict[str, Side]]:
    count = round(1000 * options.effort)
    with pairs("b01", {"raw": RAW, "edge": EDGE, "ours": OURS}) as found:
        yield {side: partial(pair.paced, count, 1000) for side, pair in found.items()}
