"""From the position that shows a meeting to the order, and to the motion that shows it: the latency of giving way."""

from collections import deque
from statistics import median
from typing import Final

KEPT: Final = 64


class ReactionTimes:
    """The last manoeuvres. Federation time; results in seconds.

    Attributes:
        to_order: from the valid time of the position at which a manoeuvre was planned to its first order, by manoeuvre.
        to_motion: to when the vehicle's motion shows it.
    """

    def __init__(self) -> None:
        self.to_order: deque[float] = deque(maxlen=KEPT)
        self.to_motion: deque[float] = deque(maxlen=KEPT)
        self._under_way: tuple[int, int] | None = None

    def on_order(self, number: int, seen_us: int, now_us: int) -> None:
        """The first order of a manoeuvre, planned at the position valid at `seen_us`, is sent."""
        self.to_order.append(max(0.0, (now_us - seen_us) / 1e6))
        self._under_way = number, seen_us

    def on_motion(self, number: int, now_us: int) -> str:
        """The motion shows that order; returns both times in words, or nothing if it is not that of a manoeuvre's first place."""
        if self._under_way is None or self._under_way[0] != number:
            return ""
        taken_s, self._under_way = max(0.0, (now_us - self._under_way[1]) / 1e6), None
        self.to_motion.append(taken_s)
        return f"ordered {self.to_order[-1]:.2f} s after the position that shows the meeting, seen in motion {taken_s:.2f} s after it"

    def medians(self) -> tuple[float | None, float | None]:
        """To the order, to the motion; None: there was no manoeuvre yet."""
        return (
            median(self.to_order) if self.to_order else None,
            median(self.to_motion) if self.to_motion else None,
        )
