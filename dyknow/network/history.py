"""The history of a stream generator (thesis 5.3.2; the queries of 4.3.2)."""

from bisect import bisect_left, bisect_right

from dyknow.model.errors import ValueNotAvailable
from dyknow.model.sample import Sample

_EVER_US = 2**80


class History:
    """The last `capacity` samples of one stream, by available time, which must increase.

    Queries by valid time cost a bisection while valid times came in order, and a sort per change when they did not.

    Raises:
        ValueError: if `capacity` is not positive.
    """

    __slots__ = (
        "_base", "_counted", "_disorder", "_dropped_us", "_highest_us", "_limit", "_samples", "_sorted", "capacity",
    )  # fmt: skip

    def __init__(self, capacity: int) -> None:
        if capacity < 1:
            raise ValueError(f"a history holds at least 1 sample, got {capacity}")
        self.capacity = capacity
        self._limit = capacity + max(64, capacity // 4)
        self._samples: list[Sample] = []
        self._sorted: list[Sample] | None = None
        self._base = 0  # samples forgotten
        self._disorder = 0  # the last sample out of order is the so-maniest of all
        self._highest_us = -_EVER_US
        self._dropped_us: int | None = None  # highest valid time among the forgotten, of which
        self._counted = 0  # so many still stand at the front of the list and were looked at

    def copy(self) -> "History":
        """The same samples, to be queried while this one continues."""
        other = History(self.capacity)
        for name in self.__slots__:
            setattr(other, name, getattr(self, name))
        other._samples, other._sorted = list(self._samples), None
        return other

    def add(self, sample: Sample) -> None:
        """Remember `sample`, which became available after all others."""
        samples = self._samples
        samples.append(sample)
        self._sorted = None
        if sample.valid_us >= self._highest_us:
            self._highest_us = sample.valid_us
        else:
            self._disorder = self._base + len(samples)
        if len(samples) >= self._limit:
            self._forget()

    def get_size(self) -> int:
        """How many samples are held."""
        return min(len(self._samples), self.capacity)

    def get_latest(self) -> Sample:
        """The sample with the highest available time.

        Raises:
            ValueNotAvailable: nothing is held.
        """
        if not self._samples:
            raise ValueNotAvailable("no sample has arrived yet")
        return self._samples[-1]

    def get_nth_latest(self, n: int) -> Sample:
        """The n-th latest sample; the 0-th has the highest available time.

        Raises:
            ValueNotAvailable: fewer samples are held.
        """
        if not 0 <= n < self.get_size():
            raise ValueNotAvailable(f"sample {n} before the latest is not held: {self.get_size()} are")
        return self._samples[-1 - n]

    def get_slice(self, i: int, j: int) -> list[Sample]:
        """The i-th to the j-th sample, both included, oldest first, numbered from 0.

        Raises:
            ValueNotAvailable: one of them is not held.
        """
        if not (i >= 0 and j < self.get_size()):
            raise ValueNotAvailable(f"samples {i} to {j} are not all held: 0 to {self.get_size() - 1} are")
        start = self._start
        return self._samples[start + i : start + j + 1]

    def reset(self) -> None:
        """Forget every sample, and that there were any."""
        self._samples.clear()
        self._sorted = self._dropped_us = None
        self._base = self._disorder = self._counted = 0
        self._highest_us = -_EVER_US

    def forget(self) -> int:
        """Drop every sample; returns how many. Unlike after `reset`, what was valid until then is known to be missing."""
        held = self._samples[self._start :]
        if held:
            newest_us, dropped_us = max(map(_valid_us, held)), self._dropped()
            self.reset()
            self._dropped_us = newest_us if dropped_us is None else max(newest_us, dropped_us)
        return len(held)

    def get_latest_vtime(self) -> Sample:
        """The sample with the highest valid time; of equals the one with the highest available time.

        Raises:
            ValueNotAvailable: nothing is held.
        """
        ordered, start, end = self._ordered()
        if start == end:
            raise ValueNotAvailable("no sample has arrived yet")
        return ordered[end - 1]

    def get_closest_at_or_before(self, valid_us: int) -> Sample:
        """The held sample with the highest valid time <= `valid_us`; of equals the highest available time.

        Raises:
            ValueNotAvailable: there is none.
        """
        ordered, start, end = self._ordered()
        at = bisect_right(ordered, valid_us, start, end, key=_valid_us)
        if at == start:
            raise ValueNotAvailable(f"no sample valid at or before {valid_us} us is held")
        return ordered[at - 1]

    def get_between(self, from_us: int, to_us: int) -> list[Sample]:
        """All held samples valid in [from_us, to_us], ordered by (valid, available) time; corrections included."""
        ordered, start, end = self._ordered()
        first = bisect_left(ordered, from_us, start, end, key=_valid_us)
        return ordered[first : bisect_right(ordered, to_us, first, end, key=_valid_us)] if from_us <= to_us else []

    def most_recent_at(self, valid_us: int, query_us: int) -> Sample:
        """As `get_closest_at_or_before`, among what was available at `query_us` (Def. 4.3.11).

        Raises:
            ValueNotAvailable: there is none, or it may have been forgotten.
        """
        ordered, start, end = self._ordered()
        if ordered is self._samples:  # then both times increase along it
            end = bisect_right(ordered, query_us, start, end, key=_available_us)
        at = bisect_right(ordered, valid_us, start, end, key=_valid_us)
        while at > start and ordered[at - 1].available_us > query_us:
            at -= 1
        dropped_us = self._dropped()
        if at == start or (dropped_us is not None and ordered[at - 1].valid_us < dropped_us):
            starts_us = self.starts_us
            if starts_us is None and len(ordered) > start:
                starts_us = ordered[start].valid_us
            began = "" if starts_us is None else f"; the history starts at {starts_us} us"
            raise ValueNotAvailable(f"no sample valid at or before {valid_us} us was available at {query_us} us{began}")
        return ordered[at - 1]

    @property
    def starts_us(self) -> int | None:
        """Every sample valid from here on is still held; None when nothing was forgotten."""
        dropped_us = self._dropped()
        if dropped_us is None:
            return None
        ordered, start, end = self._ordered()
        at = bisect_right(ordered, dropped_us, start, end, key=_valid_us)
        return ordered[at].valid_us if at < end else dropped_us + 1

    @property
    def whole_since_us(self) -> int | None:
        """The earliest time from which on nothing valid was forgotten; None when nothing was forgotten."""
        dropped_us = self._dropped()
        return None if dropped_us is None else dropped_us + 1

    @property
    def _start(self) -> int:
        return max(0, len(self._samples) - self.capacity)

    def _ordered(self) -> tuple[list[Sample], int, int]:
        """A list and the part of it that holds our samples by (valid, available) time."""
        samples, start = self._samples, self._start
        if self._disorder <= self._base + start:  # samples out of order are forgotten
            return samples, start, len(samples)
        if self._sorted is None:
            self._sorted = sorted(samples[start:], key=_valid_us)  # stable: equals stay by available time
        return self._sorted, 0, len(self._sorted)

    def _forget(self) -> None:
        """Drop what is over capacity, in one go for many samples."""
        excess = self._start
        self._dropped()
        del self._samples[:excess]
        self._counted = 0
        self._base += excess
        if self._disorder > self._base:  # a single valid time from the future must not disorder all that follow
            self._highest_us = -_EVER_US
            for at, sample in enumerate(self._samples, self._base + 1):
                if sample.valid_us >= self._highest_us:
                    self._highest_us = sample.valid_us
                else:
                    self._disorder = at

    def _dropped(self) -> int | None:
        """The highest valid time among the samples no longer held; each is looked at once."""
        start = self._start
        for sample in self._samples[self._counted : start]:
            if self._dropped_us is None or sample.valid_us > self._dropped_us:
                self._dropped_us = sample.valid_us
        self._counted = start
        return self._dropped_us


def _valid_us(sample: Sample) -> int:
    return sample.valid_us


def _available_us(sample: Sample) -> int:
    return sample.available_us
