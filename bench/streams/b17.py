"""B17: what batch and train processing buy at a host (thesis 5.3), beside the same units in the instance itself."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import partial

from bench.rows import Figures, Options, Ratio, Side
from bench.streams.hosting import Measured, site

TITLE = (
    "a chain of three light units at a host: 200 Hz, then flood; plain, in batches of 64, as a train, and in the node"
)
SIDES: dict[str, tuple[str, ...]] = {"plain": (), "batch": ("--batch", "64"), "train": ("--train",)}
BATCH = 64
BARS = (
    Ratio("cpu_us", 1.0, ours="batch", peer="plain"),
    Ratio("rate_per_s", 1.0, ours="batch", peer="plain", at_least=True),
    Ratio("p50_us", 1.0, ours="train", peer="plain"),
    Ratio("cpu_us", 1.0, ours="train", peer="plain"),
    Ratio("rate_per_s", 1.0, ours="train", peer="plain", at_least=True),
)


@contextmanager
def sides(options: Options) -> Iterator[dict[str, Side]]:
    paced, flooded = (-(-round(count * options.effort) // BATCH) * BATCH for count in (200, 20_000))

    def run(measured: Measured) -> Figures:
        """A batch is waited for: whole ones, so that the last samples come through."""
        return {**measured.paced(paced, 5000), **measured.flooded(flooded)}

    with ExitStack() as stack:
        found: dict[str, Side] = {}
        for name in (*SIDES, "node"):
            if options.wants(name):
                measured = stack.enter_context(site(*SIDES.get(name, ()), hosted=name in SIDES))
                found[name] = partial(run, measured)
        yield found
