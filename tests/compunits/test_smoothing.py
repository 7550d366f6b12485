"""Each filter against a slow transcription of what it says it is."""

import math
import statistics

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from dyknow import NO_VALUE, Predicted, Quality, Sample, variant
from dyknow.compunits import MovingAverage, StabilityFilter
from tests.compunits.units import outputs, process, stream, values

NUMBERS = st.floats(-1e6, 1e6)
STEPS_MS = st.integers(-100, 400)
WINDOWS = st.sampled_from([{}, {"samples": 1}, {"samples": 3}, {"seconds": 0.5}, {"seconds": 0.5, "samples": 2}])


def timed(steps_ms, readings) -> list[Sample]:
    at, found = 0, []
    for step, value in zip(steps_ms, readings, strict=False):
        at += step * 1000
        found.append(Sample(at, at, value))
    return found


def in_order(samples: list[Sample]) -> list[list[Sample] | None]:
    """For each sample those that are not late, up to it; None for those that are late."""
    taken: list[Sample] = []
    found: list[list[Sample] | None] = []
    for sample in samples:
        if taken and sample.valid_us < taken[-1].valid_us:
            found.append(None)
        else:
            taken.append(sample)
            found.append(list(taken))
    return found


def windowed(taken: list[Sample], seconds: float = math.inf, samples: int | None = None) -> list:
    if seconds == math.inf and samples is None:
        samples = 5
    now_us = taken[-1].valid_us
    young = [s.value for s in taken if s.valid_us > now_us - seconds * 1e6]
    return young if samples is None else young[-samples:]


@given(st.lists(STEPS_MS, max_size=30), st.lists(NUMBERS, min_size=30, max_size=30), WINDOWS)
def test_mean_and_median_are_those_of_the_last_samples(steps, readings, window) -> None:
    samples = timed(steps, readings)
    expected = in_order(samples)
    for name, reduce in (("MovingAverage", statistics.fmean), ("MovingMedian", statistics.median)):
        for made, taken in zip(outputs(name, samples, **window), expected, strict=True):
            if taken is None:
                assert made is None
            else:
                assert made.valid_us == taken[-1].valid_us
                assert made.value == pytest.approx(reduce(windowed(taken, **window)), rel=1e-9, abs=1e-6)


@given(st.lists(STEPS_MS, max_size=20), st.lists(NUMBERS, min_size=20, max_size=20), st.sampled_from([0.1, 1.0]))
def test_exponential_smoothing_weighs_by_age(steps, readings, constant) -> None:
    samples = timed(steps, readings)
    y: float | None = None
    for made, taken in zip(outputs("ExponentialSmoothing", samples, seconds=constant), in_order(samples), strict=True):
        if taken is None:
            assert made is None
            continue
        x = taken[-1].value
        dt = (taken[-1].valid_us - taken[-2].valid_us) / 1e6 if len(taken) > 1 else 0.0
        y = x if y is None else y + (1 - math.exp(-dt / constant)) * (x - y)
        assert made.value == pytest.approx(y, rel=1e-6, abs=1e-6)


def test_records_are_smoothed_field_by_field_and_stay_records() -> None:
    samples = stream((0, (1.0, 10.0)), (1, (3.0, 20.0)))
    for name in ("MovingAverage", "MovingMedian"):
        assert values(outputs(name, samples)) == [(1.0, 10.0), (2.0, 15.0)]
    assert values(outputs("ExponentialSmoothing", samples))[1] == pytest.approx((2.264, 16.32), abs=0.01)


def test_without_a_value_there_is_none_and_nothing_is_forgotten() -> None:
    samples = stream((0, 1.0), (0.1, NO_VALUE), (0.2, math.nan), (0.3, 3.0))
    for name in ("MovingAverage", "MovingMedian"):
        assert values(outputs(name, samples)) == [1.0, NO_VALUE, NO_VALUE, 2.0]


def test_a_mean_is_as_certain_as_the_least_certain_in_it() -> None:
    samples = [Sample(i, i, 1.0, Quality(c, ((4.0,),))) for i, c in enumerate((1.0, 0.5, 0.9, 0.8))]
    found = outputs("MovingAverage", samples, samples=2)
    assert [made.quality for made in found] == [Quality(1.0), Quality(0.5), Quality(0.5), Quality(0.8)]


