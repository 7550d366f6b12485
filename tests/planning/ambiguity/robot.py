"""A robot in a room with gas bottles, as in "Have another look", section 5: simulated, without chance but by its seed.

The room has four places, a corridor and a home where the robot localises itself. A bottle is visible from some places, its mark
from one. With every move the position of the robot, and so of what it sees, becomes less certain.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from random import Random

from dyknow.anchoring.matching.candidates import ObservedProperty, PerceptProperties
from dyknow.anchoring.matching.descriptions import AllowedPlace, AllowedValues, ObjectDescription
from dyknow.anchoring.matching.situations import MatchingOptions
from dyknow.planning.ambiguity.anchoring_recovery import AnchoringRecovery, RecoveryLimits, RecoveryPhase
from dyknow.planning.ambiguity.hypotheses import LookingKnowledge
from dyknow.planning.ambiguity.recovery_messages import (
    DelegatorAsked,
    FeatureObserved,
    FindRequested,
    PerceptsSeen,
    RecoveryEffect,
    RecoveryFailed,
    RecoveryPlanMade,
    SensingActionEnded,
    SensingActionStarted,
    SymbolAnchored,
    TopPlanHalted,
    TopPlanResumed,
)
from dyknow.planning.contingent.conditional_plans import figures_of, print_plan

ROOM = ("r1_1", "r1_2", "r1_3", "r1_4")
WAYS = {place: [to for to in ROOM if to != place] for place in ROOM}
MARK_FROM = {"mark": ROOM[1:], "position_m": ()}
DRIFT_M = 0.3


@dataclass
class Bottle:
    """A gas bottle; `visible_from` and `mark_from` are places."""

    name: str
    at_m: tuple[float, float]
    colour: str = "red"
    mark_from: str = ""
    visible_from: tuple[str, ...] = ROOM


@dataclass
class Robot:
    """What it did is in `log`; plans of recoveries are in `plans`."""

    bottles: list[Bottle]
    knowledge: LookingKnowledge = field(default_factory=lambda: LookingKnowledge(WAYS, "r1_1", MARK_FROM))
    lost_looks: int = 0
    blocked: frozenset[tuple[str, str]] = frozenset()
    seed: int = 0
    place: str = "r1_1"
    sd_m: float = 0.0
    now_us: int = 0
    log: list[str] = field(default_factory=list)
    plans: list[RecoveryPlanMade] = field(default_factory=list)
    anchors: dict[str, str] = field(default_factory=dict)
    monitors: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.random = Random(self.seed)

    def move(self, to: str) -> None:
        self.place, self.sd_m = to, 0.0 if to == "home" else self.sd_m + DRIFT_M
        self.now_us += 5_000_000

    def percepts(self) -> Mapping[str, PerceptProperties]:
        """What is seen from here, as the vision system says it."""
        return {
            bottle.name: {
                "kind": ObservedProperty("gasbottle"),
                "colour": ObservedProperty(bottle.colour, 0.95),
                "mark": ObservedProperty(True, 0.9) if bottle.mark_from == self.place else None,
                "position_m": ObservedProperty(self.measured(bottle), sd_m=self.sd_m),
            }
            for bottle in self.bottles
            if self.place in bottle.visible_from
        }

    def measured(self, bottle: Bottle) -> tuple[float, float]:
        off = [self.random.uniform(-0.5, 0.5) * self.sd_m for _ in range(2)]
        return bottle.at_m[0] + off[0], bottle.at_m[1] + off[1]

    def anchor(self, symbol: str, description: ObjectDescription, options: MatchingOptions) -> bool:
        """Find or Reacquire a symbol, and recover if need be; whether it is anchored. Then the top plan continues."""
        self.recovery = AnchoringRecovery(symbol, description, options, self.knowledge, RecoveryLimits())
        waiting: list[RecoveryEffect] = self.recovery.on_event(PerceptsSeen(self.percepts()), self.now_us)
        while waiting or self.recovery.phase is not RecoveryPhase.ENDED:
            if waiting:
                waiting += self.performed(waiting.pop(0), symbol, description)
            else:
                assert self.recovery.deadline_us is not None
                self.now_us = self.recovery.deadline_us
                self.log.append("timeout")
                waiting = self.recovery.on_time(self.now_us)
        return symbol in self.anchors

    def performed(self, effect: RecoveryEffect, symbol: str, description: ObjectDescription) -> list[RecoveryEffect]:
        match effect:
            case TopPlanHalted():
                self.log.append("halted")
            case TopPlanResumed():
                self.log.append("resumed")
            case RecoveryPlanMade():
                self.plans.append(effect)
                self.log.append(
                    f"case {effect.case} plan {figures_of(effect.plan).depth} {figures_of(effect.plan).leaves}"
                )
            case SymbolAnchored(name, percept):
                self.anchors[name] = percept
                self.log.append(f"anchored {percept}")
            case RecoveryFailed(_, reason, is_absent):
                self.anchors.pop(symbol, None)
                self.log.append(f"failed{' absent' if is_absent else ''}: {reason}")
            case DelegatorAsked(_, question, _):
                self.log.append(question)
            case FindRequested():
                return self.recovery.on_event(PerceptsSeen(self.percepts()), self.now_us)
            case SensingActionStarted(number, action, _, monitor):
                self.monitors.append(monitor)
                self.log.append(str(action))
                return self.acted(number, action.name, action.arguments[0], description)
        return []

    def acted(self, number: int, name: str, target: str, description: ObjectDescription) -> list[RecoveryEffect]:
        if name == "move":
            if (self.place, target) in self.blocked:
                return self.recovery.on_event(SensingActionEnded(number, False, "the way is blocked"), self.now_us)
            self.move(target)
            return self.recovery.on_event(SensingActionEnded(number, True), self.now_us)
        if self.lost_looks:
            self.lost_looks -= 1
            return []
        self.now_us += 1_000_000
        problem = self.recovery._remaining
        assert problem is not None
        if problem.problem.task == "search":
            return self.recovery.on_event(PerceptsSeen(self.percepts()), self.now_us)
        return self.recovery.on_event(FeatureObserved(number, self.observed(target, description)), self.now_us)

    def observed(self, target: str, description: ObjectDescription) -> str:
        bottle = next(each for each in self.bottles if each.name == target)
        position = description.properties.get("position_m")
        if isinstance(position, AllowedPlace) and self.sd_m < position.within_m:
            return "as-described" if position.degree(self.measured(bottle)) > 0.0 else "other"
        return "t" if bottle.mark_from == self.place else "f"

    def printed(self) -> list[str]:
        return [print_plan(each.plan) for each in self.plans]


def described(*, is_definite: bool = True, **allowed: object) -> ObjectDescription:
    """A gas bottle with these properties."""
    properties = {
        name: value if isinstance(value, AllowedPlace) else AllowedValues(((value, 1.0),))  # type: ignore[arg-type]
        for name, value in {"kind": "gasbottle", **allowed}.items()
    }
    return ObjectDescription(properties, is_definite)
