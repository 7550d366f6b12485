"""Several weighted hypotheses about one percept: which of the known objects it shows, while that is not certain.

Each candidate has a track of its own, as the states of the percept make it if it is this one. At each state the weights are
multiplied by how likely each track makes it, and normalised; those below `LEAST_WEIGHT` are dropped. Which is linked
changes when another has become the likelier one: all links that are not certain are assigned again, so that two percepts may
change their objects. A condition that fails lowers a weight instead of ending the link.

The object of a link that is not certain may be claimed by another percept: which of both gets it is part of the one
assignment of a tick, where each candidate costs the first -2 ln of its weight.
"""

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from math import exp, log
from typing import Final, NamedTuple

import numpy as np

from dyknow.anchoring.links.assignment import assigned
from dyknow.anchoring.links.objects import LastSeen, LinkObject, ObjectLink
from dyknow.anchoring.links.specification import filtered
from dyknow.anchoring.links.states import ObjectState

LEAST_WEIGHT: Final = 0.02
OPEN_WEIGHT: Final = 0.1
"""With a smaller weight a candidate is no reason to leave an object to another percept."""
_NO_WEIGHT, _PREFERRED = 1e-12, 1e-9
_LOWERED: Final = 0.1
"""The factor on a weight when the maintain condition fails."""


@dataclass(slots=True)
class LinkCandidate:
    """A known object that a percept may be.

    Attributes:
        state: its latest, if it is the one.
        before: how it was known before the percept.
    """

    target: LinkObject
    weight: float
    state: ObjectState
    before: LastSeen


class OpenLink(NamedTuple):
    """A link whose object another percept may claim.

    Attributes:
        expected: the object as if it had not been linked, which is how it was known `before`.
        costs: of each candidate, by symbol.
    """

    link: ObjectLink
    before: LastSeen
    expected: LinkObject
    costs: Mapping[str, float]


class LinkCandidates:
    """The candidates for one percept.

    Attributes:
        chosen: the symbol of the one that is linked.
    """

    def __init__(self, chosen: str, candidates: dict[str, LinkCandidate]) -> None:
        self.chosen, self._candidates = chosen, candidates
        self._normalise()

    @property
    def weight(self) -> float:
        """How probable the one is that is linked."""
        return self._candidates[self.chosen].weight

    @property
    def is_decided(self) -> bool:
        """Whether no other is left."""
        return len(self._candidates) == 1

    def go_over(self, to: LinkCandidate) -> None:
        """Replace the linked object by another candidate; `to.before` is the last time its target was seen."""
        to.before = to.target.last_seen
        self.chosen = to.target.symbol

    def of(self, symbol: str) -> LinkCandidate:
        """One candidate."""
        return self._candidates[symbol]

    def costs(self, least: float = 0.0) -> dict[str, float]:
        """-2 ln of the weights, by symbol, of those with this weight at least; of equal ones the one that is linked."""
        costs = {
            name: -2.0 * log(max(each.weight, _NO_WEIGHT))
            for name, each in self._candidates.items()
            if each.weight >= least
        }
        if self.chosen in costs:
            costs[self.chosen] -= _PREFERRED
        return costs

    def open_link(self, process: str) -> OpenLink | None:
        """The link, if it may be another that is linked."""
        costs = self.costs(OPEN_WEIGHT)
        if self.chosen not in costs or len(costs) < 2:
            return None
        one, before = self._candidates[self.chosen].target, self._candidates[self.chosen].before
        return OpenLink(one.incoming[process], before, one.as_known(before), costs)

    def others(self) -> tuple[str, ...]:
        """The symbols of those that are not linked."""
        return tuple(symbol for symbol in self._candidates if symbol != self.chosen)

    def on_state(self, valid_us: int, state: ObjectState, later: Callable[[ObjectState, int], ObjectState]) -> None:
        """The percept has a state."""
        scores: dict[str, float] = {}
        for symbol, each in self._candidates.items():
            expected = later(each.state, valid_us)
            scores[symbol] = _unlikely(state, expected)
            each.state = filtered(state, expected)
        least = min(scores.values())
        for symbol, each in self._candidates.items():
            each.weight *= exp((least - scores[symbol]) / 2.0)
        self._normalise()

    def lower(self) -> None:
        """The condition under which the one that is linked stays so has failed."""
        self._candidates[self.chosen].weight *= _LOWERED
        self._normalise()

    def rename(self, before: str, after: str) -> None:
        """An object has another symbol."""
        if before in self._candidates:
            self._candidates[after] = self._candidates.pop(before)
        if self.chosen == before:
            self.chosen = after

    def drop(self, symbol: str) -> None:
        """An object is shown by another percept, or gone."""
        del self._candidates[symbol]
        self._normalise()

    def _normalise(self) -> None:
        for symbol in [symbol for symbol in self.others() if self._share(symbol) < LEAST_WEIGHT]:
            del self._candidates[symbol]
        total = self._total
        for each in self._candidates.values():
            share = each.weight / total if total > 0.0 else 1.0 / len(self._candidates)
            each.weight = max(share, _NO_WEIGHT)  # the linked object may become likely again

    @property
    def _total(self) -> float:
        return sum(each.weight for each in self._candidates.values())

    def _share(self, symbol: str) -> float:
        total = self._total
        return self._candidates[symbol].weight / total if total > 0.0 else 0.0


