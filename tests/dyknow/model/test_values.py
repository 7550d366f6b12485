import copy
import pickle
from math import inf, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow import NO_VALUE, Field, NoValue, Sort, SortError

POSITION = Sort("position", (Field("latitude_deg", "deg"), Field("longitude_deg", "deg")))
STATUS = Sort("status", (Field("armed", "bool"), Field("mode", "text"), Field("battery", "1")))
finite = st.floats(-1e30, 1e30) | st.integers(-(10**9), 10**9)


def test_no_value_is_one_falsy_thing_that_survives_copies() -> None:
    assert not NO_VALUE
    assert (repr(NO_VALUE), str(NO_VALUE)) == ("no_value", "no_value")
    assert isinstance(NO_VALUE, NoValue)
    assert copy.deepcopy(NO_VALUE) is NO_VALUE
    assert pickle.loads(pickle.dumps(NO_VALUE)) is NO_VALUE
    assert NO_VALUE not in (0, False, None, "no_value")


@given(finite, finite)
def test_a_record_and_its_tuple_are_the_same_value(latitude: float, longitude: float) -> None:
    record = {"longitude_deg": longitude, "latitude_deg": latitude}
    assert POSITION.as_record((latitude, longitude)) == record


def test_fields_may_hold_truth_values_and_texts_where_the_unit_says_so() -> None:
    STATUS.check((True, "GUIDED", 0.7))
    for wrong in ((1, "GUIDED", 0.7), (True, 4, 0.7), (True, "GUIDED", True)):
        with pytest.raises(SortError):
            STATUS.check(wrong)


@pytest.mark.parametrize(
    "wrong",
    [(1.0,), (1.0, 2.0, 3.0), [1.0, 2.0], 1.0, "ab", None, (nan, 0.0), (0.0, inf), (True, 0.0), ("1", 0.0), (10**400, 0.0), (NO_VALUE, 0.0), ((1.0,), 0.0)],
)  # fmt: skip
def test_what_is_not_of_the_sort_is_refused_and_named(wrong: object) -> None:
    with pytest.raises(SortError, match="position"):
        POSITION.check(wrong)


def test_no_value_is_of_every_sort() -> None:
    POSITION.check(NO_VALUE)
    with pytest.raises(SortError):
        POSITION.as_record(NO_VALUE)


def test_a_sort_without_fields_holds_simple_values() -> None:
    speed = Sort("speed")
    for value in (1, 1.5, True, "fast"):
        speed.check(value)
        assert speed.as_record(value) == {"value": value}
    for wrong in (nan, (1.0,), None, [1]):
        with pytest.raises(SortError):
            speed.check(wrong)


def test_a_huge_value_does_not_make_a_huge_message() -> None:
    with pytest.raises(SortError) as refused:
        POSITION.check("x" * 1_000_000)
    assert len(str(refused.value)) < 300
