"""Looks that may err: beliefs are probabilities, updated by Bayes' rule, and a plan may look twice at the same.

The plan has a maximum number of looks. A branch succeeds as soon as one answer is probable enough; the plan is that
under which most branches do, by their probability, and of these the cheapest in the mean.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, NamedTuple, TypeAlias

from dyknow.planning.contingent.conditional_plans import (
    ConditionalPlan,
    ObservedFeature,
    PlanFigures,
    SensingAction,
    figures_of,
)
from dyknow.planning.contingent.optimal_search import SearchLimitReached
from dyknow.planning.contingent.sensing_problems import CompiledSensing, LookErrors, MacroLook, SensingProblem, bits_of

MOST_STEPS: Final = 60_000
_Counts: TypeAlias = tuple[tuple[int, int, int], ...]
"""For each look that was taken, by number: how often it showed something, and how often nothing."""
_EQUAL: Final = 1e-9


class _NoisyWorth(NamedTuple):
    """Probability of success, mean cost, and the look to take, by number; -1 where the plan ends."""

    success: float
    cost: float
    look: int


@dataclass(frozen=True, slots=True)
class NoisyPlan:
    """A plan for looks that may err.

    Attributes:
        expected: mean cost.
        success: the probability that the plan ends with an answer.
        right: the probability that it is the right one then.
        looks: how many looks a branch has at most; fewer than were allowed where the search was given up.
    """

    plan: ConditionalPlan
    figures: PlanFigures
    expected: float
    success: float
    right: float
    looks: int
    notes: tuple[str, ...] = ()


def plan_noisy(
    problem: SensingProblem, errors: LookErrors, stop: Callable[[], str] = str, most_steps: int = MOST_STEPS
) -> NoisyPlan:
    """The best plan with at most `errors.looks` looks, or with as many as can be searched within limits.

    Possibilities of hypotheses are taken for probabilities, divided by their sum.
    """
    compiled = CompiledSensing(problem)
    notes: list[str] = []
    best = _NoisySearch(compiled, errors, 0, stop, most_steps)
    for looks in range(1, errors.looks + 1):
        search = _NoisySearch(compiled, errors, looks, stop, most_steps)
        try:
            search.worth(problem.start, ())
        except SearchLimitReached as limit:
            notes.append(f"planned with {looks - 1} looks at most: {limit.reason} with one more")
            break
        best = search
    return best.plan(notes)


class _NoisySearch:
    def __init__(
        self, compiled: CompiledSensing, errors: LookErrors, looks: int, stop: Callable[[], str], most_steps: int
    ) -> None:
        self._compiled, self._errors, self._most_looks = compiled, errors, looks
        self._stop, self._most_steps, self._steps = stop, most_steps, 0
        self._looks: list[tuple[str, MacroLook]] = [
            (place, look) for place, found in sorted(compiled.looks.items()) for look in found if len(look.masks) == 2
        ]
        total = sum(each.weight for each in compiled.classes)
        self._prior = [each.weight / total for each in compiled.classes]
        self._worths: dict[tuple[str, _Counts], _NoisyWorth] = {}
        self._end_cost = compiled.problem.costs.anchor * (compiled.problem.task == "identify")
        self._right = 0.0
        self._shows: dict[int, list[float]] = {}

    def worth(self, place: str, counts: _Counts) -> _NoisyWorth:
        """Of the best plan after some looks."""
        key = (place, counts)
        if key not in self._worths:
            self._worths[key] = self._best(place, counts)
        return self._worths[key]

    def plan(self, notes: list[str]) -> NoisyPlan:
        """The plan from the start on."""
        start = self._compiled.problem.start
        worth = self.worth(start, ())
        plan = self._built(start, (), 1.0)
        right = self._right / worth.success if worth.success > 0.0 else 0.0
        return NoisyPlan(plan, figures_of(plan), worth.cost, worth.success, right, self._most_looks, tuple(notes))

    def _best(self, place: str, counts: _Counts) -> _NoisyWorth:
        answer, certainty = self._answer(self._posterior(counts))
        if answer and certainty >= self._errors.sure - _EQUAL:
            return _NoisyWorth(1.0, self._end_cost, -1)
        best = _NoisyWorth(0.0, 0.0, -1)
        if sum(shown + nothing for _, shown, nothing in counts) >= self._most_looks:
            return best
        far = self._compiled.distances(place)
        for number, (target, _) in enumerate(self._looks):
            if target not in far:
                continue
            self._count()
            after_looks = self._outcomes(counts, number)
            if min(probability for _, probability in after_looks) < _EQUAL:
                continue  # its outcome is certain already
            success, cost = 0.0, float(far[target][0] + self._compiled.problem.costs.look)
            for after, probability in after_looks:
                worth = self.worth(target, after)
                success, cost = success + probability * worth.success, cost + probability * worth.cost
            if success > best.success + _EQUAL or (success > best.success - _EQUAL and cost < best.cost - _EQUAL):
                best = _NoisyWorth(success, cost, number)
        return best

    def _built(self, place: str, counts: _Counts, probability: float) -> ConditionalPlan:
        worth = self.worth(place, counts)
        if worth.look < 0:
            return self._ended(counts, probability, is_success=worth.success > 0.0)
        target, macro = self._looks[worth.look]
        actions, costs = [], self._compiled.problem.costs
        while place != target:
            to = self._compiled.first_moves(place, target)[0]
            actions.append(SensingAction("move", (to,), self._compiled.problem.ways[place][to] * costs.move))
            place = to
        look = macro.look
        actions.append(SensingAction("look-at", (look.target,), costs.look))
        found = [
            (share, ObservedFeature(look.feature, look.target, value), after)
            for (after, share), (value, _) in zip(self._outcomes(counts, worth.look), look.outcomes, strict=True)
        ]
        found.sort(key=lambda each: (-each[0], each[1]))
        branches = tuple((seen, self._built(place, after, probability * share)) for share, seen, after in found)
        return ConditionalPlan(tuple(actions), branches, possibility=probability)

    def _ended(self, counts: _Counts, probability: float, *, is_success: bool) -> ConditionalPlan:
        answer, certainty = self._answer(self._posterior(counts))
        if not is_success:
            return ConditionalPlan((), end="fail", possibility=probability)
        self._right += probability * certainty
        problem = self._compiled.problem
        anchor = SensingAction("anchor", (problem.symbol, answer), problem.costs.anchor)
        actions = (anchor,) if problem.task == "identify" else ()
        return ConditionalPlan(actions, end="success", answer=answer, possibility=probability)

    def _outcomes(self, counts: _Counts, number: int) -> list[tuple[_Counts, float]]:
        """The outcomes of a look, something and nothing: the counts then, and the probability."""
        posterior = self._posterior(counts)
        shows = self._likelihoods(number)
        shown = sum(p * each for p, each in zip(posterior, shows, strict=True))
        known = {look: (something, nothing) for look, something, nothing in counts}
        something, nothing = known.get(number, (0, 0))
        after = [{**known, number: (something + 1, nothing)}, {**known, number: (something, nothing + 1)}]
        made = [tuple(sorted((look, *count) for look, count in each.items())) for each in after]
        return [(made[0], shown), (made[1], 1.0 - shown)]

    def _posterior(self, counts: _Counts) -> list[float]:
        weights = list(self._prior)
        for number, something, nothing in counts:
            for at, shows in enumerate(self._likelihoods(number)):
                weights[at] *= shows**something * (1.0 - shows) ** nothing
        total = sum(weights)
        return [each / total for each in weights] if total > 0.0 else list(self._prior)

    def _likelihoods(self, number: int) -> list[float]:
        """How probable it is that a look shows something, for each hypothesis."""
        if number not in self._shows:
            seen = set(bits_of(self._looks[number][1].masks[0]))
            shown, false = 1.0 - self._errors.unseen, self._errors.false
            self._shows[number] = [shown if at in seen else false for at in range(len(self._prior))]
        return self._shows[number]

    def _answer(self, posterior: list[float]) -> tuple[str, float]:
        """The most probable answer, and how probable it is."""
        sums: dict[str, float] = {}
        for each, probability in zip(self._compiled.classes, posterior, strict=True):
            sums[each.answer] = sums.get(each.answer, 0.0) + probability
        return min(sums.items(), key=lambda each: (-each[1], each[0]))

    def _count(self) -> None:
        self._steps += 1
        if self._steps > self._most_steps:
            raise SearchLimitReached(f"gave up after {self._most_steps} steps")
        if self._steps % 64 == 0 and (reason := self._stop()):
            raise SearchLimitReached(reason)
