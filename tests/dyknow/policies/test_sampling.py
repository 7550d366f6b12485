from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow import NO_VALUE, Policy, PolicyAdapter, Sample
from dyknow.model.sample import Quality
from dyknow.network.computational_unit import ComputationalUnit, of_values
from dyknow.policies.adapters import max_delay, monotone_order, sample_every, strict_order
from dyknow.policies.lines import interpolate
from dyknow.policies.sampling import CATCH_UP
from dyknow.policies.upcoming import MAX_AHEAD
from tests.dyknow.policies.filters import restrict
from tests.fakes import FakeClock
from tests.satisfaction import satisfied
from tests.strategies import gridded_streams, policies, streams

MOST_RECENT = Policy.parse("from 0 to oo, sample every 100us, max delay 250us, use most recent")


def delivered(adapter: PolicyAdapter, arrived: list[Sample]) -> list[Sample]:
    return [out for s in arrived for out in adapter.on_sample(s, s.available_us)]


@given(gridded_streams())
def test_the_adapter_does_in_one_step_what_the_filters_define(arrived: list[Sample]) -> None:
    sampled = PolicyAdapter(Policy(change="sample", sample_us=20, max_delay_us=50))
    assert delivered(sampled, arrived) == list(restrict(arrived, max_delay(50), sample_every(20), strict_order))
    ordered = PolicyAdapter(Policy(order="monotone", max_delay_us=50))
    assert delivered(ordered, arrived) == list(restrict(arrived, max_delay(50), monotone_order))


@given(streams())
def test_a_stream_without_constraints_passes_as_it_is(arrived: list[Sample]) -> None:
    adapter = PolicyAdapter(Policy())
    assert delivered(adapter, arrived) == arrived
    assert not adapter.dropped


@given(policies(), streams(), st.integers(1, 50))
def test_available_times_increase_strictly_however_coarse_the_clock(
    policy: Policy, arrived: list[Sample], tick_us: int
) -> None:
    adapter, out = PolicyAdapter(policy), []
    for s in arrived:
        now_us = s.available_us // tick_us * tick_us
        out += adapter.on_sample(s._replace(available_us=now_us), now_us)
    assert all(a.available_us < b.available_us for a, b in pairwise(out))


def test_a_tie_is_moved_after_the_maximum_delay_was_checked() -> None:
    adapter = PolicyAdapter(Policy(max_delay_us=10))
    assert adapter.on_sample(Sample(15, 5, "a"), 15) == [Sample(15, 5, "a")]
    assert adapter.on_sample(Sample(15, 5, "b"), 15) == [Sample(16, 5, "b")]
    assert adapter.on_sample(Sample(15, 4, "c"), 15) == []


def test_a_sample_that_waited_is_judged_by_when_it_could_be_used() -> None:
    adapter = PolicyAdapter(Policy(max_delay_us=10))
    assert adapter.on_sample(Sample(5, 5, "a"), 20) == []
    assert adapter.on_sample(Sample(15, 15, "b"), 20) == [Sample(20, 15, "b")]
    assert adapter.dropped == {"late": 1}


def test_what_is_dropped_is_counted_by_reason() -> None:
    adapter = PolicyAdapter(Policy.parse("sample every 10us, from 100us to 200us, max delay 50us"))
    for at, valid in [(100, 90), (110, 105), (120, 110), (130, 110), (160, 100), (201, 150), (230, 210)]:
        adapter.on_sample(Sample(at, valid, "v"), at)
    assert adapter.dropped == {"outside duration": 2, "off grid": 1, "out of order": 1, "late": 2}
    changes = PolicyAdapter(Policy.parse("any change"))
    for at, valid, value in [(1, 1, "a"), (2, 1, "a"), (3, 1, "b"), (4, 2, "b"), (5, 2, "b")]:
        changes.on_sample(Sample(at, valid, value), at)
    assert changes.dropped == {"no change": 2}


def test_each_hole_in_the_grid_is_one_gap() -> None:
    adapter = PolicyAdapter(Policy(change="sample", sample_us=10))
    delivered(adapter, [Sample(t, t, "v") for t in (5, 15, 45, 55, 75)])
    assert adapter.gaps == 2


# use most recent


