"""Cars on roads: how they drive, and the relations of two cars on one road (thesis 8.7.4, 8.7.5).

Positions are metres in a local frame, x to the east and y to the north; directions are degrees clockwise from north. The
units are made to be put one behind the other:

    seen car -> `CarOnRoad` -> car
    car[a], car[b] -> a state of both -> `RoadOffset` -> `SmoothOffset` -> `RoadRelations` -> `StableFields`

The state has `max age`, so that the relations of a car end when it leaves the view.

Raw relations, for comparison, are made with `CarByStep` in the place of `CarOnRoad`, and without the two filters
`SmoothOffset` and `StableFields`: an error of the positions turns cars round, and near a border relations come and go.
"""

import math
from collections.abc import Callable
from itertools import permutations
from operator import eq
from typing import Any, Final, TypeGuard

from dyknow import NO_VALUE, US_PER_S, Field, Sample, Sort, Value, computational_unit, value_unit
from dyknow.compunits.motion import heading_deg, wrapped_deg
from dyknow.compunits.numeric import Numbers, is_sound, numbers_of, numeric, positive
from dyknow.compunits.smoothing import MovingAverage
from dyknow.model.errors import SortError
from dyknow.model.members import MAX_MEMBERS, members_of

NO_LINK: Final = "no_link"
NO_CROSSING: Final = "no_crossing"
_LEAST_PLACES: Final = 8
_SIGNIFICANT: Final = 8.0
"""How many times its standard error a trend must be: positions are compared at many times, and their errors may be alike."""

_PLACE: Final = (Field("symbol", "text"), Field("x_m", "m"), Field("y_m", "m"))
_AREAS: Final = (Field("link", "text"), Field("crossing", "text"))
SEEN_CAR: Final = Sort("seen-car", (*_PLACE, Field("road_deg", "deg"), *_AREAS), is_open=True)
"""The place of a car, with the map's data for it: the direction of the road segment, the link, the crossing.

More fields may follow, such as `end in bool`, by which a car is no longer there.
"""
CAR: Final = Sort("car", (*_PLACE, Field("forward_deg", "deg"), *_AREAS))
"""The same of a car whose forward direction is known: along its road segment or against it."""
CAR_AREA: Final = Sort("car-area", _AREAS)
"""The areas of the map that a car is in: `cars.link[car1]` and `cars.crossing[car1]` of 8.7.4."""
CAR_WAY: Final = Sort("car-way", (Field("link", "text"), Field("along", "bool")))
"""The link that a car is on, and whether it drives along the direction that is given of it."""
ROAD_OFFSET: Final = Sort("road-offset", (Field("ahead_m", "m"), Field("right_m", "m"), Field("agreement", "1")))
"""Where car 1 is, seen from car 2 in the direction in which car 1 drives; `agreement`: the cosine of their directions."""
ROAD_RELATIONS: Final = Sort(
    "road-relations",
    tuple(Field(name, "bool") for name in ("behind", "beside", "in_front", "left", "right", "oncoming", "close")),
)
"""The output of `RoadRelations`: `car_relations.behind[car1, car2]` is "car1 is behind car2"."""


GLOBAL_OBJECT: Final = Sort(
    "global-object",
    (
        *_PLACE, Field("vx_m_s", "m/s"), Field("vy_m_s", "m/s"), Field("sd_m", "m"), Field("colour", "text"),
        Field("by", "text"), Field("anchored", "bool"), Field("end", "bool"),
    ),
)  # fmt: skip
"""An object that platforms see together, as `global-objects[self]` has it."""


@computational_unit(GLOBAL_OBJECT, GLOBAL_OBJECT)
class SeenTogether:
    """The objects of all platforms, `global-objects[self]`, while at least one of them sees them; predicted states are left out."""

    def __call__(self, _now_us: int, state: Sample) -> Value:
        value = state.value
        is_shown = isinstance(value, tuple) and any(each is True for each in value[-2:])
        return value if is_shown and is_sound(value) else None


class _Trend:
    """Whether places on a line go one way or the other, by least squares; None while errors may look so.

    Args:
        least_m: how far they must have gone.
    """

    def __init__(self, least_m: float) -> None:
        self._least_m, self._first_s = least_m, 0.0
        self._n = self._t = self._s = self._tt = self._ts = self._ss = 0.0

    def sign(self, at_s: float, along_m: float) -> bool | None:
        """After one more place."""
        if not self._n:
            self._first_s = at_s
        t, n = at_s - self._first_s, self._n + 1.0
        self._n, self._t, self._s = n, self._t + t, self._s + along_m
        self._tt, self._ts, self._ss = self._tt + t * t, self._ts + t * along_m, self._ss + along_m * along_m
        tt, ts = self._tt - self._t**2 / n, self._ts - self._t * self._s / n
        if n < _LEAST_PLACES or tt <= 0.0 or abs(ts / tt) * t < self._least_m:
            return None
        error = max(0.0, self._ss - self._s**2 / n - ts * ts / tt) / (n - 2.0) / tt
        return ts > 0.0 if (ts / tt) ** 2 > _SIGNIFICANT**2 * error else None


