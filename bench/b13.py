"""B13: how long until platforms that start together know each other."""

import itertools
import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

from bench.meshes import newcomers
from bench.rows import Above, Options, Side

TITLE = "discovery: n sessions opened at once, until every one holds the tokens of all"
SIZES = (2, 8, 16)
BARS = tuple(Above(f"n{size}_ms", 50.0, ours="edge") for size in SIZES)
KINDS = {"raw": "bench.meshes:RawNewcomer", "edge": "bench.meshes:EdgeNewcomer"}


@contextmanager
def sides(options: Options) -> Iterator[dict[str, Side]]:
    number = itertools.count()
    with ExitStack() as stack:
        found: dict[str, Side] = {}
        for side, what in KINDS.items():
            if options.wants(side):
                measure = stack.enter_context(newcomers(what, SIZES))
                found[side] = lambda measure=measure: measure(f"bench-b13-{os.getpid()}-{next(number)}")
        yield found
