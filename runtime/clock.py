"""The node's clock: UTC when the process started, monotonic from then on, so that time never jumps or goes back."""

import time
from collections import deque
from collections.abc import Callable, Iterable
from typing import Final

READINGS: Final = 8


class NodeClock:
    """Microseconds since the Unix epoch.

    Args:
        skew_us: the error of the clock; for tests of a federation with wrong clocks.
    """

    def __init__(self, skew_us: int = 0) -> None:
        self._offset_ns = _utc_minus_monotonic_ns() + skew_us * 1000

    @property
    def monotonic_offset_us(self) -> int:
        """This clock minus the monotonic clock of the machine."""
        return self._offset_ns // 1000

    def now_us(self) -> int:
        return (time.monotonic_ns() + self._offset_ns) // 1000


def _utc_minus_monotonic_ns() -> int:
    """By the least interrupted of some readings: between two clocks a busy machine may run something else for milliseconds."""
    return min(_reading() for _ in range(READINGS))[1]


def _reading() -> tuple[int, int]:
    """How long it took, and UTC minus the monotonic clock, both in nanoseconds."""
    before_ns, utc_ns, after_ns = time.monotonic_ns(), time.time_ns(), time.monotonic_ns()
    return after_ns - before_ns, utc_ns - (before_ns + after_ns) // 2


class Stopwatch:
    """Federation time within a step; its readings can be kept for a journal, and are repeated in a replay.

    Args:
        federation_us: the clock.
        keeps: whether `taken` is wanted.
    """

    def __init__(self, federation_us: Callable[[], int], *, keeps: bool = False) -> None:
        self._federation_us, self._keeps = federation_us, keeps
        self._shown: list[int] = []

    def now_us(self) -> int:
        """The present reading."""
        now_us = self._federation_us()
        if self._keeps:
            self._shown.append(now_us)
        return now_us

    def taken(self) -> tuple[int, ...]:
        """The readings since the last call."""
        taken, self._shown = tuple(self._shown), []
        return taken


class ReplayedStopwatch:
    """Shows again what a stopwatch showed in each step that is replayed."""

    def __init__(self) -> None:
        self._ahead: deque[int] = deque()
        self._last_us = 0

    def expect(self, shown: Iterable[int]) -> None:
        """Give the readings of the next step."""
        self._ahead = deque(shown)

    def now_us(self) -> int:
        """The recorded reading; a missing one repeats the last."""
        if self._ahead:
            self._last_us = self._ahead.popleft()
        return self._last_us
