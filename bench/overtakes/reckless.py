"""Reckless overtakes (thesis, Example 8.2.2): how often each of the three is recognised, and how often without cause."""

from collections import Counter
from typing import Final

import numpy as np

from bench.overtakes.drives import again_and_again, decent, oncoming_too_near, seen, wrong_side
from bench.overtakes.recognition import recognised

VARIANTS: Final = {
    "wrong_side": wrong_side,
    "oncoming_too_near": oncoming_too_near,
    "again_and_again": again_and_again,
}
"""By the name of the chronicle: drives in which it happens."""
SITUATIONS: Final = {**VARIANTS, "decent": decent}
PERIOD_MS: Final = 100
ERROR_M: Final = 2.0
"""The largest error of a coordinate."""


def counted(situation: str, runs: int, *, error_m: float = ERROR_M, filtered: bool = True) -> Counter[str]:
    """In how many of the runs 0, 1, ... of a situation each chronicle is recognised."""
    return Counter(name for number in range(runs) for name in told(situation, number, error_m, filtered=filtered))


def told(situation: str, number: int, error_m: float = ERROR_M, *, filtered: bool = True) -> set[str]:
    """The chronicles of which an instance is recognised in run `number`, which is its seed."""
    rng = np.random.default_rng((number, sorted(SITUATIONS).index(situation)))
    positions = seen(SITUATIONS[situation](rng), PERIOD_MS, error_m, rng)
    return {one.chronicle for one in recognised(positions, filtered=filtered)}
