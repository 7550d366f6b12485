"""Joining streams: at every available time the last available sample of each (thesis, Def. 4.3.7 to 4.3.16).

`no_sample` is None: it is never part of a stream.
"""

from collections.abc import Iterable, Sequence
from typing import TypeAlias

from dyknow.sample import Sample

Inputs: TypeAlias = tuple[Sample | None, ...]
"""The last sample of each input, None where none has arrived."""


def available(stream: Iterable[Sample], at_us: int) -> list[Sample]:
    """The samples available at `at_us` (Def. 4.3.7)."""
    return [s for s in stream if s.available_us <= at_us]


def last_available(stream: Iterable[Sample], at_us: int) -> Sample | None:
    """The available sample with the greatest available time (Def. 4.3.8)."""
    return max(available(stream, at_us), key=_available_us, default=None)


def valid_before(stream: Iterable[Sample], valid_us: int, query_us: int) -> list[Sample]:
    """The samples valid at or before `valid_us` among those available at `query_us` (Def. 4.3.9)."""
    return [s for s in available(stream, query_us) if s.valid_us <= valid_us]


def last_valid_before(stream: Iterable[Sample], valid_us: int, query_us: int) -> list[Sample]:
    """Of these the ones with the greatest valid time (Def. 4.3.10)."""
    found = valid_before(stream, valid_us, query_us)
    latest_us = max((s.valid_us for s in found), default=0)
    return [s for s in found if s.valid_us == latest_us]


def most_recent_at(stream: Iterable[Sample], valid_us: int, query_us: int) -> Sample | None:
    """Of these the one that became available last (Def. 4.3.11); `History.most_recent_at` finds it in large streams."""
    return last_available(last_valid_before(stream, valid_us, query_us), query_us)


def previous(stream: Iterable[Sample], sample: Sample | None) -> Sample | None:
    """prev(f, s): the sample that arrived before `sample` (Def. 4.3.12)."""
    return None if sample is None else last_available(stream, sample.available_us - 1)


def available_times(*streams: Iterable[Sample]) -> set[int]:
    """When some sample became available in one of the streams (Def. 4.3.13)."""
    return {s.available_us for stream in streams for s in stream}


def join(*streams: Sequence[Sample]) -> list[Sample]:
    """<t, t, [last available of each]> for each available time t (Def. 4.3.16)."""
    return [Sample(t, t, tuple(last_available(f, t) for f in streams)) for t in sorted(available_times(*streams))]


class Join:
    """The same, step by step: what `on_sample` returned last at an instant is the element of `join` at that instant."""

    __slots__ = ("_last",)

    def __init__(self, inputs: int) -> None:
        self._last: list[Sample | None] = [None] * inputs

    def on_sample(self, i: int, sample: Sample, now_us: int) -> Sample:
        """A sample of input `i`, counted from 0, became available at `now_us`."""
        self._last[i] = sample
        return Sample(now_us, now_us, tuple(self._last))

    @property
    def inputs(self) -> Inputs:
        return tuple(self._last)


def _available_us(sample: Sample) -> int:
    return sample.available_us
