"""Places in records of streams: metres of another platform are about another origin, degrees are the same everywhere."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow import NO_VALUE, Sample
from dyknow.anchoring.links.states import ObjectState, diagonal
from dyknow.anchoring.links.structures import StateRecord
from dyknow.anchoring.percepts.records import ObjectRecords, PerceptRecords, object_sort
from dyknow.navigation import LocalFrame

THEIRS, OURS = LocalFrame(58.41, 15.62, 0.0), LocalFrame(58.40, 15.60, 0.0)
SORT = object_sort("car", [], is_placed=True)
METRES = st.floats(-5000.0, 5000.0)


def record(x_m: float, y_m: float) -> tuple[object, ...]:
    """The state of an object of another platform, as its stream has it."""
    state = StateRecord(0, "wo1", "car", ObjectState(0, x_m, y_m, 1.0, 2.0, diagonal(0.5)), (), None)
    value = ObjectRecords(SORT, THEIRS).value(state, is_anchored=True, ended=False)
    assert isinstance(value, tuple)
    return value


def place(value: tuple[object, ...], frame: LocalFrame | None) -> tuple[float, float]:
    percept = PerceptRecords("car", SORT, frame).percept(Sample(0, 0, value))
    assert percept is not None
    assert percept.state is not None
    return percept.state.x_m, percept.state.y_m


@given(x_m=METRES, y_m=METRES)
def test_degrees_count_where_a_record_has_both(x_m: float, y_m: float) -> None:
    latitude_deg, longitude_deg = THEIRS.level(y_m, x_m, 0.0)
    north_m, east_m, _ = OURS.to_ned(latitude_deg, longitude_deg, 0.0)
    assert place(record(x_m, y_m), OURS) == pytest.approx((east_m, north_m), abs=0.001)
    assert math.dist(place(record(x_m, y_m), OURS), (x_m, y_m)) > 1000.0, "their origin is another"
    assert place(record(x_m, y_m), THEIRS) == pytest.approx((x_m, y_m), abs=0.001)


def test_metres_count_where_no_origin_is_known_or_degrees_are_missing() -> None:
    value = record(100.0, 200.0)
    assert place(value, None) == (100.0, 200.0)
    names = [field.name for field in SORT.fields]
    without = tuple(NO_VALUE if name == "latitude_deg" else each for name, each in zip(names, value, strict=True))
    assert place(without, OURS) == (100.0, 200.0)
