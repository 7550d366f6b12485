"""Which way an object goes, by the places where it was: velocities of others' trackers are not there, or late in a bend."""

import math
from typing import Final, NamedTuple

from dyknow.anchoring.roads.geometry import Point2
from dyknow.model.instants import US_PER_S

LEAST_M: Final = 3.0
"""A shorter way says no direction: places have errors of up to a metre."""
WITHIN_US: Final = US_PER_S


class Travel(NamedTuple):
    """Where and when an object was, and its velocity on the way to there, east and north; None: it went less than `LEAST_M`."""

    valid_us: int
    x_m: float
    y_m: float
    velocity_m_s: Point2 | None = None

    def to(self, valid_us: int, x_m: float, y_m: float) -> "Travel":
        """With the object at a place a moment later: a velocity is known until it goes `LEAST_M` no more in a second."""
        passed_us = valid_us - self.valid_us
        if passed_us <= 0:
            return self
        if math.hypot(x_m - self.x_m, y_m - self.y_m) >= LEAST_M and passed_us <= WITHIN_US:
            velocity = (x_m - self.x_m) / passed_us * US_PER_S, (y_m - self.y_m) / passed_us * US_PER_S
            return Travel(valid_us, x_m, y_m, velocity)
        return self if passed_us < WITHIN_US else Travel(valid_us, x_m, y_m)
