"""Counts of events that one member causes within a window: repeated ones are reported in bounds, and as repeated."""

from collections import deque
from typing import Final

REPORTS, REPORTS_US = 4, 4_000_000
"""Answers to acts of one member are reported at most so often within that time; the rest is answered and counted alone."""
PURSUES, PURSUES_US = 6, 60_000_000
"""A vehicle for which that number of manoeuvres began within that time may be following this one on purpose."""
MOST: Final = 256


class Often:
    """Events by unit within a sliding window of `window_us`; those of the units that were counted last are kept."""

    def __init__(self, most: int, window_us: int) -> None:
        self._most, self._window_us = most, window_us
        self._at_us: dict[str, deque[int]] = {}

    def count(self, unit: str, now_us: int) -> int:
        """Count one more; return how many there were within the window, at most one more than `most`."""
        times = self._at_us.pop(unit, None) or deque[int](maxlen=self._most + 1)
        self._at_us[unit] = times
        while len(self._at_us) > MOST:
            del self._at_us[next(iter(self._at_us))]
        while times and times[0] <= now_us - self._window_us:
            times.popleft()
        times.append(now_us)
        return len(times)

    def allows(self, unit: str, now_us: int) -> bool:
        """Whether one more is within bounds; it is counted only then."""
        times = self._at_us.get(unit)
        if times is not None and sum(at_us > now_us - self._window_us for at_us in times) >= self._most:
            return False
        self.count(unit, now_us)
        return True

    def forget(self, unit: str) -> None:
        """Begin to count that unit again."""
        self._at_us.pop(unit, None)
