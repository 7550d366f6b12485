"""Conversations: which answers are due, by FIPA's interaction protocols, over acts that are made reliable.

Each conversation has an initiator and a participant, and each side its own record. A request, query or proposal wants
an answer by its reply-by; silence is a failure. After an agree the result is awaited, or, in a standing conversation
(a subscription, a task that lives until it is cancelled), informs come until it is ended: the initiator by
cancel, which wants its own answer by its own reply-by, the participant by failure, or the loss of the peer. Both
sides are notified of that loss, and the peer learns what was dropped because of it if the same incarnation returns,
so that no conversation is open on one side only.
"""

from collections.abc import Callable
from typing import TypeAlias, TypeVar

from dyknow import earlier
from dyknow.federation import keys
from dyknow.federation.messages import protocols
from dyknow.federation.messages.acts import Act, AgentName, Performative
from dyknow.federation.messages.codec import encode_act
from dyknow.federation.messages.contents import Progress
from dyknow.federation.messages.delivery import Delivery
from dyknow.federation.messages.ends import GIVEN_UP, LOST, cancel_of
from dyknow.federation.messages.receipts import Receipt, encode_receipt
from dyknow.federation.messages.refusals import Refusals
from dyknow.federation.messages.sexpr import Expr, QuotedText
from dyknow.federation.shares import MemberShare, own_share
from dyknow.federation.transport import Put
from dyknow.model.errors import Refused

P = Performative
REPLY_BY_US = 2_000_000
REPLY_BY_MOST_US = 600_000_000
RESULT_WITHIN_US = 10_000_000
OPEN_PER_PEER = 64
PEERS = 512
ANSWERED = 1024
TOO_LATE = Expr("leave-proposal", {"because": QuotedText("the call is over")})
"""The content of the rejection of a proposal that comes after it was due."""

Outcome: TypeAlias = Put | protocols.ConversationEvent
"""The result of a step: puts for the wire and events for the agents, in order."""

_K = TypeVar("_K")
_Name: TypeAlias = tuple[str, str, bool]
"""Conversation id, unit of the peer, whether we opened it."""


