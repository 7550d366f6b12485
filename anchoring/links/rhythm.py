"""How often a kind of percept comes, learnt from the gaps between samples of one percept."""

from collections import deque
from statistics import median
from typing import Final

from dyknow import US_PER_S

LEAST_PERIOD_US: Final = 10_000
MOST_PERIOD_US: Final = 2 * US_PER_S
LEAST_SILENCE_US: Final = 250_000
UNKNOWN_SILENCE_US: Final = 2 * US_PER_S
_REMEMBERED: Final = 31
_PERIODS_SILENT: Final = 2.5


class Rhythm:
    """The sample period of one type of percepts.

    Args:
        period_us: if it is known; None: the median of the latest gaps.
        silence_us: percepts without a sample for so long have ended; None: two and a half periods, at least 250 ms.
    """

    def __init__(self, period_us: int | None = None, silence_us: int | None = None) -> None:
        self.period_us = period_us
        self._given_silence_us = silence_us
        self._is_known = period_us is not None
        self._gaps: deque[int] = deque(maxlen=_REMEMBERED)

    def observe(self, gap_us: int) -> None:
        """The time between two samples of one percept."""
        if not self._is_known:
            self._gaps.append(gap_us)
            self.period_us = min(MOST_PERIOD_US, max(LEAST_PERIOD_US, round(median(self._gaps))))

    @property
    def silence_us(self) -> int:
        """A percept without a sample for longer than this has ended."""
        if self._given_silence_us is not None:
            return self._given_silence_us
        if self.period_us is None:
            return UNKNOWN_SILENCE_US
        return max(LEAST_SILENCE_US, round(_PERIODS_SILENT * self.period_us))
