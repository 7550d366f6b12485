"""Things are put somewhere in a local frame; what is said of them is what was arranged."""

import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from dyknow import NO_VALUE
from dyknow.compunits import CAR_RELATIONS
from dyknow.compunits.motion import turn_deg
from tests.compunits.test_motion import HERE, moved
from tests.compunits.units import prototype, value_of

HEADINGS = st.floats(0, 359)
SIDES = {"InFront": "in_front", "Behind": "behind", "LeftOf": "left", "RightOf": "right"}
PLACES = st.tuples(st.floats(-70, 70), st.floats(-180, 180))


def beside_it(place, forward_deg: float, ahead_m: float, right_m: float):
    """A place so many metres ahead of and to the right of another, for somebody who faces `forward_deg`."""
    angle = math.radians(forward_deg)
    return moved(
        place,
        ahead_m * math.cos(angle) - right_m * math.sin(angle),
        ahead_m * math.sin(angle) + right_m * math.cos(angle),
    )


@given(PLACES, HEADINGS, st.floats(-200, 200), st.floats(-200, 200))
def test_figure_8_11_exactly_one_side_holds_and_it_is_the_right_one(place, forward, ahead, right) -> None:
    """car1 is put `ahead` of and `right` of car2, both driving `forward`."""
    assume(abs(abs(ahead) - abs(right)) > 0.1)
    car1, car2 = beside_it(place, forward, ahead, right), place
    expected = (
        ("in_front" if ahead > 0 else "behind") if abs(ahead) > abs(right) else ("right" if right > 0 else "left")
    )
    assert value_of("Relation", car1, forward, car2) == expected
    assert {name: value_of(name, car1, forward, car2) for name in SIDES} == {
        name: side == expected for name, side in SIDES.items()
    }
    assert value_of("Beside", car1, forward, car2) == (expected in {"left", "right"})
    record = CAR_RELATIONS.as_record(value_of("CarRelations", car1, forward, car2))
    assert {name for name, holds in record.items() if holds} - {"beside"} == {expected}
    assert record["beside"] == (record["left"] or record["right"])


@given(PLACES, HEADINGS, st.floats(5, 100), st.floats(-4, 4))
def test_who_drives_the_same_way_and_is_behind_has_the_other_in_front(place, forward, ahead, right) -> None:
    car1 = beside_it(place, forward, ahead, right)
    assert value_of("InFront", car1, forward, place) is True
    assert value_of("Behind", place, forward, car1) is True


def test_8_7_5_an_overtake_goes_from_behind_by_beside_to_in_front() -> None:
    seen = [value_of("Relation", beside_it(HERE, 30.0, ahead, -3.5), 30.0, HERE) for ahead in range(-20, 21)]
    assert [new for old, new in zip([None, *seen], seen, strict=False) if new != old] == ["behind", "left", "in_front"]


@given(HEADINGS, HEADINGS)
def test_8_7_5_the_forward_direction_is_along_the_road_or_against_it(road, track) -> None:
    found = value_of("ForwardAlong", road, track)
    assert 0 <= found < 360
    assert min(abs(turn_deg(found, road)), abs(turn_deg(found, road + 180))) < 1e-9
    assert abs(turn_deg(found, track)) <= 90 + 1e-9


def test_at_one_place_there_is_no_relation() -> None:
    for name in (*SIDES, "Relation", "CarRelations", "Beside", "ClockDirection"):
        assert value_of(name, HERE, 10.0, HERE) is NO_VALUE
    assert value_of("DirectionSector", HERE, HERE) is NO_VALUE


def test_close_and_same_height_have_a_measure() -> None:
    near, far = moved(HERE, 30, 0), moved(HERE, 60, 0)
    assert [value_of("Close", HERE, place) for place in (near, far)] == [True, False]
    assert [value_of("Close", HERE, place, metres=20.0) for place in (near, far)] == [False, False]
    assert [value_of("SameHeight", (100.0,), (height,)) for height in (104.0, 106.0)] == [True, False]
    assert value_of("SameHeight", (100.0,), NO_VALUE) is NO_VALUE
    with pytest.raises(ValueError, match="metres"):
        prototype("Close").make(metres=-1.0)


NAMES = ["north", "northeast", "east", "southeast", "south", "southwest", "west", "northwest"]


@given(PLACES, st.integers(0, 7), st.floats(-22, 22), st.floats(1, 500))
def test_the_sector_is_the_nearest_direction(place, sector, off, distance) -> None:
    there = beside_it(place, 45.0 * sector + off, distance, 0.0)
    assert value_of("DirectionSector", place, there) == NAMES[sector]


@given(PLACES, st.integers(0, 3), st.floats(-44, 44))
def test_there_may_be_four_sectors(place, sector, off) -> None:
    there = beside_it(place, 90.0 * sector + off, 50.0, 0.0)
    assert value_of("DirectionSector", place, there, sectors=4) == NAMES[2 * sector]
    with pytest.raises(ValueError, match="4 or 8"):
        prototype("DirectionSector").make(sectors=5)


@given(PLACES, HEADINGS, st.integers(1, 12), st.floats(-14, 14))
def test_the_clock_tells_where_to_look(place, forward, hour, off) -> None:
    there = beside_it(place, forward + 30.0 * hour + off, 300.0, 0.0)
    assert value_of("ClockDirection", place, forward, there) == hour
