"""Recovery plans: found, drawn from the search, and measured; or the reason why there is none."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Final, NamedTuple, Protocol

from dyknow.planning.contingent.conditional_plans import (
    ConditionalPlan,
    ObservedFeature,
    PlanFigures,
    SensingAction,
    figures_of,
)
from dyknow.planning.contingent.greedy_search import GreedySearch
from dyknow.planning.contingent.optimal_search import (
    MOST_STEPS,
    MacroStep,
    OptimalSearch,
    PlanValue,
    SearchLimitReached,
)
from dyknow.planning.contingent.sensing_problems import CompiledSensing, SensingProblem, bits_of

_MOST_NAMED: Final = 4
_MOST_CLASSES_NARROWED: Final = 40


@dataclass(frozen=True, slots=True)
class RecoveryPlan:
    """A plan that finds out which hypothesis holds.

    Attributes:
        expected: cost, by the possibilities of the hypotheses that it covers.
        covered: the part of all possibility under which the plan reaches the goal.
        is_optimal: there is no better one.
        notes: the hypotheses that are not covered, and why the plan may not be the best.
    """

    plan: ConditionalPlan
    figures: PlanFigures
    expected: float
    covered: float
    is_optimal: bool
    steps: int
    notes: tuple[str, ...] = ()


class NoRecoveryPlan(NamedTuple):
    """There is no plan.

    Attributes:
        reason: a sentence.
        indistinguishable: sets of hypotheses, by number, that no plan separates.
    """

    reason: str
    indistinguishable: tuple[tuple[int, ...], ...]


class _Search(Protocol):
    def step(self, belief: int, place: str) -> MacroStep | None: ...


def plan_recovery(
    problem: SensingProblem,
    value: PlanValue = "worst",
    least_possibility: float = 0.0,
    stop: Callable[[], str] = str,
    most_steps: int = MOST_STEPS,
) -> RecoveryPlan | NoRecoveryPlan:
    """The best plan, or within limits a good one, or the reason why there is none.

    Args:
        problem: hypotheses, looks, ways and costs.
        value: `worst` is the cost of the most expensive branch, `expected` the mean over hypotheses, by possibility. Of
            equal plans it is that with fewer leaves, then with fewer actions, then that whose actions come first by name.
        least_possibility: hypotheses that are no more possible than this may stay unresolved.
        stop: called now and then; a text that is not empty ends the search.
        most_steps: looks that are weighed before the search for the best plan is given up.
    """
    compiled = CompiledSensing(problem, least_possibility)
    notes = list[str]()
    if least_possibility > 0.0 and (left := len(problem.hypotheses) - compiled.counted.bit_count()):
        notes.append(f"{left} hypotheses are no more possible than {least_possibility:g}, and are left out")
    if not compiled.classes:
        return NoRecoveryPlan("no hypothesis remains", ())
    if compiled.conflicts:
        return _indistinguishable(compiled)
    search = OptimalSearch(compiled, value, stop, most_steps)
    try:
        if search.worth((1 << len(compiled.classes)) - 1, problem.start) is None:
            return _stuck(compiled, search)
        return _built(compiled, search, search.steps, notes, is_optimal=True)
    except SearchLimitReached as limit:
        notes.append(f"the plan may not be the best: {limit.reason}")
        greedy = GreedySearch(compiled, stop)
        found = _built(compiled, greedy, search.steps, notes, is_optimal=False)
        if found.covered == 1.0:
            return found
        reason = greedy.reason or "some places have no way back"
        return replace(found, notes=(*notes, f"the plan covers {found.covered:.1%} of what is possible: {reason}"))


class _Part:
    """A part of a plan whose branches are being made."""

    def __init__(self, belief: int, place: str, seen: ObservedFeature | None, cost: int) -> None:
        self.belief, self.place, self.seen, self.cost = belief, place, seen, cost
        self.actions: list[SensingAction] = []
        self.parts: list[_Part] | None = None
        self.plan: ConditionalPlan | None = None


def _built(
    compiled: CompiledSensing, search: _Search, steps: int, notes: list[str], *, is_optimal: bool
) -> RecoveryPlan:
    """The plan that a search's steps make."""
    root = _Part((1 << len(compiled.classes)) - 1, compiled.problem.start, None, 0)
    stack, sums = [root], _Sums(compiled)
    while stack:
        part = stack[-1]
        if part.parts is None:
            part.parts = _continued(compiled, search, part)
            stack.extend(part.parts)
            if part.parts:
                continue
        stack.pop()
        if part is not root:
            part.plan = sums.finished(part)
    plan = sums.finished(root)
    return RecoveryPlan(plan, figures_of(plan), sums.expected(), sums.covered(), is_optimal, steps, tuple(notes))


