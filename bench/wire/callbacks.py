"""Which kind of Zenoh callback an edge should use: `plain` (a thread and a queue each) or `direct` (Zenoh's thread)."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial

from bench.rows import Bar, Options, Side
from bench.wire.pairs import RAW, Pair, pairs

TITLE = "plain and direct callbacks: hand-over at 1 kHz, then flood"
BARS: tuple[Bar, ...] = ()


@contextmanager
def sides(options: Options) -> Iterator[dict[str, Side]]:
    count = round(1000 * options.effort)

    def both(pair: Pair) -> dict[str, float]:
        paced, flooded = pair.paced(count, 1000), pair.flooded(options.effort)
        return {"p50_us": paced["p50_us"], "p99_us": paced["p99_us"], "rate_per_s": flooded["rate_per_s"]}

    kinds = dict.fromkeys(("plain", "direct"), RAW)
    with pairs("callbacks", kinds, plain={"callback": "plain"}, direct={"callback": "direct"}) as found:
        yield {side: partial(both, pair) for side, pair in found.items()}
