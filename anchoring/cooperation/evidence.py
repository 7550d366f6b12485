"""Which tracks of two members are of one thing: association of tracks to tracks.

At each look, states a and b of two tracks at one time are as far apart as

    d^2 = (a - b)^T (A + B + C)^-1 (a - b),   C = 2 s^2 I + v v^T (t_a^2 + t_b^2),

where A and B are their covariances, s the error that a member makes of all places alike (its own position, its camera)
and t the standard deviation of its clock, in which something with velocity v moves on. Errors of one track hang
together from look to look, so that looks are averaged, not summed: two tracks are **joined** when the mean over enough
looks is below `JOIN`, and no other pair is nearly as near; they are **split** when it is above `SPLIT`. In between what
was, stays. Reports of a member are evidence about its own pairs only: no third member comes between two.
"""

from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from typing import Final, TypeAlias

import numpy as np

from dyknow import US_PER_S
from dyknow.anchoring.cooperation.reports import TrackKey
from dyknow.anchoring.cooperation.tracks import Track, Tracks
from dyknow.anchoring.links.assignment import assigned
from dyknow.anchoring.links.states import ObjectState
from dyknow.compunits.covariances import Matrix

JOIN: Final = 9.49
"""95 % of chi-squared with four degrees of freedom."""
SPLIT: Final = 18.47
"""99.9 %."""
LEAST_LOOKS: Final = 5
MOST_LOOKS: Final = 12
MARGIN: Final = 4.0
"""How much nearer than any other a pair has to be, until it has been the nearest for `PATIENT_LOOKS`."""
PATIENT_LOOKS: Final = 20
SHARED_SD_M: Final = 1.5
SHARED_SD_M_S: Final = 0.7
WIDEST_SD_M: Final = 8.0
"""A track with a larger error is no evidence."""
GATE_M: Final = 60.0
NEAREST: Final = 4
"""Tracks of another member that are compared with one."""
OLD_US: Final = 10 * US_PER_S

Pair: TypeAlias = tuple[TrackKey, TrackKey]
"""Sorted."""


@dataclass(slots=True)
class PairEvidence:
    """The looks at two tracks together."""

    distances: deque[float] = field(default_factory=lambda: deque(maxlen=MOST_LOOKS))
    looks: int = 0
    latest_us: int = 0
    joined_us: int | None = None

    @property
    def mean(self) -> float:
        return sum(self.distances) / len(self.distances)

    @property
    def is_enough(self) -> bool:
        return len(self.distances) >= LEAST_LOOKS


class TrackEvidence:
    """Compares the tracks of each two members, look by look.

    Attributes:
        pairs: the pairs that were near each other.
    """

    def __init__(self) -> None:
        self.pairs: dict[Pair, PairEvidence] = {}

    def look(self, tracks: Tracks, at_us: int, clock_sd_us: Mapping[str, int]) -> tuple[list[Pair], list[Pair]]:
        """Compare all tracks at a time; returns the pairs that are joined now, and those that are split."""
        states = {unit: _states(tracks.of(unit).values(), at_us) for unit in tracks.units()}
        joined: list[Pair] = []
        split: list[Pair] = []
        for one, other in combinations(states, 2):
            if states[one] and states[other]:
                self._compare(states[one], states[other], (clock_sd_us.get(one, 0), clock_sd_us.get(other, 0)), at_us)
        by_units: dict[tuple[str, str], list[Pair]] = {}
        for pair in tuple(self.pairs):
            evidence = self.pairs[pair]
            if evidence.joined_us is None and at_us - evidence.latest_us > OLD_US:
                del self.pairs[pair]
                continue
            if evidence.joined_us is not None and evidence.is_enough and evidence.mean > SPLIT:
                evidence.joined_us = None
                split.append(pair)
            by_units.setdefault((pair[0].unit, pair[1].unit), []).append(pair)
        for pairs in by_units.values():
            joined += self._joined(pairs, tracks, at_us)
        return joined, split

    def forget(self, keys: Sequence[TrackKey]) -> None:
        """These tracks are there no longer."""
        gone = set(keys)
        self.pairs = {pair: each for pair, each in self.pairs.items() if gone.isdisjoint(pair)}

    def joined(self) -> list[tuple[Pair, PairEvidence]]:
        """All joined pairs, those of long standing first."""
        found = [(pair, each) for pair, each in self.pairs.items() if each.joined_us is not None]
        return sorted(found, key=lambda one: (one[1].joined_us, one[1].mean, one[0]))

    def contradicts(self, one: TrackKey, other: TrackKey) -> bool:
        """Whether the two have been seen apart, and lately."""
        evidence = self.pairs.get(ordered(one, other))
        return evidence is not None and evidence.is_enough and evidence.mean > SPLIT

    def is_open(self, key: TrackKey) -> bool:
        """Whether a track may yet turn out to be that of another member."""
        return any(
            key in pair and each.distances and each.joined_us is None and each.mean <= JOIN
            for pair, each in self.pairs.items()
        )

    def _compare(self, one: "_States", other: "_States", clocks_us: tuple[int, int], at_us: int) -> None:
        for i, j, distance in _distances(one, other, clocks_us):
            pair = ordered(one.keys[i], other.keys[j])
            evidence = self.pairs.get(pair)
            if evidence is None:
                if distance > 4.0 * SPLIT:
                    continue
                evidence = self.pairs[pair] = PairEvidence()
            elif at_us - evidence.latest_us > US_PER_S:
                evidence.distances.clear()
            evidence.distances.append(min(distance, 4.0 * SPLIT))
            evidence.looks += 1
            evidence.latest_us = at_us

    def _joined(self, pairs: Sequence[Pair], tracks: Tracks, at_us: int) -> list[Pair]:
        """The pairs of two members that are joined at this look: each track with one of the other's at most."""
        taken = {
            key
            for pair in pairs
            if self.pairs[pair].joined_us is not None and all(_is_live(tracks, key, at_us) for key in pair)
            for key in pair
        }
        free = {
            pair: self.pairs[pair].mean
            for pair in pairs
            if self.pairs[pair].joined_us is None
            and self.pairs[pair].is_enough
            and self.pairs[pair].latest_us == at_us
            and self.pairs[pair].mean <= JOIN
            and taken.isdisjoint(pair)
        }
        if not free:
            return []
        names = {(one.symbol, other.symbol): (one, other) for one, other in free}
        chosen = [names[each] for each in assigned({(a.symbol, b.symbol): mean for (a, b), mean in free.items()})]
        found = [pair for pair in chosen if self.pairs[pair].looks >= PATIENT_LOOKS or _is_clear(pair, free)]
        for pair in found:
            for other in pairs:
                if other != pair and not set(other).isdisjoint(pair):
                    self.pairs[other].joined_us = None  # of a track that is not seen: this one is in its place
            self.pairs[pair].joined_us = at_us
        return found


