"""An entry of the saliency map: a person that one platform has found, and the gate that entries of members pass.

An entry comes from another member, which may be wrong or malicious: it is refused, by member and reason, if it is no
number or no covariance, of another time, or one too many. A member speaks for its own entries only.
"""

from collections import Counter
from math import isfinite
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dyknow import US_PER_S

FARTHEST_M: Final = 1e6
LEAST_SD_M: Final = 0.3
"""No place is surer than that, whatever is claimed."""
MOST_SD_M: Final = 20.0
"""Vaguer than this is no place."""
EARLY_US: Final = US_PER_S
OLDEST_US: Final = 24 * 3600 * US_PER_S
MOST_ENTRIES: Final = 200
"""Of one member."""
MOST_REPORTS_S: Final = 1000
LONGEST_TEXT: Final = 120


class PersonEntry(NamedTuple):
    """A person that a platform has found. Times are federation time.

    Attributes:
        unit, symbol: the platform, and its symbol for the person.
        x_m, y_m: metres east and north of the federation's origin.
        covariance: (xx, xy, yy), m^2.
        since_us, seen_us: when it was seen first, and last.
        observed_s: how long it was in images.
        thermal, colour: mean scores of both channels, from 0 to 1.
        thermal_image, colour_image: references to the images in which it looked most like a person.
    """

    unit: str
    symbol: str
    x_m: float
    y_m: float
    covariance: tuple[float, float, float]
    since_us: int
    seen_us: int
    observed_s: float
    thermal: float
    colour: float
    thermal_image: str
    colour_image: str

    @property
    def name(self) -> str:
        """Its name everywhere."""
        return f"{self.unit}:{self.symbol}"

    @property
    def mean(self) -> NDArray[np.float64]:
        return np.array([self.x_m, self.y_m])

    @property
    def spread(self) -> NDArray[np.float64]:
        """(2, 2), m^2, no surer than anything can be."""
        xx, xy, yy = self.covariance
        return np.array([[xx + LEAST_SD_M**2, xy], [xy, yy + LEAST_SD_M**2]])


class EntryGate:
    """Refuses what cannot be, and counts it.

    Attributes:
        refused: by member and reason.
    """

    def __init__(self) -> None:
        self.refused = Counter[tuple[str, str]]()
        self._budgets: dict[str, tuple[int, int]] = {}

    def passes(self, entry: PersonEntry, now_us: int) -> bool:
        """Whether an entry may be believed at all; `now_us` in federation time."""
        reason = self._excess(entry.unit, now_us) or fault_of(entry, now_us)
        if reason:
            self.refuse(entry.unit, reason)
        return not reason

    def refuse(self, unit: str, reason: str) -> None:
        """Count one more."""
        self.refused[unit, reason] += 1

    def _excess(self, unit: str, now_us: int) -> str:
        since_us, count = self._budgets.get(unit, (now_us, 0))
        if not 0 <= now_us - since_us < US_PER_S:
            since_us, count = now_us, 0
        self._budgets[unit] = since_us, count + 1
        return "too many reports" if count >= MOST_REPORTS_S else ""


def fault_of(entry: PersonEntry, now_us: int) -> str:
    """Why an entry cannot be that of a person; empty: it can."""
    xx, xy, yy = entry.covariance
    numbers = (entry.x_m, entry.y_m, xx, xy, yy, entry.observed_s, entry.thermal, entry.colour)
    texts = (entry.symbol, entry.thermal_image, entry.colour_image)
    if not all(map(isfinite, numbers)):
        return "not a number"
    if max(abs(entry.x_m), abs(entry.y_m)) > FARTHEST_M:
        return "too far"
    if min(xx, yy) < 0.0 or xx * yy < xy * xy:
        return "no covariance"
    if max(xx, yy) > MOST_SD_M**2:
        return "too vague"
    if not 0.0 <= min(entry.thermal, entry.colour) <= max(entry.thermal, entry.colour) <= 1.0:
        return "no score"
    if not now_us - OLDEST_US <= entry.since_us <= entry.seen_us <= now_us + EARLY_US:
        return "another time"
    if not 0.0 <= entry.observed_s <= (entry.seen_us - entry.since_us) / US_PER_S + 1.0:
        return "observed longer than it was there"
    if not entry.symbol or max(map(len, texts)) > LONGEST_TEXT or not all(map(str.isprintable, texts)):
        return "no symbol"
    return ""
