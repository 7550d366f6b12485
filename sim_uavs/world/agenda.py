"""Time that moves from one appointment to the next: the clock and the queue of the simulated world."""

from collections.abc import Callable
from heapq import heappop, heappush
from typing import Any


class Agenda:
    """Events to come, in order of time; those of one instant in the order in which they were entered.

    Attributes:
        now_us: the world's time. No platform sees it: each has a clock of its own.
    """

    __slots__ = ("_count", "_queue", "now_us")

    def __init__(self, now_us: int) -> None:
        self.now_us = now_us
        self._count = 0
        self._queue: list[tuple[int, int, Callable[..., None], tuple[Any, ...]]] = []

    def __len__(self) -> int:
        return len(self._queue)

    def at(self, at_us: int, action: Callable[..., None], *arguments: Any) -> None:
        """Have `action(*arguments)` happen at `at_us`, or now if that is over."""
        self._count += 1
        heappush(self._queue, (at_us, self._count, action, arguments))

    def run_until(self, until_us: int) -> None:
        """Let everything happen that is due by then."""
        queue = self._queue
        while queue and queue[0][0] <= until_us:
            at_us, _, action, arguments = heappop(queue)
            self.now_us = max(self.now_us, at_us)
            action(*arguments)
        self.now_us = max(self.now_us, until_us)
