"""Whether an act gets there and back sooner when it is sent express: by itself, at once."""

import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

from bench.rows import Bar, Options, Side
from bench.workers import Worker

TITLE = "200 B there and back by two puts, express or not"
BARS: tuple[Bar, ...] = ()


@contextmanager
def sides(options: Options) -> Iterator[dict[str, Side]]:
    count = round(200 * options.effort)
    with ExitStack() as stack:
        found: dict[str, Side] = {}
        for side, express in (("batched", False), ("express", True)):
            shared = {"federation": f"bench-{os.getpid()}-{side}", "express": express}
            first, second = (
                stack.enter_context(Worker("bench.wire.raw:Player", {**shared, "own": own, "other": other}))
                for own, other in (("0", "1"), ("1", "0"))
            )
            first.call("ready")
            second.call("ready")

            def run(first: Worker = first, second: Worker = second) -> dict[str, float]:
                second.begin("play", count=count)
                figures = first.call("hit", count=count)
                second.end()
                return dict(figures)

            found[side] = run
        yield found
