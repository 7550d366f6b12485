"""The parts of the wire in a box: sessions, the transports between them, and their two directions."""

from collections.abc import Callable
from typing import Any, NamedTuple

from dyknow.federation.transport import Arrived, WireEvent

_new = tuple.__new__  # makes a NamedTuple in half the time


class SessionLink(NamedTuple):
    """How one direction treats what passes. Times in microseconds, shares 0..1.

    Attributes:
        delay_us: the delay of every message; jitter_us: its greatest addition.
        loss, duplication: shares of messages.
        reordering: share that takes up to `late_us` longer, and is so overtaken.
    """

    delay_us: int = 300
    jitter_us: int = 400
    loss: float = 0.0
    duplication: float = 0.0
    reordering: float = 0.0
    late_us: int = 60_000

    @property
    def is_steady(self) -> bool:
        """Whether everything that is sent arrives, once, in order, and after the same time."""
        return not (self.loss or self.duplication or self.reordering or self.jitter_us)


class Session:
    """The declarations of one process, and its transports.

    Declarations are dictionaries: sets that keep their order. `routes` is where its puts on a key pass, as of
    `routes_version` of all subscriptions.
    """

    def __init__(
        self, number: int, unit: str, zid: str, post: Callable[[WireEvent], None], now_us: Callable[[], int]
    ) -> None:
        self.number, self.unit, self.zid, self.post, self.now_us = number, unit, zid, post, now_us
        self.alive, self.frozen = True, False
        self.reopened = 0
        self.subscriptions: dict[str, None] = {}
        self.queryables: dict[str, None] = {}
        self.tokens: dict[str, None] = {}
        self.watches: dict[str, None] = {}
        self.transports: dict[int, Transport] = {}
        self.outgoing: list[Direction] = []
        self.incoming: list[Direction] = []
        self.routes: dict[str, tuple[Direction, ...]] = {}
        self.routes_version = -1

    def named(self, token: str) -> str:
        """The token as others see it: a session that was opened again has another identity."""
        return token.replace(f"/{self.zid}/", f"/{self.zid}{self.reopened:x}/", 1) if self.reopened else token

    def take(self, kind: Callable[..., WireEvent], last: Any, *first: Any) -> None:
        """An event reached the process, unless that is no more: its fields around the stamp, which is made here."""
        if self.alive:
            self.post(kind(*first, self.now_us(), last))

    def arrive(self, key: str, payload: bytes) -> None:
        """`take` for puts, the most frequent events."""
        if self.alive:
            self.post(_new(Arrived, (key, self.now_us(), payload)))

    def take_over(self, closed: "Session") -> None:
        """Declare what the session before did."""
        self.subscriptions, self.queryables = closed.subscriptions, closed.queryables
        self.tokens, self.watches = closed.tokens, closed.watches
        self.reopened = closed.reopened + 1


class Direction:
    """From one session to another.

    Attributes:
        passes: whether a put gets through now.
        told: tokens of `by` that were reported to `to` as alive.
        last_us: when the last message arrives: messages that are not reordered keep their order.
        silent_since_us: since when the lease runs.
    """

    __slots__ = (
        "by",
        "is_cut",
        "is_deaf",
        "is_up",
        "last_us",
        "link",
        "passes",
        "silent_since_us",
        "to",
        "told",
    )

    def __init__(self, by: Session, to: Session) -> None:
        self.by, self.to, self.link = by, to, SessionLink()
        self.is_up = self.is_cut = self.is_deaf = self.passes = False
        self.told: dict[str, None] = {}
        self.last_us = 0
        self.silent_since_us: int | None = None

    @property
    def is_silent(self) -> bool:
        """Whether not even keep-alives come."""
        return self.is_cut or self.by.frozen or not self.by.alive


class Transport:
    """The connection of two sessions."""

    def __init__(self, one: Session, other: Session) -> None:
        self.one, self.other = one, other
        self.there, self.back = Direction(one, other), Direction(other, one)
        self.up = False
        one.transports[other.number] = other.transports[one.number] = self
        for direction in (self.there, self.back):
            direction.by.outgoing.append(direction)
            direction.to.incoming.append(direction)

    def direction(self, by: Session) -> Direction:
        return self.there if by is self.one else self.back

    @property
    def is_clear(self) -> bool:
        """Whether nothing keeps it from coming up."""
        return not (self.there.is_silent or self.back.is_silent)

    def settle(self) -> None:
        """Recompute what may pass, after a change."""
        self.one.routes.clear()
        self.other.routes.clear()
        for direction in (self.there, self.back):
            direction.is_up = self.up
            direction.passes = self.up and not direction.is_cut and not direction.is_deaf

    def part(self) -> None:
        """One of the sessions is no more: both forget the transport."""
        if self.one.transports.pop(self.other.number, None) is None:
            return
        del self.other.transports[self.one.number]
        self.one.routes.clear()
        self.other.routes.clear()
        for direction in (self.there, self.back):
            direction.by.outgoing.remove(direction)
            direction.to.incoming.remove(direction)
