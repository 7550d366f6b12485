"""Whatever arrives, a unit of the library gives a sound value, no value, or nothing."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dyknow import NO_VALUE, SURE, Quality, Sample
from dyknow.compunits import MovingAverage, library
from dyknow.compunits.numeric import is_sound, numbers_of
from tests.compunits.units import process, prototype

FEW = settings(max_examples=settings.default.max_examples // 3)
LONG_AGO, IN_AGES = -(2**62), 2**62


class Odd:
    """Not a value of any sort."""


components = st.one_of(
    st.sampled_from(
        [
            NO_VALUE,
            math.nan,
            math.inf,
            -math.inf,
            1e308,
            -1e308,
            1e-320,
            0.0,
            -0.0,
            True,
            10**400,
            None,
            "",
            b"x",
            Odd(),
        ]
    ),
    st.floats(),
    st.floats(-180, 180),
    st.integers(),
    st.text(max_size=3),
)
hostile = st.one_of(components, st.lists(components, max_size=5).map(tuple), st.just(((1.0, 2.0), 3.0)))
plausible = st.lists(st.floats(-90, 90), min_size=1, max_size=3).map(tuple)
covariances = st.lists(st.lists(st.floats(), max_size=3).map(tuple), max_size=3).map(tuple)
qualities = st.one_of(
    st.just(Quality()),
    st.builds(Quality, st.floats(0, 1), covariances),
    st.sampled_from([Quality(0.5, ((1e308,),)), Quality(1.0, ((5e-324, 0.0), (0.0, 5e-324)))]),
)
times = st.one_of(st.integers(0, 10_000_000), st.sampled_from([LONG_AGO, -1, 0, IN_AGES]))


@pytest.mark.parametrize("name", sorted(library()))
@FEW
@given(st.lists(st.tuples(st.integers(0, 3), times, hostile | plausible, qualities), max_size=12))
def test_hostile_values_kill_no_process(name, arrivals) -> None:
    unit, arity = process(name), len(prototype(name).inputs)
    for now_us, (i, valid_us, value, quality) in enumerate(arrivals):
        made = unit.on_sample(i % arity, Sample(now_us, valid_us, value, quality), now_us)
        if made is not None:
            assert is_sound(made.value)
            assert made.available_us == now_us
            assert isinstance(made.valid_us, int)


@pytest.mark.parametrize("name", sorted(library()))
def test_no_value_in_gives_no_value_or_nothing_out(name) -> None:
    unit = process(name)
    for i in range(len(prototype(name).inputs)):
        made = unit.on_sample(i, Sample(5, 5, NO_VALUE), 5)
    assert made is None or made.value is NO_VALUE


@pytest.mark.parametrize("name", ["KalmanConstant", "KalmanMoving", "KalmanPosition"])
@FEW
@given(st.lists(st.tuples(times, plausible | hostile, qualities), max_size=15))
def test_what_an_estimate_says_of_itself_is_a_covariance(name, arrivals) -> None:
    unit = process(name)
    for now_us, (valid_us, value, quality) in enumerate(arrivals):
        made = unit.on_sample(0, Sample(now_us, valid_us, value, quality), now_us)
        if made is not None and made.value is not NO_VALUE:
            count = len(numbers_of(made.value))
            rows = made.quality.covariance
            assert [len(row) for row in rows] == [count] * count
            assert all(math.isfinite(each) for row in rows for each in row)
            assert all(rows[i][i] >= 0 and rows[i][k] == rows[k][i] for i in range(count) for k in range(count))


def test_a_value_nested_without_end_is_no_value() -> None:
    value = (1.0,)
    for _ in range(100_000):
        value = (value,)
    unit = process("StabilityFilter")
    for i in range(3):
        made = unit.on_sample(0, Sample(i, i * 400_000, value), i)
    assert made.value is NO_VALUE


def test_a_flood_is_remembered_within_bounds() -> None:
    unit = MovingAverage(seconds=1e6)
    unit._window._known.extend((i, (1.0,), SURE) for i in range(10_000))
    made = unit(10_000, Sample(10_000, 10_000, 1.0))
    assert made is not None
    assert made.value == 1.0
    assert len(unit._window._known) == 10_000
