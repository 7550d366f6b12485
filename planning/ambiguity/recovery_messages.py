"""Events that step a recovery, and its effects."""

from collections.abc import Mapping
from typing import NamedTuple, TypeAlias

from dyknow.anchoring.matching.candidates import PerceptProperties
from dyknow.anchoring.matching.discrimination import Discriminating
from dyknow.planning.contingent.conditional_plans import ConditionalPlan, SensingAction
from dyknow.planning.contingent.sensing_problems import SensingProblem


class PerceptsSeen(NamedTuple):
    """Event: all percepts that are seen from where the observer is, the answer to `FindRequested` or to a look in a search."""

    percepts: Mapping[str, PerceptProperties]


class FeatureObserved(NamedTuple):
    """Event: the outcome of look `number`, one of the values of the plan's branches."""

    number: int
    value: str


class SensingActionEnded(NamedTuple):
    """Event: move `number` has ended; a failed one makes the way impassable for this recovery."""

    number: int
    succeeded: bool
    reason: str = ""


class RecoveryPlanned(NamedTuple):
    """Event: the answer to `RecoveryPlanWanted` of that number; without a plan `reason` says why there is none."""

    number: int
    plan: ConditionalPlan | None
    reason: str = ""


class DelegatorAnswered(NamedTuple):
    """Event: the answer to `DelegatorAsked`, one of the values that it names."""

    value: str


RecoveryEvent: TypeAlias = PerceptsSeen | FeatureObserved | SensingActionEnded | RecoveryPlanned | DelegatorAnswered


class TopPlanHalted(NamedTuple):
    """Effect: the plan that needs the symbol waits, at the action that does."""

    reason: str


class RecoveryPlanWanted(NamedTuple):
    """Effect: make a plan elsewhere, which may take long; answer with `RecoveryPlanned`."""

    number: int
    problem: SensingProblem


class RecoveryPlanMade(NamedTuple):
    """Effect, for reports: the situation was built and a plan found.

    Attributes:
        level: 1, or more in a recovery within a recovery.
        left_out: hypotheses that the plan leaves out.
    """

    level: int
    case: int
    hypotheses: int
    left_out: int
    plan: ConditionalPlan


class SensingActionStarted(NamedTuple):
    """Effect: perform an action.

    Attributes:
        number: to answer with; numbers grow.
        until_us: when it counts as failed.
        monitor: formula of its goal, with its deadline (thesis 7.7).
    """

    number: int
    action: SensingAction
    until_us: int
    monitor: str


class FindRequested(NamedTuple):
    """Effect: answer with `PerceptsSeen`, of where the observer is."""

    symbol: str


class SymbolAnchored(NamedTuple):
    """Effect: a symbol denotes a percept from now on; temporary anchors of the other candidates end."""

    symbol: str
    percept: str


class TopPlanResumed(NamedTuple):
    """Effect: the plan continues at the action that was interrupted, if its preconditions still hold; else it is replanned."""

    symbol: str


class RecoveryFailed(NamedTuple):
    """Effect: the plan that needs the symbol has to do without it; `is_absent` where the object was found to be nowhere."""

    symbol: str
    reason: str
    is_absent: bool = False


class DelegatorAsked(NamedTuple):
    """Effect: the description is insufficient; `ask` names the property that would tell the candidates apart."""

    symbol: str
    question: str
    ask: Discriminating


RecoveryEffect: TypeAlias = (
    TopPlanHalted
    | RecoveryPlanWanted
    | RecoveryPlanMade
    | SensingActionStarted
    | FindRequested
    | SymbolAnchored
    | TopPlanResumed
    | RecoveryFailed
    | DelegatorAsked
)
