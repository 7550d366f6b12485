"""Association of several observations of one time: each comes from one source, each instance gives at most one.

Pairs within the gate are the edges of a bipartite graph, weighted by psi = r P_D L / ((1 - r P_D) lambda). Loopy belief
propagation (Williams, Lau: "Approximate evaluation of marginal association probabilities") gives the marginals, which are
exact for each connected part without a cycle. Of parts with cycles, all associations are summed where these are few.
"""

from collections import Counter, defaultdict
from typing import Final, NamedTuple

import numpy as np

from anchoring.belief.arrays import Flags, Floats, Indices

_CLOSE, _CONVERGED, _SWEEPS = 1e-5, 1e-13, 50
_SAFE = 1e6
"""Below it differences of sums are exact to 1e-10."""
EXACT_INSTANCES: Final = 8
"""Parts with cycles and more instances than that are left to belief propagation."""
EXACT_STEPS: Final = 2_000
"""So are those that take more additions."""


class ScanAssociation(NamedTuple):
    """Where the observations of a scan came from.

    Attributes:
        pairs: (E,) P(instance i exists and gave observation j).
        none: (N,) P(instance i gave no observation).
        unclaimed: (M,) P(observation j came from no instance).
        is_exact: whether these are sums over all associations, within 1e-9.
    """

    pairs: Floats
    none: Floats
    unclaimed: Floats
    is_exact: bool


def associate(
    rows: Indices, cols: Indices, psi: Floats, count: int, observed: int, *, exact_instances: int = EXACT_INSTANCES
) -> ScanAssociation:
    """Marginals of all pairs.

    Args:
        rows: (E,) instance of each pair.
        cols: (E,) its observation.
        psi: (E,) how much likelier the pair is than both without it.
        count: number of instances.
        observed: number of observations.
        exact_instances: the largest part with cycles whose associations are all summed.
    """
    into = ScanAssociation(np.zeros(len(psi)), np.ones(count), np.ones(observed), is_exact=True)
    core = _core(rows, cols, count, observed)
    if not core.any():
        return _propagated(rows, cols, psi, into, _CONVERGED)
    if not exact_instances:
        return _propagated(rows, cols, psi, into, _CLOSE)._replace(is_exact=False)
    trees, loops = np.ones(len(psi), dtype=np.bool_), []
    for part in _parts(rows, cols, core):
        trees[part] = False
        if not _sum(part, rows, cols, psi, into, exact_instances):
            loops += part
    for chosen, close in ((np.flatnonzero(trees), _CONVERGED), (np.array(loops, dtype=np.intp), _CLOSE)):
        if len(chosen):
            row, col = rows[chosen], cols[chosen]
            found = _propagated(row, col, psi[chosen], into, close)
            into.pairs[chosen] = found.pairs
            into.none[row], into.unclaimed[col] = found.none[row], found.unclaimed[col]
    return into._replace(is_exact=not loops)


def _propagated(rows: Indices, cols: Indices, psi: Floats, of: ScanAssociation, close: float) -> ScanAssociation:
    """Belief propagation among some pairs of a scan until no message changes by more than `close`."""
    if not len(psi):
        return of
    count, observed = len(of.none), len(of.unclaimed)
    back = np.ones(len(psi))
    for _ in range(_SWEEPS):
        along = psi * back
        there = psi / (1.0 + _others(along, rows, count))
        updated = 1.0 / (1.0 + _others(there, cols, observed))
        change = np.abs(updated - back).max()
        back = updated
        if change <= close:
            break
    along = psi * back
    none = np.asarray(1.0 / (1.0 + np.bincount(rows, along, count)), dtype=np.float64)
    unclaimed = np.asarray(1.0 / (1.0 + np.bincount(cols, there, observed)), dtype=np.float64)
    return ScanAssociation(along * none[rows], none, unclaimed, is_exact=True)


def _others(values: Floats, index: Indices, count: int) -> Floats:
    """(E,) the sum of all other values with the same index, right also where these are smaller by orders of magnitude."""
    others = np.bincount(index, values, count)[index] - values
    if values.max() < _SAFE:
        return others
    largest = np.zeros(count)
    np.maximum.at(largest, index, values)
    places = np.flatnonzero(values == largest[index])
    places = places[np.unique(index[places], return_index=True)[1]]
    rest = values.copy()
    rest[places] = 0.0
    others[places] = np.bincount(index, rest, count)[index[places]]
    return others