def test_a_missing_sample_is_approximated_when_its_delay_is_over() -> None:
    clock, adapter = FakeClock(300), PolicyAdapter(MOST_RECENT)
    assert adapter.on_sample(Sample(300, 300, "a"), clock.now_us()) == [], "100 and 200 may still come"
    assert adapter.deadline_us == 350
    clock.advance_us(50)
    assert adapter.on_time(clock.now_us()) == [Sample(350, 100, NO_VALUE)]
    assert adapter.on_sample(Sample(420, 200, "late but in time"), 420) == [
        Sample(420, 200, "late but in time"),
        Sample(421, 300, "a"),
    ]
    assert adapter.on_sample(Sample(430, 430, "off grid"), 430) == []
    assert adapter.on_time(650) == [Sample(650, 400, "a")]
    assert adapter.on_time(750) == [Sample(750, 500, "off grid")]
    assert adapter.dropped == {"off grid": 1}


def test_at_one_instant_the_sample_comes_before_the_timer() -> None:
    adapter = PolicyAdapter(MOST_RECENT)
    adapter.on_time(0)
    assert adapter.on_sample(Sample(250, 0, "just in time"), 250) == [Sample(250, 0, "just in time")]
    assert adapter.on_sample(Sample(351, 100, "a moment late"), 351) == [Sample(350, 100, "just in time")]
    assert adapter.dropped == {"late": 1}


def test_a_timer_that_goes_off_late_hands_on_what_was_due() -> None:
    punctual, late = PolicyAdapter(MOST_RECENT), PolicyAdapter(MOST_RECENT)
    punctual.on_time(0)
    late.on_time(0)
    arrivals = [Sample(10, 0, "a"), Sample(460, 300, "c"), Sample(461, 200, "b"), Sample(1300, 1100, "d")]
    found = [
        each
        for one in arrivals
        for each in (*punctual._until(one.available_us - 1), *punctual.on_sample(one, one.available_us))
    ]
    found += punctual._until(1500)
    stood_still = [each for one in arrivals for each in late.on_sample(one, one.available_us)]
    stood_still += late.on_time(1500)
    assert stood_still == found
    assert satisfied(MOST_RECENT, found)
    assert punctual.dropped == late.dropped


def test_at_one_instant_all_samples_come_before_the_timer() -> None:
    adapter = PolicyAdapter(MOST_RECENT)
    adapter.on_time(0)
    assert adapter.on_sample(Sample(250, 100, "next"), 250) == []
    assert adapter.on_sample(Sample(250, 0, "now"), 250) == [Sample(250, 0, "now"), Sample(251, 100, "next")]


def test_points_that_were_due_before_anybody_listened_are_not_made_up() -> None:
    adapter = PolicyAdapter(MOST_RECENT)
    now_us = 1_800_000_000_000_000
    assert adapter.deadline_us == 250
    assert adapter.on_time(now_us) == []
    assert adapter.deadline_us == now_us + 50
    assert adapter.on_time(now_us + 50) == [Sample(now_us + 50, now_us - 200, NO_VALUE)]
    assert adapter.gaps == 0


def test_after_a_silence_of_the_caller_the_last_points_are_caught_up_with() -> None:
    adapter = PolicyAdapter(MOST_RECENT)
    adapter.on_sample(Sample(10, 0, "a"), 10)
    caught_up = adapter.on_time(10**15)
    assert len(caught_up) == CATCH_UP
    assert {s.value for s in caught_up} == {"a"}
    assert adapter.gaps == 1
    assert adapter.deadline_us == 10**15 + 50


def test_a_duration_that_is_over_leaves_no_timer() -> None:
    adapter = PolicyAdapter(Policy.parse("from 0 to 200us, sample every 100us, max delay 50us, use most recent"))
    assert [s.valid_us for t in (50, 150, 250) for s in adapter.on_time(t)] == [0, 100, 200]
    assert adapter.deadline_us is None
    assert adapter.on_sample(Sample(300, 300, "a"), 300) == []


def test_samples_from_the_far_future_fill_no_memory() -> None:
    adapter = PolicyAdapter(MOST_RECENT)
    adapter.on_time(0)
    for n in range(3 * MAX_AHEAD):
        adapter.on_sample(Sample(n % 200, 10**12 + 100 * n, "far"), n % 200)
    assert adapter.dropped["overflow"] == 2 * MAX_AHEAD
    assert adapter.on_sample(Sample(200, 0, "now"), 200) == [Sample(200, 0, "now")], (
        "and keep nothing near from coming through"
    )


# use linear