class Conversations:
    """All conversations of one platform, and the delivery of their acts. Times are the node clock.

    `encode` turns an act into bytes, `receipt_bytes` a receipt for a unit, signed where there is a roster; `share_of` says
    with which other names a unit shares what one member may have open here.
    """

    def __init__(
        self,
        unit: str,
        boot: int,
        encode: Callable[[Act], bytes] = encode_act,
        receipt_bytes: Callable[[str, Receipt], bytes] = lambda _receiver, receipt: encode_receipt(receipt),
        share_of: Callable[[str], MemberShare] = own_share,
    ) -> None:
        self.unit, self.boot, self._share_of = unit, boot, share_of
        self.delivery, self.refusals = Delivery(unit, boot, encode, receipt_bytes), Refusals(share_of)
        self._open: dict[_Name, protocols.Conversation] = {}
        self._due_us: int | None = None
        self._opened = 0
        self._prefix = _beginning(unit, boot)
        self._dropped: dict[str, tuple[int | None, list[Act]]] = {}
        self._answered: dict[str, None] = {}
        self._ended: dict[tuple[str, str], None] = {}

    def new_conversation(self, receiver: str) -> str:
        """An id that no other platform and no other life of this one uses; it names both platforms.

        A task has the id of the conversation in which it was delegated, so its delegate is in its name.
        """
        self._opened += 1
        return f"{self._prefix}{self._opened}.{receiver}"

    def conversations(self) -> list[protocols.Conversation]:
        """All open ones, for display and tests."""
        return list(self._open.values())

    # Saying

    def send(
        self,
        act: Act,
        now_us: int,
        *,
        standing: bool = False,
        result_within_us: int | None = RESULT_WITHIN_US,
    ) -> tuple[Act, list[Outcome]]:
        """Send an act. Returns it as sent (numbered, with its conversation) and the effects.

        An act that wants an answer opens a conversation here: `standing` if it is to live beyond its first result
        (a subscription always does). An answer moves the conversation that it answers; an agree with `standing`
        keeps the participant's side open until it is cancelled.

        Raises:
            Refused: too many conversations are open with that peer.
            ContentError: the act cannot be encoded.
        """
        peer, performative = act.receiver.unit, act.performative
        is_proposal = performative is P.PROPOSE and (act.conversation_id or "", peer, False) in self._open
        opens = performative in protocols.OPENING and not is_proposal
        if opens or performative is P.CANCEL:
            act = self._addressed(act, now_us)
        if opens and sum(name[1] == peer and name[2] for name in self._open) >= OPEN_PER_PEER:
            raise Refused(f"{OPEN_PER_PEER} conversations with {peer} are open already", "too-many")
        said, put = self.delivery.send(act, now_us, patient=not opens)
        conversation = said.conversation_id or ""
        if opens:
            standing = standing or performative is P.SUBSCRIBE
            self._add(
                protocols.Conversation(
                    said, peer, True, protocols.Phase.ASKED, said.reply_by_us, standing, result_within_us
                )
            )
        elif performative is P.CANCEL:
            known = self._open.get((conversation, peer, True))  # None: another member opened it, or it is closed
            found = known or protocols.Conversation(said, peer, True, protocols.Phase.CANCELLING, None)
            found.phase, found.due_us, found.cancel = protocols.Phase.CANCELLING, said.reply_by_us, said.reply_with
            self._add(found)
        elif not self._decides(
            said, peer, ours=True, due_us=None if result_within_us is None else now_us + result_within_us
        ):
            theirs = self._open.get((conversation, peer, False))
            if theirs is not None and theirs.said(said, standing=standing):
                del self._open[conversation, peer, False]
        return said, [put]

    def answer(
        self,
        to: Act,
        performative: Performative,
        content: Expr | None,
        now_us: int,
        *,
        sender: AgentName | None = None,
        standing: bool = False,
    ) -> list[Outcome]:
        """Answer `to` in its conversation, as the agent it was sent to."""
        return self.send(self.answering(to, performative, content, sender), now_us, standing=standing)[1]

    def answering(
        self, to: Act, performative: Performative, content: Expr | None, sender: AgentName | None = None
    ) -> Act:
        """The act that answers `to`, not sent yet."""
        return Act(
            performative,
            sender or AgentName(to.receiver.agent, self.unit),
            to.reply_to or to.sender,
            content,
            conversation_id=to.conversation_id,
            protocol=to.protocol,
            in_reply_to=to.reply_with,
            language=to.language,
            ontology=to.ontology,
        )

    def cancel(self, conversation: str, peer: str, now_us: int) -> list[Outcome]:
        """End one of our conversations by the cancel meta-protocol; nothing if it is closed or being cancelled."""
        found = self._open.get((conversation, peer, True))
        if found is None or found.phase is protocols.Phase.CANCELLING:
            return []
        return self.send(cancel_of(found.opening), now_us)[1]

    def close(self, conversation: str, peer: str) -> None:
        """Forget a standing conversation whose end both sides know, such as that of a stream that has run out."""
        self._open.pop((conversation, peer, True), None)
        self._open.pop((conversation, peer, False), None)

    def flush(self) -> list[Put]:
        """Acknowledge what no act of this step did. Call it at the end of each step."""
        return self.delivery.flush()

    # Hearing

    def on_act(self, act: Act, now_us: int) -> list[Outcome]:
        """An act arrived whose sender was verified. Duplicates are only acknowledged."""
        if not self.delivery.on_act(act, now_us):
            return []
        conversation, sender, performative = act.conversation_id, act.sender.unit, act.performative
        if self._decides(act, sender, ours=False, due_us=None):
            return [protocols.Incoming(act)]
        if conversation is not None and performative is not P.CANCEL:
            for peer in (sender, keys.EVERYBODY):
                found = self._open.get((conversation, peer, True))
                if found is not None:
                    return self._replied(conversation, found, act, now_us)
            is_bid = performative is P.PROPOSE and act.protocol == protocols.PROTOCOLS[P.CFP]
            if (is_bid or performative not in protocols.OPENING) and self._is_ours(conversation):
                return self._unasked(conversation, act, now_us)
        if conversation is not None and (performative in protocols.OPENING or performative is P.CANCEL):
            return self._asked(conversation, act, now_us)
        return [protocols.Incoming(act)]

    def on_receipt(self, sender: str, receipt: Receipt, now_us: int) -> None:
        """A bare acknowledgement arrived."""
        self.delivery.on_receipt(sender, receipt, now_us)

    def peer_gone(self, unit: str) -> list[Outcome]:
        """The directory calls a platform gone: all open conversations with it have failed."""
        self.delivery.peer_gone(unit)
        events: list[Outcome] = []
        dropped: list[Act] = []
        for name in [name for name in self._open if name[1] == unit]:
            found = self._open.pop(name)
            events.append(protocols.PeerLost(name[0], found.opening, unit, found.ours))
            if found.standing and found.phase is not protocols.Phase.CANCELLING:
                lost = cancel_of(found.opening, LOST)
                mine = lost if found.ours else self._no(found.opening, P.FAILURE, f"{unit} was gone")
                dropped.append(mine)
        if dropped:
            self._dropped[unit] = (self.delivery.boot_of(unit), dropped)
            while len(self._dropped) > PEERS:
                del self._dropped[next(iter(self._dropped))]
        return events

    def peer_appeared(self, unit: str, boot: int, now_us: int) -> list[Outcome]:
        """A platform is there (again): the same incarnation gets what it lacks, and learns what was dropped meanwhile."""
        outcome: list[Outcome] = [*self.delivery.peer_appeared(unit, boot, now_us)]
        went, dropped = self._dropped.pop(unit, (boot, []))
        if went in (None, boot):
            outcome += [self.delivery.send(act, now_us)[1] for act in dropped]
        return outcome

    @property
    def deadline_us(self) -> int | None:
        return earlier(self._due_us, self.delivery.deadline_us)

    def on_time(self, now_us: int) -> list[Outcome]:
        """Put again what is not acknowledged, and close what was not answered in time."""
        puts, undelivered = self.delivery.on_time(now_us)
        outcome: list[Outcome] = [*puts]
        for act in undelivered:
            outcome += self._undelivered(act, now_us)
        if self._due_us is not None and now_us >= self._due_us:
            self._due_us = None
            for name, found in list(self._open.items()):
                if found.due_us is not None and now_us >= found.due_us:
                    outcome += self._overdue(name, found, now_us)
                else:
                    self._wake(found.due_us)
        return outcome

    # Steps

    def _addressed(self, act: Act, now_us: int) -> Act:
        """An act with the parameters that its answer needs."""
        return act._replace(
            conversation_id=act.conversation_id or self.new_conversation(act.receiver.unit),
            protocol=act.protocol or protocols.PROTOCOLS.get(act.performative),
            reply_with=act.reply_with or f"r{self.delivery.next_seq}",
            reply_by_us=act.reply_by_us if act.reply_by_us is not None else now_us + REPLY_BY_US,
        )

    def _decides(self, act: Act, peer: str, *, ours: bool, due_us: int | None) -> bool:
        """Accept or reject the proposal that stands in a contract net; whether the act does that."""
        name = (act.conversation_id or "", peer, ours)
        found = self._open.get(name) if act.performative in protocols.DECIDING else None
        if found is None or found.opening.performative is not P.CFP or found.phase is not protocols.Phase.PROPOSED:
            return False
        if found.decided(act.performative, due_us):
            del self._open[name]
        self._wake(due_us)
        return True

    def _replied(self, conversation: str, found: protocols.Conversation, act: Act, now_us: int) -> list[Outcome]:
        closed = found.peer != keys.EVERYBODY and found.heard(act, now_us)
        if closed:
            del self._open[conversation, found.peer, True]
            _remember(self._answered, conversation)
        else:
            self._wake(found.due_us)
        return [protocols.Reply(conversation, act, found.opening, closed)]

    def _is_ours(self, conversation: str) -> bool:
        """Whether we have opened it, or cancel it."""
        return conversation.startswith(self._prefix) or any(name[0] == conversation and name[2] for name in self._open)

    def _unasked(self, conversation: str, act: Act, now_us: int) -> list[Outcome]:
        """An act of a platform that owes no answer in a conversation of ours, which is closed or with another one.

        A task may have participants, which inform: the agents know them. Nothing else is heard of a third platform.
        """
        is_told = act.performative is P.INFORM and act.in_reply_to is None
        is_addressed = conversation.endswith((f".{act.sender.unit}", f".{keys.EVERYBODY}"))
        if is_told and (_is_progress(act) or not is_addressed):
            return [protocols.Incoming(act)]
        return self._late(act, now_us) if is_addressed else [protocols.Foreign(act)]

    def _late(self, act: Act, now_us: int) -> list[Outcome]:
        """An answer in a conversation that we have closed. A late agree is answered by a cancel, a late proposal rejected.

        But an agree that its own result overtook only comes late.
        """
        self.delivery.counts["late"] += 1
        if act.performative is P.PROPOSE:
            return [self.delivery.send(self.answering(act, P.REJECT_PROPOSAL, TOO_LATE), now_us)[1]]
        if act.performative is not P.AGREE or act.conversation_id in self._answered:
            return []
        mine = AgentName(act.receiver.agent, self.unit)
        cancel = Act(P.CANCEL, mine, act.sender, GIVEN_UP, act.conversation_id, act.protocol)
        return [self.delivery.send(cancel, now_us)[1]]

    def _asked(self, conversation: str, act: Act, now_us: int) -> list[Outcome]:
        """A request to this platform; it is answered by its reply-by in any case."""
        within_us = REPLY_BY_US if act.reply_by_us is None else max(0, act.reply_by_us - act.created_us)
        peer = act.sender.unit
        known = self._open.get((conversation, peer, False))
        own = _beginning(peer, act.boot)
        if act.performative is not P.CANCEL and not conversation.startswith(own):
            said = f"what you ask opens a conversation of yours: its id begins with {own}"
            return self._refused(act, said, now_us)
        if (
            known is not None
            and known.phase in {protocols.Phase.AGREED, protocols.Phase.STANDING}
            and act.performative in protocols.OPENING
        ):
            return self._refused(act, "this conversation is about something else", now_us)
        if act.performative is P.CANCEL:
            if known is None:
                _remember(self._ended, (conversation, peer))
        elif (conversation, peer) in self._ended:  # its cancel overtook it
            return self._refused(act, "this conversation was cancelled", now_us)
        if known is None and self._is_full(peer):
            return self._refused(act, "too many open conversations", now_us)
        phase = protocols.Phase.CANCELLING if act.performative is P.CANCEL else protocols.Phase.ASKED
        self._add(protocols.Conversation(act, peer, False, phase, now_us + min(within_us, REPLY_BY_MOST_US)))
        return [protocols.Incoming(act)]

    def refuse(self, to: Act, performative: Performative, content: Expr, now_us: int) -> list[Outcome]:
        """Answer `to` by a refusal, which ends its conversation; beyond the quota it is left unanswered."""
        if self.refusals.admit(to.sender.unit, now_us):
            return self.answer(to, performative, content, now_us)
        self.delivery.forgo(to.sender.unit)
        self._open.pop((to.conversation_id or "", to.sender.unit, False), None)
        return [protocols.Unanswered(to)]

    def _refused(self, act: Act, reason: str, now_us: int) -> list[Outcome]:
        """The same, of an act that opens no conversation."""
        if self.refusals.admit(act.sender.unit, now_us):
            return [self.delivery.send(self._no(act, P.REFUSE, reason), now_us)[1]]
        self.delivery.forgo(act.sender.unit)
        return [protocols.Unanswered(act)]

    def _overdue(self, name: _Name, found: protocols.Conversation, now_us: int) -> list[Outcome]:
        del self._open[name]
        if found.ours:
            awaited = {protocols.Phase.ASKED: "no answer", protocols.Phase.AGREED: "no result"}.get(
                found.phase, "no answer to cancel"
            )
            return self._failed(name[0], found, f"{awaited} in time", now_us)
        return [self.delivery.send(self._no(found.opening, P.FAILURE, "not answered in time"), now_us)[1]]

    def _undelivered(self, act: Act, now_us: int) -> list[Outcome]:
        name = (act.conversation_id or "", act.receiver.unit, True)
        found = self._open.get(name)
        if found is not None and (act.seq == found.opening.seq or act.performative is P.CANCEL):
            del self._open[name]
            return self._failed(name[0], found, "not delivered", now_us)
        return [protocols.Undelivered(act)]

    def _failed(self, conversation: str, found: protocols.Conversation, why: str, now_us: int) -> list[Outcome]:
        """Silence. The participant of a standing conversation may have begun all the same: it is sent a cancel."""
        outcome: list[Outcome] = [protocols.TimedOut(conversation, found.opening, why)]
        if found.standing and found.phase is not protocols.Phase.CANCELLING and found.peer != keys.EVERYBODY:
            outcome.append(self.delivery.send(cancel_of(found.opening, GIVEN_UP), now_us)[1])
        return outcome

    def _no(self, to: Act, performative: Performative, reason: str) -> Act:
        return self.answering(to, performative, Expr("reason", {"text": QuotedText(reason)}))

    def _add(self, found: protocols.Conversation) -> None:
        self._open[found.opening.conversation_id or "", found.peer, found.ours] = found
        self._wake(found.due_us)

    def _is_full(self, unit: str) -> bool:
        """Whether the member behind a unit has opened as many as it may."""
        owner, shares = self._share_of(unit)
        opened = [peer for _, peer, ours in self._open if not ours]
        if len(opened) < OPEN_PER_PEER:
            return False
        return sum(self._share_of(peer).owner == owner for peer in opened) >= OPEN_PER_PEER * shares

    def _wake(self, due_us: int | None) -> None:
        if due_us is not None and (self._due_us is None or due_us < self._due_us):
            self._due_us = due_us


def _beginning(unit: str, boot: int) -> str:
    """Of the conversations that a platform opens in one life: no other can open one of that name, or one before it is."""
    return f"{unit}-{boot:x}-"


def _remember(ended: dict[_K, None], name: _K) -> None:
    ended[name] = None
    while len(ended) > ANSWERED:
        del ended[next(iter(ended))]


def _is_progress(act: Act) -> bool:
    """Whether it reports of a task, which outlives the conversation with its delegate."""
    return act.content is not None and act.content.head == Progress.head
