"""The best conditional plan for a problem of looking: memoised search over e-states, with bounds that cut branches.

An e-state is a place and a set of merged hypotheses, a bit each. Between looks the way is a shortest one, so that only
looks are branched on: a look with the moves that lead to it is one macro step. Every branch is the best one for its
remaining hypotheses.
"""

from collections.abc import Callable
from typing import Final, Literal, NamedTuple, TypeAlias

from dyknow.planning.contingent.search_bounds import SearchBounds
from dyknow.planning.contingent.sensing_problems import CompiledSensing, MacroLook

MOST_STEPS: Final = 200_000
"""Looks that are weighed before the search for the best plan is given up."""
MOST_CLASSES: Final = 200
"""Merged hypotheses with which the best plan is searched for at all."""
PlanValue: TypeAlias = Literal["worst", "expected"]
Worth: TypeAlias = tuple[int, int, int]
"""The order of plans: the cost (of the worst branch, or expected times the sum of all weights), leaves, and actions."""
_Target: TypeAlias = tuple[tuple[int, int], str]


class MacroStep(NamedTuple):
    """Moves to a place, and a look from there."""

    moves: tuple[str, ...]
    look: MacroLook


class SearchLimitReached(Exception):
    """More steps than are allowed; `reason` is a sentence's end."""

    def __init__(self, reason: str) -> None:
        self.reason = reason
        super().__init__(reason)


class OptimalSearch:
    """Worths of e-states, each computed once.

    Args:
        stop: called now and then; a text that is not empty ends the search.
    """

    def __init__(
        self, compiled: CompiledSensing, value: PlanValue, stop: Callable[[], str] = str, most_steps: int = MOST_STEPS
    ) -> None:
        self._compiled, self._is_worst, self._stop, self._most = compiled, value == "worst", stop, most_steps
        self.steps = 0
        self._bounds = SearchBounds(compiled, is_worst=self._is_worst)
        self._look_cost = compiled.problem.costs.look
        self._worths: dict[tuple[int, str], Worth | None] = {}
        self._targets: dict[str, list[_Target]] = {}

    def worth(self, belief: int, place: str) -> Worth | None:
        """Of the best plan; None where no plan reaches the goal. Raises SearchLimitReached."""
        if len(self._compiled.classes) > MOST_CLASSES:
            raise SearchLimitReached(f"{len(self._compiled.classes)} hypotheses, more than {MOST_CLASSES}")
        key = (belief, place)
        if key not in self._worths:
            self._worths[key] = self._bounds.end(belief) or self._best(belief, place)
        return self._worths[key]

    def step(self, belief: int, place: str) -> MacroStep | None:
        """How the best plan continues, of equal ones that whose actions come first by name; None where there is none."""
        moves = list[str]()
        while (best := self.worth(belief, place)) is not None:
            look = self._best_look(belief, place, (0, 0), best)
            if look is not None:
                return MacroStep(tuple(moves), look)
            place = self._best_move(belief, place, best)
            moves.append(place)
        return None

    def _best_look(self, belief: int, target: str, far: tuple[int, int], best: Worth) -> MacroLook | None:
        """The first look by name at a place that is worth as much as the best."""
        looks = sorted(self._compiled.looks.get(target, ()), key=lambda each: each.look.target)
        return next((each for each in looks if self._worth_of_look(belief, target, each, far, best) == best), None)

    def _best_move(self, belief: int, place: str, best: Worth) -> str:
        """The first place by name to which the best plan may move next."""
        first_moves = sorted(
            (first, far, target)
            for far, target in self._targets_from(place)
            if target != place
            for first in self._compiled.first_moves(place, target)
        )
        return next(
            first for first, far, target in first_moves if self._best_look(belief, target, far, best) is not None
        )

    def _best(self, belief: int, place: str) -> Worth | None:
        """The best of all looks; looks with the lowest bounds are weighed first."""
        ordered = list[tuple[Worth, int, _Target, MacroLook]]()
        for number, (far, target) in enumerate(self._targets_from(place)):
            for look in self._compiled.looks[target]:
                bound = self._bound_of_look(belief, target, look, far)
                if bound is not None:
                    ordered.append((bound, number, (far, target), look))
        best: Worth | None = None
        for bound, _, (far, target), look in sorted(ordered, key=lambda each: each[:2]):
            if best is not None and bound >= best:
                break
            worth = self._worth_of_look(belief, target, look, far, best)
            if worth is not None and (best is None or worth < best):
                best = worth
        return best

    def _bound_of_look(self, belief: int, place: str, look: MacroLook, far: tuple[int, int]) -> Worth | None:
        """Bounds of cost, leaves and actions; None where the look shows nothing new."""
        groups = [part for mask in look.masks if (part := belief & mask)]
        if len(groups) < 2:
            return None
        self._count()
        least = [self._bounds.least(each, place) for each in groups]
        return self._joined(belief, far, least)

    def _joined(self, belief: int, far: tuple[int, int], worths: list[Worth]) -> Worth:
        """The worth of a macro step after which each group is worth so much."""
        cost, leaves, actions = far[0] + self._look_cost, 0, far[1] + 1
        after = 0
        for worth in worths:
            after = max(after, worth[0]) if self._is_worst else after + worth[0]
            leaves, actions = leaves + worth[1], actions + worth[2]
        if not self._is_worst:
            cost *= self._bounds.remaining(belief).weight
        return cost + after, leaves, actions

    def _worth_of_look(
        self, belief: int, place: str, look: MacroLook, far: tuple[int, int], best: Worth | None
    ) -> Worth | None:
        """Of a macro step and the best plans after it; None where it is of no use, has no plan, or is worse than `best`."""
        groups = [part for mask in look.masks if (part := belief & mask)]
        if len(groups) < 2:
            return None
        self._count()
        worths = [self._bounds.least(each, place) for each in groups]
        for number in sorted(range(len(groups)), key=lambda each: worths[each], reverse=True):
            if best is not None and self._joined(belief, far, worths) > best:
                return None
            worth = self.worth(groups[number], place)
            if worth is None:
                return None
            worths[number] = worth
        return self._joined(belief, far, worths)

    def _targets_from(self, place: str) -> list[_Target]:
        """The places of looks that can be reached from a place, the nearest first."""
        if place not in self._targets:
            reached = self._compiled.distances(place).items()
            self._targets[place] = sorted((far, target) for target, far in reached if target in self._compiled.looks)
        return self._targets[place]

    def _count(self) -> None:
        self.steps += 1
        if self.steps > self._most:
            raise SearchLimitReached(f"gave up after {self._most} steps")
        if self.steps % 256 == 0 and (reason := self._stop()):
            raise SearchLimitReached(reason)