def _continued(compiled: CompiledSensing, search: _Search, part: _Part) -> list[_Part]:
    """The branches after the next look, that with more possibility first; none where the plan ends."""
    problem = compiled.problem
    answers = {compiled.classes[number].answer for number in bits_of(part.belief)}
    if len(answers) == 1:
        if problem.task == "identify":
            part.actions.append(SensingAction("anchor", (problem.symbol, answers.pop()), problem.costs.anchor))
        return []
    step = search.step(part.belief, part.place)
    if step is None:
        return []
    place = part.place
    for each in step.moves:
        part.actions.append(SensingAction("move", (each,), problem.ways[place][each] * problem.costs.move))
        place = each
    look = step.look.look
    part.actions.append(SensingAction("look-at", (look.target,), problem.costs.look))
    part.cost += sum(each.cost for each in part.actions)
    parts = [
        _Part(group, place, ObservedFeature(look.feature, look.target, value), part.cost)
        for (value, _), mask in zip(look.outcomes, step.look.masks, strict=True)
        if (group := part.belief & mask)
    ]
    weight = {each.belief: sum(compiled.classes[number].weight for number in bits_of(each.belief)) for each in parts}
    return sorted(parts, key=lambda each: (-weight[each.belief], each.seen))


class _Sums:
    """Sums over the leaves of a plan."""

    def __init__(self, compiled: CompiledSensing) -> None:
        self._compiled = compiled
        self._cost = self._weight = 0

    def finished(self, part: _Part) -> ConditionalPlan:
        """The plan of a part whose branches are made."""
        members = [self._compiled.classes[number] for number in bits_of(part.belief)]
        possibility = max(each.possibility for each in members)
        if part.parts:
            branches = tuple((each.seen, each.plan) for each in part.parts if each.seen and each.plan)
            return ConditionalPlan(tuple(part.actions), branches, possibility=possibility)
        answers = {each.answer for each in members}
        if len(answers) > 1:
            return ConditionalPlan((), end="fail", possibility=possibility)
        weight = sum(each.weight for each in members)
        self._weight += weight
        self._cost += (part.cost + sum(each.cost for each in part.actions)) * weight
        return ConditionalPlan(tuple(part.actions), end="success", answer=answers.pop(), possibility=possibility)

    def expected(self) -> float:
        return float(Fraction(self._cost, self._weight)) if self._weight else 0.0

    def covered(self) -> float:
        total = sum(each.weight for each in self._compiled.classes)
        return float(Fraction(self._weight, total))


def _indistinguishable(compiled: CompiledSensing) -> NoRecoveryPlan:
    sets = [bits_of(block) for block in compiled.conflicts]
    shown = "; ".join(_named(compiled, each) for each in sets[:_MOST_NAMED])
    more = f"; and {len(sets) - _MOST_NAMED} more sets" if len(sets) > _MOST_NAMED else ""
    away = (
        f"; no way leads to {_some(compiled.unreachable)} from {compiled.problem.start}" if compiled.unreachable else ""
    )
    reason = f"every look shows the same under {shown}{more}{away}"
    return NoRecoveryPlan(reason, tuple(map(tuple, sets)))


def _stuck(compiled: CompiledSensing, search: OptimalSearch) -> NoRecoveryPlan:
    """Every two hypotheses can be separated, but not all on one way: the smallest set for which that is so."""
    belief = (1 << len(compiled.classes)) - 1
    start = compiled.problem.start
    if len(compiled.classes) <= _MOST_CLASSES_NARROWED:
        for number in bits_of(belief):
            if search.worth(belief & ~(1 << number), start) is None:
                belief &= ~(1 << number)
    numbers = [compiled.heads[number] for number in bits_of(belief)]
    reason = f"no one way leads past all looks that separate {_named(compiled, numbers)}: some places have no way back"
    return NoRecoveryPlan(reason, (tuple(numbers),))


def _named(compiled: CompiledSensing, numbers: list[int]) -> str:
    names = [f"hypotheses[{each}] ({compiled.problem.hypotheses[each].answer})" for each in numbers]
    return " and ".join(names[:_MOST_NAMED]) + (f" and {len(names) - _MOST_NAMED} more" * (len(names) > _MOST_NAMED))


def _some(names: list[str]) -> str:
    return ", ".join(names[:_MOST_NAMED]) + (f" and {len(names) - _MOST_NAMED} more" * (len(names) > _MOST_NAMED))
