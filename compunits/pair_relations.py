"""What pairs of cars are to each other, filtered, in one unit: there are many pairs, and each unit of a chain costs as much again."""

import math
from collections import deque
from typing import Any, Final, TypeAlias

from compunits.cars import CAR, ROAD_RELATIONS, offset_of, relations_of
from compunits.numeric import positive
from compunits.smoothing import StableFields
from dyknow import NO_VALUE, SURE, US_PER_S, Quality, Sample, Value, computational_unit
from dyknow.model.sample import oldest

_MOST: Final = 1_000
_Offset: TypeAlias = tuple[int, float, float, float, Quality]
_XY: Final = slice(1, 3)


@computational_unit(ROAD_RELATIONS, CAR, CAR)
class StableRelations:
    """All relations of car 1 to car 2: `RoadOffset`, `SmoothOffset`, `RoadRelations` and `StableFields` of both at one time.

    Where one is seen at other times than the other, its place is on the line between those where it was seen. After `unseen_s`
    without one of them there is no offset; the output has no value `stable_s` later.

    Args:
        metres: how near is `close`.
        smooth_s: offsets are the mean of so many seconds.
        stable_s: what has lasted for so many seconds counts.
        unseen_s: the longest gap in what is seen of a car.
    """

    def __init__(
        self, metres: float = 60.0, smooth_s: float = 1.0, stable_s: float = 0.5, unseen_s: float = 0.5
    ) -> None:
        self._most_m = positive("metres", metres)
        self._span_us = round(positive("smooth_s", smooth_s) * US_PER_S)
        self._gap_us = round(positive("unseen_s", unseen_s) * US_PER_S)
        self._over_us = self._gap_us + round(positive("stable_s", stable_s) * US_PER_S)
        self._offsets: deque[_Offset] = deque(maxlen=_MOST)
        self._stable = StableFields(stable_s)
        self._last: list[Sample | None] = [None, None]
        self._before: list[Sample | None] = [None, None]
        self._ends_us: int | None = None

    def __call__(self, now_us: int, one: Sample, other: Sample) -> Sample | None:
        made: Sample | None = None
        for i, sample in enumerate((one, other)):
            last = self._last[i]
            if sample is not last and (last is None or sample.valid_us > last.valid_us):
                self._before[i], self._last[i] = last, sample
                made = self._taken(i, now_us) or made
        return made

    @property
    def due_us(self) -> int | None:
        """When there is nothing to be known any more, if none of them is seen."""
        return self._ends_us

    def on_time(self, now_us: int) -> Value:
        """One of them has not been seen for too long."""
        if self._ends_us is None or now_us < self._ends_us:
            return None
        self._ends_us = None
        self._stable.restart()
        return NO_VALUE

    def _taken(self, i: int, now_us: int) -> Sample | None:
        """There is a new sample of one of them: relate both when the last of the other was valid, if that is between two of it."""
        newest, before, other = self._last[i], self._before[i], self._last[1 - i]
        if newest is None or other is None:
            return None
        valid_us = other.valid_us
        if newest.valid_us == valid_us:
            made = self._related(now_us, valid_us, newest, other, is_first=i == 0)
        elif newest.valid_us < valid_us:
            return None
        elif newest.valid_us - valid_us > self._gap_us:
            made = self._stable.on_record(now_us, newest.valid_us, NO_VALUE, newest.quality)
        elif before is None or before.valid_us >= valid_us or newest.valid_us - before.valid_us > self._gap_us:
            return None
        else:
            made = self._related(now_us, valid_us, _between(before, newest, valid_us), other, is_first=i == 0)
        if made is not None:
            ends_us = min(newest.valid_us, valid_us) + self._over_us
            self._ends_us = None if made.value is NO_VALUE else ends_us
        return made

    def _related(self, now_us: int, valid_us: int, new: Sample, other: Sample, *, is_first: bool) -> Sample | None:
        offsets, quality = self._offsets, _worse(new.quality, other.quality)
        offset = offset_of((new.value, other.value) if is_first else (other.value, new.value))
        if offsets and valid_us <= offsets[-1][0]:
            return None
        if offset is None:
            return self._stable.on_record(now_us, valid_us, NO_VALUE, quality)
        offsets.append((valid_us, *offset, quality))
        while offsets[0][0] <= valid_us - self._span_us:
            offsets.popleft()
        count = len(offsets)
        record = relations_of(
            math.fsum([each[1] for each in offsets]) / count,
            math.fsum([each[2] for each in offsets]) / count,
            math.fsum([each[3] for each in offsets]) / count,
            self._most_m,
        )
        for each in offsets:
            quality = _worse(quality, each[4])
        return self._stable.on_record(now_us, valid_us, record, quality)


def _between(before: Sample, after: Sample, valid_us: int) -> Sample:
    """The later sample at an earlier time, with the place there; its place alone if one of the two has none."""
    share = (valid_us - before.valid_us) / (after.valid_us - before.valid_us)
    try:
        place: tuple[Any, ...] = tuple(
            was + share * (new - was) for was, new in zip(before.value[_XY], after.value[_XY], strict=True)
        )
    except TypeError:
        return after
    return after._replace(
        value=(after.value[0], *place, *after.value[3:]), quality=_worse(before.quality, after.quality)
    )


def _worse(one: Quality, other: Quality) -> Quality:
    """As certain as the less certain of two values, and as old as the older prediction."""
    if one is SURE and other is SURE:
        return SURE
    return Quality(min(one.certainty, other.certainty), (), oldest((one.prediction, other.prediction)))
