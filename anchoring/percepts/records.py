"""Percepts and objects as records of streams: their fields, and how they are read.

A percept has a symbol and a position, `x_m` and `y_m` (east and north) or, where the origin of those is known,
`latitude_deg` and `longitude_deg`; deviation, velocity and further attributes are optional.
"""

import math
from collections.abc import Iterable
from typing import Final

from dyknow import NO_VALUE, Sample, Sort, Value
from dyknow.anchoring.links.composites import COUNT, PARTS
from dyknow.anchoring.links.states import ObjectState, diagonal
from dyknow.anchoring.links.structures import Percept, StateRecord
from dyknow.anchoring.percepts.reading import FARTHEST_GEOGRAPHIC_M, FARTHEST_M, LEAST_SD_M, USUAL_SD_M, VELOCITY_SD_M_S
from dyknow.model.values import END, SYMBOL, Field
from dyknow.navigation import LocalFrame
from dyknow.reasoning.formulas.evaluation import is_missing

ANCHORED: Final = "anchored"
LOCAL: Final = ("x_m", "y_m")
GEOGRAPHIC: Final = ("latitude_deg", "longitude_deg")
_STATE: Final = (*LOCAL, "vx_m_s", "vy_m_s")
_COVARIANCE: Final = ("xx_m2", "xy_m2", "yy_m2", "v_sd_m_s")
_UNITS: Final = {SYMBOL: "text", **dict.fromkeys(LOCAL, "m"), "vx_m_s": "m/s", "vy_m_s": "m/s", "sd_m": "m"}
ROAD_FIELDS: Final = {
    "link": "text", "crossing": "text", "direction": "1", "lane": "1", "offset_m": "m", "along_m_s": "m/s",
    "turn": "text", "world_x_m": "m", "world_y_m": "m",
}  # fmt: skip
"""Attributes of objects that are put on roads, and their units."""
_OWN: Final = frozenset({*_UNITS, *GEOGRAPHIC, END, ANCHORED})


def object_sort(
    name: str, below: Iterable[Sort | None], *, is_on_roads: bool = False, is_placed: bool, is_composite: bool = False
) -> Sort:
    """The sort of the states of linked objects, unless one is declared.

    Args:
        name: of the sort.
        below: of the objects from which they are made, whose attributes they keep.
        is_on_roads: whether they are put on roads.
        is_placed: whether it is known where `x_m` and `y_m` are 0.
        is_composite: whether they have parts, and their attributes not.
    """
    units = dict(_UNITS)
    if is_placed:
        units |= dict.fromkeys(GEOGRAPHIC, "deg")
    units |= {ANCHORED: "bool"} | (ROAD_FIELDS if is_on_roads else {})
    if is_composite:
        units |= {PARTS: "text", COUNT: "1"}
    for sort in () if is_composite else below:
        units |= {each.name: each.unit for each in (sort.fields if sort else ()) if each.name not in {*units, *_OWN}}
    return Sort(name, tuple(Field(*each) for each in (*units.items(), (END, "bool"))))


def lacks_of(sort: Sort) -> tuple[str, ...]:
    """The fields without which a record is no percept."""
    named = {each.name for each in sort.fields}
    position = GEOGRAPHIC if named.issuperset(GEOGRAPHIC) else LOCAL
    return tuple(each for each in (SYMBOL, *position) if each not in named)


def is_geographic(sort: Sort) -> bool:
    """Whether positions are latitude and longitude alone."""
    named = {each.name for each in sort.fields}
    return named.issuperset(GEOGRAPHIC) and not named.issuperset(LOCAL)


