"""The interaction protocols of FIPA as moves of one record: SC00026 request, 27 query, 29 contract net, 35 subscribe, 36 propose."""

from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple, TypeAlias

from dyknow.federation.messages.acts import Act, Performative

P = Performative

OPENING = frozenset(
    {P.REQUEST, P.REQUEST_WHEN, P.REQUEST_WHENEVER, P.QUERY_IF, P.QUERY_REF, P.SUBSCRIBE, P.PROPOSE, P.CFP, P.PROXY}
)
"""The performatives that want an answer."""
CLOSING = frozenset({P.REFUSE, P.FAILURE, P.NOT_UNDERSTOOD, P.ACCEPT_PROPOSAL, P.REJECT_PROPOSAL})
DECIDING = frozenset({P.ACCEPT_PROPOSAL, P.REJECT_PROPOSAL})
RESULTS = frozenset({P.INFORM, P.INFORM_IF, P.INFORM_REF, P.CONFIRM, P.DISCONFIRM, P.PROPOSE})
PROTOCOLS = {
    P.REQUEST: "fipa-request",
    P.REQUEST_WHEN: "fipa-request-when",
    P.QUERY_IF: "fipa-query",
    P.QUERY_REF: "fipa-query",
    P.SUBSCRIBE: "fipa-subscribe",
    P.PROPOSE: "fipa-propose",
    P.CFP: "fipa-contract-net",
}


class Incoming(NamedTuple):
    """Something new for the agents of this platform: an act that is no answer to one of ours."""

    act: Act


class Foreign(NamedTuple):
    """A platform's act in a conversation of ours with another one: it is ignored."""

    act: Act


class Unanswered(NamedTuple):
    """An act that is refused without an answer: its sender has been sent as many refusals as it may."""

    act: Act


class Reply(NamedTuple):
    """An answer in one of our conversations; `closed` says that it was the last."""

    conversation: str
    act: Act
    opening: Act
    closed: bool


class TimedOut(NamedTuple):
    """One of our conversations failed in silence. It is closed; a standing one was cancelled as well."""

    conversation: str
    opening: Act
    why: str


class Undelivered(NamedTuple):
    """An act of ours, none that opened a conversation, was given up: it was not acknowledged in ten seconds."""

    act: Act


class PeerLost(NamedTuple):
    """The platform of the other side is gone, and the conversation closed; `ours` if we had opened it."""

    conversation: str
    opening: Act
    peer: str
    ours: bool


ConversationEvent: TypeAlias = Incoming | Foreign | Unanswered | Reply | TimedOut | Undelivered | PeerLost


class Phase(Enum):
    """The next due step: `STANDING` lives, and owes nothing.

    ASKED wants an answer, PROPOSED a decision, AGREED a result, CANCELLING the answer to a cancel.
    """

    ASKED = "asked"
    PROPOSED = "proposed"
    AGREED = "agreed"
    STANDING = "standing"
    CANCELLING = "cancelling"


@dataclass(slots=True)
class Conversation:
    """One side's record of a conversation, moved by the acts that this side hears (if ours) or sends (if theirs).

    Attributes:
        opening: the act that began it; on the participant's side a cancel, once one has come.
        peer: unit of the other side, `all` for a question to everybody.
        ours: whether this platform opened it.
        due_us: when silence closes it; node clock.
        standing: whether it lives beyond its first result, until it is ended.
        result_within_us: how long after an agree the result may take.
        cancel: the `reply_with` of our cancel.
    """

    opening: Act
    peer: str
    ours: bool
    phase: Phase
    due_us: int | None
    standing: bool = False
    result_within_us: int | None = None
    cancel: str | None = None

    def heard(self, act: Act, now_us: int) -> bool:
        """We opened it, and hear an answer. True if that closes it; an unexpected act moves nothing."""
        performative = act.performative
        if self.phase is Phase.CANCELLING:
            return act.in_reply_to == self.cancel or performative in CLOSING
        if performative in CLOSING:
            return True
        if self.opening.performative is P.CFP and self.phase in {Phase.ASKED, Phase.PROPOSED}:
            if performative is P.PROPOSE:
                self.phase, self.due_us = Phase.PROPOSED, None
            return False
        if performative is P.AGREE and self.phase is Phase.ASKED:
            subscribed = self.opening.performative is P.SUBSCRIBE
            self.phase = Phase.STANDING if subscribed else Phase.AGREED
            within_us = None if subscribed else self.result_within_us
            self.due_us = None if within_us is None else now_us + within_us
        elif performative in RESULTS:
            self.phase, self.due_us = Phase.STANDING, None
            return not self.standing
        return False

    def said(self, act: Act, *, standing: bool) -> bool:
        """They opened it, and we answer. True if that closes it."""
        performative = act.performative
        if self.phase is Phase.CANCELLING:
            return performative in CLOSING or act.in_reply_to == self.opening.reply_with
        self.standing = self.standing or standing or self.opening.performative is P.SUBSCRIBE
        if performative is P.PROPOSE and self.opening.performative is P.CFP:
            self.phase, self.due_us = Phase.PROPOSED, None
        elif performative is P.AGREE:
            self.phase, self.due_us = Phase.STANDING if self.standing else Phase.AGREED, None
        elif performative in RESULTS and self.standing:
            self.phase, self.due_us = Phase.STANDING, None
        else:
            return performative in CLOSING or performative in RESULTS
        return False

    def decided(self, performative: Performative, due_us: int | None) -> bool:
        """The proposal of a contract net is accepted: a result is due, at the initiator's side by `due_us`. True if it is
        rejected, which closes the conversation.
        """
        self.phase, self.due_us, self.standing = Phase.AGREED, due_us, True
        return performative is P.REJECT_PROPOSAL
