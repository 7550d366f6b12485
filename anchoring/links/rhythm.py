"""How often a kind of percept comes, learnt from the gaps between samples of one percept."""

from collections import deque
from itertools import islice
from statistics import median
from typing import Final

from dyknow import US_PER_S

LEAST_PERIOD_US: Final = 10_000
MOST_PERIOD_US: Final = 2 * US_PER_S
LEAST_SILENCE_US: Final = 250_000
UNKNOWN_SILENCE_US: Final = 2 * US_PER_S
_REMEMBERED: Final = 31
_REMEMBERED_OF_ONE: Final = 2
_PERIODS_SILENT: Final = 2.5


class Rhythm:
    """The sample periods of one type of percepts.

    Percepts of one type may have different periods: a percept that comes again soon after it had ended by silence has a
    longer period than the others.

    Args:
        period_us: if it is known; None: the median of the latest gaps.
        silence_us: percepts without a sample for so long have ended; None: two and a half periods, at least 250 ms.
    """

    def __init__(self, period_us: int | None = None, silence_us: int | None = None) -> None:
        self.period_us = period_us
        self._given_silence_us = silence_us
        self._is_known = period_us is not None
        self._gaps: deque[int] = deque(maxlen=_REMEMBERED)
        self._own_gaps: dict[str, deque[int]] = {}
        self._latest_us: dict[str, int] = {}

    def on_sample(self, symbol: str, now_us: int) -> None:
        """A percept has a sample; times do not go backwards."""
        before_us = self._latest_us.pop(symbol, None)
        self._latest_us[symbol] = now_us
        if before_us is not None and now_us - before_us <= MOST_PERIOD_US:
            self._on_gap(symbol, now_us - before_us)
        for old, old_us in list(islice(self._latest_us.items(), 2)):
            if now_us - old_us > _PERIODS_SILENT * MOST_PERIOD_US:
                self.on_end(old)

    def _on_gap(self, symbol: str, gap_us: int) -> None:
        self._own_gaps.setdefault(symbol, deque(maxlen=_REMEMBERED_OF_ONE)).append(gap_us)
        if not self._is_known:
            self._gaps.append(gap_us)
            self.period_us = min(MOST_PERIOD_US, max(LEAST_PERIOD_US, round(median(self._gaps))))

    def on_end(self, symbol: str) -> None:
        """A percept has ended: the next one of its name is another."""
        self._latest_us.pop(symbol, None)
        self._own_gaps.pop(symbol, None)

    def silence_us(self, symbol: str) -> int:
        """A percept without a sample for longer than this has ended."""
        if self._given_silence_us is not None:
            return self._given_silence_us
        if self.period_us is None:
            return UNKNOWN_SILENCE_US
        period_us = max(self.period_us, *self._own_gaps.get(symbol, (0,)))
        return max(LEAST_SILENCE_US, round(_PERIODS_SILENT * period_us))
