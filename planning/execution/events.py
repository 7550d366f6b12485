"""Events that a mission takes, and effects that it returns. Times are federation time in microseconds."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal, NamedTuple, TypeAlias

from dyknow.model.sample import Value
from dyknow.planning.domains.model import Declarations
from dyknow.planning.search.plans import MissionPlan, PlannedAction

HoldWay: TypeAlias = Literal["brake", "loiter", "land"]
Outcome: TypeAlias = Literal["reached", "partly reached", "gave up", "aborted"]


class StateSampled(NamedTuple):
    """One state of fluents: values by label, all of one valid time; `NO_VALUE` where there is none."""

    valid_us: int
    values: Mapping[str, Value]


class ActionEnded(NamedTuple):
    """The action of `StartAction` has ended, or could not be begun; `seen` are the labels observed at its end."""

    step: int
    succeeded: bool
    reason: str = ""
    seen: Mapping[str, Value] = MappingProxyType({})


class NotLocated(NamedTuple):
    """The search of `Locate` was in vain."""

    reason: str


class PilotTookOver(NamedTuple):
    """The pilot commands the vehicle by hand."""

    unit: str
    reason: str = ""


class PilotGaveBack(NamedTuple):
    unit: str
    reason: str = ""


class UnitLost(NamedTuple):
    """A unit that no plan can count on."""

    unit: str
    reason: str = ""


class UnitBack(NamedTuple):
    unit: str
    reason: str = ""


class MissionSuspended(NamedTuple):
    """A pause; `keeps_plan`: the plan continues after it at the actions that it has interrupted, if they can begin then."""

    reason: str = ""
    keeps_plan: bool = False


class MissionResumed(NamedTuple):
    reason: str = ""


class MissionAborted(NamedTuple):
    reason: str = ""


class PlanSearched(NamedTuple):
    """The answer to `SearchPlan`; without a plan `is_certain` tells whether there is none, or the search gave up."""

    search: int
    plan: MissionPlan | None
    reason: str = ""
    is_certain: bool = True


class QuestionAnswered(NamedTuple):
    question: int
    answer: str
    by: str = ""


MissionEvent: TypeAlias = (
    StateSampled
    | ActionEnded
    | NotLocated
    | PilotTookOver
    | PilotGaveBack
    | UnitLost
    | UnitBack
    | MissionSuspended
    | MissionResumed
    | MissionAborted
    | PlanSearched
    | QuestionAnswered
)


class StartAction(NamedTuple):
    """Have the unit do it; the answer is `ActionEnded` with this step.

    `located` are labels that are to be looked at when its commands are done, `values` all that is held for true now.
    """

    step: int
    unit: str
    action: PlannedAction
    located: tuple[str, ...] = ()
    values: Mapping[str, Value] = MappingProxyType({})


class AbortAction(NamedTuple):
    """Have the unit stop it; no answer is expected."""

    step: int
    unit: str
    reason: str


class HoldUnit(NamedTuple):
    """Have the unit brake, loiter or land; never sent to one that its pilot flies."""

    unit: str
    how: HoldWay
    reason: str


class SearchPlan(NamedTuple):
    """Search for a plan by these units, all of them if None, for at most `limit_us`; the answer is `PlanSearched`."""

    search: int
    domain: Declarations
    problem: Declarations
    units: tuple[str, ...] | None
    limit_us: int
    why: str


class CancelSearch(NamedTuple):
    search: int


class Locate(NamedTuple):
    """Find objects by sight: states with these labels, of `since_us` or later, are awaited, or `NotLocated`.

    `values` are those of all other labels, as far as they are known.
    """

    objects: tuple[str, ...]
    labels: tuple[str, ...]
    since_us: int
    reason: str
    values: Mapping[str, Value]


class AskHuman(NamedTuple):
    """A question with the answers that there are; without one by `until_us` the default is taken."""

    question: int
    text: str
    options: tuple[str, ...]
    default: str
    until_us: int


class MissionNote(NamedTuple):
    """One line for users and for the log; `step` is the action it is about, if it is about one."""

    kind: str
    text: str
    step: int | None = None


class MissionEnded(NamedTuple):
    """The last effect."""

    outcome: Outcome
    reason: str
    unreached: tuple[str, ...] = ()


MissionEffect: TypeAlias = (
    StartAction | AbortAction | HoldUnit | SearchPlan | CancelSearch | Locate | AskHuman | MissionNote | MissionEnded
)
