"""B3: what each further stream over one source costs."""

from collections.abc import Iterator
from contextlib import contextmanager

from bench.pairs import OURS, RAW, Pair, pairs
from bench.rows import Limit, Options, Ratio, Side

TITLE = "fan-out: one source, the last of n streams in another process, 50 Hz (raw: one subscriber, n calls)"
STREAMS = (1, 10, 25, 50)
BARS = (Ratio(f"p50_n{STREAMS[-1]}_us", 1.3), Limit("slope_us", 5.0))


@contextmanager
def sides(options: Options) -> Iterator[dict[str, Side]]:
    count = round(50 * options.effort)

    def fanned(pair: Pair) -> dict[str, float]:
        found = {n: pair.paced(count, 20_000, streams=n)["p50_us"] for n in STREAMS}
        slope = (found[STREAMS[-1]] - found[STREAMS[0]]) / (STREAMS[-1] - STREAMS[0])
        return {**{f"p50_n{n}_us": value for n, value in found.items()}, "slope_us": slope}

    with pairs("b03", {"raw": RAW, "ours": OURS}) as found:
        yield {side: lambda pair=pair: fanned(pair) for side, pair in found.items()}
