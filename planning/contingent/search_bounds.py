"""Lower bounds of a plan's worth, with which a search for the best plan cuts branches.

Let each look have an outcome that it keeps: that of most hypotheses at the start. On the branch of kept outcomes a look removes at
most `_most_removed` hypotheses, and all looks from one place together only those of `_removed_at`. The branch ends when one answer
remains, so that all hypotheses have to be removed on it but those of the commonest answer, or, where some are removed by no look,
but those of their answer. How many looks there are follows; and which places are visited, since some hypotheses are removed from
one place only. With looks of more than two outcomes the branch may not exist, and one look is the bound.
"""

from functools import reduce
from operator import or_
from typing import Final, NamedTuple

from dyknow.planning.contingent.sensing_problems import CompiledSensing, bits_of
from dyknow.planning.contingent.walks import ShortestWalks

_MOST_COMPARED: Final = 40


class _Remaining(NamedTuple):
    """Of one belief.

    Attributes:
        removed: how many hypotheses have to be removed.
        weights: of the hypotheses, greatest first.
        visited: places that have to be visited, a bit each; 0 where it is not known which hypotheses have to be removed.
        is_exact: each hypothesis that has to be removed is so from one place only.
    """

    weight: int
    answers: int
    removed: int
    weights: tuple[int, ...]
    visited: int
    is_exact: bool


class SearchBounds:
    """Bounds of costs, leaves and actions from an e-state on."""

    def __init__(self, compiled: CompiledSensing, *, is_worst: bool) -> None:
        self._is_worst = is_worst
        problem = compiled.problem
        self._ends = int(problem.task == "identify")
        self._look, self._end = problem.costs.look, problem.costs.anchor * self._ends
        self._weights = [each.weight for each in compiled.classes]
        answers: dict[str, int] = {}
        for number, each in enumerate(compiled.classes):
            answers[each.answer] = answers.get(each.answer, 0) | 1 << number
        self._answers = list(answers.values())
        self._is_binary = all(len(look.masks) == 2 for looks in compiled.looks.values() for look in looks)
        self._most_removed, self._removed_at = 1, dict[str, int]()
        for place, looks in compiled.looks.items():
            removed = [min(look.masks, key=int.bit_count) for look in looks]
            self._most_removed = max(self._most_removed, *(each.bit_count() for each in removed))
            self._removed_at[place] = reduce(or_, removed)
        self._removable = reduce(or_, self._removed_at.values(), 0) if self._is_binary else -1
        self._most_removed_at = max((each.bit_count() for each in self._removed_at.values()), default=1)
        self._step = _nearest(compiled)
        self._walks = ShortestWalks(compiled)
        self._longest = problem.costs.move * max(
            (way for each in problem.ways.values() for way in each.values()), default=1
        )
        self._bit = places = {place: 1 << number for number, place in enumerate(self._walks.places)}
        self._from = [
            sum(bit for place, bit in places.items() if self._removed_at[place] >> number & 1)
            for number in range(len(compiled.classes))
        ]
        self._most_outcomes = max((len(look.masks) for found in compiled.looks.values() for look in found), default=2)
        self._remaining: dict[int, _Remaining] = {}

    def remaining(self, belief: int) -> _Remaining:
        """The figures of a belief, computed once."""
        found = self._remaining.get(belief)
        if found is None:
            found = self._remaining[belief] = self._figures(belief)
        return found

    def _figures(self, belief: int) -> _Remaining:
        weights = tuple(sorted((self._weights[number] for number in bits_of(belief)), reverse=True))
        parts = [part for mask in self._answers if (part := belief & mask)]
        always = belief & ~self._removable
        kept = max((part for part in parts if not always & ~part), key=int.bit_count, default=0)
        removed = len(weights) - kept.bit_count()
        if not always:
            return _Remaining(sum(weights), len(parts), removed, weights, 0, False)
        places = [self._from[number] for number in bits_of(belief & ~kept)]
        single = [each for each in places if each & (each - 1) == 0]
        visited = reduce(or_, single, 0)
        return _Remaining(sum(weights), len(parts), removed, weights, visited, len(single) == len(places))

    def end(self, belief: int) -> tuple[int, int, int] | None:
        """The exact worth where one answer remains, else None."""
        found = self.remaining(belief)
        if found.answers > 1:
            return None
        return self._end * (1 if self._is_worst else found.weight), 1, self._ends

    def least(self, belief: int, place: str) -> tuple[int, int, int]:
        """Bounds of cost, leaves and actions, each by itself, of the plan for a belief from a place on."""
        found = self.remaining(belief)
        if found.answers == 1:
            return self._end * (1 if self._is_worst else found.weight), 1, self._ends
        looks = -(-found.removed // self._most_removed) if self._is_binary else 1
        is_one_by_one = self._is_binary and self._most_removed == 1
        here = (self._removed_at.get(place, 0) & belief).bit_count()
        hops = self._moves(found.removed, here) if self._is_binary else 0
        visited = found.visited & ~self._bit.get(place, 0)
        walk = self._walks.cost(place, visited, visited.bit_count())
        moves = max(hops * self._step, walk)
        leaves = max(found.answers, looks + 1)
        actions = (
            self._ends * leaves + -(-(leaves - 1) // (self._most_outcomes - 1)) + max(hops, -(-walk // self._longest))
        )
        if self._is_worst:
            return looks * self._look + moves + self._end, leaves, actions
        if not is_one_by_one:
            return found.weight * (self._look + self._end), leaves, actions
        total = found.weight * self._end
        for number in range(1, looks):
            hops = self._moves(number, here)
            moved = self._walks.cost(place, visited, hops) if found.is_exact else hops * self._step
            total += found.weights[number - 1] * (number * self._look + moved)
        return total + sum(found.weights[looks - 1 :]) * (looks * self._look + moves), leaves, actions

    def _moves(self, removed: int, here: int) -> int:
        """Places that have to be visited to remove a number of hypotheses; `here` of them are removed without a move."""
        return max(0, -(-(removed - here) // self._most_removed_at))


def _nearest(compiled: CompiledSensing) -> int:
    """The least cost of going from one place of looks to another."""
    ways = compiled.problem.ways.values()
    if len(compiled.looks) > _MOST_COMPARED:
        return compiled.problem.costs.move * min((length for way in ways for length in way.values()), default=0)
    distances = {place: compiled.distances(place) for place in compiled.looks}
    return min(
        (far[to][0] for place, far in distances.items() for to in compiled.looks if to != place and to in far),
        default=0,
    )