@dataclass(slots=True)
class _States:
    keys: list[TrackKey]
    means: Matrix
    covariances: Matrix

    def __bool__(self) -> bool:
        return bool(self.keys)


def ordered(one: TrackKey, other: TrackKey) -> Pair:
    """The pair of two tracks."""
    return (one, other) if one < other else (other, one)


def _states(tracks: Iterable[Track], at_us: int) -> _States:
    found: list[tuple[TrackKey, ObjectState]] = []
    for track in tracks:
        state = None if track.has_ended else track.at(at_us)
        if state is not None and state.deviation_m <= WIDEST_SD_M:
            found.append((track.key, state))
    means = np.array([state[1:5] for _, state in found]).reshape(-1, 4)
    covariances = np.array([state.covariance for _, state in found]).reshape(-1, 4, 4)
    return _States([key for key, _ in found], means, covariances)


_SHARED: Final = np.diag([2 * SHARED_SD_M**2] * 2 + [2 * SHARED_SD_M_S**2] * 2)


def _distances(one: _States, other: _States, clocks_us: tuple[int, int]) -> Iterator[tuple[int, int, float]]:
    """(i, j, d^2) of each track and the nearest of the other member's, within the gate."""
    from scipy.spatial import cKDTree

    count = min(NEAREST, len(other.keys))
    apart_m, nearest = cKDTree(other.means[:, :2]).query(one.means[:, :2], k=count, distance_upper_bound=GATE_M)
    apart_m, nearest = apart_m.reshape(-1, count), nearest.reshape(-1, count)
    rows, places = np.nonzero(np.isfinite(apart_m))
    near = nearest[rows, places]
    between = one.means[rows] - other.means[near]
    total = one.covariances[rows] + other.covariances[near] + _SHARED
    late_s2 = (clocks_us[0] ** 2 + clocks_us[1] ** 2) / US_PER_S**2
    velocity = (one.means[rows, 2:] + other.means[near, 2:]) / 2
    total[:, :2, :2] += late_s2 * velocity[:, :, None] * velocity[:, None, :]
    solved = np.linalg.solve(total, between[:, :, None])[:, :, 0]
    distances = np.einsum("ij,ij->i", between, solved)
    return zip(rows.tolist(), near.tolist(), distances.tolist(), strict=True)


def _is_live(tracks: Tracks, key: TrackKey, at_us: int) -> bool:
    track = tracks.get(key)
    return track is not None and track.is_live(at_us)


def _is_clear(pair: Pair, means: Mapping[Pair, float]) -> bool:
    """Whether no other pair with one of the two is nearly as near."""
    rivals = (mean for other, mean in means.items() if other != pair and not set(other).isdisjoint(pair))
    return all(mean > means[pair] + MARGIN for mean in rivals)
