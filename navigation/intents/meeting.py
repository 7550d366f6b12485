"""Whether tubes come too near to each other, as one number a step: the closeness.

closeness(t) = max(level distance / (R + both radii), upright gap / H): below 1 both minima are lost. Two that are nearer than
that already meet only if they come nearer still.
"""

from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from dyknow.navigation.intents.path import STEP_S, Tube


class Minima(NamedTuple):
    """The least distances of vehicles, level or upright, metres, besides the widths of their tubes."""

    level_m: float
    upright_m: float


MINIMA: Final = Minima(15.0, 10.0)
"""Less than that is a conflict."""
WIDER: Final = Minima(20.0, 12.0)
"""The minima of a chosen way, so that the next look still finds it free."""
NEARER: Final = 0.05
"""By so much a pair that is too near already has to come nearer for a conflict."""

Closeness = npt.NDArray[np.float64]


def closeness(own: Tube, others: npt.NDArray[np.float64], minima: Minima) -> Closeness:
    """Of one tube (5, N) to others (K, 5, N): an array of (K, N), without a unit."""
    level = np.hypot(others[:, 0] - own[0], others[:, 1] - own[1]) / (minima.level_m + others[:, 4] + own[4])
    gap = np.maximum(others[:, 2] - own[3], own[2] - others[:, 3])
    found: Closeness = np.maximum(level, gap / minima.upright_m)
    return found


def bounds_of(close: Closeness) -> npt.NDArray[np.float64]:
    """The least allowed closeness of each pair: 1, or less where it is less at the start; an array of (K, 1)."""
    found: npt.NDArray[np.float64] = np.minimum(1.0, close[:, :1] - NEARER)
    return found


def first_meetings(close: Closeness) -> npt.NDArray[np.float64]:
    """When each pair first meets, in seconds; infinite: not as far as the tubes reach. An array of (K,)."""
    met = close < bounds_of(close)
    first = met.argmax(axis=1)
    return np.where(met.any(axis=1), first * STEP_S, np.inf)


def clearance(close: Closeness) -> float:
    """The least closeness of all pairs, each in relation to its bound: at least 1 where all are free."""
    if not close.shape[0]:
        return np.inf
    bounds = bounds_of(close)
    met = close < bounds
    if not met.any():
        return 1.0
    return float(np.where(met, close, 1.0).min())
