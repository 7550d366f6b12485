"""Qualitative relations of one thing to another (thesis 8.3.1, 8.7.5, 12.3 requirement 2).

"We compare the forward direction of car1 with the direction from car2 to car1 to determine the spatial relation between
car1 and car2" (8.7.5): the second input is the forward direction of the first thing, a heading in degrees, as
`ForwardAlong` gives it for cars on a road and `Track`, `TrackEst` or `Heading` for others. Four sectors of 90 degrees
tell the four sides apart, so that of two things at different places exactly one of behind, left, in front and right
holds. Where both are at one place, there is no relation and no value.

Near a border noise makes relations flicker: put a `StabilityFilter` behind them.
"""

from typing import Final

from dyknow import NO_VALUE, Field, Sort, Value, value_unit
from dyknow.compunits.motion import Position, distance_xy, distance_z, heading_deg, offset_m, turn_deg, wrapped_deg
from dyknow.compunits.numeric import numeric, positive

CAR_RELATIONS: Final = Sort(
    "car_relations", tuple(Field(name, "bool") for name in ("behind", "beside", "in_front", "left", "right"))
)
"""The output of `CarRelations`: `car_relations.behind[car1, car2]` is "car1 is behind car2"."""

_COMPASS: Final = ("north", "northeast", "east", "southeast", "south", "southwest", "west", "northwest")
_SIDES: Final = ("in_front", "right", "behind", "left")


def side(one: Position, forward_deg: float, other: Position) -> str | None:
    """On which side of the other the first one is: one of in_front, right, behind, left; None where both are at one place."""
    north_m, east_m = offset_m(other, one)
    if not north_m and not east_m:
        return None
    return _SIDES[round(turn_deg(forward_deg, heading_deg(north_m, east_m)) / 90.0) % 4]


@value_unit("relation", "position", "heading", "position", name="Relation")
@numeric(2, 1, 2)
def relation(one: Position, forward_deg: float, other: Position) -> Value:
    """Where the first is, seen from the second: in_front, right, behind or left."""
    return side(one, forward_deg, other) or NO_VALUE


@value_unit("car_relations", "position", "heading", "position", name="CarRelations")
@numeric(2, 1, 2)
def car_relations(one: Position, forward_deg: float, other: Position) -> Value:
    """All of them as one record, `CAR_RELATIONS`."""
    found = side(one, forward_deg, other)
    if found is None:
        return NO_VALUE
    return found == "behind", found in {"left", "right"}, found == "in_front", found == "left", found == "right"


@value_unit("boolean", "position", "heading", "position", name="Behind")
@numeric(2, 1, 2)
def behind(one: Position, forward_deg: float, other: Position) -> Value:
    """The first is behind the second."""
    return _is({"behind"}, side(one, forward_deg, other))


@value_unit("boolean", "position", "heading", "position", name="Beside")
@numeric(2, 1, 2)
def beside(one: Position, forward_deg: float, other: Position) -> Value:
    """The first is left or right of the second."""
    return _is({"left", "right"}, side(one, forward_deg, other))


@value_unit("boolean", "position", "heading", "position", name="InFront")
@numeric(2, 1, 2)
def in_front(one: Position, forward_deg: float, other: Position) -> Value:
    """The first is in front of the second."""
    return _is({"in_front"}, side(one, forward_deg, other))


@value_unit("boolean", "position", "heading", "position", name="LeftOf")
@numeric(2, 1, 2)
def left_of(one: Position, forward_deg: float, other: Position) -> Value:
    """The first is left of the second."""
    return _is({"left"}, side(one, forward_deg, other))


@value_unit("boolean", "position", "heading", "position", name="RightOf")
@numeric(2, 1, 2)
def right_of(one: Position, forward_deg: float, other: Position) -> Value:
    """The first is right of the second."""
    return _is({"right"}, side(one, forward_deg, other))


def _is(wanted: set[str], found: str | None) -> Value:
    return NO_VALUE if found is None else found in wanted


@value_unit("heading", "heading", "heading", name="ForwardAlong")
@numeric(1, 1)
def forward_along(road_deg: float, track_deg: float) -> float:
    """The forward direction of a car: along its road segment or against it, whichever is nearer its track (8.7.5)."""
    return wrapped_deg(road_deg if abs(turn_deg(road_deg, track_deg)) <= 90.0 else road_deg + 180.0)


@value_unit("boolean", "position", "position")
class Close:
    """Their `DistanceXY` is at most `metres`."""

    def __init__(self, metres: float = 50.0) -> None:
        self._most_m = positive("metres", metres)

    def __call__(self, one: Value, other: Value) -> Value:
        found = distance_xy(one, other)
        return found if found is NO_VALUE else found <= self._most_m


@value_unit("boolean", "altitude", "altitude")
class SameHeight:
    """Their `DistanceZ` is at most `metres`."""

    def __init__(self, metres: float = 5.0) -> None:
        self._most_m = positive("metres", metres)

    def __call__(self, one: Value, other: Value) -> Value:
        found = distance_z(one, other)
        return found if found is NO_VALUE else found <= self._most_m


@value_unit("direction", "position", "position")
class DirectionSector:
    """In which of 4 or 8 directions the second position lies, seen from the first: north, northeast, east, and so on."""

    def __init__(self, sectors: int = 8) -> None:
        if sectors not in {4, 8}:
            raise ValueError(f"there are 4 or 8 directions, not {sectors!r}")
        self._names = _COMPASS[:: 8 // sectors]

    @numeric(2, 2)
    def __call__(self, one: Position, other: Position) -> Value:
        north_m, east_m = offset_m(one, other)
        if not north_m and not east_m:
            return NO_VALUE
        count = len(self._names)
        return self._names[round(heading_deg(north_m, east_m) * count / 360.0) % count]


@value_unit("clock", "position", "heading", "position", name="ClockDirection")
@numeric(2, 1, 2)
def clock_direction(one: Position, forward_deg: float, other: Position) -> Value:
    """At how many o'clock the first, which faces `forward_deg`, sees the second: 12 is ahead, 3 to the right."""
    north_m, east_m = offset_m(one, other)
    if not north_m and not east_m:
        return NO_VALUE
    return round(turn_deg(forward_deg, heading_deg(north_m, east_m)) / 30.0) % 12 or 12
