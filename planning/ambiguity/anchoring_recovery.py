"""Recovery from a failure to anchor, in five steps ("Have another look", section 4): a value, stepped by events.

1. Percepts are matched and the situation is classified; unless a percept is anchored at once, the top plan is halted.
2. Hypotheses are built of the situation.
3. A conditional plan is made.
4. It is executed: moves and looks one by one, each look awaited, then the branch of its outcome.
5. The symbol is anchored and the top plan resumed, or the failure is reported.

A look in a search is a Find: the percepts in view may be ambiguous again, which is a recovery within the recovery, to a
depth of `RecoveryLimits.levels`. After a deadline a new plan is made of the remaining hypotheses, without the move or
look that was late.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum

from dyknow import US_PER_S
from dyknow.anchoring.matching.candidates import PerceptProperties
from dyknow.anchoring.matching.descriptions import AllowedValues, ObjectDescription
from dyknow.anchoring.matching.situations import AnchoringSituation, MatchingOptions, classify
from dyknow.planning.ambiguity.hypotheses import LookingKnowledge, identification_problem, search_problem, shown_by_look
from dyknow.planning.ambiguity.recovery_messages import (
    DelegatorAnswered,
    DelegatorAsked,
    FeatureObserved,
    FindRequested,
    PerceptsSeen,
    RecoveryEffect,
    RecoveryEvent,
    RecoveryFailed,
    RecoveryPlanMade,
    RecoveryPlanned,
    RecoveryPlanWanted,
    SensingActionEnded,
    SensingActionStarted,
    SymbolAnchored,
    TopPlanHalted,
    TopPlanResumed,
)
from dyknow.planning.ambiguity.remaining import RemainingProblem
from dyknow.planning.contingent.conditional_plans import NONE, ConditionalPlan, SensingAction
from dyknow.planning.contingent.recovery_planning import NoRecoveryPlan, plan_recovery
from dyknow.planning.contingent.sensing_problems import MOST_HYPOTHESES


@dataclass(frozen=True, slots=True)
class RecoveryLimits:
    """How long and how often is tried.

    Attributes:
        levels: recoveries within recoveries, the first included.
        replans: plans made again in one recovery.
        at_once: plans over more hypotheses are made elsewhere.
        answer_us: how long an answer of the delegator is waited for; 0: the recovery fails with the question.
    """

    levels: int = 2
    replans: int = 3
    move_us: int = 60 * US_PER_S
    look_us: int = 10 * US_PER_S
    plan_us: int = 30 * US_PER_S
    at_once: int = MOST_HYPOTHESES
    answer_us: int = 0


class RecoveryPhase(Enum):
    """The event that a recovery waits for; the value is its name in messages."""

    FINDING = "percepts"
    PLANNING = "a plan"
    ASKING = "an answer"
    MOVING = "a move"
    LOOKING = "a look"
    ENDED = "nothing"


class AnchoringRecovery:
    """Anchors one symbol, with as many looks as that takes.

    Args:
        symbol: the object's name in the top plan.
        knowledge: places, ways and viewpoints; where the observer is is kept up here.
    """

    def __init__(
        self,
        symbol: str,
        description: ObjectDescription,
        options: MatchingOptions,
        knowledge: LookingKnowledge,
        limits: RecoveryLimits = RecoveryLimits(),
    ) -> None:
        self.symbol, self.description, self.options = symbol, description, options
        self.knowledge, self.limits = knowledge, limits
        self.phase = RecoveryPhase.FINDING
        self.situation: AnchoringSituation | None = None
        self.deadline_us: int | None = None
        self.level = 0
        self._is_halted = False
        self._number = self._replans = 0
        self._percepts: Mapping[str, PerceptProperties] = {}
        self._case = self._left_out = 0
        self._steps: list[SensingAction] = []
        self._rest: ConditionalPlan | None = None
        self._remaining: RemainingProblem | None = None
        self._outer: RemainingProblem | None = None

    def on_event(self, event: RecoveryEvent, now_us: int) -> list[RecoveryEffect]:
        """The effects of an event; an event that answers nothing under way is ignored."""
        match event:
            case PerceptsSeen(percepts) if self.phase is RecoveryPhase.FINDING:
                return self._found(percepts, now_us)
            case PerceptsSeen(percepts) if self.phase is RecoveryPhase.LOOKING and self._is_search:
                return self._found_in_search(percepts, now_us)
            case FeatureObserved(number, value) if number == self._number and self.phase is RecoveryPhase.LOOKING:
                return [] if self._is_search else self._observed(value, now_us)
            case RecoveryPlanned(number, plan, reason) if (
                number == self._number and self.phase is RecoveryPhase.PLANNING
            ):
                return self._with_plan(plan, reason, now_us)
            case DelegatorAnswered(answer) if self.phase is RecoveryPhase.ASKING:
                return self._answered(answer)
            case SensingActionEnded(number, succeeded, reason) if number == self._number:
                if self.phase is RecoveryPhase.MOVING:
                    return self._moved(now_us, "" if succeeded else reason or "the move failed")
        return []

    def on_time(self, now_us: int) -> list[RecoveryEffect]:
        """Replan after a deadline, without the late move or look."""
        if self.deadline_us is None or now_us < self.deadline_us:
            return []
        if self.phase is RecoveryPhase.MOVING:
            return self._moved(now_us, "the move took too long")
        if self.phase is RecoveryPhase.LOOKING and self._remaining is not None:
            self._remaining.drop_look(self._steps[0].arguments[0], self.knowledge.start)
            return self._replanned("nothing was observed in time", now_us)
        if self.phase is RecoveryPhase.PLANNING:
            return self._failed("no plan was made in time")
        if self.phase is RecoveryPhase.ASKING:
            return self._failed("the description is insufficient, and no answer came")
        return []

    def add_viewpoints(self, places: Sequence[str], names: Iterable[str]) -> None:
        """Places from which these properties may be visible, found on the way; each can be reached from every other place."""
        every = (*self.knowledge.ways, *places)
        ways = {each: tuple(to for to in every if to != each and (each in places or to in places)) for each in every}
        ways = {each: (*self.knowledge.ways.get(each, ()), *others) for each, others in ways.items()}
        viewpoints = {**self.knowledge.viewpoints, **dict.fromkeys(names, tuple(places))}
        self.knowledge = replace(self.knowledge, ways=ways, viewpoints=viewpoints)
        if self._remaining is not None:
            self._remaining.add_ways(ways)

    def shown(self, target: str, properties: PerceptProperties) -> str:
        """The outcome of a look at a candidate with these properties, as the branches of plans name it."""
        matches = () if self.situation is None else self.situation.matches
        names = next((each.unobserved for each in matches if each.percept == target), ())
        return shown_by_look(self.description, names, properties, self.options.gates, self.knowledge)

    @property
    def _is_search(self) -> bool:
        return self._remaining is not None and self._remaining.problem.task == "search"

    def _found(self, percepts: Mapping[str, PerceptProperties], now_us: int) -> list[RecoveryEffect]:
        """Steps 1 and 2: a Find or Reacquire has these percepts."""
        self.level += 1
        self._percepts = percepts
        situation = self.situation = classify(self.description, percepts, self.options)
        if situation.recovery is None:
            return self._anchored(situation.anchors[0].percept)
        effects: list[RecoveryEffect] = []
        if not self._is_halted:
            self._is_halted = True
            effects.append(TopPlanHalted(f"case {situation.case}: {situation.reasons()[0]}"))
        if situation.recovery == "description_insufficient" and situation.ask is not None:
            effects.append(DelegatorAsked(self.symbol, situation.ask.sentence(), situation.ask))
            if not (self.limits.answer_us and situation.ask.name):
                return [*effects, *self._failed("the description is insufficient")]
            self.phase, self.deadline_us = RecoveryPhase.ASKING, now_us + self.limits.answer_us
            return effects
        if self.level > self.limits.levels:
            return [*effects, *self._failed(f"recovery within recovery is limited to {self.limits.levels}")]
        self._replans = 0
        here = self.knowledge.start
        self._outer = self._remaining if self._is_search else None
        if situation.recovery == "search":
            self.knowledge = replace(self.knowledge, searched=self.knowledge.searched | {here})
            built = search_problem(self.symbol, self.knowledge)
        else:
            built = identification_problem(
                self.symbol, self.description, situation, self.knowledge, is_cautious=self.options.is_cautious
            )
        self._remaining = RemainingProblem(built.problem)
        return [*effects, *self._planned(situation.case, built.left_out, now_us)]

    def _answered(self, answer: str) -> list[RecoveryEffect]:
        """The description has one more property."""
        ask = None if self.situation is None else self.situation.ask
        if ask is None or answer not in ask.values:
            return []
        seen = self._percepts[ask.values[answer][0]][ask.name]
        if seen is None:
            return []
        properties = {**self.description.properties, ask.name: AllowedValues(((seen.value, 1.0),))}
        self.description = replace(self.description, properties=properties)
        self.level -= 1
        self.phase, self.deadline_us = RecoveryPhase.FINDING, None
        return [FindRequested(self.symbol)]

    def _planned(self, case: int, left_out: int, now_us: int) -> list[RecoveryEffect]:
        """Step 3."""
        if self._remaining is None:
            return []
        self._case, self._left_out = case, left_out
        problem = self._remaining.problem_from(self.knowledge.start)
        if len(problem.hypotheses) > self.limits.at_once:
            self._number += 1
            self.phase, self.deadline_us = RecoveryPhase.PLANNING, now_us + self.limits.plan_us
            return [RecoveryPlanWanted(self._number, problem)]
        found = plan_recovery(problem)
        if isinstance(found, NoRecoveryPlan):
            return self._with_plan(None, found.reason, now_us)
        return self._with_plan(found.plan, "", now_us)

    def _with_plan(self, plan: ConditionalPlan | None, reason: str, now_us: int) -> list[RecoveryEffect]:
        remaining = self._remaining
        if remaining is None:
            return []
        if plan is None and remaining.take_back():
            return self._planned(self._case, self._left_out, now_us)
        if plan is None:
            return self._failed(f"no plan: {reason}")
        made = RecoveryPlanMade(self.level, self._case, len(remaining.problem.hypotheses), self._left_out, plan)
        return [made, *self._continued(plan, now_us)]

    def _continued(self, plan: ConditionalPlan, now_us: int) -> list[RecoveryEffect]:
        """Step 4: the actions of a plan's part, one by one."""
        self._rest, self._steps = plan, list(plan.actions)
        return self._next(now_us)

    def _next(self, now_us: int) -> list[RecoveryEffect]:
        plan = self._rest
        if plan is None:
            return []
        if not self._steps or self._steps[0].name == "anchor":
            return self._ended(plan, now_us)
        action = self._steps[0]
        is_move = action.name == "move"
        self.phase = RecoveryPhase.MOVING if is_move else RecoveryPhase.LOOKING
        limit_us = self.limits.move_us if is_move else self.limits.look_us
        self._number += 1
        self.deadline_us = now_us + limit_us
        fact = f"at[observer] = {action.arguments[0]}" if is_move else f"observed[{action.arguments[0]}]"
        monitor = f"eventually[0, {limit_us // 1000}ms] {fact}"
        return [SensingActionStarted(self._number, action, self.deadline_us, monitor)]

    def _ended(self, plan: ConditionalPlan, now_us: int) -> list[RecoveryEffect]:
        """Step 5: the result of the plan."""
        if plan.end == "fail":
            return self._failed("the plan does not cover what was observed")
        if plan.answer == NONE and self._outer is not None:
            return self._search_continued(self._outer, now_us)
        if plan.answer == NONE and self._is_search:
            return self._failed("not present", is_absent=True)
        if plan.answer == NONE:
            return self._failed("none of the candidates is as described")
        return self._anchored(plan.answer)

    def _search_continued(self, outer: RemainingProblem, now_us: int) -> list[RecoveryEffect]:
        """The object found in a search is not the wanted one: continue at the places that remain."""
        self._remaining, self._outer = outer, None
        self.level -= 1
        outer.drop_answers(self.knowledge.searched)
        return self._planned(1, 0, now_us)

    def _moved(self, now_us: int, failure: str) -> list[RecoveryEffect]:
        to = self._steps[0].arguments[0]
        if failure:
            here = self.knowledge.start
            ways = {
                place: [each for each in others if (place, each) != (here, to)]
                for place, others in self.knowledge.ways.items()
            }
            self.knowledge = replace(self.knowledge, ways=ways)
            if self._remaining is not None:
                self._remaining.drop_way(here, to)
            return self._replanned(failure, now_us)
        self.knowledge = replace(self.knowledge, start=to)
        del self._steps[0]
        return self._next(now_us)

    def _found_in_search(self, percepts: Mapping[str, PerceptProperties], now_us: int) -> list[RecoveryEffect]:
        """A look in a search saw something that may be the object, or did not."""
        self.knowledge = replace(self.knowledge, searched=self.knowledge.searched | {self.knowledge.start})
        situation = classify(self.description, percepts, self.options)
        if situation.case == 1:
            return self._observed("f", now_us)
        return self._found(percepts, now_us)

    def _observed(self, value: str, now_us: int) -> list[RecoveryEffect]:
        plan, remaining = self._rest, self._remaining
        if plan is None or remaining is None:
            return []
        remaining.observe(self._steps[0].arguments[0], self.knowledge.start, value)
        for seen, rest in plan.branches:
            if seen.value == value:
                return self._continued(rest, now_us)
        self.phase, self.deadline_us = RecoveryPhase.FINDING, None
        return [FindRequested(self.symbol)]

    def _replanned(self, reason: str, now_us: int) -> list[RecoveryEffect]:
        self._replans += 1
        if self._replans > self.limits.replans or self.situation is None:
            return self._failed(f"{reason}, and {self.limits.replans} plans were made again")
        return self._planned(self.situation.case, 0, now_us)

    def _anchored(self, percept: str) -> list[RecoveryEffect]:
        self._end()
        anchored = SymbolAnchored(self.symbol, percept)
        return [anchored, TopPlanResumed(self.symbol)] if self._is_halted else [anchored]

    def _failed(self, reason: str, *, is_absent: bool = False) -> list[RecoveryEffect]:
        self._end()
        return [RecoveryFailed(self.symbol, reason, is_absent)]

    def _end(self) -> None:
        self.phase, self.deadline_us, self._rest, self._remaining = RecoveryPhase.ENDED, None, None, None
