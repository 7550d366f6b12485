"""From the position that shows a meeting to the order, and to the motion that shows it: the latency of giving way."""


class ReactionTimes:
    """The latency of the manoeuvre under way. Federation time."""

    def __init__(self) -> None:
        self._number, self._seen_us, self._ordered_us = -1, 0, 0

    def on_order(self, number: int, seen_us: int, now_us: int) -> None:
        """The first order of a manoeuvre, planned at the position valid at `seen_us`, is sent."""
        self._number, self._seen_us, self._ordered_us = number, seen_us, now_us

    def on_motion(self, number: int, now_us: int) -> str:
        """The motion shows that order; returns both latencies in words, once, or nothing if it is not a manoeuvre's first order."""
        if number != self._number:
            return ""
        self._number = -1
        order_s, motion_s = (max(0.0, (at_us - self._seen_us) / 1e6) for at_us in (self._ordered_us, now_us))
        return f"ordered {order_s:.2f} s after the position that shows the meeting, seen in motion {motion_s:.2f} s after it"
