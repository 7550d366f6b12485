"""One map of persons from the entries of all members: entries of one person are one place (thesis 9.2). Pure.

Two entries are of one person if no third of the same members suits better and their distance is small for their
covariances; all entries of a place are near each other, and those of one member are of different times (it was
restarted between them). So an entry that a member makes up is a place of its own or one more entry of a place: it takes
no other member's entry away. The members' errors are correlated, so the place is their covariance intersection. The
same entries make the same map everywhere.
"""

from collections.abc import Mapping
from typing import Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dyknow.anchoring.saliency.entries import MOST_ENTRIES, EntryGate, PersonEntry

Floats: TypeAlias = NDArray[np.float64]
GATE: Final = 9.21
"""The square of the distance, in standard deviations, that 99 of 100 pairs of one person do not exceed."""
NEAR_M: Final = 5.0
"""Persons further apart than that are two, however vague their places are."""
_LEAST_TRUST: Final = 1e-3


class SalientPlace(NamedTuple):
    """A person, once.

    Attributes:
        name: of the entry that was there first.
        covariance: (xx, xy, yy), m^2.
        entries: its entries, by member; the scores and images are those of the entry that was observed longest.
    """

    name: str
    x_m: float
    y_m: float
    covariance: tuple[float, float, float]
    entries: tuple[PersonEntry, ...]

    @property
    def by(self) -> tuple[str, ...]:
        """The members that have found it."""
        return tuple(dict.fromkeys(each.unit for each in self.entries))

    @property
    def best(self) -> PersonEntry:
        """The entry of the member that observed it longest."""
        return max(self.entries, key=lambda each: (each.observed_s, each.name))

    @property
    def since_us(self) -> int:
        return min(each.since_us for each in self.entries)

    @property
    def seen_us(self) -> int:
        return max(each.seen_us for each in self.entries)


class SaliencyMap:
    """The entries of all members that passed the gate.

    Attributes:
        gate: counts of refused entries, by member and reason.
    """

    def __init__(self, trusted: Mapping[str, float] | None = None) -> None:
        self._trusted = dict(trusted or {})
        self._entries: dict[str, dict[str, PersonEntry]] = {}
        self._places: list[SalientPlace] | None = None
        self.gate = EntryGate()

    @property
    def members(self) -> tuple[str, ...]:
        """The members with entries."""
        return tuple(sorted(unit for unit, entries in self._entries.items() if entries))

    def take(self, entry: PersonEntry, now_us: int) -> None:
        """Take an entry of a member, new or seen again; an impossible one is refused and counted."""
        if not self.gate.passes(entry, now_us):
            return
        of_member = self._entries.setdefault(entry.unit, {})
        if entry.symbol not in of_member and len(of_member) >= MOST_ENTRIES:
            self.gate.refuse(entry.unit, "too many entries")
        elif of_member.get(entry.symbol) != entry:
            of_member[entry.symbol] = entry
            self._places = None

    def withdraw(self, unit: str, symbol: str) -> None:
        """A member says that an entry of its own is none."""
        if self._entries.get(unit, {}).pop(symbol, None) is not None:
            self._places = None

    def places(self) -> list[SalientPlace]:
        """All persons, by name."""
        if self._places is None:
            entries = [entry for of_member in self._entries.values() for entry in of_member.values()]
            groups = _grouped(sorted(entries, key=lambda each: each.name))
            self._places = sorted((self._place(each) for each in groups), key=lambda each: each.name)
        return self._places

    def _place(self, entries: list[PersonEntry]) -> SalientPlace:
        entries = sorted(entries, key=lambda each: (-self._trust(each.unit), each.unit))
        mean, spread = _intersection([(self._trust(each.unit), each) for each in entries])
        first = min(entries, key=lambda each: (-self._trust(each.unit), each.since_us, each.name))
        (xx, xy), (_, yy) = spread.tolist()
        x_m, y_m = mean.tolist()
        return SalientPlace(first.name, x_m, y_m, (xx, xy, yy), tuple(entries))

    def _trust(self, unit: str) -> float:
        return self._trusted.get(unit, 1.0)


def _intersection(weighed: list[tuple[float, PersonEntry]]) -> tuple[Floats, Floats]:
    """Mean (2,) and covariance (2, 2): P = (sum w_i P_i^-1)^-1, the weights w_i as the members are trusted, 1 together.

    For any such weights it is no more certain than is right, and no member alone decides by claiming to be very certain.
    """
    total = sum(max(trust, _LEAST_TRUST) for trust, _ in weighed)
    information, pull = np.zeros((2, 2)), np.zeros(2)
    for trust, entry in weighed:
        inverse = max(trust, _LEAST_TRUST) / total * np.linalg.inv(entry.spread)
        information, pull = information + inverse, pull + inverse @ entry.mean
    covariance = np.asarray(np.linalg.inv(information), dtype=np.float64)
    return covariance @ pull, covariance


def _grouped(entries: list[PersonEntry]) -> list[list[PersonEntry]]:
    """Those of one person together: the nearest first, each near each."""
    distances = {
        (a, b): distance for a, b in _near(entries) if (distance := _distance(entries[a], entries[b])) is not None
    }
    groups: dict[int, set[int]] = {at: {at} for at in range(len(entries))}
    for a, b in sorted(distances, key=lambda pair: (distances[pair], pair)):
        one, other = groups[a], groups[b]
        if one is other or any((min(x, y), max(x, y)) not in distances for x in one for y in other):
            continue
        one |= other
        for at in other:
            groups[at] = one
    unique = {min(group): group for group in groups.values()}
    return [[entries[at] for at in sorted(group)] for group in unique.values()]


def _near(entries: list[PersonEntry]) -> list[tuple[int, int]]:
    """Pairs of places no further apart than one person can be."""
    places = np.array([(each.x_m, each.y_m) for each in entries]).reshape(-1, 2)
    apart = np.hypot(*(places[:, None] - places[None, :]).transpose(2, 0, 1))
    return [(int(a), int(b)) for a, b in np.argwhere(np.triu(apart <= NEAR_M, 1))]


def _distance(one: PersonEntry, other: PersonEntry) -> float | None:
    """The square of the Mahalanobis distance; None: they are two persons."""
    if one.unit == other.unit and one.since_us <= other.seen_us and other.since_us <= one.seen_us:
        return None
    off = one.mean - other.mean
    found = float(off @ np.linalg.solve(one.spread + other.spread, off))
    return found if found < GATE else None
