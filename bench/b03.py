"""B3: what each further stream over one source costs, in another process (Figure 5.7)."""

from collections.abc import Iterator
from contextlib import contextmanager

from bench.experiments import STREAMS, slopes
from bench.pairs import OURS, RAW, Pair, pairs
from bench.rows import Figures, Limit, Options, Ratio, Side

TITLE = "fan-out: one source, n streams in another process, `sample every 20` (raw: one subscriber, n calls)"
BARS = (Ratio(f"p50_n{STREAMS[-1]}_us", 1.3), Limit("slope_us", 5.0))
PERIOD_US = 20_000


@contextmanager
def sides(options: Options) -> Iterator[dict[str, Side]]:
    count = max(5, round(50 * options.effort))

    def fanned(pair: Pair) -> Figures:
        figures: Figures = {}
        for n in STREAMS:
            found = pair.on_grid(count, PERIOD_US, streams=n)
            figures |= {
                f"p50_n{n}_us": found["p50_us"],
                f"total_5.7_n{n}_us": found["total_us"],
                f"channel_5.7_n{n}_us": found["channel_us"],
            }
        slope = (figures[f"p50_n{STREAMS[-1]}_us"] - figures[f"p50_n{STREAMS[0]}_us"]) / (STREAMS[-1] - STREAMS[0])
        return {"slope_us": slope, **figures, **slopes(figures)}

    with pairs("b03", {"raw": RAW, "ours": OURS}) as found:
        yield {side: lambda pair=pair: fanned(pair) for side, pair in found.items()}
