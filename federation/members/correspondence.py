"""The speech acts of a member: its questions and answers, signed and verified, each act once.

Wants are conversations; its opener gets the answers by plain calls. Times are the node clock.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Literal, Protocol, TypeAlias

from dyknow.federation import keys
from dyknow.federation.messages import contents
from dyknow.federation.messages.acts import Act, AgentName, Performative
from dyknow.federation.messages.codec import decode_act, encode_act
from dyknow.federation.messages.conversations import Conversations, Outcome
from dyknow.federation.messages.dialogue import is_paged
from dyknow.federation.messages.protocols import (
    OPENING,
    PROTOCOLS,
    Foreign,
    Incoming,
    PeerLost,
    Reply,
    TimedOut,
    Unanswered,
    Undelivered,
)
from dyknow.federation.messages.receipts import (
    RECEIPT_AGENT,
    Receipt,
    decode_receipt,
    decode_signed,
    encode_receipt,
    encode_signed,
    signed_bytes,
)
from dyknow.federation.security.trust import Trust
from dyknow.federation.shares import own_share
from dyknow.federation.transport import Arrived, Put
from dyknow.model.errors import ContentError, DecodeError, Refused

P = Performative
INTERFACE = "interface"
"""The agent that speaks for a member, and is spoken to by others."""
ONTOLOGY = "dyknow"
REPLY_WITHIN_US = 2_000_000
FOREIGN = "not its conversation"
"""The result of an act in a conversation of others."""
UNANSWERED = "not answered"
"""The result of an act that is refused in silence, since its sender was refused so often."""

Direction: TypeAlias = Literal["in", "out"]
OnReply: TypeAlias = Callable[[Act, contents.Content | None, bool, int], None]
"""Takes an answer, its content (None: none, or not understood), whether it is the last, and the time."""
OnSilence: TypeAlias = Callable[[str, int], None]
"""Takes why no further answer comes, and the time."""
Audit: TypeAlias = Callable[[int, Direction, str, Act | None, str], None]
"""Takes each act that passes: when, which way, the peer, the act (None for bytes that were none), what became of it."""


class ActAgents(Protocol):
    """Agents that speak through it. Times are the node clock."""

    def on_request(self, act: Act, now_us: int, /) -> None:
        """An act that answers none of ours."""

    def on_lost(self, opening: Act, now_us: int, /) -> None:
        """The platform is gone that had opened this conversation with us."""


@dataclass(slots=True)
class _Pending:
    """Takes the answers of a conversation that we opened."""

    unit: str
    on_reply: OnReply | None
    on_silence: OnSilence | None
    is_paged: bool


class Correspondence:
    """See the module.

    Args:
        unit: the member's name.
        boot: its incarnation.
        agents: given what arrives.
        audit: given what passes.
        emit: takes what is to be put on the wire.
        offset_us_of: the clock of a unit minus ours; 0 while it is not known.
        trust: None in an open federation.

    Attributes:
        ended: how many answers, silences and losses it has passed on.
    """

    def __init__(
        self,
        unit: str,
        boot: int,
        agents: ActAgents,
        audit: Audit,
        emit: Callable[[Put], None],
        offset_us_of: Callable[[str], int],
        trust: Trust | None = None,
    ) -> None:
        self.unit = unit
        self.share_of = own_share if trust is None else trust.share_of
        self.conversations = Conversations(unit, boot, self._encoded, self._receipt_bytes, self.share_of)
        self._agents, self._audit, self._emit = agents, audit, emit
        self._offset_us_of, self._trust = offset_us_of, trust
        self._now_us, self.ended = 0, 0
        self._pending: dict[str, _Pending] = {}

    # -- acts out ----------------------------------------------------------------------------------------------

    def _encoded(self, act: Act) -> bytes:
        """Every act that leaves is encoded here, once."""
        payload = encode_act(act, None if self._trust is None else self._trust.signer)
        self._audit(self._now_us, "out", act.receiver.unit, act, "sent")
        return payload

    def _receipt_bytes(self, receiver: str, receipt: Receipt) -> bytes:
        if self._trust is None:
            return encode_receipt(receipt)
        return encode_signed(receiver, receipt, self._trust.signer)

    def ask(
        self,
        unit: str,
        content: contents.Content,
        now_us: int,
        *,
        performative: Performative = P.REQUEST,
        on_reply: OnReply | None = None,
        on_silence: OnSilence | None = None,
        within_us: int = REPLY_WITHIN_US,
        standing: bool = False,
        conversation: str = "",
        evidence: bytes = b"",
    ) -> str:
        """Open a conversation with the Interface Agent of `unit`; returns its id.

        Args:
            unit: the recipient.
            content: the content.
            now_us: the time.
            performative: how.
            on_reply: takes each answer.
            on_silence: takes why no further one comes.
            within_us: when the first answer is due.
            standing: whether the conversation lives beyond its first result, until it is cancelled.
            conversation: its id, if one was taken already.
            evidence: of the task that this is for: the act that delegated it, as it arrived.

        Raises:
            Refused: too many conversations with `unit` are open.
            ContentError: the content cannot be encoded.
        """
        self._now_us = now_us
        conversation = conversation or self.conversations.new_conversation(unit)
        act = self._act(performative, unit, content, conversation, now_us + within_us)._replace(evidence=evidence)
        in_pages = is_paged(content)
        self._pending[conversation] = _Pending(unit, on_reply, on_silence, in_pages)
        try:
            _, outcomes = self.conversations.send(act, now_us, standing=standing or in_pages)
        except (Refused, ContentError):
            del self._pending[conversation]
            raise
        self._handle(outcomes, now_us)
        return conversation

    def tell(
        self,
        unit: str,
        content: contents.Content,
        now_us: int,
        *,
        conversation: str | None = None,
        evidence: bytes = b"",
    ) -> None:
        """Inform the Interface Agent of `unit`; no answer is expected. `evidence`: as in `ask`."""
        self._now_us = now_us
        act = self._act(P.INFORM, unit, content, conversation)._replace(evidence=evidence)
        self._handle(self.conversations.send(act, now_us)[1], now_us)

    def answer(
        self,
        act: Act,
        performative: Performative,
        content: contents.Content | None,
        now_us: int,
        *,
        standing: bool = False,
    ) -> None:
        """Answer an act of another platform in its conversation; `standing` keeps that open after an agree."""
        self._now_us = now_us
        expr = None if content is None else content.expr()
        self._handle(self.conversations.answer(act, performative, expr, now_us, standing=standing), now_us)

    def refuse(self, act: Act, performative: Performative, content: contents.Content, now_us: int) -> bool:
        """Refuse an act of another platform; False if it was left unanswered, being refused too much."""
        self._now_us = now_us
        outcomes = self.conversations.refuse(act, performative, content.expr(), now_us)
        self._handle(outcomes, now_us)
        return not any(isinstance(outcome, Unanswered) for outcome in outcomes)

    def decide(
        self, unit: str, conversation: str, performative: Performative, content: contents.Content, now_us: int
    ) -> None:
        """Accept or reject the proposal of `unit` in a call of ours; an accepted one lives until it is cancelled."""
        self._now_us = now_us
        if performative is P.REJECT_PROPOSAL:
            self._pending.pop(conversation, None)
        act = self._act(performative, unit, content, conversation)._replace(protocol=PROTOCOLS[P.CFP])
        self._handle(self.conversations.send(act, now_us)[1], now_us)

    def cancel(self, unit: str, conversation: str, now_us: int) -> None:
        """End our request to `unit`, if it still stands."""
        self._now_us = now_us
        self._handle(self.conversations.cancel(conversation, unit, now_us), now_us)

    def give_up(self, unit: str, conversation: str, now_us: int) -> None:
        """End our request to `unit`; no further answer is taken."""
        self._pending.pop(conversation, None)
        self.cancel(unit, conversation, now_us)

    def cancel_task(
        self,
        unit: str,
        conversation: str,
        now_us: int,
        *,
        on_reply: OnReply,
        on_silence: OnSilence,
        within_us: int = REPLY_WITHIN_US,
    ) -> None:
        """End a task of `unit`, delegated by us or by another member; the answers are those to the cancel."""
        self._now_us = now_us
        act = self._act(P.CANCEL, unit, contents.Cancel(), conversation, now_us + within_us)
        self._pending[conversation] = _Pending(unit, on_reply, on_silence, is_paged=False)
        self._handle(self.conversations.send(act, now_us)[1], now_us)

    def _act(
        self,
        performative: Performative,
        unit: str,
        content: contents.Content,
        conversation: str | None,
        reply_by_us: int | None = None,
    ) -> Act:
        return Act(
            performative,
            AgentName(INTERFACE, self.unit),
            AgentName(INTERFACE, unit),
            content.expr(),
            conversation_id=conversation,
            ontology=ONTOLOGY,
            reply_by_us=reply_by_us,
        )

    # -- acts in -----------------------------------------------------------------------------------------------

    def on_arrived(self, event: Arrived, key: keys.ActKey, now_us: int) -> bool:
        """Bytes on an act key addressed to us: only genuine acts, each once, reach the agents.

        Returns whether anything may follow from it; nothing does from a receipt.
        """
        self._now_us = now_us
        try:
            if key.agent == RECEIPT_AGENT:
                self.conversations.on_receipt(key.sender, self._receipt(key.sender, event.payload), now_us)
                return False
            act, signature, body = decode_act(event.payload)
        except DecodeError as error:
            self._audit(event.at_us, "in", key.sender, None, error.reason)
            return True
        if (act.receiver.unit, act.sender.unit, act.receiver.agent) != key or act.sender.unit == self.unit:
            self._audit(event.at_us, "in", key.sender, act, "sender and key differ")
            return True
        if self._trust is not None:
            offset_us = self._offset_us_of(act.sender.unit)
            reason = self._trust.verifier.check(act, signature, body, event.at_us, offset_us=offset_us)
            if reason is not None:
                self._audit(event.at_us, "in", key.sender, act, reason)
                if reason == "replayed":  # it is genuine, and its receipt may have been lost
                    self.conversations.delivery.on_act(act, now_us)
                return True
        self.on_act(act._replace(original=event.payload) if act.performative in OPENING else act, now_us)
        return True

    def _receipt(self, sender: str, payload: bytes) -> Receipt:
        """The receipt of a unit; raises DecodeError if it did not sign it, where there is a roster."""
        if self._trust is None:
            return decode_receipt(payload)
        receipt, signature, body = decode_signed(payload)
        if not self._trust.verifier.is_genuine(sender, signature, signed_bytes(self.unit, body)):
            raise DecodeError("forged")
        return receipt

    def evidence(self, payload: bytes) -> Act:
        """The act that another one carries, of the member that it names, whenever it was made.

        Raises:
            Refused: `unproven`: it is no act, or not that of its sender.
        """
        try:
            act, signature, body = decode_act(payload)
        except DecodeError as error:
            raise Refused(f"the evidence is no act: {error.reason}", "unproven") from None
        forgery = None if self._trust is None else self._trust.verifier.forgery(act, signature, body)
        if forgery is not None:
            raise Refused(f"the evidence is not of {act.sender.unit}: {forgery}", "unproven")
        return act

    def on_act(self, act: Act, now_us: int) -> None:
        """An act whose sender is verified."""
        before = self.conversations.delivery.counts["received"]
        outcomes = self.conversations.on_act(act, now_us)
        if not any(isinstance(outcome, Incoming) for outcome in outcomes):
            is_new = self.conversations.delivery.counts["received"] > before
            outcome = _fate(act, outcomes) if is_new else "duplicate"
            self._audit(now_us, "in", act.sender.unit, act, outcome)
        self._handle(outcomes, now_us)

    def _handle(self, outcomes: Iterable[Outcome], now_us: int) -> None:
        for outcome in outcomes:
            match outcome:
                case Incoming(act):
                    self._on_incoming(act, now_us)
                case Reply(conversation, act, _, closed):
                    self._on_reply(conversation, act, is_last=closed, now_us=now_us)
                case TimedOut(conversation, _, why):
                    self._on_silence(conversation, why, now_us)
                case PeerLost(conversation, _, peer, True):
                    self._on_silence(conversation, f"platform {peer} is gone", now_us)
                case PeerLost():
                    self._agents.on_lost(outcome.opening, now_us)
                case Foreign() | Unanswered():
                    pass
                case Undelivered(act):
                    self._audit(now_us, "out", act.receiver.unit, act, "undelivered")
                case _:
                    self._emit(outcome)
                    continue
            self.ended += 1

    def _on_incoming(self, act: Act, now_us: int) -> None:
        """An act that answers none of ours; in a conversation of ours that waits for another platform only progress is heard."""
        is_asked = act.performative in OPENING or act.performative is P.CANCEL
        is_progress = act.content is not None and act.content.head == contents.Progress.head
        if is_asked or is_progress or (act.conversation_id or "") not in self._pending:
            self._agents.on_request(act, now_us)
        else:
            self._audit(now_us, "in", act.sender.unit, act, FOREIGN)

    def _on_reply(self, conversation: str, act: Act, *, is_last: bool, now_us: int) -> None:
        pending = self._pending.get(conversation)
        try:
            content = None if act.content is None else contents.read(act.content)
        except ContentError:
            content = None
        if (
            pending is not None
            and pending.unit == act.sender.unit
            and pending.is_paged
            and not getattr(content, "more", False)
        ):
            self.conversations.close(conversation, pending.unit)
            is_last = True
        if is_last:
            self._pending.pop(conversation, None)
        if pending is not None and pending.on_reply is not None:
            pending.on_reply(act, content, is_last, now_us)

    def _on_silence(self, conversation: str, why: str, now_us: int) -> None:
        pending = self._pending.pop(conversation, None)
        if pending is not None and pending.on_silence is not None:
            pending.on_silence(why, now_us)

    # -- peers and time ----------------------------------------------------------------------------------------

    def peer_gone(self, unit: str, now_us: int) -> None:
        """Fail all open conversations with `unit`."""
        self._now_us = now_us
        self._handle(self.conversations.peer_gone(unit), now_us)

    def peer_appeared(self, unit: str, boot: int, now_us: int) -> None:
        """`unit` is there, again or for the first time: it is sent what it lacks."""
        self._now_us = now_us
        self._handle(self.conversations.peer_appeared(unit, boot, now_us), now_us)

    @property
    def deadline_us(self) -> int | None:
        return self.conversations.deadline_us

    def on_time(self, now_us: int) -> None:
        """Send again what was not acknowledged, and close conversations that were not answered in time."""
        self._now_us = now_us
        self._handle(self.conversations.on_time(now_us), now_us)

    def flush(self) -> None:
        """Acknowledge what no act of this step did."""
        for put in self.conversations.flush():
            self._emit(put)


def _fate(act: Act, outcomes: list[Outcome]) -> str:
    """The result of a new act that is no request."""
    if any(isinstance(outcome, Foreign) for outcome in outcomes):
        return FOREIGN
    if any(isinstance(outcome, Unanswered) for outcome in outcomes):
        return UNANSWERED
    if any(isinstance(outcome, Reply) for outcome in outcomes):
        return "accepted"
    return "conversation refused" if act.performative in OPENING or act.performative is P.CANCEL else "late"