@pytest.mark.parametrize(
    "settings",
    [{"seconds": 0}, {"seconds": math.nan}, {"samples": 0}, {"samples": 2.5}, {"samples": True}, {"samples": 10**9}],
)
def test_windows_that_are_none_are_refused(settings) -> None:
    with pytest.raises(ValueError, match=next(iter(settings))):
        process("MovingAverage", **settings)


def stable(samples: list[Sample], span_us: int) -> list:
    """8.7.4: the value last seen to have been the same over `span_us`, by trying all beginnings and ends."""
    found = []
    for taken in in_order(samples):
        if taken is None:
            found.append(None)
            continue
        passed = None
        for j, end in enumerate(taken):
            for k in range(j + 1):
                lasted = end.valid_us - taken[k].valid_us >= span_us
                if lasted and all(s.value == end.value for s in taken[k : j + 1]):
                    passed = end.value
        found.append(passed)
    return found


@given(
    st.lists(STEPS_MS, max_size=20),
    st.lists(st.sampled_from(["l1", "l2", "no_link", NO_VALUE]), min_size=20, max_size=20),
    st.sampled_from([0.1, 0.5, 1.0]),
)
@example([100] * 20, ["l1"] * 7 + ["l2"] + ["l1"] * 3 + ["l2"] * 7 + ["l1"] * 2, 0.5)
def test_8_7_4_a_value_changes_only_after_it_has_been_stable(steps, readings, seconds) -> None:
    samples = timed(steps, readings)
    assert values(outputs("StabilityFilter", samples, seconds=seconds)) == stable(samples, round(seconds * 1e6))


def test_8_7_4_a_car_that_seems_to_enter_a_crossing_twice_enters_it_once() -> None:
    """Figure 8.8: noise near the border between link and crossing."""
    seen = ["l1"] * 8 + ["x1"] * 2 + ["l1"] * 2 + ["x1"] * 8
    samples = stream(*[(i / 10, value) for i, value in enumerate(seen)])
    found = [value for value in values(outputs("StabilityFilter", samples)) if value is not None]
    changes = [new for old, new in zip([None, *found], found, strict=False) if new != old]
    assert changes == ["l1", "x1"]


def test_what_is_not_finite_is_never_stable_and_interrupts() -> None:
    nan = (math.nan, 1.0)
    samples = stream(*[(i / 10, 1.0 if i != 7 else nan) for i in range(14)])
    assert set(values(outputs("StabilityFilter", samples))[5:]) == {1.0}
    frozen = stream(*[(i / 10, nan) for i in range(8)])
    assert values(outputs("StabilityFilter", frozen)) == [None] * 5 + [NO_VALUE] * 3


def test_a_user_names_a_variant_of_a_filter() -> None:
    link = variant(StabilityFilter, "StableLink", "link", "link", seconds=0.2, history_us=200_000)
    assert (link.name, link.sort, link.inputs, link.history_us) == ("StableLink", "link", ("link",), 200_000)
    samples = stream(*[(i / 10, "l1") for i in range(4)])
    assert values(outputs(link, samples)) == [None, None, "l1", "l1"]
    slower = variant(link, "SlowLink", seconds=0.3)
    assert values(outputs(slower, samples)) == [None, None, None, "l1"]
    assert (slower.sort, slower.history_us) == ("link", 200_000)
    assert variant(MovingAverage, "Smooth5", samples=5).sort == "?sort"


def test_what_is_predicted_or_uncertain_is_not_observed() -> None:
    unit = process("Observed")
    seen = Sample(0, 5, (1.0, 2.0))
    assert unit.on_sample(0, seen, 7) == Sample(7, 5, (1.0, 2.0))
    assert unit.on_sample(0, seen._replace(quality=Quality(0.5)), 7) is None
    assert unit.on_sample(0, seen._replace(quality=Quality(prediction=Predicted(4))), 7) is None


def test_a_record_that_is_not_known_for_half_a_second_is_no_value_and_begins_again() -> None:
    unit = process("StableFields")
    made = []
    for at in range(40):
        value = (True,) if at < 10 or at >= 25 else NO_VALUE
        out = unit.on_sample(0, Sample(at * 100_000, at * 100_000, value), at * 100_000)
        if out is not None:
            made.append((at, out.value))
    assert [each for each in made if each[1] is NO_VALUE] == [(15, NO_VALUE)]
    assert [at for at, value in made if value == (True,)] == [*range(5, 10), *range(30, 40)]
