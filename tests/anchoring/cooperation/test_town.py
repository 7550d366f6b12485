"""Three platforms over a town with twelve cars: identities over all platforms, as py-motmetrics scores them."""

import os
from statistics import fmean

import pytest

from bench.cooperation.scores import scored

FULL = bool(os.environ.get("DYKNOW_FULL"))


RUNS = 20 if FULL else 1


@pytest.mark.timeout(1200 if FULL else 240)
def test_idf1_over_platforms_is_at_least_nine_tenths() -> None:
    scores = [scored(seed, 60.0 if FULL else 25.0) for seed in range(RUNS)]
    assert fmean(each.idf1 for each in scores) >= 0.9, scores
    assert min(each.agreement for each in scores) >= 0.98, scores
