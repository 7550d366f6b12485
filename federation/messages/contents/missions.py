"""Missions: goals and plans that are delegated, the vehicles that take part in them, and questions to users (thesis 7.2)."""

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from dyknow.federation.messages.contents import parts
from dyknow.federation.messages.descriptions import Cost, Count

LONGEST_DOMAIN = 24_000
"""Characters of a domain, and of a problem, in an act."""
MAX_ACTIONS = 256
MAX_COMMANDS = 16
MAX_UNITS = 32

DomainText = Annotated[str, Field(max_length=LONGEST_DOMAIN), parts.TO_PARSE]
Actions = Annotated[tuple[parts.Line, ...], Field(max_length=MAX_ACTIONS)]
Chain = Annotated[tuple[parts.Unit, ...], Field(max_length=4)]
_UnitNames = Annotated[dict[parts.Word, parts.Unit], Field(max_length=MAX_UNITS)]


class FlyMission(parts.Content):
    """Reach the goals of a problem with the operators of a domain, in one of four degrees.

    Only the goals; with constraints, which are statements of the domain's syntax; with some actions of the plan, in their
    order, between which others may stand; with all of them (`is_whole`).

    Attributes:
        mission: its name, by which vehicles are permitted to take part.
        platforms: by unit of the problem, the platform that has that vehicle.
        chain: the delegators, the first one first.
    """

    lasting: ClassVar[bool] = True
    mission: parts.Conversation
    domain: DomainText
    problem: DomainText
    constraints: DomainText = ""
    actions: Actions = ()
    is_whole: bool = False
    platforms: _UnitNames = Field(default_factory=dict)
    chain: Chain = ()
    timeout_s: parts.Timeout = 10.0


class CallForMission(FlyMission):
    """Propose to lead this mission: with `cfp`; nothing is flown before the proposal is taken."""


class MissionProposal(parts.Content):
    """A plan in its completed form, its cost, and how long it takes: with `propose`."""

    cost: Cost
    duration_s: parts.Seconds
    actions: Actions
    unreached: Annotated[tuple[parts.Word, ...], Field(max_length=64)] = ()


class TakeMission(parts.Content):
    """The proposed plan of this conversation is consented to: fly it. With `accept-proposal`."""


class LeaveMission(parts.Content):
    """The proposed plan of this conversation is not wanted, and why: with `reject-proposal`."""

    because: parts.Prose


class PermitMission(parts.Content):
    """Let these platforms command your vehicle in a mission, until it ends; only a command centre may permit it.

    The first of `leaders` leads it, each next one when all before it are gone. `vehicles`: the platforms whose vehicles are
    permitted, those to which a leader may show this act as evidence; empty: only the one that it was sent to.
    """

    mission: parts.Conversation
    leaders: Annotated[tuple[parts.Unit, ...], Field(min_length=1, max_length=8)]
    vehicles: Annotated[tuple[parts.Unit, ...], Field(max_length=MAX_UNITS)] = ()


class JoinMission(parts.Content):
    """Have your vehicle take part in a mission that the sender leads, until this is cancelled."""

    lasting: ClassVar[bool] = True
    mission: parts.Conversation
    chain: Chain = ()


class KeepMission(parts.Content):
    """The rest of a mission that your vehicle takes part in: lead it, should the sender be gone.

    Attributes:
        delegator: whose mission it is, as the task `conversation`.
        problem: with the state that the sender holds for true.
        domain: empty: as before.
    """

    mission: parts.Conversation
    delegator: parts.Unit
    conversation: parts.Conversation
    problem: DomainText
    domain: DomainText = ""
    platforms: _UnitNames
    chain: Chain = ()
    timeout_s: parts.Timeout = 10.0


class CommandEntry(parts.ContentPart):
    """One command to a vehicle: degrees, metres above home, seconds."""

    name: parts.Word
    numbers: Annotated[tuple[parts.Metres, ...], Field(max_length=8)] = ()


class PerformCommands(parts.Content):
    """Do these one after another, for a mission that your vehicle takes part in; `action` says what for.

    They overtake those of an earlier step. `Performed` tells what became of them.
    """

    mission: parts.Conversation
    step: Count
    action: parts.Line
    commands: Annotated[tuple[CommandEntry, ...], Field(max_length=MAX_COMMANDS)]


class Performed(parts.Content):
    """The commands of a step are done, or why not."""

    step: Count
    failure: parts.Line = ""


class VehicleNews(parts.Content):
    """Why the vehicle takes no commands, as its pilot has it; empty: it takes them."""

    waits: parts.Line


class MissionQuery(parts.Content):
    """Which missions do you lead, and how far are they?"""


class MissionQuestion(parts.ContentPart):
    """A question of a mission to users: one of `options`; without an answer until then it takes `default`."""

    number: Count
    text: parts.Prose
    options: Annotated[tuple[parts.Line, ...], Field(max_length=16)]
    default: parts.Line
    until_us: parts.Instant


class MissionEntry(parts.ContentPart):
    """One mission: its phase, its actions with theirs, what has been reported last."""

    mission: parts.Conversation
    conversation: parts.Conversation
    phase: parts.Line
    since_us: parts.Instant
    why: parts.Line = ""
    actions: Actions = ()
    replans: Count = 0
    chain: Chain = ()
    question: MissionQuestion | None = None


class MissionList(parts.Content):
    missions: Annotated[tuple[MissionEntry, ...], Field(max_length=16)]


class AnswerQuestion(parts.Content):
    """The answer to a question of a mission: one of its options."""

    mission: parts.Conversation
    number: Count
    answer: parts.Line


class ControlMission(parts.Content):
    """Suspend a mission, or have one continue that waits; `task-over` ends one, at each platform."""

    mission: parts.Conversation
    how: Literal["suspend", "resume"]
