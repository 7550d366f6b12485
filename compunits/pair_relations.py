"""What pairs of cars are to each other, filtered, in one unit: there are many pairs, and each unit of a chain costs as much again."""

import math
from collections import deque
from typing import Final

from compunits.cars import ROAD_RELATIONS, offset_of, relations_of
from compunits.numeric import positive
from compunits.smoothing import StableFields
from dyknow import NO_VALUE, SURE, US_PER_S, Quality, Sample, Value, computational_unit
from dyknow.model.sample import oldest

_MOST: Final = 1_000
_Offset = tuple[int, float, float, float, Quality]


@computational_unit(ROAD_RELATIONS, "state", history_us=3 * US_PER_S // 2)
class StableRelations:
    """All relations of car 1 to car 2, from states of both: `RoadOffset`, `SmoothOffset`, `RoadRelations` and `StableFields` in one.

    Args:
        metres: how near is `close`.
        smooth_s: offsets are the mean of so many seconds.
        stable_s: what has lasted for so many seconds counts.
    """

    def __init__(self, metres: float = 60.0, smooth_s: float = 1.0, stable_s: float = 0.5) -> None:
        self._most_m = positive("metres", metres)
        self._span_us = round(positive("smooth_s", smooth_s) * US_PER_S)
        self._known: deque[_Offset] = deque(maxlen=_MOST)
        self._stable = StableFields(stable_s)

    def __call__(self, now_us: int, sample: Sample) -> Sample | None:
        valid_us, known = sample.valid_us, self._known
        if known and valid_us < known[-1][0]:
            return None
        offset = offset_of(sample.value)
        if offset is None:
            return self._stable.on_record(now_us, valid_us, NO_VALUE, sample.quality)
        known.append((valid_us, *offset, sample.quality))
        while known[0][0] <= valid_us - self._span_us:
            known.popleft()
        return self._stable.on_record(now_us, valid_us, self._relations(), self._quality())

    def _relations(self) -> Value:
        known, count = self._known, len(self._known)
        return relations_of(
            math.fsum([each[1] for each in known]) / count,
            math.fsum([each[2] for each in known]) / count,
            math.fsum([each[3] for each in known]) / count,
            self._most_m,
        )

    def _quality(self) -> Quality:
        """As certain as the least certain offset, and as old as the oldest prediction."""
        qualities = [each[4] for each in self._known if each[4] is not SURE]
        if not qualities:
            return SURE
        certainty = min(each.certainty for each in qualities)
        return Quality(certainty, (), oldest(each.prediction for each in qualities))
