"""The Interface Agent: every act enters and leaves a platform here (thesis 9.3.2).

It holds the platform's membership in the federation and speaks for the other agents: every act that leaves or arrives
is entered into the audit log. Which requests are let in, `dyknow.agents.admission.admission` decides. Times are the
node clock.
"""

from collections.abc import Callable, Sequence
from typing import TypeVar

from dyknow.agents.audit_log import AuditLog
from dyknow.agents.containment import Containment, place_of
from dyknow.agents.part import ClockCompared, PeerChange
from dyknow.federation.members.correspondence import OnSilence
from dyknow.federation.members.directory import DirectoryEvent
from dyknow.federation.members.member import Member, MemberAgents
from dyknow.federation.messages.acts import Act, Performative
from dyknow.federation.messages.contents import Content, Done, Reason, is_lasting
from dyknow.model.errors import Refused

P = Performative
T = TypeVar("T")
OnReply = Callable[[Act, Content | None, int], None]


class InterfaceAgent:
    """See the module.

    Args:
        make_member: makes the member from the callbacks that receive its events.
        audit_log: takes every act that passes.
        on_peer: called with every change of a peer.
        contain: contains errors of the callback that takes an answer.

    Attributes:
        member: membership in the federation: directory, clock offsets, imported streams, acts.
        requests: acts that arrived and were not admitted yet.
        lost: the opening acts of conversations whose initiators are gone.
    """

    def __init__(
        self,
        make_member: Callable[[MemberAgents], Member],
        audit_log: AuditLog,
        on_peer: Callable[[PeerChange, int], None],
        contain: Containment,
    ) -> None:
        self.member, self._contain = make_member(self), contain
        self.unit, self.audit_log, self._publish = self.member.unit, audit_log, on_peer
        self.acts = self.member.acts
        self.conversations = self.acts.conversations
        self.requests: list[Act] = []
        self.lost: list[Act] = []

    # -- out ---------------------------------------------------------------------------------------------------

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
        evidence: bytes = b"",
    ) -> str:
        """Ask the Interface Agent of `unit` for something; returns the conversation.

        `on_reply` takes each answer, `on_silence` why none came (or that too many conversations are open). If one of
        them raises, the conversation ends: for `on_silence`, as if no further answer came.

        `evidence` is the act that delegated the task that it is for.
        """

        def on_answer(act: Act, answer: Content | None, _is_last: bool, at_us: int) -> None:
            if on_reply is None:
                return
            try:
                on_reply(act, answer, at_us)
            except Exception as error:  # noqa: BLE001  (contained)
                self._contain.caught(place_of(on_reply), error, act.sender.unit, by_act=True)
                self.acts.give_up(unit, conversation, at_us)
                on_no_answer(f"what {unit} answered could not be taken", at_us)

        def on_no_answer(why: str, at_us: int) -> None:
            if on_silence is not None:
                self._contain.call(on_silence, why, at_us, otherwise=None)

        conversation = self.conversations.new_conversation(unit)
        try:
            self.acts.ask(
                unit,
                content,
                now_us,
                performative=performative,
                on_reply=on_answer,
                on_silence=on_no_answer,
                within_us=reply_within_us,
                standing=content.lasting,
                conversation=conversation,
                evidence=evidence,
            )
        except Refused as refused:
            on_no_answer(refused.reason, now_us)
        return conversation

    def tell(
        self, unit: str, content: Content, now_us: int, *, conversation: str | None = None, evidence: bytes = b""
    ) -> None:
        """Inform the Interface Agent of `unit`; no answer is expected. `evidence`: the act that delegated the task."""
        self.acts.tell(unit, content, now_us, conversation=conversation, evidence=evidence)

    def answer(self, act: Act, performative: Performative, content: Content | None, now_us: int) -> None:
        """Answer an act that came in, in its conversation."""
        if act.sender.unit == self.unit:
            return
        standing = performative is P.AGREE and act.content is not None and is_lasting(act.content.head)
        self.acts.answer(act, performative, content, now_us, standing=standing)

    def answer_pages(
        self,
        act: Act,
        entries: Sequence[T],
        size: int,
        content: Callable[[tuple[T, ...], bool], Content],
        now_us: int,
    ) -> None:
        """Answer `act` with `size` entries a page; `content` makes an answer of a page and whether there are more."""
        for at in range(0, max(1, len(entries)), size):
            page = content(tuple(entries[at : at + size]), at + size < len(entries))
            self.answer(act, P.INFORM, page, now_us)

    def done(self, act: Act, now_us: int, text: str | None = None) -> None:
        """Agree to an act that came in, and inform that it is done."""
        self.answer(act, P.AGREE, None, now_us)
        self.answer(act, P.INFORM, Done(text=text), now_us)

    def end(self, conversation: str, unit: str, reason: str, now_us: int) -> None:
        """Notify `unit` that what it asked for in `conversation` has ended here, if it still stands."""
        for each in self.conversations.conversations():
            if not each.ours and each.peer == unit and each.opening.conversation_id == conversation:
                self.answer(each.opening, P.FAILURE, Reason(text=reason), now_us)

    def cancel(self, unit: str, conversation: str, now_us: int) -> None:
        """End our request to `unit` in `conversation`."""
        self.acts.cancel(unit, conversation, now_us)

    # -- in ----------------------------------------------------------------------------------------------------

    def on_peer(self, change: DirectoryEvent, now_us: int) -> None:
        self._publish(change, now_us)

    def on_clock(self, unit: str, now_us: int) -> None:
        self._publish(ClockCompared(unit), now_us)

    def on_request(self, act: Act, _now_us: int) -> None:
        self.requests.append(act)

    def on_lost(self, opening: Act, _now_us: int) -> None:
        self.lost.append(opening)
