"""Proposals to lead missions: a call is answered with the completed plan, its cost and duration, or refused (FIPA SC00029).

Nothing is flown before the proposal is taken, which is the consent to its plan. A proposal stands until it is taken, left, or
ten minutes old. Times are the node clock.
"""

from dataclasses import dataclass
from typing import Final

from dyknow.agents.actions import COORDINATION, Action, Offer
from dyknow.agents.capabilities.missions.leading import LONGEST_SEARCH_US, MissionLeading
from dyknow.agents.capabilities.missions.mission_texts import MissionTexts, texts_of
from dyknow.agents.effects import SearchOver
from dyknow.agents.part import Part
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.federation.members.deadlines import Deadlines
from dyknow.federation.messages.acts import Act, Performative
from dyknow.federation.messages.contents import (
    CallForMission,
    LeaveMission,
    MissionProposal,
    Progress,
    Reason,
    TakeMission,
)
from dyknow.model.errors import DyknowError, Refused
from dyknow.planning.search.plans import MissionPlan, plan_of

P = Performative
STAND_US: Final = 600_000_000
MOST: Final = 8
"""Calls that are answered, and proposals that stand, at once."""


@dataclass(slots=True)
class _Called:
    """A call, what it is about, and the plan once there is one."""

    act: Act
    content: CallForMission
    texts: MissionTexts
    plan: MissionPlan | None = None


class MissionProposals(Part):
    """See the module."""

    offers = (
        Offer(
            COORDINATION,
            (
                Action(CallForMission, "on_call", frozenset({P.CFP})),
                Action(TakeMission, "on_taken", frozenset({P.ACCEPT_PROPOSAL})),
                Action(LeaveMission, "on_left", frozenset({P.REJECT_PROPOSAL})),
            ),
        ),
    )
    answers = (MissionProposal,)

    def __init__(self, ports: Ports, parts: PartRegistry) -> None:
        self._agent, self._leading = ports.agent, parts[MissionLeading]
        self._called: dict[tuple[str, str], _Called] = {}
        self._due: Deadlines[tuple[str, str]] = Deadlines()

    def on_call(self, act: Act, content: CallForMission, now_us: int) -> None:
        """`(call-for-mission ...)`: search, then propose or refuse.

        Raises:
            Refused: as `(fly-mission ...)` is, or too many proposals stand.
        """
        if len(self._called) >= MOST:
            raise Refused(f"{MOST} proposals stand: leave some", "busy")

        def on_read(texts: MissionTexts, at_us: int) -> None:
            self._search(act, content, texts, at_us)

        self._leading.read(act, content, on_read, now_us)

    def _search(self, act: Act, content: CallForMission, texts: MissionTexts, now_us: int) -> None:
        name = (act.sender.unit, act.conversation_id or "")
        called = self._called[name] = _Called(act, content, texts)
        self._due.set(name, now_us + STAND_US)

        def on_over(event: SearchOver, at_us: int) -> None:
            self._searched(name, called, event, at_us)

        limit_us = min(round(content.timeout_s * 1e6), LONGEST_SEARCH_US)
        domain, problem = texts_of(texts.domain, self._leading.problem_now(texts, now_us))
        self._leading.searches.plan(self, (domain, problem), None, limit_us, on_over)

    def _searched(self, name: tuple[str, str], called: _Called, event: SearchOver, now_us: int) -> None:
        if self._called.get(name) is not called:
            return
        if event.plan is None:
            self._forget(name)
            self._agent.answer(
                called.act, P.REFUSE, Reason(text=f"no plan: {event.reason}"[:1000], code="no-plan"), now_us
            )
            return
        plan = called.plan = plan_of(event.plan, (*called.texts.domain.operators, *called.texts.problem.operators))
        proposal = MissionProposal(
            cost=max(0.0, plan.cost),
            duration_s=plan.end_ms / 1000,
            actions=tuple(f"{one.start_ms / 1000:.1f} s  {one.shown}"[:1024] for one in plan.actions[:256]),
            unreached=tuple(name[:64] for name in plan.unreached[:64]),
        )
        self._agent.answer(called.act, P.PROPOSE, proposal, now_us)

    def on_taken(self, act: Act, _content: TakeMission, now_us: int) -> None:
        """`(take-mission)`: fly the plan that was proposed; a proposal that does not stand fails."""
        called = self._forget((act.sender.unit, act.conversation_id or ""))
        if called is None or called.plan is None:
            self._agent.answer(act, P.FAILURE, Reason(text="no proposal stands in this conversation"), now_us)
            return
        try:
            self._leading.check(called.act, called.content, now_us)  # the permit may have ended since
            self._leading.lead(called.act, called.content, called.texts, called.plan, now_us)
        except DyknowError as wrong:
            self._agent.answer(called.act, P.FAILURE, Reason(text=str(wrong)[:1000]), now_us)
            return
        self._agent.acts.answer(called.act, P.INFORM, Progress(step="taken: the plan is flown"), now_us, standing=True)

    def on_left(self, act: Act, _content: LeaveMission, _now_us: int) -> None:
        """`(leave-mission ...)`: the proposal of this conversation stands no longer."""
        self._forget((act.sender.unit, act.conversation_id or ""))

    def on_cancel(self, act: Act, now_us: int) -> bool:  # noqa: ARG002  (as every part)
        """The call is over before the proposal was decided on."""
        return self._forget((act.sender.unit, act.conversation_id or "")) is not None

    def on_lost(self, act: Act, now_us: int) -> bool:  # noqa: ARG002  (as every part)
        """The caller is gone."""
        return self._forget((act.sender.unit, act.conversation_id or "")) is not None

    @property
    def deadline_us(self) -> int | None:
        return self._due.next_us

    def on_time(self, now_us: int) -> None:
        """Proposals that are too old stand no longer."""
        for name in self._due.pop_due(now_us):
            called = self._called.pop(name, None)
            if called is not None:
                self._agent.end(name[1], name[0], "the proposal was not decided on in time", now_us)

    def _forget(self, name: tuple[str, str]) -> _Called | None:
        if name in self._called:
            self._due.set(name, None)
        return self._called.pop(name, None)
