"""How much one peer may ask: buckets that refill, and a bounded number of them."""

from hypothesis import given
from hypothesis import strategies as st

from dyknow.federation.shares import ActLimits, TokenBucket

MOMENTS = st.lists(st.integers(0, 2_000_000), max_size=200).map(sorted)


@given(MOMENTS)
def test_a_bucket_never_gives_more_than_its_burst_and_its_rate(moments: list[int]) -> None:
    bucket = TokenBucket(20.0, 5.0, 5.0)
    given_at = [at_us for at_us in moments if bucket.take(at_us)]
    for first in range(len(given_at)):
        for last in range(first, len(given_at)):
            assert last - first + 1 <= 5 + 20.0 * (given_at[last] - given_at[first]) / 1e6 + 1e-6


def test_names_cost_no_memory_and_the_busy_are_not_forgotten() -> None:
    limits = ActLimits(20.0, 3.0, peers=4)
    assert [limits.admit("busy", 0) for _ in range(4)] == [True, True, True, False]
    for at in range(3):
        limits.admit(f"n{at}", 0)
    assert not limits.admit("busy", 0)
    for at in range(100):
        limits.admit(f"m{at}", 0)
    assert len(limits._buckets) == 4