@computational_unit(CAR, SEEN_CAR)
class CarOnRoad:
    """The car drives along its road segment or against it, as its motion says (thesis 8.7.5).

    "The current direction of the car as estimated by the derivative of the position" is compared with that of the
    segment whenever the car has moved by `metres`, the first time as soon as a quarter of that cannot be an error of
    the positions; before there is no output. A car that stands or wavers keeps its direction, also onto a segment that
    is drawn the other way round.

    Args:
        metres: the larger, the less an error of the positions can turn the car round, and the later it is known.
    """

    def __init__(self, metres: float = 20.0) -> None:
        self._least_m = positive("metres", metres)
        self._from: tuple[float, float] | None = None
        self._latest_us = 0
        self._is_along: bool | None = None
        self._road_deg, self._link = 0.0, ""
        self._trend = _Trend(self._least_m / 4)

    def __call__(self, _now_us: int, sample: Sample) -> Value:
        value = sample.value
        seen = numbers_of(value[1:4], 3) if _is_car(value) and is_sound(value) else None
        if seen is None:
            return NO_VALUE
        x_m, y_m, road_deg = seen
        if self._from is None:
            self._from = x_m, y_m
        elif sample.valid_us <= self._latest_us:
            return None
        self._latest_us = sample.valid_us
        if math.cos(math.radians(road_deg - self._road_deg)) < 0.0:
            self._trend = _Trend(self._least_m / 4)
            if self._is_along is not None:
                self._is_along = not self._is_along if value[4] == self._link else self._onto(not self._is_along)
        self._road_deg, self._link = road_deg, value[4]
        east_m, north_m, road = x_m - self._from[0], y_m - self._from[1], math.radians(road_deg)
        along_m = east_m * math.sin(road) + north_m * math.cos(road)
        if math.hypot(east_m, north_m) >= self._least_m:
            self._is_along = along_m >= 0.0
            self._from = x_m, y_m
        elif self._is_along is None:
            self._is_along = self._trend.sign(sample.valid_us / US_PER_S, along_m)
        is_along = self._assumed(road_deg) if self._is_along is None else self._is_along
        if is_along is None:
            return None
        forward_deg = wrapped_deg(road_deg if is_along else road_deg + 180.0)
        return value[0], x_m, y_m, forward_deg, *value[4 : len(CAR.fields)]

    def _onto(self, is_along: bool) -> bool | None:
        """Whether it drives along the next link, which is drawn the other way round; None: that is assumed as at the beginning."""
        return is_along

    def _assumed(self, _road_deg: float) -> bool | None:
        """Whether it drives along the segment, before it has moved enough; None: that is not known."""
        return None


@computational_unit(CAR, SEEN_CAR)
class CarInLane(CarOnRoad):
    """As `CarOnRoad`, where `road_deg` is the direction of the lane, as `OnMap` has it: known before the car has moved.

    Until it has moved by `metres`, and after a sharp turn onto another link, its direction is the mean of the lanes in which it
    was seen. So a car that queues has a direction.
    """

    def __init__(self, metres: float = 20.0) -> None:
        super().__init__(metres)
        self._east = self._north = 0.0

    def _onto(self, is_along: bool) -> None:  # noqa: ARG002  (the lane says it)
        self._east = self._north = 0.0

    def _assumed(self, road_deg: float) -> bool:
        east, north = math.sin(math.radians(road_deg)), math.cos(math.radians(road_deg))
        self._east, self._north = self._east + east, self._north + north
        return self._east * east + self._north * north >= 0.0


@computational_unit(CAR, SEEN_CAR)
class CarByStep(CarOnRoad):
    """As `CarOnRoad`, by each step from the position before: with an error of the positions the direction is chance."""

    def __init__(self, metres: float = 0.01) -> None:
        super().__init__(metres)


@computational_unit(CAR_WAY, SEEN_CAR)
class CarWay:
    """On which link a car is and whether it drives along it, by its motion, as `CarOnRoad`; a car that turns back changes that.

    Args:
        metres: so far it has to drive the other way before that counts.
    """

    def __init__(self, metres: float = 10.0) -> None:
        self._car = CarOnRoad(metres)

    def __call__(self, now_us: int, sample: Sample) -> Value:
        car = self._car(now_us, sample)
        if not isinstance(car, tuple):
            return car
        return car[4], math.cos(math.radians(car[3] - sample.value[3])) > 0.0


@value_unit(CAR_AREA, CAR, name="CarArea")
def car_area(car: Value) -> Value:
    """The link and the crossing that a car is in, `no_link` and `no_crossing` where it is in none."""
    return car[4 : len(CAR.fields)] if _is_car(car) and is_sound(car) else NO_VALUE


