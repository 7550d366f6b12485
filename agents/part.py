"""A part of a platform: the acts and events that it takes, and when it is due. A new capability is a new part."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import ClassVar, Final, NamedTuple, Protocol, TypeAlias

from dyknow.agents.actions import Offer
from dyknow.federation.members.directory import DirectoryEvent
from dyknow.federation.messages.acts import Act
from dyknow.federation.messages.contents import Content
from dyknow.federation.messages.descriptions import ConditionEntry, LabelEntry
from dyknow.reasoning import AlarmEvent


class ClockCompared(NamedTuple):
    """The clock of `unit`, compared with ours, can be relied on more, or less, than before."""

    unit: str


PeerChange: TypeAlias = DirectoryEvent | ClockCompared
"""A change of another platform: it, a service or a label came or went, or its clock was compared."""


class Timed(Protocol):
    """Something with work at a time: a part, or a component of it with a deadline of its own."""

    @property
    def deadline_us(self) -> int | None:
        """When it has work next, or a little earlier (node clock); 0 for at once."""


class Part:
    """One agent, proxy or store of a platform. Every method has a default that does nothing; times are the node clock.

    A handler of an event takes (event, node clock) and returns what may follow from it: None when anything may (the
    default), an empty tuple when nothing does but the effects emitted, a tuple of parts that may be due at another time when that
    and samples are all, or `NOT_MINE` when the event is for another part. The last three are for events that come by the
    thousand. `on_time` returns the same. The part itself goes without saying there, and so does what follows in both from
    acts that are sent, samples that wait, peers and alarms.

    Attributes:
        offers: the actions it handles, by service.
        answers: contents it only sends, never takes.
        takes: by type of event, the method that takes it; a type of key stands for questions on such keys.
        arrivals: by the first chunk of a key, the method that takes what arrives there.
        vital: whether vehicles are not kept apart, or the platform is deaf, without it: never left out for long.
        heeds_samples: whether samples of streams here may make it due, which handlers that cause some do not name.
        keeps_acts: whether acts that any part sends make it due: it waits for their answers.
    """

    offers: ClassVar[tuple[Offer, ...]] = ()
    answers: ClassVar[tuple[type[Content], ...]] = ()
    takes: ClassVar[Mapping[type, str]] = {}
    arrivals: ClassVar[Mapping[str, str]] = {}
    vital: ClassVar[bool] = False
    heeds_samples: ClassVar[bool] = False
    keeps_acts: ClassVar[bool] = False

    def __init__(self, _ports: object, _parts: object) -> None:
        """Build it of an `dyknow.agents.ports.Ports` and the other parts, an `dyknow.agents.ports.PartRegistry`."""

    @property
    def deadline_us(self) -> int | None:
        """When `on_time` has work next, or a little earlier; 0 for at once."""
        return None

    @property
    def is_owing(self) -> bool:
        """Whether something waits here to become an effect."""
        return False

    def labels(self) -> Iterable[LabelEntry]:
        """The semantic labels it offers to other platforms."""
        return ()

    def conditions(self) -> Iterable[ConditionEntry]:
        """The conditions of its state that users should know; `ls` shows them. After a change call the port `offer`."""
        return ()

    def start(self, now_us: int) -> None:
        """The platform comes into the federation."""

    def on_time(self, now_us: int) -> "Followed":  # noqa: ARG002
        """Do the work that is due; called at `deadline_us` or a little later."""
        return None

    def flush(self) -> None:
        """A step that may have changed anything ends: emit what was gathered."""

    def on_peer(self, change: PeerChange, now_us: int) -> None:
        """Take a change of another platform: it, a service, a label, or the comparison of its clock."""

    def on_alarm(self, event: AlarmEvent, now_us: int) -> None:
        """An alarm opened or closed here."""

    def on_cancel(self, act: Act, now_us: int) -> bool:  # noqa: ARG002
        """End what was asked for in the conversation of `act`; whether this part knew of it.

        Raises:
            Refused: it is another's, or must be cancelled elsewhere.
        """
        return False

    def on_lost(self, act: Act, now_us: int) -> bool:  # noqa: ARG002
        """The platform that opened a conversation with `act` is gone; whether this part knew of it."""
        return False


class Within(NamedTuple):
    """A component of a part, whose deadline is computed again instead of that of the whole part."""

    part: Part
    timed: Timed


class _NotMine(tuple[Part, ...]):
    __slots__ = ()


NOT_MINE: Final[Sequence[Part]] = _NotMine()
Followed: TypeAlias = Sequence[Part | Within] | None
Handler: TypeAlias = Callable[..., Followed]


def overrides(part: Part, name: str) -> bool:
    """Whether the class of `part` has its own `name`."""
    return getattr(type(part), name) is not getattr(Part, name)
