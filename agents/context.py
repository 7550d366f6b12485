"""What the agents of one platform share."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Protocol

from agents.alarm_book import AlarmBook
from agents.gateway import Gateway
from agents.pilot import Fix, Pilot
from agents.tasks import TaskBook
from federation.acts import Act, Performative
from federation.clock import FederationClock
from federation.contents import Content
from federation.directory import Directory
from navigation.vehicle import Command

OnReply = Callable[[Act, Content | None, int], None]
OnSilence = Callable[[str, int], None]


class Desk(Protocol):
    """The Interface Agent as the other agents of the platform use it: nothing leaves but through it."""

    def delegate(
        self,
        unit: str,
        content: Content,
        now_us: int,
        *,
        performative: Performative = Performative.REQUEST,
        on_reply: OnReply | None = None,
        on_silence: OnSilence | None = None,
        reply_within_us: int = 2_000_000,
    ) -> str:
        """Say something to the Interface Agent of `unit`; returns the conversation."""

    def tell(self, unit: str, content: Content, now_us: int, *, conversation: str | None = None) -> None:
        """Inform the Interface Agent of `unit`; no answer is expected."""

    def answer(self, act: Act, performative: Performative, content: Content | None, now_us: int) -> None:
        """Answer an act that came in."""

    def end(self, conversation: str, unit: str, reason: str, now_us: int) -> None:
        """Tell `unit` that what it asked for in `conversation` has ended here, if it still stands."""

    def cancel(self, unit: str, conversation: str, now_us: int) -> None:
        """End what was asked of `unit` in `conversation`."""


@dataclass(slots=True)
class Context:
    """One platform's parts, as its agents reach them.

    `fix_of` gives the newest position of a unit, this one included, as the monitors see it.
    """

    unit: str
    boot: int
    clock: FederationClock
    directory: Directory
    gateway: Gateway
    desk: Desk
    tasks: TaskBook
    alarms: AlarmBook
    pilot: Pilot
    fix_of: Callable[[str], Fix | None]
    fly: Callable[[Iterable[Command]], None]
    avoidance: bool = True
