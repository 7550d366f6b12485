"""What a plan takes at least: bounds of worths that a search for the best plan cuts branches with.

Let each look have an outcome that it keeps: that of most hypotheses at the start. On the branch of kept outcomes a look removes at
most `_most_removed` hypotheses, and all looks from one place together only those of `_removed_at`. The branch ends when one answer
remains, so that all hypotheses but those of the commonest answer have to be removed on it; how many looks there are, and how many
places are visited, follows. With looks of more than two outcomes the branch may not exist, and one look is the bound.
"""

from functools import reduce
from operator import or_
from typing import Final, NamedTuple

from planning.contingent.sensing_problems import CompiledSensing, bits_of

_MOST_COMPARED: Final = 40


class _Remaining(NamedTuple):
    """Of one belief: weight, number of answers, hypotheses to be removed, and the weights, greatest first."""

    weight: int
    answers: int
    removed: int
    weights: tuple[int, ...]


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
        self._most_removed_at = max((each.bit_count() for each in self._removed_at.values()), default=1)
        self._step = _nearest(compiled)
        self._most_outcomes = max((len(look.masks) for found in compiled.looks.values() for look in found), default=2)
        self._remaining: dict[int, _Remaining] = {}

    def remaining(self, belief: int) -> _Remaining:
        """The figures of a belief, computed once."""
        found = self._remaining.get(belief)
        if found is None:
            weights = tuple(sorted((self._weights[number] for number in bits_of(belief)), reverse=True))
            sizes = [size for mask in self._answers if (size := (belief & mask).bit_count())]
            found = _Remaining(sum(weights), len(sizes), len(weights) - max(sizes), weights)
            self._remaining[belief] = found
        return found

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
        moves = self._moves(found.removed, here) if self._is_binary else 0
        leaves = max(found.answers, looks + 1)
        actions = self._ends * leaves + -(-(leaves - 1) // (self._most_outcomes - 1)) + moves
        if self._is_worst:
            return looks * self._look + moves * self._step + self._end, leaves, actions
        if not is_one_by_one:
            return found.weight * (self._look + self._end), leaves, actions
        cost, total = 0, found.weight * self._end
        for number in range(1, looks + 1):
            cost = number * self._look + self._moves(number, here) * self._step
            total += found.weights[number - 1] * cost
        return total + sum(found.weights[looks:]) * cost, leaves, actions

    def _moves(self, removed: int, here: int) -> int:
        """Places that have to be visited to remove a number of hypotheses; `here` of them are removed without a move."""
        return max(0, -(-(removed - here) // self._most_removed_at))


def _nearest(compiled: CompiledSensing) -> int:
    """What it costs at least to go from one place of looks to another."""
    ways = compiled.problem.ways.values()
    if len(compiled.looks) > _MOST_COMPARED:
        return compiled.problem.costs.move * min((length for way in ways for length in way.values()), default=0)
    distances = {place: compiled.distances(place) for place in compiled.looks}
    return min(
        (far[to][0] for place, far in distances.items() for to in compiled.looks if to != place and to in far),
        default=0,
    )
