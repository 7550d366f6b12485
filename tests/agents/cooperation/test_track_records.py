"""What others say of their tracks is read, or is nothing; no number ends the reader."""

import pytest

from agents.cooperation.track_records import identity_claim


@pytest.mark.parametrize("born_s", [1e303, -1e303, 1e13, float("nan"), float("inf"), True, "soon"])
def test_a_time_that_no_instant_holds_claims_nothing(born_s):
    assert identity_claim("3", ("car-1", "3-car-1", born_s, 1.0, False)) is None
    assert identity_claim("3", ("car-1", "3-car-1", 1.0, born_s, False)) is None


def test_a_claim_is_read_in_microseconds():
    claim = identity_claim("3", ("car-1", "3-car-1", 1.5, 2.0, False))
    assert claim is not None
    assert (claim.born_us, claim.since_us) == (1_500_000, 2_000_000)
