"""Three platforms over a town with twelve cars: identities over all platforms, as py-motmetrics scores them."""

import os

import pytest

from bench.cooperation.scores import scored

FULL = bool(os.environ.get("DYKNOW_FULL"))


@pytest.mark.parametrize("seed", range(20 if FULL else 1))
def test_idf1_over_platforms_is_at_least_nine_tenths(seed) -> None:
    score = scored(seed, 60.0 if FULL else 25.0)
    assert score.idf1 >= 0.9, score
    assert score.agreement >= 0.98, score