def test_a_missing_point_is_interpolated_when_the_sample_after_it_arrives() -> None:
    adapter = PolicyAdapter(Policy.parse("sample every 100us, use linear, from 0"))
    assert adapter.on_sample(Sample(60, 50, (0.0, 1)), 60) == []
    assert adapter.on_sample(Sample(260, 250, (2.0, 5)), 260) == [
        Sample(260, 100, (0.5, 2.0)),
        Sample(261, 200, (1.5, 4.0)),
    ]
    assert adapter.on_sample(Sample(300, 300, (9.0, 9)), 300) == [Sample(300, 300, (9.0, 9))], (
        "an exact value is not touched"
    )
    assert adapter.deadline_us is None
    assert adapter.on_time(10**9) == []


def test_a_long_silence_is_not_interpolated_without_end() -> None:
    adapter = PolicyAdapter(Policy.parse("sample every 100us, use linear, from 0"))
    adapter.on_sample(Sample(0, 0, 0.0), 0)
    assert len(adapter.on_sample(Sample(10**15, 10**15, 1.0), 10**15)) <= CATCH_UP + 1


def test_what_lies_on_no_line_is_a_gap() -> None:
    adapter = PolicyAdapter(Policy.parse("sample every 100us, use linear, from 0"))
    adapter.on_sample(Sample(0, 0, NO_VALUE), 0)
    assert [s.valid_us for s in adapter.on_sample(Sample(200, 200, 1.0), 200)] == [200]
    assert adapter.gaps == 1


@given(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6), st.integers(1, 1000), st.integers(0, 1000))
def test_interpolation_stays_between_its_ends(a: float, b: float, length_us: int, at_us: int) -> None:
    at_us = min(at_us, length_us)
    value = interpolate(Sample(0, 0, a), Sample(0, length_us, b), at_us)
    assert min(a, b) - 1e-6 <= value <= max(a, b) + 1e-6
    assert value == pytest.approx(a + (b - a) * at_us / length_us, abs=1e-6)


@pytest.mark.parametrize(
    ("a", "b"),
    [
        ("x", "y"),
        (True, False),
        ((1.0,), (1.0, 2.0)),
        ((1.0,), 1.0),
        (1.0, (1.0,)),
        (NO_VALUE, 1.0),
        ((1.0, "x"), (2.0, "y")),
    ],
)
def test_values_without_a_line_have_no_value_between_them(a: object, b: object) -> None:
    assert interpolate(Sample(0, 0, a), Sample(0, 10, b), 5) is NO_VALUE


def test_what_is_too_uncertain_is_dropped_and_counted() -> None:
    adapter = PolicyAdapter(Policy(min_certainty=0.95, max_deviation=2.0))
    good, unsure = Sample(1, 1, "a", Quality(0.95, ((4.0,),))), Sample(2, 2, "b", Quality(0.9))
    spread = Sample(3, 3, "c", Quality(1.0, ((1.0, 0.0), (0.0, 4.1))))
    assert delivered(adapter, [good, unsure, spread, Sample(4, 4, "d")]) == [good, Sample(4, 4, "d")]
    assert adapter.dropped == {"uncertain": 2}


def test_what_is_too_uncertain_stands_in_for_nothing() -> None:
    """The most recent value is that of a sample which is good enough, and what it is worth comes with it."""
    policy = Policy.parse("from 0, sample every 10us, max delay 5us, use most recent, min certainty 0.5")
    adapter = PolicyAdapter(policy)
    assert adapter.on_sample(Sample(0, 0, "a", Quality(0.7)), 0) == [Sample(0, 0, "a", Quality(0.7))]
    assert adapter.on_sample(Sample(9, 9, "b", Quality(0.4)), 9) == []
    assert adapter.on_time(15) == [Sample(15, 10, "a", Quality(0.7))]


def test_between_two_samples_certainty_is_the_lesser_and_errors_are_independent() -> None:
    adapter = PolicyAdapter(Policy.parse("sample every 10us, use linear"))
    adapter.on_sample(Sample(0, 0, 1.0, Quality(0.9, ((4.0,),))), 0)
    (middle, last) = adapter.on_sample(Sample(20, 20, 3.0, Quality(0.8, ((4.0,),))), 20)
    assert middle == Sample(20, 10, 2.0, Quality(0.8, ((2.0,),)))
    assert last.quality == Quality(0.8, ((4.0,),))


def test_a_unit_is_as_sure_as_all_that_it_computes_from() -> None:
    unit = ComputationalUnit(of_values(lambda a, b: a + b), 2)
    unit.on_sample(0, Sample(1, 1, 1, Quality(0.5)), 1)
    assert unit.on_sample(1, Sample(2, 2, 2, Quality(0.5)), 2) == Sample(2, 2, 3, Quality(0.25))
