"""A sending and a receiving process for each side, all alive during the row, one pair at work at a time."""

import os
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import NamedTuple

from bench.workers import Worker


class Pair(NamedTuple):
    sender: Worker
    receiver: Worker

    def paced(self, count: int, period_us: int, **collecting: int) -> dict[str, float]:
        self.receiver.begin("collect", count=count, **collecting)
        self.sender.call("pace", count=count, period_us=period_us)
        return dict(self.receiver.end())

    def on_grid(self, count: int, period_us: int, **collecting: int) -> dict[str, float]:
        """The same with every sample at a multiple of the period, as `sample every` wants it."""
        self.receiver.begin("collect_on_grid", count=count, period_us=period_us, **collecting)
        self.sender.call("put_on_grid", count=count, period_us=period_us)
        return dict(self.receiver.end())

    def linked(self) -> bool:
        """Whether samples come through; what was on its way has arrived after it."""
        self.receiver.begin("collect", count=10**9)
        self.sender.call("pace", count=5, period_us=20_000)
        return bool(self.receiver.end()["received"])

    def flooded(self, seconds: float) -> dict[str, float]:
        self.receiver.begin("collect", count=10**9)
        sent = self.sender.call("flood", seconds=seconds)
        return {**self.receiver.end(), **sent}


ATTEMPTS = 5
RAW = ("bench.wire.raw:Sender", "bench.wire.raw:Receiver")
EDGE = ("bench.wire.pipeline:EdgeSender", "bench.wire.pipeline:EdgeReceiver")
OURS = ("bench.wire.pipeline:Exporter", "bench.wire.pipeline:Importer")


@contextmanager
def pairs(row: str, kinds: dict[str, tuple[str, str]], **arguments: dict[str, object]) -> Iterator[dict[str, Pair]]:
    """Start every pair in a federation of its own, and wait until each is linked."""
    with ExitStack() as stack:
        found = {}
        for side, (sender, receiver) in kinds.items():
            federation = f"bench-{row}-{os.getpid()}-{side}"
            taking = stack.enter_context(Worker(receiver, {"federation": federation, **arguments.get(side, {})}))
            sending = stack.enter_context(Worker(sender, {"federation": federation}))
            found[side] = Pair(sending, taking)
        for side, pair in found.items():
            pair.receiver.call("ready")
            pair.sender.call("ready")
            if not any(pair.linked() for _ in range(ATTEMPTS)):
                raise TimeoutError(f"{side}: no sample comes through")
        yield found
