"""B3: what each further stream over one source costs, in another process (Figure 5.7)."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial

from bench.rows import Figures, Limit, Options, Ratio, Side
from bench.streams.experiments import STREAMS, slopes
from bench.wire.pairs import OURS, RAW, Pair, pairs

TITLE = "fan-out: one source, n streams in another process, `sample every 20` (raw: one subscriber, n calls)"
BARS = (Ratio(f"p50_n{STREAMS[-1]}_us", 1.3), Limit("slope_us", 5.0))
COMPARED = tuple(f"{kind}_n{STREAMS[-1]}_us" for kind in ("p50", "channel_5.7"))
PERIOD_US = 20_000


@contextmanager
def sides(options: Options) -> Iterator[dict[str, Side]]:
    count = max(5, round(50 * options.effort))
    streams = STREAMS[:: options.size(1, (len(STREAMS) - 1) // 2)]

    def fanned(pair: Pair) -> Figures:
        figures: Figures = {}
        for n in streams:
            found = pair.on_grid(count, PERIOD_US, streams=n)
            figures |= {
                f"p50_n{n}_us": found["p50_us"],
                f"total_5.7_n{n}_us": found["total_us"],
                f"channel_5.7_n{n}_us": found["channel_us"],
            }
        slope = (figures[f"p50_n{STREAMS[-1]}_us"] - figures[f"p50_n{STREAMS[0]}_us"]) / (STREAMS[-1] - STREAMS[0])
        return {"slope_us": slope, **figures, **slopes(figures)}

    with pairs("b03", {"raw": RAW, "ours": OURS}) as found:
        yield {side: partial(fanned, pair) for side, pair in found.items()}
