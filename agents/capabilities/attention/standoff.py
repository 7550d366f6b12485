"""The place for a vehicle that follows an object, near it but not too near; leaps are not followed at once. Pure."""

from collections.abc import Sequence
from math import hypot, isfinite
from typing import Final, NamedTuple

from dyknow import US_PER_S
from dyknow.anchoring.attention.watched import WatchedPlace

LEAD_S: Final = 2.0
"""The vehicle flies to where the object will be after so long."""
FASTEST_M_S: Final = 60.0
"""An object that moves faster from one look to the next has leapt."""
SURE_M: Final = 25.0
"""A symbol may move so far at once, as the object that it names is found again."""
CREDIBLE_US: Final = 2 * US_PER_S
"""After so long at places that no object reaches it is not followed any longer."""


class Whereabouts(NamedTuple):
    """Metres east and north, metres per second."""

    x_m: float
    y_m: float
    vx_m_s: float = 0.0
    vy_m_s: float = 0.0


def expected(places: Sequence[WatchedPlace]) -> Whereabouts | None:
    """The mean over the hypotheses, which is nearest to wherever the object may be; None: there is no place."""
    known = [each for each in places if all(map(isfinite, each)) and each.weight > 0.0]
    total = sum(each.weight for each in known)
    if not known or not isfinite(total):
        return None
    sums = (sum(each.weight * each[axis] for each in known) / total for axis in range(4))
    place = Whereabouts(*sums)
    return place if all(map(isfinite, place)) else None


def goal(own: Whereabouts, followed: Whereabouts, standoff_m: float) -> Whereabouts:
    """Where to fly: on the line to where the object will be, `standoff_m` before it; a vehicle that is nearer stays."""
    x_m, y_m = followed.x_m + LEAD_S * followed.vx_m_s, followed.y_m + LEAD_S * followed.vy_m_s
    away_m = hypot(x_m - own.x_m, y_m - own.y_m)
    if away_m <= standoff_m:
        return Whereabouts(own.x_m, own.y_m)
    share = (away_m - standoff_m) / away_m
    return Whereabouts(own.x_m + share * (x_m - own.x_m), own.y_m + share * (y_m - own.y_m))


class Leaps:
    """Whether a place is one that the object can have reached; times in microseconds."""

    def __init__(self) -> None:
        self._last: tuple[int, Whereabouts] | None = None
        self.since_us: int | None = None

    def is_credible(self, now_us: int, place: Whereabouts) -> bool:
        """Take the next place; a place that is not credible changes nothing but `since_us`."""
        if self._last is not None:
            at_us, before = self._last
            reach_m = SURE_M + FASTEST_M_S * max(now_us - at_us, 0) / US_PER_S
            if hypot(place.x_m - before.x_m, place.y_m - before.y_m) > reach_m:
                self.since_us = now_us if self.since_us is None else self.since_us
                return False
        self._last, self.since_us = (now_us, place), None
        return True
