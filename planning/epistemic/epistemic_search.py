"""The best conditional plan over e-states in the worst case: memoised search under a limit of cost that is raised step by step.

Costs are above 0, so that a branch ends when its limit is used up, also where moves lead back.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, TypeAlias

from dyknow.planning.contingent.conditional_plans import ConditionalPlan, SensingAction
from dyknow.planning.contingent.optimal_search import SearchLimitReached
from dyknow.planning.epistemic.actions import ActionOutcome, EpistemicProblem, EState, outcomes, reaches

MOST_STEPS: Final = 200_000
MOST_COST: Final = 200
_Worth: TypeAlias = tuple[int, int, int]
"""Cost of the worst branch, leaves, actions."""


@dataclass(frozen=True, slots=True)
class EpistemicPlan:
    """The best plan, or the reason why there is none."""

    plan: ConditionalPlan | None
    reason: str = ""
    steps: int = 0


def plan_epistemic(
    problem: EpistemicProblem, stop: Callable[[], str] = str, most_steps: int = MOST_STEPS, most_cost: int = MOST_COST
) -> EpistemicPlan:
    """The plan whose worst branch is cheapest; of equal ones that with fewer leaves, fewer actions, and first by names."""
    search = _EpistemicSearch(problem, stop, most_steps)
    start: EState = tuple(enumerate(problem.worlds))
    try:
        limit = 0
        while limit <= most_cost:
            if search.worth(start, limit) is not None:
                return EpistemicPlan(search.plan(start), steps=search.steps)
            if search.beyond is None:
                return EpistemicPlan(None, "no actions lead to what is to be known", search.steps)
            limit, search.beyond = limit + 1, None
    except SearchLimitReached as reached:
        return EpistemicPlan(None, reached.reason, search.steps)
    return EpistemicPlan(None, f"no plan costs {most_cost} or less in the worst case", search.steps)


class _EpistemicSearch:
    """Worths of e-states; `beyond` is set where a branch was cut by the limit."""

    def __init__(self, problem: EpistemicProblem, stop: Callable[[], str], most_steps: int) -> None:
        self._problem, self._stop, self._most = problem, stop, most_steps
        self.steps = 0
        self.beyond: int | None = None
        self._known: dict[EState, _Worth] = {}
        self._above: dict[EState, int] = {}
        self._outcomes: dict[EState, list[ActionOutcome]] = {}

    def worth(self, state: EState, limit: int) -> _Worth | None:
        """Of the best plan, if its cost is within the limit."""
        if (known := self._known.get(state)) is not None:
            if known[0] > limit:
                self.beyond = limit
            return known if known[0] <= limit else None
        if reaches(self._problem.goal, state) is not None:
            self._known[state] = 0, 1, 0
            return self._known[state]
        if limit <= self._above.get(state, 0):
            self.beyond = limit
            return None
        best: _Worth | None = None
        for outcome in self._continued(state):
            worth = self._worth_of(outcome, limit if best is None else best[0])
            if worth is not None and (best is None or worth < best):
                best = worth
        if best is None:
            self._above[state] = limit
        else:
            self._known[state] = best
        return best

    def plan(self, state: EState) -> ConditionalPlan:
        """The plan of an e-state whose worth is known."""
        actions: list[SensingAction] = []
        possibility = max(self._problem.possibilities[number] for number, _ in state)
        while True:
            best = self._known[state]
            binding = reaches(self._problem.goal, state)
            if binding is not None:
                answer = next(iter(binding.values()), "")
                return ConditionalPlan(tuple(actions), end="success", answer=answer, possibility=possibility)
            chosen = next(each for each in self._continued(state) if self._worth_of(each, best[0]) == best)
            actions.append(chosen.action)
            if len(chosen.branches) > 1:
                break
            state = chosen.branches[0][1]
        weights = {part: sum(self._problem.possibilities[number] for number, _ in part) for _, part in chosen.branches}
        ordered = sorted(chosen.branches, key=lambda each: (-weights[each[1]], str(each[0])))
        branches = tuple((seen, self.plan(part)) for seen, part in ordered if seen is not None)
        return ConditionalPlan(tuple(actions), branches, possibility=possibility)

    def _worth_of(self, outcome: ActionOutcome, limit: int) -> _Worth | None:
        self.steps += 1
        if self.steps > self._most:
            raise SearchLimitReached(f"gave up after {self._most} steps")
        if self.steps % 256 == 0 and (reason := self._stop()):
            raise SearchLimitReached(reason)
        cost = outcome.action.cost
        if cost > limit:
            self.beyond = limit
            return None
        worst, leaves, actions = 0, 0, 1
        for _, part in outcome.branches:
            worth = self.worth(part, limit - cost)
            if worth is None:
                return None
            worst, leaves, actions = max(worst, worth[0]), leaves + worth[1], actions + worth[2]
        return cost + worst, leaves, actions

    def _continued(self, state: EState) -> list[ActionOutcome]:
        """The possible actions, by name, without those that change nothing."""
        if state not in self._outcomes:
            found = [each for each in outcomes(self._problem.actions, state) if each.branches[0][1] != state]
            self._outcomes[state] = sorted(found, key=lambda each: str(each.action))
        return self._outcomes[state]