class PerceptRecords:
    """Reads the records of one stream. Where they have metres and degrees, degrees count: whose metres these are nothing says.

    Args:
        frame: about which positions in degrees are taken; None: metres count.
    """

    def __init__(self, type_: str, sort: Sort, frame: LocalFrame | None) -> None:
        self._type, self._frame = type_, frame
        self._names = tuple(each.name for each in sort.fields)
        self._is_geographic = is_geographic(sort)
        self._has_both = not self._is_geographic and {*self._names}.issuperset(GEOGRAPHIC)

    def percept(self, sample: Sample) -> Percept | None:
        """None: it has no value, or no place that can be."""
        if sample.value is NO_VALUE:
            return None
        record: dict[str, Value] = dict(zip(self._names, sample.value, strict=True))
        symbol = record[SYMBOL]
        if record.get(END) is True:
            return Percept(symbol, self._type, None)
        place = self._place(record)
        if place is None:
            return None
        velocity = record.get("vx_m_s", NO_VALUE), record.get("vy_m_s", NO_VALUE)
        moves = not any(map(is_missing, velocity))
        sd_m = record.get("sd_m", NO_VALUE)
        deviation_m = USUAL_SD_M if is_missing(sd_m) else max(LEAST_SD_M, float(sd_m))
        attributes = {name: value for name, value in record.items() if name not in _OWN}
        vx_m_s, vy_m_s = map(float, velocity) if moves else (0.0, 0.0)
        covariance = diagonal(deviation_m, VELOCITY_SD_M_S if moves else None)
        return Percept(symbol, self._type, ObjectState(sample.valid_us, *place, vx_m_s, vy_m_s, covariance, attributes))

    def _place(self, record: dict[str, Value]) -> tuple[float, float] | None:
        """East and north."""
        if self._has_both and self._frame is not None and not any(is_missing(record[name]) for name in GEOGRAPHIC):
            return self._on_earth(*(float(record[name]) for name in GEOGRAPHIC))
        one, other = (record[name] for name in (GEOGRAPHIC if self._is_geographic else LOCAL))
        if is_missing(one) or is_missing(other):
            return None
        if not self._is_geographic:
            return (float(one), float(other)) if max(abs(one), abs(other)) <= FARTHEST_M else None
        return self._on_earth(float(one), float(other))

    def _on_earth(self, latitude_deg: float, longitude_deg: float) -> tuple[float, float] | None:
        if self._frame is None or not (abs(latitude_deg) <= 90.0 and abs(longitude_deg) <= 180.0):
            return None
        north_m, east_m, _ = self._frame.to_ned(latitude_deg, longitude_deg, 0.0)
        return (east_m, north_m) if max(abs(north_m), abs(east_m)) <= FARTHEST_GEOGRAPHIC_M else None


class ObjectRecords:
    """Writes states of objects as records of a sort.

    Args:
        frame: of the positions, if it is known where they are 0.
    """

    def __init__(self, sort: Sort, frame: LocalFrame | None) -> None:
        self._names = tuple(each.name for each in sort.fields)
        self._frame = frame if {*GEOGRAPHIC} & {*self._names} else None

    def value(self, record: StateRecord, *, is_anchored: bool, ended: bool) -> Value:
        """The state of an object; `ended`: its last one."""
        state = record.state
        own = {SYMBOL: record.symbol, END: ended, "sd_m": state.deviation_m / 2**0.5, ANCHORED: is_anchored}
        own |= zip(_STATE, state[1:5], strict=True)
        own |= zip(_COVARIANCE, _covariance(state), strict=True)
        if self._frame is not None:
            own |= zip(GEOGRAPHIC, self._frame.level(state.y_m, state.x_m, 0.0), strict=True)
        return tuple(own.get(name, state.attributes.get(name, NO_VALUE)) for name in self._names)

    def ended(self, symbol: str) -> Value:
        """The last state of an object whose other attributes are unknown."""
        known: dict[str, Value] = {SYMBOL: symbol, END: True}
        return tuple(known.get(name, NO_VALUE) for name in self._names)


def _covariance(state: ObjectState) -> tuple[float, float, float, float]:
    """Of the position, and the standard deviation of the velocity on each axis."""
    known = state.covariance
    return known[0, 0], known[0, 1], known[1, 1], math.sqrt((known[2, 2] + known[3, 3]) / 2)
