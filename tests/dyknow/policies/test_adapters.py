from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow import PolicyError, Sample
from dyknow.policies.adapters import (
    any_change,
    duration,
    max_delay,
    monotone_order,
    on_grid,
    sample_every,
    strict_order,
)
from tests.dyknow.policies.filters import restrict
from tests.strategies import gridded_streams, streams


@given(streams())
def test_restricted_stream_satisfies_its_policy(arrived: list[Sample]) -> None:
    kept = list(restrict(arrived, max_delay(100), monotone_order))
    assert all(s.delay_us <= 100 for s in kept)
    assert all(a.valid_us <= b.valid_us for a, b in pairwise(kept))
    assert [s for s in arrived if s in kept] == kept, "a subsequence: nothing invented, nothing moved"
    assert kept or all(s.delay_us > 100 for s in arrived), "and not empty without need"


@given(streams())
def test_what_restricts_nothing_keeps_everything(arrived: list[Sample]) -> None:
    assert list(restrict(arrived, duration(None, None))) == arrived


@given(gridded_streams(), st.sampled_from([10, 20, 40]), st.integers(0, 20))
def test_sampled_streams_keep_to_their_grid(arrived: list[Sample], period_us: int, anchor_us: int) -> None:
    kept = list(restrict(arrived, sample_every(period_us), on_grid(period_us, anchor_us)))
    assert all((s.valid_us - anchor_us) % period_us == 0 for s in kept)
    assert all(b.valid_us - a.valid_us >= period_us for a, b in pairwise(kept))


@given(streams())
def test_any_change_drops_only_repetitions_of_value_and_valid_time(arrived: list[Sample]) -> None:
    kept = list(restrict(arrived, any_change))
    assert all(a[1:] != b[1:] for a, b in pairwise(kept))
    assert [s[1:] for s in kept] == [
        s[1:] for before, s in pairwise([None, *arrived]) if before is None or before[1:] != s[1:]
    ]


@given(streams(), st.integers(0, 300), st.integers(0, 300))
def test_durations_include_both_ends(arrived: list[Sample], from_us: int, length_us: int) -> None:
    kept = list(restrict(arrived, duration(from_us, from_us + length_us)))
    assert kept == [s for s in arrived if s.valid_us in range(from_us, from_us + length_us + 1)]


def test_strict_order_refuses_equal_times_and_monotone_order_does_not() -> None:
    a, b = Sample(1, 5, "a"), Sample(2, 5, "b")
    assert list(restrict([a, b], strict_order)) == [a]
    assert list(restrict([a, b], monotone_order)) == [a, b]


@pytest.mark.parametrize(
    "wrong", [lambda: sample_every(0), lambda: sample_every(-1), lambda: max_delay(-1), lambda: duration(2, 1)]
)
def test_constraints_no_stream_can_satisfy_are_refused(wrong: object) -> None:
    with pytest.raises(PolicyError):
        wrong()  # type: ignore[operator]