def _core(rows: Indices, cols: Indices, count: int, observed: int) -> Flags:
    """(E,) pairs on cycles or on paths between them: those which remain while ends are cut off."""
    kept = np.ones(len(rows), dtype=np.bool_)
    before = len(rows) + 1
    while before > (before := int(np.count_nonzero(kept))) > 0:
        kept &= np.bincount(rows, kept, count)[rows] > 1.0
        kept &= np.bincount(cols, kept, observed)[cols] > 1.0
    return kept


def _parts(rows: Indices, cols: Indices, core: Flags) -> list[list[int]]:
    """The connected parts that have cycles, each as its pairs."""
    of_row, of_col = defaultdict[int, list[int]](list), defaultdict[int, list[int]](list)
    row, col = rows.tolist(), cols.tolist()
    for edge in range(len(row)):
        of_row[row[edge]].append(edge)
        of_col[col[edge]].append(edge)
    parts: list[list[int]] = []
    seen = set[int]()
    for start in np.flatnonzero(core).tolist():
        if start in seen:
            continue
        part, ahead = [], [start]
        seen.add(start)
        while ahead:
            edge = ahead.pop()
            part.append(edge)
            for other in (*of_row[row[edge]], *of_col[col[edge]]):
                if other not in seen:
                    seen.add(other)
                    ahead.append(other)
        parts.append(sorted(part))
    return parts


class _Choices(NamedTuple):
    """What one instance can give: nothing, with weight 1, or one of its pairs.

    Attributes:
        shared: (pair, bit of the observation) where also other instances can give that.
        free: the other pairs.
    """

    shared: list[tuple[int, int]]
    free: list[int]


def _sum(
    part: list[int], rows: Indices, cols: Indices, psi: Floats, into: ScanAssociation, exact_instances: int
) -> bool:
    """Replace the marginals of a part by sums over its associations; whether these are few enough.

    Instance by instance, sums are kept for each set of shared observations that were given so far, and then from the back.
    """
    row_of, col_of, weights = rows[part].tolist(), cols[part].tolist(), dict(zip(part, psi[part].tolist(), strict=True))
    shared = [col for col, number in Counter(col_of).items() if number > 1]
    bits = {col: 1 << place for place, col in enumerate(shared)}
    choices: dict[int, _Choices] = {}
    for edge, row, col in zip(part, row_of, col_of, strict=True):
        chosen = choices.setdefault(row, _Choices([], []))
        chosen.shared.append((edge, bits[col])) if col in bits else chosen.free.append(edge)
    if len(choices) > exact_instances:
        return False
    forward: list[dict[int, float]] = [{0: 1.0}]
    alone: list[float] = []
    steps = 0
    for chosen in choices.values():
        every = [*chosen.free, *(edge for edge, _ in chosen.shared)]
        scale = max(1.0, *(weights[edge] for edge in every))
        for edge in every:
            weights[edge] /= scale
        alone.append(1.0 / scale + sum(weights[edge] for edge in chosen.free))
        taken = forward[-1]
        after = {mask: value * alone[-1] for mask, value in taken.items()}
        steps += len(taken) * (1 + len(chosen.shared))
        if steps > EXACT_STEPS:
            return False
        for edge, bit in chosen.shared:
            weight = weights[edge]
            for mask, value in taken.items():
                if not mask & bit:
                    after[mask | bit] = after.get(mask | bit, 0.0) + value * weight
        forward.append(after)
    total = sum(forward[-1].values())
    backward = dict.fromkeys(forward[-1], 1.0)
    for chosen, before, rest in zip(reversed(choices.values()), reversed(forward[:-1]), reversed(alone), strict=True):
        without = sum([value * backward[mask] for mask, value in before.items()]) / total
        for edge in chosen.free:
            into.pairs[edge] = without * weights[edge]
        earlier = {mask: backward[mask] * rest for mask in before}
        for edge, bit in chosen.shared:
            weight, found = weights[edge] / total, 0.0
            for mask, value in before.items():
                if not mask & bit:
                    after_it = weight * backward[mask | bit]
                    found += value * after_it
                    earlier[mask] += after_it * total
            into.pairs[edge] = found
        backward = earlier
    for edge, row, col in zip(part, row_of, col_of, strict=True):
        into.none[row] -= into.pairs[edge]
        into.unclaimed[col] -= into.pairs[edge]
    for places, found_of in ((row_of, into.none), (col_of, into.unclaimed)):
        found_of[places] = np.maximum(found_of[places], 0.0)
    return True
