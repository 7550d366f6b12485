"""Places to look from: a square that expands from the middle of a prior, along its axes. Pure."""

from collections.abc import Iterator
from math import ceil, sqrt
from typing import Final

import numpy as np

from dyknow.model.errors import WrongCall
from dyknow.navigation.searching.landing import Floats, LandingPrior

MOST_STOPS: Final = 400


def expanding_square(
    prior: LandingPrior, swath_m: float, deviations: float = 4.0, margin_m: float = 2.0
) -> list[Floats]:
    """Stops, (2,) each, `swath_m` apart, from which squares of that width cover a prior up to `deviations`, and the margin.

    The nearest come first, ring by ring, each next to the one before it, as in an expanding square search. At most
    `MOST_STOPS`: a prior that is wider is covered as far as these go.

    Raises:
        WrongCall: a width is not positive.
    """
    if not (swath_m > 0.0 and deviations > 0.0 and margin_m >= 0.0):
        raise WrongCall(f"a square of {swath_m:g} m cannot expand; widths and deviations are positive")
    variances, axes = np.linalg.eigh(prior.covariance)
    # Squares that cover up to `half` on both sides of the middle one, along each axis.
    rings = [max(0, ceil((deviations * sqrt(max(variance, 0.0)) + margin_m) / swath_m - 0.5)) for variance in variances]
    stops = (
        prior.mean + axes @ (swath_m * np.array(cell, dtype=np.float64))
        for cell in _spiral(max(rings))
        if abs(cell[0]) <= rings[0] and abs(cell[1]) <= rings[1]
    )
    return [stop for stop, _ in zip(stops, range(MOST_STOPS), strict=False)]


def _spiral(rings: int) -> Iterator[tuple[int, int]]:
    """Cells of a square lattice: legs of 1, 1, 2, 2, 3, 3, ... steps."""
    x, y, step = 0, 0, (1, 0)
    yield x, y
    length = 1
    while length <= 2 * rings + 1:
        for _ in range(2):
            for _ in range(length):
                x, y = x + step[0], y + step[1]
                yield x, y
            step = -step[1], step[0]
        length += 1
