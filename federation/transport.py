"""Effects from a node to the wire, and events from the wire to a node. Pure data: Zenoh and the fake wire both speak
it.

Keys are relative to the federation's namespace (`dyknow.federation.keys` builds and parses them). `at_us` is the
node clock (UTC at start + monotonic), stamped where the bytes arrived, before they waited in the mailbox.
"""

from enum import Enum
from typing import NamedTuple, TypeAlias


class Urgency(Enum):
    """How a put travels. All are DROP: one slow receiver must not stall its sender."""

    ACT = "act"
    CONTROL = "control"
    STREAM = "stream"
    BULK = "bulk"


class Arrived(NamedTuple):
    """Bytes put on `key` by a peer."""

    key: str
    at_us: int
    payload: bytes


class TokenChanged(NamedTuple):
    """A liveliness token appeared (`alive`) or went."""

    key: str
    at_us: int
    alive: bool


class Asked(NamedTuple):
    """A question reached one of our queryables; answer with `Answer(ask, ...)` any number of times, then `AnswerEnd`."""

    ask: int
    key: str
    at_us: int
    payload: bytes


class Answered(NamedTuple):
    """One answer to our `Ask(question, ...)`."""

    question: int
    key: str
    at_us: int
    payload: bytes


class AskEnded(NamedTuple):
    """No more answers to `question` will come: all answered, or the time is over."""

    question: int
    at_us: int


class Conflated(NamedTuple):
    """The mailbox replaced or refused `lost` events of `key` since the last one."""

    key: str
    at_us: int
    lost: int


class HandlerFailed(NamedTuple):
    """A callback at the edge raised; Zenoh would have swallowed it."""

    where: str
    at_us: int
    error: str


class RosterRead(NamedTuple):
    """The roster's file has a later generation."""

    text: str
    at_us: int


class RosterKept(NamedTuple):
    """The roster's file has changed and cannot be used; the roster before it is kept."""

    why: str
    at_us: int


class LinkClosed(NamedTuple):
    """A link was closed whose certificate was made out to `name`, which the roster does not admit; or `surplus`: it was the
    oldest of more links of that name than one may have.
    """

    name: str
    at_us: int
    surplus: bool = False


class CertificateEnds(NamedTuple):
    """Our own certificate ends within a day (wall clock), and all links with it."""

    ends_us: int
    at_us: int


WireEvent: TypeAlias = (
    Arrived
    | TokenChanged
    | Asked
    | Answered
    | AskEnded
    | Conflated
    | HandlerFailed
    | RosterRead
    | RosterKept
    | LinkClosed
    | CertificateEnds
)


class Put(NamedTuple):
    """Put `payload` on `key`."""

    key: str
    payload: bytes
    urgency: Urgency


class Subscribe(NamedTuple):
    """Receive everything put on `key_expr`. Declaring the same expression twice is declaring it once."""

    key_expr: str


class Unsubscribe(NamedTuple):
    key_expr: str


class DeclareToken(NamedTuple):
    key: str


class UndeclareToken(NamedTuple):
    key: str


class WatchTokens(NamedTuple):
    """Receive `TokenChanged` for `key_expr`, the present ones first."""

    key_expr: str


class DeclareQueryable(NamedTuple):
    key_expr: str


class Ask(NamedTuple):
    """Put a question to every queryable that matches `key`; answers come back as `Answered`, then `AskEnded`."""

    question: int
    key: str
    payload: bytes
    timeout_us: int


class Answer(NamedTuple):
    ask: int
    key: str
    payload: bytes


class AnswerEnd(NamedTuple):
    """Free the question; without it the requester waits for its full timeout."""

    ask: int


class Reopen(NamedTuple):
    """The session is deaf to a peer that others hear: close it, open a new one and declare everything again."""

    why: str


WireEffect: TypeAlias = (
    Put
    | Subscribe
    | Unsubscribe
    | DeclareToken
    | UndeclareToken
    | WatchTokens
    | DeclareQueryable
    | Ask
    | Answer
    | AnswerEnd
    | Reopen
)
