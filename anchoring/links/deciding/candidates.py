"""Several weighted hypotheses about one percept: which of the known objects it shows, while that is not certain.

Each candidate has a track of its own, as the states of the percept make it if it is this one. At each state the weights are
multiplied by how likely each track makes it, and normalised; those below `LEAST_WEIGHT` are dropped. Which is linked
changes when another has become the likelier one. A condition that fails lowers a weight instead of ending the link.
"""

from dataclasses import dataclass
from math import exp
from typing import Final

import numpy as np

from anchoring.links.objects import LastSeen, LinkObject
from anchoring.links.specification import filtered
from anchoring.links.states import ObjectState, moved

LEAST_WEIGHT: Final = 0.02
_LOWERED: Final = 0.1
"""What remains of a weight when the maintain condition fails."""


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

    @property
    def likeliest(self) -> LinkCandidate:
        """The most probable; of several that are, the one that is linked."""
        return max(self._candidates.values(), key=lambda each: (each.weight, each is self._candidates[self.chosen]))

    def go_over(self) -> tuple[LinkCandidate, LastSeen]:
        """The likeliest takes the place of the one that is linked: it, and how the one before was known before."""
        before, likeliest = self._candidates[self.chosen].before, self.likeliest
        likeliest.before = likeliest.target.last_seen
        self.chosen = likeliest.target.symbol
        return likeliest, before

    def others(self) -> tuple[str, ...]:
        """The symbols of those that are not linked."""
        return tuple(symbol for symbol in self._candidates if symbol != self.chosen)

    def on_state(self, valid_us: int, state: ObjectState, noise: float) -> None:
        """The percept has a state."""
        scores: dict[str, float] = {}
        for symbol, each in self._candidates.items():
            expected = moved(each.state, valid_us, noise)
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

    def drop(self, symbol: str) -> None:
        """An object is shown by another percept, or gone."""
        del self._candidates[symbol]
        self._normalise()

    def _normalise(self) -> None:
        for symbol in [symbol for symbol in self.others() if self._share(symbol) < LEAST_WEIGHT]:
            del self._candidates[symbol]
        total = self._total
        for each in self._candidates.values():
            each.weight = each.weight / total if total > 0.0 else 1.0 / len(self._candidates)

    @property
    def _total(self) -> float:
        return sum(each.weight for each in self._candidates.values())

    def _share(self, symbol: str) -> float:
        total = self._total
        return self._candidates[symbol].weight / total if total > 0.0 else 0.0


def _unlikely(state: ObjectState, expected: ObjectState) -> float:
    """d^T S^-1 d + log det S over position and velocity, where S is the sum of both covariances."""
    both = state.covariance + expected.covariance
    apart = np.array(state[1:5]) - np.array(expected[1:5])
    return float(apart @ np.linalg.solve(both, apart) + np.linalg.slogdet(both)[1])
