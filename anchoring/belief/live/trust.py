"""How far a source of observations is trusted, in [0, 1]: as declared, and less where it contradicts what is believed.

A source contradicts by not reporting what is believed to exist where it looks, more often than its `detects` says, and by
reporting what is then never confirmed, more often than its `clutter` says. Both are counted with a memory of `MEMORY_US`:

    trust = declared (n + found) / (n + max(found, expected)) (n + reports - surplus) / (n + reports)

with n = `CAUTION`, `expected` the sum of existence of confirmed instances in view, times `detects`, `surplus` the
unconfirmed beyond the clutter.
"""

from math import exp
from typing import Final, NamedTuple

import numpy as np

from dyknow import US_PER_S
from dyknow.anchoring.belief.arrays import Floats
from dyknow.anchoring.belief.description import WorldSensor

MEMORY_US: Final = 30 * US_PER_S
CAUTION: Final = 20.0
LEAST: Final = 0.01
"""A source that is trusted at all is never trusted less, so that it can earn trust again."""


class TrustInSource(NamedTuple):
    """How far, and why.

    Attributes:
        declared: as it was stated.
        found, expected: observations of confirmed instances, and their expected number.
        reports: observations.
        unconfirmed, usual: instances that it reported and nothing confirmed, and how many are as its clutter says.
        valid_us: of the latest look.
    """

    declared: float = 1.0
    found: float = 0.0
    expected: float = 0.0
    reports: float = 0.0
    unconfirmed: float = 0.0
    usual: float = 0.0
    valid_us: int = 0

    @property
    def value(self) -> float:
        """In [0, declared]."""
        complete = (CAUTION + self.found) / (CAUTION + max(self.found, self.expected))
        right = (CAUTION + self.reports - self._surplus) / (CAUTION + self.reports)
        return min(self.declared, max(LEAST, self.declared * complete * right))

    @property
    def because(self) -> str:
        """In a few words."""
        said = f"declared {self.declared:g}"
        if self.expected - self.found >= 0.5:
            said += f", found {self.found:.0f} where {self.expected:.0f} were expected"
        if self._surplus >= 0.5:
            said += f", {self._surplus:.0f} of {self.reports:.0f} reports were never confirmed"
        return said

    @property
    def _surplus(self) -> float:
        return min(self.reports, max(0.0, self.unconfirmed - self.usual))

    def after(self, valid_us: int, sensor: WorldSensor, seen: Floats, hits: Floats, reports: int) -> "TrustInSource":
        """With one more look.

        Args:
            valid_us: of the look.
            sensor: as the model describes it.
            seen: (N,) existence of the confirmed instances, times the share of each in view.
            hits: (N,) probability that each was observed.
            reports: how many observations there were.
        """
        kept = exp(-max(0, valid_us - self.valid_us) / MEMORY_US)
        return TrustInSource(
            self.declared,
            kept * self.found + float(np.minimum(hits, seen).sum()),
            kept * self.expected + sensor.detects * float(seen.sum()),
            kept * self.reports + reports,
            kept * self.unconfirmed,
            kept * self.usual + sensor.clutter,
            valid_us,
        )

    def disproved(self) -> "TrustInSource":
        """Something that it reported first was given up without ever having been confirmed."""
        return self._replace(unconfirmed=self.unconfirmed + 1.0)
