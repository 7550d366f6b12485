"""Relations of pairs of cars, filtered, in one unit: pairs are many, and each unit of a chain costs as much again."""

import math
from abc import ABC, abstractmethod
from collections import deque
from operator import eq
from typing import Final, Protocol, TypeAlias

from dyknow import NO_VALUE, SURE, US_PER_S, Field, Quality, Sample, Sort, Value, computational_unit
from dyknow.compunits.cars import CAR, NO_LINK, ROAD_RELATIONS, offset_of, relations_of
from dyknow.compunits.numeric import numbers_of, positive
from dyknow.compunits.smoothing import StableFields
from dyknow.model.sample import oldest

_MOST: Final = 1_000
_Offset: TypeAlias = tuple[int, float, float, float, Quality, float, float]
"""Valid time, metres ahead and to the right, agreement, quality; then the place of the first car."""
_XY: Final = slice(1, 3)
_AREAS: Final = slice(4, 6)
FOLLOWING: Final = Sort(
    "following", tuple(Field(name, "bool") for name in ("same_lane", "behind", "short_gap", "too_close"))
)
"""The output of `StableFollowing`: car 1 is in the lane of car 2; it is behind it; the gap to it is short, and has been
so for a while.
"""


class OneRoad(Protocol):
    """The links of a map that are one road, by their names."""

    def is_one(self, one: str, other: str) -> bool:
        """Whether two links are parts of one road."""

    def through(self, link: str, crossing: str) -> str | None:
        """The link after a crossing where a road continues, for a car that came on a link; None: there is none, or several."""


class StablePair(ABC):
    """Relations of two cars at one time, from offsets of the last while, once it is stable.

    Where one is seen at other times than the other, its place is on the line between those where it was seen.

    Attributes:
        roads: which links are one road; None: each is one by itself.
    """

    roads: OneRoad | None = None

    def __init__(self, smooth_s: float, stable_s: float, unseen_s: float, every_s: float = 0.0) -> None:
        self._span_us = round(positive("smooth_s", smooth_s) * US_PER_S)
        self._gap_us = round(positive("unseen_s", unseen_s) * US_PER_S)
        self._every_us = max(1, round(every_s * US_PER_S))
        self._over_us = self._gap_us + round(positive("stable_s", stable_s) * US_PER_S)
        self._offsets: deque[_Offset] = deque(maxlen=_MOST)
        self._stable = StableFields(stable_s)
        self._last: list[Sample | None] = [None, None]
        self._before: list[Sample | None] = [None, None]
        self._links = [NO_LINK, NO_LINK]
        self._ends_us: int | None = None
        self._sure_us = 0

    @abstractmethod
    def _record(self, forward_deg: float) -> Value:
        """The relations now, by the offsets."""

    def _restart(self) -> None:
        """Nothing is known."""
        self._stable.restart()

    def _mean(self, at: int) -> float:
        return math.fsum([each[at] for each in self._offsets]) / len(self._offsets)  # type: ignore[misc]

    def __call__(self, now_us: int, one: Sample, other: Sample) -> Sample | None:
        made: Sample | None = None
        for i, sample in enumerate((one, other)):
            last = self._last[i]
            if sample is not last and (last is None or sample.valid_us > last.valid_us):
                self._before[i] = last
                self._last[i] = sample if self.roads is None else self._on_road(i, sample, self.roads)
                made = self._taken(i, now_us) or made
        return made

    @property
    def due_us(self) -> int | None:
        """When the relations end, if neither of them is seen."""
        return self._ends_us

    def on_time(self, now_us: int) -> Value:
        """One of them has not been seen for too long."""
        if self._ends_us is None or now_us < self._ends_us:
            return None
        self._ends_us = None
        self._restart()
        return NO_VALUE

    def _on_road(self, i: int, sample: Sample, roads: OneRoad) -> Sample:
        """In a crossing where its road continues a car is on the link after it."""
        value = sample.value
        if not isinstance(value, tuple) or len(value) < len(CAR.fields):
            return sample
        link, crossing = value[_AREAS]
        if link != NO_LINK:
            self._links[i] = link
            return sample
        after = roads.through(self._links[i], crossing)
        return sample if after is None else sample._replace(value=(*value[:4], after, crossing))

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
        offsets = self._offsets
        if offsets and valid_us < offsets[-1][0] + self._every_us:
            if self._ends_us is not None:
                self._ends_us = max(self._ends_us, valid_us + self._over_us)
            return None
        pair = (new.value, other.value) if is_first else (other.value, new.value)
        is_one = eq if self.roads is None else self.roads.is_one
        offset, quality = offset_of(pair, is_one), _worse(new.quality, other.quality)
        if offset is None:
            return self._stable.on_record(now_us, valid_us, NO_VALUE, quality)
        _, x_m, y_m, forward_deg, *_ = pair[0]
        offsets.append((valid_us, *offset, quality, x_m, y_m))
        while offsets[0][0] <= valid_us - self._span_us:
            offsets.popleft()
        if quality is not SURE:
            self._sure_us = valid_us + self._span_us
        if valid_us < self._sure_us:
            for each in offsets:
                quality = _worse(quality, each[4])
        return self._stable.on_record(now_us, valid_us, self._record(forward_deg), quality)