@value_unit(ROAD_OFFSET, "state", name="RoadOffset")
def road_offset(pair: Value) -> Value:
    """From a state of two cars: where the first is, seen from the second; no value unless both are on one link."""
    return offset_of(pair) or NO_VALUE


def offset_of(pair: Value, is_one: Callable[[str, str], bool] = eq) -> tuple[float, float, float] | None:
    """The same, `is_one`: whether two links are one road; None: there is none."""
    one, other = pair if isinstance(pair, tuple) and len(pair) == 2 else (NO_VALUE, NO_VALUE)
    if not _is_car(one) or not _is_car(other) or one[4] == NO_LINK or not is_one(one[4], other[4]):
        return None
    try:
        east_m, north_m, forward = one[1] - other[1], one[2] - other[2], math.radians(one[3])
        agreement = math.cos(math.radians(other[3]) - forward)
    except (TypeError, ArithmeticError, ValueError):
        return None
    sine, cosine = math.sin(forward), math.cos(forward)
    ahead_m, right_m = east_m * sine + north_m * cosine, east_m * cosine - north_m * sine
    return (ahead_m, right_m, agreement) if math.isfinite(ahead_m + right_m) else None


def _is_car(value: Value) -> TypeGuard[tuple[Any, ...]]:
    return isinstance(value, tuple) and len(value) >= len(CAR.fields)


@computational_unit(ROAD_OFFSET, ROAD_OFFSET, history_us=US_PER_S)
class SmoothOffset(MovingAverage):
    """The mean of the offsets of the last `seconds`, 1, so that an error of the positions counts less."""

    def __init__(self, seconds: float = 1.0) -> None:
        super().__init__(seconds)


@value_unit(ROAD_RELATIONS, ROAD_OFFSET)
class RoadRelations:
    """All relations of car 1 to car 2 as one record, by four sectors of 90 degrees as in Figure 8.11.

    Args:
        metres: how near is `close`.
    """

    def __init__(self, metres: float = 60.0) -> None:
        self._most_m = positive("metres", metres)

    @numeric(3)
    def __call__(self, offset: Numbers) -> Value:
        ahead_m, right_m, agreement = offset
        return relations_of(ahead_m, right_m, agreement, self._most_m)


def relations_of(ahead_m: float, right_m: float, agreement: float, most_m: float) -> Value:
    """The output of `RoadRelations` for an offset; no value where both are in one place."""
    if not ahead_m and not right_m:
        return NO_VALUE
    quarter = round(heading_deg(ahead_m, right_m) / 90.0) % 4
    close = math.hypot(ahead_m, right_m) <= most_m
    return quarter == 2, quarter in {1, 3}, quarter == 0, quarter == 3, quarter == 1, agreement < 0.0, close


@value_unit("pairs", "object", name="Pairs")
def pairs(names: Value) -> Value:
    """All pairs of two different objects of a set, in both orders: the first may overtake the second."""
    return tuple(permutations(_names(names), 2))


def _names(value: Value) -> tuple[str, ...]:
    try:
        return members_of(value)
    except SortError:
        return ()


@computational_unit("object", "recognition")
class Subjects:
    """A class of objects that a chronicle forms: the first argument of all instances of the last `seconds`, an hour.

    Its input is the stream of instances, `chronicle[wrong_side]`; an output whenever the class changes, also by time.
    """

    def __init__(self, seconds: float = 3600.0) -> None:
        self._span_us = round(positive("seconds", seconds) * US_PER_S)
        self._named_us: dict[str, int] = {}

    def __call__(self, _now_us: int, sample: Sample) -> Value:
        arguments = sample.value[0] if isinstance(sample.value, tuple) and sample.value else ()
        names = _names(arguments[:1]) if isinstance(arguments, tuple) else ()
        before = tuple(self._named_us)
        for name in names:
            if name in before or len(before) < MAX_MEMBERS:
                self._named_us[name] = max(sample.valid_us, self._named_us.get(name, sample.valid_us))
        members = self._kept(max(self._named_us.values(), default=0))
        return None if members == before else members

    @property
    def due_us(self) -> int | None:
        """When the first of them is a member no longer."""
        return min(self._named_us.values()) + self._span_us + 1 if self._named_us else None

    def on_time(self, now_us: int) -> Value:
        """The class without those that were named too long ago; an empty one is reported."""
        before = tuple(self._named_us)
        members = self._kept(now_us)
        return None if members == before else members

    def _kept(self, now_us: int) -> tuple[str, ...]:
        oldest_us = now_us - self._span_us
        self._named_us = {name: named_us for name, named_us in self._named_us.items() if named_us >= oldest_us}
        return tuple(self._named_us)


@computational_unit("object", "object", "object", name="Either", needs_all=False)
def either(_now_us: int, one: Sample | None, other: Sample | None) -> Value:
    """The objects that one of two sets names, or both; no value where there is none. An input without a sample is
    empty.
    """
    named = (_names(each.value) for each in (one, other) if each is not None)
    return tuple(dict.fromkeys(name for names in named for name in names)) or NO_VALUE
