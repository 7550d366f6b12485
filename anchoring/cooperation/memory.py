"""Objects that no member sees now: kept, predicted with growing uncertainty, and found again."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from math import sqrt
from typing import Final, NamedTuple

import numpy as np

from dyknow import US_PER_S
from dyknow.anchoring.cooperation.evidence import SHARED_SD_M, SHARED_SD_M_S
from dyknow.anchoring.cooperation.reports import TrackKey
from dyknow.anchoring.cooperation.tracks import FRESH_US, NOISE
from dyknow.anchoring.links.states import ObjectState, moved
from dyknow.compunits.covariances import Matrix

KEPT_US: Final = 60 * US_PER_S
ABSENT_KEPT_US: Final = 600 * US_PER_S
"""For so long if a member that saw it is cut off: it may see it still."""
ONWARD_US: Final = 5 * US_PER_S
"""A vehicle that is not seen for longer has probably turned, or stands."""
MATCH: Final = 13.28
"""99 % of chi-squared with four degrees of freedom."""
MATCH_MARGIN: Final = 6.0
_ALONE: Final = 21.0
"""The cost of a track that is none of the objects."""
MATCH_SD_M: Final = 20.0
"""An object with a larger expected error is recognised by its own members only."""
MOST_OBJECTS: Final = 4096
MOST_OF_ONE: Final = 512
"""Objects that are kept of those that one member alone has seen."""
_CLAIM_M: Final = 25.0
ALONG_NOISE: Final = 1.5
ACROSS_NOISE: Final = 0.3
"""Of the acceleration of what drives on, m^2/s^3."""
_DRIVES_M_S: Final = 3.0


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

    def onward(self, at_us: int) -> ObjectState:
        """The state at a time if it drives on as it did: more uncertain along its way than across."""
        state, speed_m_s = moved(self.state, max(at_us, self.state.valid_us), 0.0), self.state.speed_m_s
        seconds = (state.valid_us - self.state.valid_us) / US_PER_S
        along = np.array([self.state.vx_m_s, self.state.vy_m_s]) / max(speed_m_s, 1e-9)
        noise = NOISE * np.eye(2)
        if speed_m_s >= _DRIVES_M_S:
            noise = ACROSS_NOISE * np.eye(2) + (ALONG_NOISE - ACROSS_NOISE) * np.outer(along, along)
        grown = np.kron(np.array([[seconds**3 / 3, seconds**2 / 2], [seconds**2 / 2, seconds]]), noise)
        return state._replace(covariance=state.covariance + grown)

    def may_be_at(self, state: ObjectState) -> bool:
        """Whether it can be where a member claims it to be."""
        expected = self.at(state.valid_us)
        return expected.distance_m(state) <= _CLAIM_M + 3.0 * expected.deviation_m


def has_room(objects: dict[str, Remembered], units: frozenset[str]) -> bool:
    """Whether there is room for an object of these members; one member's oldest unseen one makes room for its next."""
    own = [each for each in objects.values() if each.units == units] if len(units) == 1 else []
    if len(own) >= MOST_OF_ONE:
        oldest = min(own, key=lambda each: (each.is_seen, each.seen_us))
        if oldest.is_seen:
            return False
        del objects[oldest.name]
    return len(objects) < MOST_OBJECTS


class Matches(NamedTuple):
    """Names for tracks, with the distances d^2; and the tracks that may be one or another object: it may yet show."""

    found: Mapping[TrackKey, tuple[str, float]]
    open: frozenset[TrackKey]


def matches(candidates: Mapping[TrackKey, ObjectState], objects: Iterable[Remembered], at_us: int) -> Matches:
    """Which tracks without a name are unseen objects, where these are expected.

    A track has to be where an object may have got by any turn. Which track is which object is decided for all together
    by how vehicles drive that do not turn, if any other choice would fit worse by `MATCH_MARGIN`. `candidates` are
    states of the tracks, best the first ones: the sooner after it was lost, the better is known where an object is. An
    object that was not reported for `FRESH_US` may be lost soon: a track that may be that object stays open.
    """
    missing = [each for each in objects if not each.is_seen or at_us - each.seen_us > FRESH_US]
    expected = [each for each in missing if each.at(at_us).deviation_m / sqrt(2.0) <= MATCH_SD_M]
    keys = list(candidates)
    if not keys or not expected:
        return Matches({}, frozenset())
    gates, costs = np.full((2, len(keys), len(expected)), np.inf)
    for row, key in enumerate(keys):
        for column, each in enumerate(expected):
            state = moved(candidates[key], max(candidates[key].valid_us, each.seen_us), NOISE)
            gates[row, column] = _distance(state, each.at(state.valid_us), 1.0)
            costs[row, column] = _distance(state, each.onward(state.valid_us), _RELATIVE)
    costs[gates > MATCH] = np.inf
    best, pairs = _assigned(costs)
    found: dict[TrackKey, tuple[str, float]] = {}
    may_be = {keys[row] for row, _ in zip(*np.nonzero(costs <= _ALONE), strict=True)}
    for row, column in pairs:
        without = costs.copy()
        without[row, column] = np.inf
        if expected[column].is_seen:
            continue
        if np.isfinite(costs[row, column]) and _assigned(without)[0] - best >= MATCH_MARGIN:
            found[keys[row]] = expected[column].name, float(gates[row, column])
    return Matches(found, frozenset(may_be - found.keys()))


def _assigned(costs: Matrix) -> tuple[float, list[tuple[int, int]]]:
    """The least sum of costs, where a track may have none of the objects at the cost of one that just does not match."""
    from scipy.optimize import linear_sum_assignment

    rows, columns = costs.shape
    padded = np.hstack([np.minimum(costs, 2.0 * _ALONE), np.full((rows, rows), _ALONE)])
    chosen = list(zip(*linear_sum_assignment(padded), strict=True))
    total = float(sum(padded[pair] for pair in chosen))
    return total, [(int(row), int(column)) for row, column in chosen if column < columns]


_RELATIVE: Final = 0.2
"""Of the errors that members make of all places alike: between two choices most of them cancels."""
_SHARED: Final = np.diag([SHARED_SD_M**2] * 2 + [SHARED_SD_M_S**2] * 2)


def _distance(one: ObjectState, other: ObjectState, shared: float) -> float:
    between = np.array(one[1:5]) - np.array(other[1:5])
    return float(between @ np.linalg.solve(one.covariance + other.covariance + shared * _SHARED, between))
