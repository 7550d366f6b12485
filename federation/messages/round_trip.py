"""How long a peer takes to acknowledge, so that repetition does not delay a busy peer's acknowledgements further.

The estimate of RFC 6298 with Karn's rule: only what was put once is measured, since it is not known which of several puts
an acknowledgement is for. A peer that leaves all puts of an act unacknowledged, or whose acknowledgements all come after a
second put, is given twice the time, until one is measured again.
"""

from typing import Final

LEAST_US: Final = 200_000
MOST_US: Final = 16_000_000
LATE: Final = 8
"""When this number of acts in a row had to be put again, that is not chance, but a peer that takes longer."""


class RoundTrip:
    """The estimate for one peer.

    Attributes:
        pause_us: how long to wait for an acknowledgement before the act is put again.
    """

    __slots__ = ("_again_us", "_deviation_us", "_late", "_smoothed_us", "pause_us")

    def __init__(self) -> None:
        self._smoothed_us: int | None = None
        self._deviation_us = self._again_us = self._late = 0
        self.pause_us = LEAST_US

    def on_measured(self, took_us: int) -> None:
        """An act that was put once was acknowledged after so long."""
        self._late = 0
        if self._smoothed_us is None:
            self._smoothed_us, self._deviation_us = took_us, took_us // 2
        else:
            self._deviation_us += (abs(took_us - self._smoothed_us) - self._deviation_us) // 4
            self._smoothed_us += (took_us - self._smoothed_us) // 8
        self.pause_us = max(LEAST_US, min(MOST_US, self._smoothed_us + 4 * self._deviation_us))

    def on_late(self, now_us: int) -> None:
        """An act that was put again was acknowledged."""
        self._late += 1
        if self._late == LATE:
            self._late = 0
            self.on_silence(now_us)

    def on_silence(self, now_us: int) -> None:
        """No put of an act was acknowledged in time; several acts at once count as one."""
        if now_us >= self._again_us:
            self.pause_us = min(MOST_US, 2 * self.pause_us)
            self._again_us = now_us + self.pause_us
