"""B13: how long until platforms that start together know each other."""

import itertools
import os
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from threading import Event

from bench.fleet.members import Member, prepare
from bench.rows import Above, Figures, Options, Side
from bench.wire.meshes import newcomers
from bench.wire.raw import PATIENCE_S
from dyknow.agents.directory.directory import DirectoryAgent

TITLE = "discovery: n opened at once, until every one holds the tokens (raw, edge) or the whole entries (ours) of all"
SIZES = (2, 8, 16)
BARS = tuple(Above(f"n{size}_ms", 200.0 if size > 8 else 50.0) for size in SIZES)
KINDS = {
    "raw": "bench.wire.meshes:RawNewcomer",
    "edge": "bench.wire.meshes:EdgeNewcomer",
    "ours": "bench.wire.b13:PlatformNewcomer",
}


@contextmanager
def sides(options: Options) -> Iterator[dict[str, Side]]:
    number, sizes = itertools.count(), {size: min(size, options.size(size, 3)) for size in SIZES}
    with ExitStack() as stack:
        found: dict[str, Side] = {}
        for side, what in KINDS.items():
            if options.wants(side):
                measure = stack.enter_context(newcomers(what, sizes))
                found[side] = partial(_measured, measure, number)
        yield found


def _measured(measure: Callable[[str], Figures], number: Iterator[int]) -> Figures:
    return measure(f"bench-b13-{os.getpid()}-{next(number)}")


class PlatformNewcomer:
    """A whole platform: session, declarations, heartbeat, and the description of every other one asked for and read."""

    def __init__(self, number: int) -> None:
        prepare()
        self._number = number

    def discover(self, federation: str, size: int, start_ns: int) -> float:
        """Milliseconds from the start until the directory holds all `size`, with their services and labels."""
        time.sleep(max(0, start_ns - time.monotonic_ns()) / 1e9)
        self._member = _Newcomer(str(self._number), federation, size)
        if not self._member.complete.wait(PATIENCE_S):
            raise TimeoutError(f"only {self._member.platform.part(DirectoryAgent).members} of {size} found")
        return (self._member.complete_ns - start_ns) / 1e6

    def leave(self) -> bool:
        self._member.close()
        return True


class _Newcomer(Member):
    def __init__(self, unit: str, federation: str, size: int) -> None:
        self._size, self.complete, self.complete_ns = size, Event(), 0
        super().__init__(unit, federation)

    def _stepped(self) -> None:
        if self.complete_ns or len(self.platform.part(DirectoryAgent).members) < self._size:
            return
        entries = self.platform.ports.directory.entries()
        if len(entries) == self._size and all(entry.labels for entry in entries):
            self.complete_ns = time.monotonic_ns()
            self.complete.set()
