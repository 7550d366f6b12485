"""Inputs, state and decisions of the rule of `dyknow.agents.capabilities.separation.logic`, as values."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import NamedTuple, TypeAlias

from dyknow.agents.capabilities.separation.neighbours import Neighbour, Traffic3D
from dyknow.navigation.intents.candidates import Allowed, PlannedManoeuvre
from dyknow.navigation.intents.intent import IntentEnding, RightOfWay
from dyknow.navigation.intents.path import FlatMotion, FlatPlace, Performance


class MeetingState(Enum):
    """State of a meeting; see `dyknow.agents.capabilities.separation.logic`."""

    EXPECTED = "the other yields"
    MINE = "ours"
    LEFT = "left to the other"
    NEITHER = "neither can"


class ManoeuvreState(Enum):
    """State of our manoeuvre; see `dyknow.agents.capabilities.separation.logic`."""

    PROPOSED = "proposed"
    FLOWN = "flown"


class Propose(NamedTuple):
    """Propose the manoeuvre to a unit, which agrees if its own way is free of it."""

    unit: str
    manoeuvre: PlannedManoeuvre


class LeaveTo(NamedTuple):
    """Tell a unit that we do not avoid it, and that it is to do so."""

    unit: str
    reason: str


class Fly(NamedTuple):
    """Command a place of the manoeuvre; `is_new`: it is the first one."""

    place: FlatPlace
    is_new: bool
    words: str
    units: tuple[str, ...]


class GoOn(NamedTuple):
    """Fly the own way again."""

    units: tuple[str, ...]


class Neither(NamedTuple):
    """Neither avoids the other; `seconds`: until they meet."""

    unit: str
    seconds: float
    reasons: tuple[str, str]


class Over(NamedTuple):
    """We meet that unit no longer."""

    unit: str


class Waits(NamedTuple):
    """The vehicle stands: those units are in its way, and there is no way round them."""

    units: tuple[str, ...]


Step: TypeAlias = Waits | Propose | LeaveTo | Fly | GoOn | Neither | Over


class Situation(NamedTuple):
    """Traffic and own state of one vehicle at a moment.

    Attributes:
        rank: its own right of way without a manoeuvre; cannot: why it may not be commanded, empty if it may.
        is_blind: whether its position is not known: its present way stands.
        slow_m_s: a lower speed that it may be given for a while; None: none.
        motion, legs, ending, performance: its own; the way is that without others.
        neighbours: by unit; traffic: their tubes from now on.
        allowed: whether it may fly to a place, and stand there.
    """

    now_us: int
    rank: RightOfWay
    cannot: str
    motion: FlatMotion
    legs: tuple[FlatPlace, ...]
    ending: IntentEnding
    performance: Performance
    neighbours: Mapping[str, Neighbour]
    traffic: Traffic3D
    allowed: Allowed
    is_blind: bool = False
    slow_m_s: float | None = None


@dataclass(slots=True)
class PairMeeting:
    """A vehicle that we meet, or met a moment ago.

    Attributes:
        seconds: until the minima are lost, as it was seen last.
        is_left: it has left it to us; refused: why it does not take what we have left to it.
        told_us: when we have left it to that one; is_unseen: that one did not see the meeting then.
    """

    since_us: int
    seconds: float
    state: MeetingState = MeetingState.EXPECTED
    seen_us: int = 0
    is_left: bool = False
    told_us: int | None = None
    is_unseen: bool = False
    refused: str = ""


@dataclass(slots=True)
class Manoeuvre:
    """A manoeuvre that we fly, or have proposed.

    Attributes:
        units: the units that it avoids; awaited: those of them that have not answered.
        at: which place is flown to.
        waits: whether it was reported that there is no way round the vehicles in its way.
        seen_us: when the position is valid at which it was planned.
        is_unseen: whether the vehicle does not show that it flies it: it is taken to fly its own way.
        before: the manoeuvre flown while this one is proposed.
    """

    planned: PlannedManoeuvre
    units: set[str]
    since_us: int
    state: ManoeuvreState = ManoeuvreState.PROPOSED
    awaited: set[str] = field(default_factory=set)
    at: int = 0
    free_since_us: int | None = None
    waits: bool = False
    is_unseen: bool = False
    seen_us: int = 0
    before: "Manoeuvre | None" = None

    @property
    def flown(self) -> "Manoeuvre | None":
        """The one that the vehicle flies: this one, or that before it; None: its own way."""
        flown = self if self.state is ManoeuvreState.FLOWN else self.before
        return None if flown is None or flown.is_unseen else flown

    @property
    def is_commanded(self) -> bool:
        """Whether the vehicle was commanded to fly it, or the one before it."""
        return self.state is ManoeuvreState.FLOWN or self.before is not None

    @property
    def places(self) -> tuple[FlatPlace, ...]:
        """The places that are ahead."""
        return self.planned.places[self.at :]
