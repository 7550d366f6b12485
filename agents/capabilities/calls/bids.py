"""Proposals for the calls of others: a label that is offered at a cost is proposed once in each call (FIPA SC00029).

A proposal stands until it is taken, left, or ten minutes old; a stream begins when its proposal is taken, and lasts as one
that was requested does. Times are the node clock.
"""

from dataclasses import dataclass
from typing import Final, NamedTuple

from dyknow.agents.actions import FEDERATION, Action, Offer
from dyknow.agents.exchange.federation_agent import FederationAgent
from dyknow.agents.exchange.label_agreements import LabelAgreements
from dyknow.agents.part import Part, PeerChange
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.agents.shedding import Shedding
from dyknow.agents.tasks.life import TaskLife
from dyknow.federation.members.deadlines import Deadlines
from dyknow.federation.members.offers import LabelGone
from dyknow.federation.messages.acts import Act, Performative
from dyknow.federation.messages.contents import (
    CallForStream,
    CreateMulticast,
    Done,
    LeaveProposal,
    Reason,
    StreamProposal,
    TakeProposal,
)
from dyknow.model.errors import DyknowError, Refused

P = Performative
STAND_US: Final = 600_000_000
OF_ONE, OF_A_CENTRE, OF_ALL = 16, 64, 256
"""Proposals that stand at once for a member, for a command centre with all its commands, and in all."""
CALLS: Final = 4096
"""Calls by which a second one for the same is known."""
TASK: Final = CallForStream.head
"""The name of a taken proposal's stream among the tasks."""


class _Named(NamedTuple):
    """A conversation with a caller."""

    unit: str
    conversation: str


@dataclass(frozen=True, slots=True)
class _Standing:
    call: Act
    content: CallForStream


class Bids(Part):
    """See the module.

    Args:
        federation: exports what was taken.
        agreements: the offers here, and to whom.
        shedding: a platform that has too much to do proposes nothing.
    """

    offers = (
        Offer(
            FEDERATION,
            (
                Action(CallForStream, "on_call", frozenset({P.CFP})),
                Action(TakeProposal, "on_taken", frozenset({P.ACCEPT_PROPOSAL})),
                Action(LeaveProposal, "on_left", frozenset({P.REJECT_PROPOSAL})),
            ),
        ),
    )
    answers = (StreamProposal,)

    def __init__(self, ports: Ports, parts: PartRegistry) -> None:
        self._tasks = parts[TaskLife]
        self._agent, self._federation, self._agreements = ports.agent, parts[FederationAgent], parts[LabelAgreements]
        self._shedding = parts[Shedding]
        self._standing: dict[_Named, _Standing] = {}
        self._due: Deadlines[_Named] = Deadlines()
        self._calls: dict[tuple[str, str], None] = {}

    def on_call(self, act: Act, content: CallForStream, now_us: int) -> None:
        """`(call-for-stream ...)`: propose what is offered, or refuse.

        Raises:
            Refused: `no-offer`, `proposed-already`, `busy`, or the caller may not have it.
        """
        caller, label = act.sender.unit, content.semantic_label
        offer = self._agreements.offer_of(label)
        if offer is None:
            raise Refused(f"{label} is not offered here", "no-offer")
        self._agreements.check(caller, label)
        if (caller, content.call) in self._calls:
            raise Refused(f"a proposal was made for this call: {content.call}", "proposed-already")
        if self._shedding.level:
            raise Refused("this platform has too much to do", "busy")
        share_of = self._agent.acts.share_of
        owner, shares = share_of(caller)
        of_one, most = (
            sum(share_of(name.unit).owner == owner for name in self._standing),
            min(OF_ONE * shares, OF_A_CENTRE),
        )
        if len(self._standing) >= OF_ALL or of_one >= most:
            raise Refused(f"{most} proposals stand for {owner}, or {OF_ALL} in all: leave some", "busy")
        name = _Named(caller, act.conversation_id or "")
        self._calls[caller, content.call] = None
        while len(self._calls) > CALLS:
            del self._calls[next(iter(self._calls))]
        self._standing[name] = _Standing(act, content)
        self._due.set(name, now_us + STAND_US)
        proposal = StreamProposal(
            semantic_label=label,
            cost=offer.cost,
            sample_period_s=(offer.period_us or content.sample_us) / 1e6,
            delay_s=offer.delay_us / 1e6,
            certainty=offer.certainty,
        )
        self._agent.answer(act, P.PROPOSE, proposal, now_us)

    def on_taken(self, act: Act, _content: TakeProposal, now_us: int) -> None:
        """`(take-proposal)`: stream from now on; a proposal that does not stand, or not for this caller, fails."""
        standing = self._forget(act)
        if standing is None:
            self._agent.answer(act, P.FAILURE, Reason(text="no proposal stands in this conversation"), now_us)
            return
        wanted = standing.content
        multicast = CreateMulticast(
            semantic_labels=(wanted.semantic_label,),
            sample_period_s=wanted.sample_period_s,
            delay_s=wanted.delay_s,
            to_units=(act.sender.unit,),
        )
        try:
            self._federation.set_up(act, multicast, TASK, now_us)
        except DyknowError as wrong:
            self._agent.answer(standing.call, P.FAILURE, Reason(text=str(wrong)), now_us)
            return
        self._agent.acts.answer(act, P.INFORM, Done(), now_us, standing=True)

    def on_left(self, act: Act, _content: LeaveProposal, _now_us: int) -> None:
        """`(leave-proposal ...)`: the proposal of this conversation stands no longer."""
        self._forget(act)

    def on_cancel(self, act: Act, now_us: int) -> bool:  # noqa: ARG002  (as every part)
        """The call is over before the proposal was decided on."""
        return self._forget(act) is not None

    def on_lost(self, act: Act, now_us: int) -> bool:  # noqa: ARG002  (as every part)
        """The caller is gone."""
        return self._forget(act) is not None

    def on_peer(self, change: PeerChange, now_us: int) -> None:
        """End the streams of offers that are withdrawn here; their callers are notified."""
        if not isinstance(change, LabelGone) or change.unit != self._agent.unit:
            return
        label = change.label.label
        if self._agreements.offer_of(label) is not None:
            return
        for name, standing in list(self._standing.items()):
            if standing.content.semantic_label == label:
                self._forget(standing.call)
                self._agent.end(name.conversation, name.unit, f"{label} is offered no longer", now_us)
        for task in self._tasks.all():
            if task.name == TASK and label in task.contracts.values():
                self._agent.end(task.conversation, task.initiator, f"{label} is offered no longer", now_us)
                self._tasks.cancel(task.conversation, now_us)

    @property
    def deadline_us(self) -> int | None:
        return self._due.next_us

    def on_time(self, now_us: int) -> None:
        """Proposals that are too old stand no longer, and their callers are notified."""
        for name in self._due.pop_due(now_us):
            if self._standing.pop(name, None) is not None:
                self._agent.end(name.conversation, name.unit, "the proposal was not decided on in time", now_us)

    def _forget(self, act: Act) -> _Standing | None:
        name = _Named(act.sender.unit, act.conversation_id or "")
        self._due.set(name, None) if name in self._standing else None
        return self._standing.pop(name, None)
