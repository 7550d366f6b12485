"""Association of several observations of one time: each comes from one source, each instance gives at most one.

Pairs within the gate are the edges of a bipartite graph, weighted by psi = r P_D L / ((1 - r P_D) lambda). Loopy belief
propagation (Williams, Lau: "Approximate evaluation of marginal association probabilities") gives the marginals, which
are exact for each connected part without a cycle. In parts with cycles all associations are summed if they are few:
side by side of the graph, with a sum for each set of used nodes of the smaller side.
"""

from collections import defaultdict
from typing import Final, NamedTuple

import numpy as np

from dyknow.anchoring.belief.arrays import Flags, Floats, Indices

_CLOSE, _CONVERGED, _SWEEPS, _TREE_SWEEPS = 1e-5, 1e-13, 50, 2_000
_SAFE = 1e6
"""Below it differences of sums are exact to 1e-10."""
EXACT_INSTANCES: Final = 8
"""Parts with cycles are left to belief propagation if they have both more instances and more observations than that."""
EXACT_CELLS: Final = 1 << 17
"""So are those with more pairs times sets."""
EXACT_PAIRS: Final = 5_000
"""Pairs of a scan in parts that are summed."""
NEGLIGIBLE: Final = 1e-5
"""Pairs that are so much less likely than both without it are left out of parts that are too large."""


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
        exact_instances: parts with cycles of up to this number of instances, or of observations, are summed; 0: none.
    """
    into = ScanAssociation(np.zeros(len(psi)), np.ones(count), np.ones(observed), is_exact=True)
    core = _core(rows, cols, count, observed)
    if not core.any():
        return _propagated(rows, cols, psi, into, _CONVERGED, _TREE_SWEEPS)
    if not exact_instances:
        return _propagated(rows, cols, psi, into, _CLOSE)._replace(is_exact=False)
    left = EXACT_PAIRS
    trees, loops = np.ones(len(psi), dtype=np.bool_), list[int]()
    for part in _parts(rows, cols, core):
        trees[part] = False
        if len(part) <= left and _sum(part, rows, cols, psi, into, exact_instances):
            left -= len(part)
        else:
            loops += part
    is_exact = _propagate_into(np.flatnonzero(trees), rows, cols, psi, into, _CONVERGED, _TREE_SWEEPS) and not loops
    if loops:
        chosen = np.array(loops, dtype=np.intp)
        _approximate(chosen[psi[chosen] >= NEGLIGIBLE], rows, cols, psi, into, exact_instances, left)
    return into._replace(is_exact=is_exact)


def _approximate(
    chosen: Indices, rows: Indices, cols: Indices, psi: Floats, into: ScanAssociation, exact_instances: int, left: int
) -> None:
    """Of parts that are too large, without their negligible pairs: sums of those that fall apart, the others propagated."""
    row, col = rows[chosen], cols[chosen]
    loops = np.ones(len(chosen), dtype=np.bool_)
    for part in _parts(row, col, _core(row, col, len(into.none), len(into.unclaimed))):
        pairs = chosen[part].tolist()
        if len(part) <= left and _sum(pairs, rows, cols, psi, into, exact_instances):
            left -= len(part)
            loops[part] = False
    _propagate_into(chosen[loops], rows, cols, psi, into, _CLOSE, _SWEEPS)


def _propagate_into(
    chosen: Indices, rows: Indices, cols: Indices, psi: Floats, into: ScanAssociation, close: float, sweeps: int
) -> bool:
    """Replace the marginals of some pairs by propagation among them; whether it converged."""
    if not len(chosen):
        return True
    row, col = rows[chosen], cols[chosen]
    found = _propagated(row, col, psi[chosen], into, close, sweeps)
    into.pairs[chosen] = found.pairs
    into.none[row], into.unclaimed[col] = found.none[row], found.unclaimed[col]
    return found.is_exact


def _propagated(
    rows: Indices, cols: Indices, psi: Floats, of: ScanAssociation, close: float, sweeps: int = _SWEEPS
) -> ScanAssociation:
    """Belief propagation among some pairs of a scan until no message changes by more than `close`; exact only if so."""
    if not len(psi):
        return of
    count, observed = len(of.none), len(of.unclaimed)
    back = np.ones(len(psi))
    change = 0.0
    for _ in range(sweeps):
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
    return ScanAssociation(along * none[rows], none, unclaimed, is_exact=bool(change <= close))


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
    """(E,) pairs on cycles or on paths between them: the remaining ones when ends are cut off."""
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
    for start in np.flatnonzero(core).tolist():
        if row[start] not in of_row:
            continue
        part, ahead = list[int](), [row[start]]
        while ahead:
            edges = of_row.pop(ahead.pop(), [])
            part += edges
            ahead += [row[other] for edge in edges for other in of_col.pop(col[edge], [])]
        parts.append(sorted(part))
    return parts


def _sum(
    part: list[int], rows: Indices, cols: Indices, psi: Floats, into: ScanAssociation, exact_instances: int
) -> bool:
    """Replace the marginals of a part by sums over its associations; whether these are few enough.

    Each of the larger side in turn takes none of the smaller side or one that is not taken: logarithms of sums are kept for
    each set of those that are, from the front and then from the back.
    """
    one, other = rows[part], cols[part]
    if len(np.unique(one)) < len(np.unique(other)):
        one, other = other, one
    bit_of = {each: 1 << place for place, each in enumerate(np.unique(other).tolist())}
    if len(bit_of) > exact_instances or len(part) << len(bit_of) > EXACT_CELLS:
        return False
    sets = np.arange(1 << len(bit_of))
    choices = defaultdict[int, list[tuple[int, Indices, int, float]]](list)
    with np.errstate(divide="ignore"):
        weights = np.log(psi[part]).tolist()
    for edge, source, target, weight in zip(part, one.tolist(), other.tolist(), weights, strict=True):
        bit = bit_of[target]
        choices[source].append((edge, np.flatnonzero(sets & bit == 0), bit, weight))
    forward = [np.where(sets == 0, 0.0, -np.inf)]
    for chosen in choices.values():
        before = forward[-1]
        after = before.copy()
        for _, free, bit, weight in chosen:
            after[free | bit] = np.logaddexp(after[free | bit], before[free] + weight)
        forward.append(after)
    total = np.logaddexp.reduce(forward[-1])
    backward = np.zeros(len(sets))
    for chosen, before in zip(reversed(choices.values()), reversed(forward[:-1]), strict=True):
        earlier = backward.copy()
        for edge, free, bit, weight in chosen:
            with_it = backward[free | bit] + weight
            into.pairs[edge] = np.exp(before[free] + with_it - total).sum()
            earlier[free] = np.logaddexp(earlier[free], with_it)
        backward = earlier
    for index, found in ((rows[part], into.none), (cols[part], into.unclaimed)):
        found[index] = np.maximum(1.0 - np.bincount(index, into.pairs[part], len(found))[index], 0.0)
    return True
