"""The Interface Agent: the only entrance of a platform, and the only exit (thesis 9.3.2).

It keeps the account of every act that enters or leaves, checks who sent it (with a roster), holds each peer to its
limits, decides by the visibility of the service whether a request is let in, and passes it to the agent that
understands it. Times are the node clock.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeAlias

from agents.account import Account
from agents.context import OnReply, OnSilence
from agents.limits import Limits
from agents.services import INTERFACE, ServiceTable, admitted
from dyknow.errors import ContentError, DecodeError, DyknowError, Refused, ValueNotAvailable
from federation import keys
from federation.acts import Act, AgentName, Performative
from federation.codec import decode_act, encode_act
from federation.contents import Content, Done, Query, Reason, read
from federation.conversations import Conversations, Outcome
from federation.offers import Service, Visibility
from federation.protocols import OPENING, Incoming, Reply, TimedOut, Undelivered
from federation.receipts import RECEIPT_AGENT, decode_receipt
from federation.transport import Arrived, Put
from federation.trust import Role, Roster, Signer, Verifier

P = Performative
Handler: TypeAlias = Callable[[Act, Content, int], None]
ONTOLOGY = "dyknow"
LASTING = frozenset({"create-multicast", "create-monitor", "monitor-proximity"})
"""Requests that are agreed to and live until they are cancelled. With a roster, observers may not ask for them."""

COMMANDS = frozenset({"goto", "hold", "land", "return-home", "resume", "fault", "leave", "rejoin"})
"""What, with a roster, only a command centre may ask for."""


class Denied(Refused):
    """Refused at the door; `kind` is what the account counts it as."""

    def __init__(self, kind: str, reason: str) -> None:
        self.kind = kind
        super().__init__(reason)


@dataclass(frozen=True, slots=True)
class Trust:
    """How acts are signed and checked; a federation without a roster is open."""

    roster: Roster
    signer: Signer
    verifier: Verifier


@dataclass(slots=True)
class _Waiting:
    unit: str
    on_reply: OnReply | None
    on_silence: OnSilence | None
    is_paged: bool = False


class InterfaceAgent:
    """One platform's desk; see the module.

    Args:
        handlers: by head of the content, what the platform's agents do with it.
        on_cancel: told (cancel, whether its sender may end what others asked for, time); says whether there was a task.
        on_lost: told (opening act, time) when the platform that asked for something is gone.
    """

    def __init__(
        self,
        unit: str,
        boot: int,
        services: ServiceTable,
        emit: Callable[[Put], None],
        *,
        account: Account,
        limits: Limits,
        trust: Trust | None = None,
        offset_us_of: Callable[[str], int] = lambda _unit: 0,
    ) -> None:
        self.unit, self.services, self.account = unit, services, account
        self.handlers: dict[str, Handler] = {}
        self.on_cancel: Callable[[Act, bool, int], bool] = lambda _act, _of_others, _now_us: False
        self.on_lost: Callable[[Act, int], None] = lambda _act, _now_us: None
        self._emit, self._limits, self._trust, self._offset_us_of = emit, limits, trust, offset_us_of
        self._now_us = 0
        self.conversations = Conversations(unit, boot, self._leaving)
        self._waiting: dict[str, _Waiting] = {}
        self._local: dict[str, Callable[[Act], None]] = {}

    # -- out ---------------------------------------------------------------------------------------------------

    def _leaving(self, act: Act) -> bytes:
        """Every act that leaves is encoded here once, and so enters the account."""
        payload = encode_act(act, None if self._trust is None else self._trust.signer)
        self.account.enter(self._now_us, "out", act.receiver.unit, act, "sent")
        return payload

    def delegate(
        self,
        unit: str,
        content: Content,
        now_us: int,
        *,
        performative: Performative = P.REQUEST,
        on_reply: OnReply | None = None,
        on_silence: OnSilence | None = None,
        reply_within_us: int = 2_000_000,
    ) -> str:
        """Say something to the Interface Agent of `unit`; returns the conversation.

        `on_reply` is told each answer, `on_silence` that none came (or that too many conversations are open).
        """
        self._now_us = now_us
        act = Act(
            performative,
            AgentName(INTERFACE, self.unit),
            AgentName(INTERFACE, unit),
            content.expr(),
            conversation_id=self.conversations.new_conversation(),
            reply_by_us=now_us + reply_within_us,
            ontology=ONTOLOGY,
        )
        conversation = act.conversation_id or ""
        is_paged = isinstance(content, Query) and content.op == "between"
        self._waiting[conversation] = _Waiting(unit, on_reply, on_silence, is_paged)
        try:
            _, outcomes = self.conversations.send(act, now_us, standing=is_paged or content.head in LASTING)
        except Refused as refused:
            del self._waiting[conversation]
            if on_silence is not None:
                on_silence(refused.reason, now_us)
            return conversation
        self._handle(outcomes, now_us)
        return conversation

    def tell(self, unit: str, content: Content, now_us: int, *, conversation: str | None = None) -> None:
        """Inform the Interface Agent of `unit`; no answer is expected."""
        self._now_us = now_us
        act = Act(
            P.INFORM,
            AgentName(INTERFACE, self.unit),
            AgentName(INTERFACE, unit),
            content.expr(),
            conversation_id=conversation,
            ontology=ONTOLOGY,
        )
        self._handle(self.conversations.send(act, now_us)[1], now_us)

    def answer(self, act: Act, performative: Performative, content: Content | None, now_us: int) -> None:
        """Answer an act that came in, in its conversation."""
        self._now_us = now_us
        expr = None if content is None else content.expr()
        if act.sender.unit == self.unit:
            on_answer = self._local.get(act.conversation_id or "")
            if on_answer is not None:
                on_answer(self.conversations.answering(act, performative, expr))
            return
        standing = performative is P.AGREE and act.content is not None and act.content.head in LASTING
        self._handle(self.conversations.answer(act, performative, expr, now_us, standing=standing), now_us)

    def end(self, conversation: str, unit: str, reason: str, now_us: int) -> None:
        """Tell `unit` that what it asked for in `conversation` has ended here, if it still stands."""
        for found in self.conversations.conversations():
            if not found.ours and found.peer == unit and found.opening.conversation_id == conversation:
                self.answer(found.opening, P.FAILURE, Reason(text=reason), now_us)

    def cancel(self, unit: str, conversation: str, now_us: int) -> None:
        """End what was asked of `unit` in `conversation`."""
        self._now_us = now_us
        self._handle(self.conversations.cancel(conversation, unit, now_us), now_us)

    # -- in ----------------------------------------------------------------------------------------------------

    def on_arrived(self, event: Arrived, key: keys.ActKey) -> None:
        """Bytes on an act key addressed to us."""
        self._now_us = event.at_us
        try:
            if key.agent == RECEIPT_AGENT:
                self.conversations.on_receipt(key.sender, decode_receipt(event.payload))
                return
            act, signature, body = decode_act(event.payload)
        except DecodeError as wrong:
            self.account.enter(event.at_us, "in", key.sender, None, wrong.reason)
            return
        if act.key != event.key or act.sender.unit == self.unit:
            self.account.enter(event.at_us, "in", key.sender, act, "sender and key differ")
            return
        if self._trust is not None:
            offset_us = self._offset_us_of(act.sender.unit)
            reason = self._trust.verifier.check(act, signature, body, event.at_us, offset_us=offset_us)
            if reason is not None:
                self.account.enter(event.at_us, "in", key.sender, act, reason)
                if reason == "replayed":
                    self.conversations.delivery.on_act(act)
                return
        self.on_act(act, event.at_us)

    def on_act(self, act: Act, now_us: int) -> None:
        """An act whose sender is who it says."""
        before = self.conversations.delivery.counts["received"]
        outcomes = self.conversations.on_act(act, now_us)
        if not any(isinstance(outcome, Incoming) for outcome in outcomes):
            is_new = self.conversations.delivery.counts["received"] > before
            self.account.enter(now_us, "in", act.sender.unit, act, _unheard(act, outcomes) if is_new else "duplicate")
        self._handle(outcomes, now_us)

    def ask_locally(
        self, agent: str, content: Content, now_us: int, on_answer: Callable[[Act], None], *, by: str = INTERFACE
    ) -> None:
        """An agent of this platform asks another: nothing leaves, so nothing is accounted for."""
        conversation = self.conversations.new_conversation()
        act = Act(
            P.REQUEST,
            AgentName(by, self.unit),
            AgentName(agent, self.unit),
            content.expr(),
            conversation_id=conversation,
        )
        self._local[conversation] = on_answer
        self._incoming(act, now_us)
        del self._local[conversation]

    def _handle(self, outcomes: list[Outcome], now_us: int) -> None:
        for outcome in outcomes:
            if isinstance(outcome, Put):
                self._emit(outcome)
            elif isinstance(outcome, Incoming):
                self._incoming(outcome.act, now_us)
            elif isinstance(outcome, Reply):
                self._replied(outcome, now_us)
            elif isinstance(outcome, TimedOut):
                self._silent(outcome.conversation, outcome.why, now_us)
            elif isinstance(outcome, Undelivered):
                self.account.enter(now_us, "out", outcome.act.receiver.unit, outcome.act, "undelivered")
            elif outcome.ours:
                self._silent(outcome.conversation, f"{outcome.peer} is gone", now_us)
            else:
                self.on_lost(outcome.opening, now_us)

    def _replied(self, reply: Reply, now_us: int) -> None:
        waiting = self._waiting.get(reply.conversation)
        try:
            content = None if reply.act.content is None else read(reply.act.content)
        except ContentError:
            content = None
        is_last = reply.closed
        if waiting is not None and waiting.is_paged and not getattr(content, "more", False):
            self.conversations.close(reply.conversation, waiting.unit)
            is_last = True
        if is_last:
            self._waiting.pop(reply.conversation, None)
        if waiting is not None and waiting.on_reply is not None:
            waiting.on_reply(reply.act, content, now_us)

    def _silent(self, conversation: str, why: str, now_us: int) -> None:
        waiting = self._waiting.pop(conversation, None)
        if waiting is not None and waiting.on_silence is not None:
            waiting.on_silence(why, now_us)

    def _incoming(self, act: Act, now_us: int) -> None:
        """Admit one act and pass it on; whatever becomes of it is noted."""
        if act.sender.unit == self.unit:
            self._consider(act, now_us)
            return
        with self.account.on_arrival(now_us, act) as comes_to:
            comes_to(self._consider(act, now_us))

    def _consider(self, act: Act, now_us: int) -> str:
        """Do what the act asks for, or say why not; returns what came of it, in words."""
        try:
            self._admit(act, now_us)
        except ContentError as wrong:
            self._say(act, P.NOT_UNDERSTOOD, str(wrong), now_us)
            return f"not understood: {wrong}"
        except ValueNotAvailable as wrong:
            self._say(act, P.FAILURE, str(wrong), now_us)
        except DyknowError as wrong:
            self._say(act, P.REFUSE, str(wrong), now_us)
            return f"{wrong.kind if isinstance(wrong, Denied) else 'refused'}: {wrong}"
        return "accepted"

    def _say(self, act: Act, performative: Performative, reason: str, now_us: int) -> None:
        """Tell why not. Only what wants an answer gets one: no not-understood answers another."""
        if act.performative in OPENING or act.performative is P.CANCEL:
            self.answer(replace(act, reply_to=None), performative, Reason(text=reason[:1000]), now_us)

    def _admit(self, act: Act, now_us: int) -> None:
        """Through the door, or not.

        Raises:
            Denied, ContentError, and what the agent that it is for raises.
        """
        is_own = act.sender.unit == self.unit
        if not is_own and not self._limits.admit(act.sender.unit, now_us):
            raise Denied("too many acts", f"too many acts from {act.sender.unit}; ask more slowly")
        if act.reply_to is not None and act.reply_to.unit != act.sender.unit:
            raise Denied("reply to another", f"answers go to {act.sender.unit}, who asks, and to nobody else")
        if act.performative is P.CANCEL:
            self._cancelled(act, now_us)
            return
        if act.content is None:
            raise ContentError("an act without content says nothing")
        content = read(act.content)
        self._check_door(act, self.services.of(content.head, act.performative), is_own=is_own)
        if not is_own:
            self._check_role(act.sender.unit, content.head)
        self.handlers[content.head](act, content, now_us)

    def _check_door(self, act: Act, service: Service, *, is_own: bool) -> None:
        """The rules of thesis 9.3.2: whether an agent of that platform reaches the service in that way."""
        through_interface = act.receiver.agent == INTERFACE
        if not through_interface and act.receiver.agent != service.agent:
            raise ContentError(f"{act.receiver.agent} does not understand this: ask {service.agent}")
        if not admitted(service.visibility, same_platform=is_own, through_interface=through_interface):
            remedy = f"; ask {INTERFACE}@{self.unit}" if service.visibility is Visibility.PROTECTED else ""
            raise Denied(service.visibility, f"{service.service} is {service.visibility} on {self.unit}{remedy}")

    def _check_role(self, unit: str, head: str) -> None:
        role = self._role_of(unit)
        if head in COMMANDS and role != "command-centre":
            raise Denied("role", f"only a command centre may ask for ({head} ...)")
        if head in LASTING and role == "observer":
            raise Denied("role", f"an observer may ask and subscribe, but not for ({head} ...)")

    def _role_of(self, unit: str) -> Role:
        """What the roster makes of a unit; without one, everybody may command."""
        if self._trust is None:
            return "command-centre"
        member = self._trust.roster.member(unit)
        return "observer" if member is None else member.role

    def _cancelled(self, act: Act, now_us: int) -> None:
        if self.on_cancel(act, self._role_of(act.sender.unit) == "command-centre", now_us):
            self.answer(act, P.INFORM, Done(), now_us)
        else:
            self.answer(act, P.FAILURE, Reason(text=f"no task {act.conversation_id} on this platform"), now_us)

    # -- peers and time ----------------------------------------------------------------------------------------

    def peer_gone(self, unit: str, now_us: int) -> None:
        self._now_us = now_us
        self._handle(self.conversations.peer_gone(unit), now_us)

    def peer_appeared(self, unit: str, boot: int, now_us: int) -> None:
        self._now_us = now_us
        self._handle(self.conversations.peer_appeared(unit, boot, now_us), now_us)

    @property
    def deadline_us(self) -> int | None:
        return self.conversations.deadline_us

    def on_time(self, now_us: int) -> None:
        self._now_us = now_us
        self._handle(self.conversations.on_time(now_us), now_us)

    def flush(self) -> None:
        """Acknowledge what no act of this step did."""
        for put in self.conversations.flush():
            self._emit(put)


def _unheard(act: Act, outcomes: list[Outcome]) -> str:
    """What became of a new act that no agent is told of as a request."""
    if any(isinstance(outcome, Reply) for outcome in outcomes):
        return "accepted"
    return "conversation refused" if act.performative in OPENING or act.performative is P.CANCEL else "late"
