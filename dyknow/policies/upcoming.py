"""The samples that matter for a point in valid time which only moves forward: the best one up to it, and all after it."""

from bisect import bisect_right, insort

from dyknow.model.sample import Sample

MAX_AHEAD = 4096
"""Samples kept beyond the point; more are refused, so that valid times from the far future fill no memory."""


class Upcoming:
    """A buffer that forgets what can no longer be used (thesis 7.8.2, `remove obsolete samples`).

    Attributes:
        best: of the samples valid at or before the point the one with the highest valid time, of equals the last to
            arrive (Def. 4.3.11); None if there is none.
        later: the samples valid after the point, by valid time, equals as they arrived.
        refused: samples that found no room.
    """

    __slots__ = ("best", "later", "refused")

    def __init__(self) -> None:
        self.best: Sample | None = None
        self.later: list[Sample] = []
        self.refused = 0

    def add(self, sample: Sample, point_us: int) -> None:
        """Keep `sample` if it can matter at `point_us` or later."""
        valid_us = sample.valid_us
        if valid_us <= point_us:
            if self.best is None or valid_us >= self.best.valid_us:
                self.best = sample
        elif not self.later or valid_us >= self.later[-1].valid_us:
            if len(self.later) < MAX_AHEAD:
                self.later.append(sample)
            else:
                self.refused += 1
        else:
            insort(self.later, sample, key=_valid_us)
            if len(self.later) > MAX_AHEAD:
                self.later.pop()
                self.refused += 1

    def advance(self, point_us: int) -> None:
        """The point has moved to `point_us`."""
        later = self.later
        if later and later[0].valid_us <= point_us:
            passed = bisect_right(later, point_us, key=_valid_us)
            newest = later[passed - 1]
            if self.best is None or newest.valid_us >= self.best.valid_us:
                self.best = newest
            del later[:passed]


def _valid_us(sample: Sample) -> int:
    return sample.valid_us