def open_links(candidates: Iterable[LinkCandidates], process: str) -> dict[str, OpenLink]:
    """Links of a process that are not certain, by the symbol of the object of B that may be claimed."""
    found = (each.open_link(process) for each in candidates)
    return {each.link.target.symbol: each for each in found if each is not None}


def known_before(
    open_links: Mapping[str, OpenLink], available: Mapping[str, tuple[LinkObject, int]], targets: Iterable[str]
) -> dict[str, tuple[LinkObject, LastSeen]]:
    """Objects of B, each as it was known before it was linked at this tick, or before its open link."""
    found = {name: (each.link.target, each.before) for name, each in open_links.items()}
    free = {name: available[name][0] for name in targets if name not in found}
    return found | {name: (one, one.last_seen) for name, one in free.items()}


def _unlikely(state: ObjectState, expected: ObjectState) -> float:
    """d^T S^-1 d + log det S over position and velocity, where S is the sum of both covariances."""
    both = state.covariance + expected.covariance
    apart = np.array(state[1:5]) - np.array(expected[1:5])
    return float(apart @ np.linalg.solve(both, apart) + np.linalg.slogdet(both)[1])


def assigned_with(
    scores: Mapping[tuple[str, str], float],
    open_links: Iterable[OpenLink],
    available: Collection[str],
    alone: float | None = None,
) -> dict[str, str]:
    """Which percept gets which object; those with links that are not certain take part where another claims their object.

    That is a percept whose link is contested, too: it may take what is available, or held by such a link. If one
    of these were left without an object, all keep theirs. `alone` is the score of a percept that is none of them, if it has one.
    """
    held = {each.link.target.symbol: each for each in open_links}
    lone = {} if alone is None else {"alone": alone}
    contested: dict[str, OpenLink] = {}
    claimed = [target for _, target in scores]
    while claimed:
        each = held.get(claimed.pop())
        if each is not None and each.link.source.symbol not in contested:
            contested[each.link.source.symbol] = each
            claimed += each.costs
    costs = {
        (name, target): cost
        for name, each in contested.items()
        for target, cost in each.costs.items()
        if target in held or target in available
    }
    chosen = dict(assigned({**scores, **costs}, **lone))
    if contested.keys() <= chosen.keys():
        return chosen
    kept = {name: each.link.target.symbol for name, each in contested.items()}
    free = {pair: score for pair, score in scores.items() if pair[1] not in kept.values()}
    return {**dict(assigned(free, **lone)), **kept}


def reassigned(candidates: Mapping[str, LinkCandidates], shown: Collection[str]) -> dict[str, str]:
    """Which percepts go over to which object when all that are shown are assigned again; the others keep theirs."""
    costs = {
        (name, target): cost
        for name, each in candidates.items()
        for target, cost in each.costs().items()
        if name in shown or target == each.chosen
    }
    return {name: target for name, target in assigned(costs) if target != candidates[name].chosen}
