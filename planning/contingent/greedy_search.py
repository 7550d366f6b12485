"""A good plan where the best one is out of reach: each next look separates the most hypotheses for its cost."""

from collections.abc import Callable, Iterable
from typing import TypeAlias

from dyknow.planning.contingent.optimal_search import MacroStep
from dyknow.planning.contingent.sensing_problems import CompiledSensing, MacroLook

_Looks: TypeAlias = list[tuple[str, MacroLook]]


class GreedySearch:
    """Steps that are chosen one by one, without looking ahead.

    Args:
        stop: a text that it returns ends the search: there are no steps from then on; "" does not.
    """

    def __init__(self, compiled: CompiledSensing, stop: Callable[[], str] = str) -> None:
        self._compiled, self._stop = compiled, stop
        self.reason = ""
        self._every: _Looks = [(place, look) for place, looks in sorted(compiled.looks.items()) for look in looks]
        self._useful: dict[int, _Looks] = {}

    def step(self, belief: int, place: str) -> MacroStep | None:
        """The next look with the moves that lead to it; None where the hypotheses cannot be separated from here."""
        if not self.reason:
            self.reason = self._stop()
        if self.reason:
            return None
        best: tuple[float, str, str] | None = None
        chosen: MacroLook | None = None
        distances, cost = self._compiled.distances(place), self._compiled.problem.costs.look
        useful: _Looks = []  # a look that shows nothing new here shows nothing new to any part of this belief
        for target, look in self._useful.pop(belief, self._every):
            gain = _separated(belief & mask for mask in look.masks)
            if gain:
                useful.append((target, look))
                if target in distances:
                    rank = (distances[target][0] + cost) / gain, target, look.look.target
                    if best is None or rank < best:
                        best, chosen = rank, look
        if best is None or chosen is None:
            return None
        for mask in chosen.masks:
            self._useful[belief & mask] = useful
        moves = list[str]()
        while place != best[1]:
            place = self._compiled.first_moves(place, best[1])[0]
            moves.append(place)
        return MacroStep(tuple(moves), chosen)


def _separated(groups: Iterable[int]) -> int:
    """Pairs of hypotheses that are in different groups."""
    every = squares = 0
    for each in groups:
        size = each.bit_count()
        every += size
        squares += size * size
    return (every * every - squares) // 2
