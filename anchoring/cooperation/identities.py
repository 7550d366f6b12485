"""The names of objects: one name for one object everywhere, whichever members see it.

A track **holds** a name by a claim of its member. A member speaks for its own tracks only. Of several groups of tracks
with one name, it belongs to that which is seen, by most members, then for longest without a gap; of several names of
one group, the one held by most members stands, then the oldest. A member counts as far as it is trusted. So every
picture of the same reports comes to the same names, and one member alone takes no name from two that hold it, nor from
one that holds it longer. A member's claim that a name began while the member was heard counts from the time of the
claim; only at the first meeting of two members are earlier times accepted.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import fsum
from typing import Final, NamedTuple

from dyknow import US_PER_S
from dyknow.anchoring.cooperation.reports import LONGEST_NAME, IdentityClaim, TrackKey

TOLD_US: Final = 5 * US_PER_S
"""A claim takes so long to be heard at most."""

RENAMES_US: Final = 3 * US_PER_S
"""A member changes the name of a track at most so often."""


@dataclass(slots=True)
class Held:
    """A name that a track has, since when there is the name, and since when the track has it without a gap."""

    name: str
    born_us: int
    since_us: int


class Named(NamedTuple):
    """A group of tracks and its name; None: it has none yet. `others`: further names that belong to it."""

    tracks: frozenset[TrackKey]
    name: str | None
    others: tuple[str, ...] = ()


def named(
    groups: Sequence[frozenset[TrackKey]], held: Mapping[TrackKey, Held], say: Callable[[TrackKey], float]
) -> list[Named]:
    """The name of each group; `say`: how far the member of a track is trusted, 0 where the track is not seen."""
    holders: dict[str, list[tuple[tuple[object, ...], int]]] = {}
    for at, tracks in enumerate(groups):
        by_name: dict[str, list[TrackKey]] = {}
        for key in tracks:
            if key in held:
                by_name.setdefault(held[key].name, []).append(key)
        for name, keys in by_name.items():
            live = [key for key in keys if say(key)]
            since_us = min(held[key].since_us for key in live or keys)
            holders.setdefault(name, []).append(((not live, -fsum(map(say, live)), since_us, min(keys)), at))
    won: dict[int, list[str]] = {}
    for name, rivals in holders.items():
        won.setdefault(min(rivals)[1], []).append(name)
    return [_named(tracks, won.get(at, []), held, say) for at, tracks in enumerate(groups)]


def _named(
    tracks: frozenset[TrackKey], names: list[str], held: Mapping[TrackKey, Held], say: Callable[[TrackKey], float]
) -> Named:
    def rank(name: str) -> tuple[object, ...]:
        keys = [key for key in tracks if key in held and held[key].name == name]
        return -fsum(map(say, keys)), min(held[key].born_us for key in keys), name

    names = sorted(names, key=rank)
    return Named(tracks, names[0], tuple(names[1:])) if names else Named(tracks, None)


class Claims:
    """The names that members claim for their tracks, within limits.

    Attributes:
        held: by track.
    """

    def __init__(self, refuse: Callable[[str, str], None]) -> None:
        self.held: dict[TrackKey, Held] = {}
        self._refuse = refuse
        self._arrived_us: dict[str, int] = {}
        self._departed_us: dict[str, int] = {}
        self._changed_us: dict[TrackKey, int] = {}

    def arrive(self, unit: str, now_us: int) -> None:
        """The member is heard from now on; it may claim times at which it was not."""
        self._arrived_us[unit] = now_us

    def depart(self, unit: str, now_us: int) -> None:
        """The member is heard no longer."""
        self._departed_us[unit] = now_us

    def _earliest_us(self, unit: str, now_us: int) -> int:
        """The earliest time that a claim may state: a member that was heard would have claimed an older name before."""
        if now_us - self._arrived_us.get(unit, now_us) > TOLD_US:
            return now_us - TOLD_US
        return self._departed_us[unit] - TOLD_US if unit in self._departed_us else 0

    def take(self, key: TrackKey, claim: IdentityClaim, now_us: int, known_us: int | None, *, is_taken: bool) -> bool:
        """Take a claim; whether the track has a new name.

        Args:
            key: the track.
            claim: of its member.
            now_us: federation time.
            known_us: since when there is the name, if it is known here.
            is_taken: until now it was the name of other tracks alone.
        """
        since_us, born_us = claim.since_us, claim.born_us
        if not 0 < len(claim.identity) <= LONGEST_NAME or not 0 <= born_us <= since_us <= now_us + US_PER_S:
            self._refuse(claim.unit, "a claim that cannot be")
            return False
        before = self.held.get(key)
        if before is not None and before.name == claim.identity:
            before.since_us = max(before.since_us, since_us)
            return False
        if before is not None and now_us - self._changed_us.get(key, 0) < RENAMES_US:
            self._refuse(claim.unit, "renames too often")
            return False
        self._changed_us[key] = now_us
        earliest_us = self._earliest_us(claim.unit, now_us)
        if known_us is not None:
            born_us = known_us
        elif born_us < earliest_us:
            self._refuse(claim.unit, "backdated")
            born_us = now_us
        since_us = now_us if is_taken else max(since_us, min(earliest_us, now_us))
        self.held[key] = Held(claim.identity, born_us, since_us)
        return True

    def forget(self, keys: Sequence[TrackKey]) -> None:
        """These tracks are there no longer."""
        for key in keys:
            self.held.pop(key, None)
            self._changed_us.pop(key, None)
