"""Which of several candidates gets which object, all at once (rules L2, L3)."""

from collections import defaultdict
from collections.abc import Iterator, Mapping
from typing import Final

import numpy as np

_NO_PAIR: Final = 1e9
_MOST_SCORE: Final = 1e6


def natural(symbol: str) -> tuple[int, str]:
    """The order of symbols: wo2 before wo10."""
    return len(symbol), symbol


def assigned(scores: Mapping[tuple[str, str], float], alone: float = _NO_PAIR) -> list[tuple[str, str]]:
    """The pairs that are chosen: as many as possible, then with the least sum of scores, then by symbols.

    Each name on either side is in one pair at most. The order in which pairs are given does not matter.

    Args:
        scores: by pair.
        alone: the score of being in no pair; given, the least sum counts, not the number of pairs.
    """
    chosen: list[tuple[str, str]] = []
    for pairs in _components(scores):
        if len({left for left, _ in pairs}) == 1 or len({right for _, right in pairs}) == 1:
            chosen.append(min(pairs, key=lambda pair: (scores[pair], *map(natural, pair))))
        else:
            chosen += _solved(pairs, scores, alone)
    return sorted(chosen, key=lambda pair: natural(pair[0]))


def _components(scores: Mapping[tuple[str, str], float]) -> Iterator[list[tuple[str, str]]]:
    """The pairs in groups that share no name, sorted."""
    by_left, by_right = defaultdict[str, list[str]](list), defaultdict[str, list[str]](list)
    for left, right in sorted(scores):
        by_left[left].append(right)
        by_right[right].append(left)
    seen = set[str]()
    for start in by_left:
        if start in seen:
            continue
        seen.add(start)
        waiting, members = [start], [start]
        while waiting:
            for right in by_left[waiting.pop()]:
                new = [left for left in by_right[right] if left not in seen]
                seen.update(new)
                waiting += new
                members += new
        yield [(left, right) for left in sorted(members) for right in by_left[left]]


def _solved(
    pairs: list[tuple[str, str]], scores: Mapping[tuple[str, str], float], alone: float
) -> list[tuple[str, str]]:
    from scipy.optimize import linear_sum_assignment

    lefts, rights = sorted({left for left, _ in pairs}), sorted({right for _, right in pairs})
    row, column = {one: at for at, one in enumerate(lefts)}, {one: at for at, one in enumerate(rights)}
    costs = np.full((len(lefts), len(rights) + (len(lefts) if alone < _NO_PAIR else 0)), _NO_PAIR)
    costs[:, len(rights) :] = alone
    for left, right in pairs:
        costs[row[left], column[right]] = min(scores[left, right], _MOST_SCORE)
    found = zip(*linear_sum_assignment(costs), strict=True)
    return [(lefts[at], rights[to]) for at, to in found if to < len(rights) and (lefts[at], rights[to]) in scores]