@computational_unit(ROAD_RELATIONS, CAR, CAR)
class StableRelations(StablePair):
    """All relations of car 1 to car 2: `RoadOffset`, `SmoothOffset`, `RoadRelations` and `StableFields` of both at one time.

    Where one is seen at other times than the other, its place is on the line between those where it was seen. After `unseen_s`
    without one of them there is no offset; the output has no value `stable_s` later.

    Args:
        metres: how near is `close`.
        smooth_s: offsets are the mean over this time.
        stable_s: a relation counts once it has lasted for this time.
        unseen_s: the longest gap between samples of a car.
        every_s: relations are made no more often: cars that are seen ten times a second cost about a quarter less.
    """

    def __init__(
        self,
        metres: float = 60.0,
        smooth_s: float = 1.0,
        stable_s: float = 0.5,
        unseen_s: float = 0.5,
        every_s: float = 0.2,
    ) -> None:
        super().__init__(smooth_s, stable_s, unseen_s, positive("every_s", every_s))
        self._most_m = positive("metres", metres)

    def _record(self, _forward_deg: float) -> Value:
        return relations_of(self._mean(1), self._mean(2), self._mean(3), self._most_m)


@computational_unit(FOLLOWING, CAR, CAR)
class StableFollowing(StablePair):
    """How car 1 follows car 2: whether it is in its lane, behind it, and with a gap in time that is too short.

    The gap is the distance between both, less the length of a car, by the speed of car 1 over the last second. Relations end as
    those of `StableRelations`.

    Args:
        gap_s: a shorter gap is a short one.
        lasting_s: a short gap that lasts for so long is `too_close`.
        lane_m: how wide a lane is; in one lane are cars that are less than half of that apart to the side.
        length_m: of a car.
        least_m_s: a slower car keeps no gap in time.
        smooth_s: as for `StableRelations`.
        stable_s: the same.
        unseen_s: the same.
    """

    def __init__(
        self,
        gap_s: float = 0.8,
        lasting_s: float = 2.0,
        lane_m: float = 3.5,
        length_m: float = 4.5,
        least_m_s: float = 4.0,
        smooth_s: float = 1.0,
        stable_s: float = 0.5,
        unseen_s: float = 0.5,
    ) -> None:  # fmt: skip
        super().__init__(smooth_s, stable_s, unseen_s)
        self._short_s, self._lasting_us = positive("gap_s", gap_s), round(positive("lasting_s", lasting_s) * US_PER_S)
        self._lane_m, self._length_m = positive("lane_m", lane_m), positive("length_m", length_m)
        self._least_m_s = positive("least_m_s", least_m_s)
        self._since_us: int | None = None
        self._seen_us = 0

    def _restart(self) -> None:
        super()._restart()
        self._since_us = None

    def _record(self, forward_deg: float) -> Value:
        ahead_m, speed_m_s, valid_us = self._mean(1), self._speed_m_s(forward_deg), self._offsets[-1][0]
        is_same_lane = abs(self._mean(2)) < self._lane_m / 2 and self._mean(3) > 0.0
        gap_m = max(0.0, -ahead_m - self._length_m)
        is_short = is_same_lane and ahead_m < 0.0 and speed_m_s >= self._least_m_s and gap_m < self._short_s * speed_m_s
        if not is_short or valid_us - self._seen_us > self._gap_us:
            self._since_us = None
        if is_short and self._since_us is None:
            self._since_us = valid_us
        self._seen_us = valid_us
        lasts = self._since_us is not None and valid_us - self._since_us >= self._lasting_us
        return is_same_lane, ahead_m < 0.0, is_short, lasts

    def _speed_m_s(self, forward_deg: float) -> float:
        """By the means of the newer and of the older half of the places of car 1."""
        offsets, half = list(self._offsets), len(self._offsets) // 2
        if not half:
            return 0.0
        older, newer = offsets[:half], offsets[-half:]
        seconds = (sum(each[0] for each in newer) - sum(each[0] for each in older)) / half / US_PER_S
        east_m, north_m = ((sum(each[at] for each in newer) - sum(each[at] for each in older)) / half for at in (5, 6))  # type: ignore[misc]
        forward = math.radians(forward_deg)
        return (east_m * math.sin(forward) + north_m * math.cos(forward)) / seconds if seconds else 0.0


def _between(before: Sample, after: Sample, valid_us: int) -> Sample:
    """The later sample at an earlier time, with the place there; its place alone if one of the two has none."""
    was, new = (numbers_of(each.value[_XY], 2) if isinstance(each.value, tuple) else None for each in (before, after))
    if was is None or new is None:
        return after
    share = (valid_us - before.valid_us) / (after.valid_us - before.valid_us)
    place = (was[0] + share * (new[0] - was[0]), was[1] + share * (new[1] - was[1]))
    return after._replace(
        value=(after.value[0], *place, *after.value[3:]), quality=_worse(before.quality, after.quality)
    )


def _worse(one: Quality, other: Quality) -> Quality:
    """As certain as the less certain of two values, and as old as the older prediction."""
    if one is SURE and other is SURE:
        return SURE
    return Quality(min(one.certainty, other.certainty), (), oldest((one.prediction, other.prediction)))
