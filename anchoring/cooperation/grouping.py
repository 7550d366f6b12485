"""Groups of tracks that are of one thing, from the pairs that are joined."""

from collections.abc import Iterable

from dyknow.anchoring.cooperation.evidence import TrackEvidence
from dyknow.anchoring.cooperation.reports import TrackKey


def groups(keys: Iterable[TrackKey], evidence: TrackEvidence) -> list[frozenset[TrackKey]]:
    """All tracks in groups: at most one of each member in each, and no two that have been seen apart.

    Pairs of long standing come first, so that reports of a newcomer cannot take them apart.
    """
    group = {key: {key} for key in keys}
    partners: dict[TrackKey, dict[str, TrackKey]] = {}
    pairs = [pair for pair, _ in evidence.joined() if pair[0] in group and pair[1] in group]
    for one, other in pairs:
        partners.setdefault(one, {})[other.unit] = other
        partners.setdefault(other, {})[one.unit] = one
    for one, other in pairs:
        first, second = group[one], group[other]
        if first is not second and _agree(first, second, partners, evidence):
            first |= second
            for key in second:
                group[key] = first
    found = {id(each): each for each in group.values()}
    return sorted((frozenset(each) for each in found.values()), key=min)


def _agree(
    first: set[TrackKey], second: set[TrackKey], partners: dict[TrackKey, dict[str, TrackKey]], evidence: TrackEvidence
) -> bool:
    """Whether nothing stands against all being of one thing."""
    for one in first:
        for other in second:
            if one.unit == other.unit or evidence.contradicts(one, other):
                return False
            if partners.get(one, {}).get(other.unit, other) != other:
                return False
            if partners.get(other, {}).get(one.unit, one) != one:
                return False
    return True
