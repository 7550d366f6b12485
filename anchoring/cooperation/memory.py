"""Objects that no member sees now: kept, predicted with growing uncertainty, and found again."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from math import sqrt
from typing import Final

import numpy as np

from anchoring.cooperation.evidence import SHARED_SD_M, SHARED_SD_M_S
from anchoring.cooperation.reports import TrackKey
from anchoring.cooperation.tracks import NOISE
from anchoring.links.states import ObjectState, moved
from dyknow import US_PER_S

KEPT_US: Final = 60 * US_PER_S
ABSENT_KEPT_US: Final = 600 * US_PER_S
"""For so long if a member that saw it is cut off: it may see it still."""
ONWARD_US: Final = 5 * US_PER_S
"""A vehicle that is not seen for longer has probably turned, or stands."""
MATCH: Final = 13.28
"""99 % of chi-squared with four degrees of freedom."""
MATCH_MARGIN: Final = 8.0
MATCH_SD_M: Final = 20.0
"""What is expected worse than this is recognised by its members only."""
MOST_OBJECTS: Final = 4096
_CLAIM_M: Final = 25.0


@dataclass(slots=True)
class Remembered:
    """An object as it was seen last; `units`: by which members."""

    name: str
    born_us: int
    state: ObjectState
    seen_us: int
    units: frozenset[str]
    is_seen: bool = True
    others: tuple[str, ...] = ()
    tracks: frozenset[TrackKey] = field(default_factory=frozenset)

    def at(self, at_us: int) -> ObjectState:
        """The state at a time, predicted: it moves on for `ONWARD_US`, and its uncertainty grows all the time."""
        at_us = max(at_us, self.state.valid_us)
        onward = moved(self.state, min(at_us, self.state.valid_us + ONWARD_US), NOISE)
        if at_us == onward.valid_us:
            return onward
        return onward._replace(valid_us=at_us, covariance=moved(self.state, at_us, NOISE).covariance)

    def may_be_at(self, state: ObjectState) -> bool:
        """Whether it can be where a member claims it to be."""
        expected = self.at(state.valid_us)
        return expected.distance_m(state) <= _CLAIM_M + 3.0 * expected.deviation_m


def matches(
    candidates: Mapping[TrackKey, ObjectState], objects: Iterable[Remembered], at_us: int
) -> dict[TrackKey, tuple[str, float]]:
    """Tracks without a name that are where an unseen object is expected, and no other: its name and the distance d^2."""
    expected = [(each.name, each.at(at_us)) for each in objects if not each.is_seen]
    expected = [(name, state) for name, state in expected if state.deviation_m / sqrt(2.0) <= MATCH_SD_M]
    scores = {
        (key, name): distance
        for key, state in candidates.items()
        for name, other in expected
        if (distance := _distance(state, other)) <= MATCH + MATCH_MARGIN
    }
    found: dict[TrackKey, tuple[str, float]] = {}
    for (key, name), distance in scores.items():
        rivals = [
            other for pair, other in scores.items() if pair != (key, name) and (pair[0] == key or pair[1] == name)
        ]
        if distance <= MATCH and all(other > distance + MATCH_MARGIN for other in rivals):
            found[key] = name, distance
    return found


_SHARED: Final = np.diag([SHARED_SD_M**2] * 2 + [SHARED_SD_M_S**2] * 2)


def _distance(one: ObjectState, other: ObjectState) -> float:
    between = np.array(one[1:5]) - np.array(other[1:5])
    return float(between @ np.linalg.solve(one.covariance + other.covariance + _SHARED, between))
