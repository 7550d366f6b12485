"""A mission whose leader is gone: the first of the platforms that take part leads the rest of it (thesis 9.4).

The leader informs them of the mission, and of the state that it holds for true whenever a step of the plan begins or ends:
`(keep-mission ...)`. From another platform than the leader of its vehicle's mission that counts for nothing. The successor
plans again from that state and its own percepts, without the vehicle that is gone; it names goals that it cannot reach.
A leader that is back in the same life leads again. Times are the node clock.
"""

from dataclasses import dataclass, field
from typing import Final

from dyknow.agents.actions import COORDINATION, INFORMED, Action, Offer
from dyknow.agents.capabilities.missions.leading import MissionLeading
from dyknow.agents.capabilities.missions.led_mission import LedMission, MissionOrder
from dyknow.agents.capabilities.missions.mission_texts import MissionTexts, texts_of
from dyknow.agents.capabilities.missions.performing import Performing
from dyknow.agents.part import Part, PeerChange
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.agents.tasks.authority import Authority
from dyknow.federation.members.directory import unit_order
from dyknow.federation.members.liveness import PlatformAppeared, PlatformGone
from dyknow.federation.messages.acts import Act, AgentName, Performative
from dyknow.federation.messages.contents import FlyMission, KeepMission, Reason
from dyknow.model.errors import Refused

PERIOD_US: Final = 1_000_000
AFTER_US: Final = 1_500_000
"""A leader that is gone for so long is succeeded; by each next platform so much later."""


@dataclass(slots=True)
class _Informed:
    """At which steps of the plan each platform was informed of one mission that this one leads."""

    steps: dict[str, object] = field(default_factory=dict)


@dataclass(slots=True)
class _Kept:
    """A mission that this platform would lead.

    Attributes:
        boot: the life of its leader.
        due_us: when it leads it; None: the leader is there.
        leads: it does.
    """

    content: KeepMission
    leader: str
    boot: int
    due_us: int | None = None
    leads: bool = False


class MissionSuccession(Part):
    """See the module."""

    offers = (Offer(COORDINATION, (Action(KeepMission, "on_keep", INFORMED),)),)

    def __init__(self, ports: Ports, parts: PartRegistry) -> None:
        self._unit, self._agent, self._directory = ports.unit, ports.agent, ports.directory
        self._performing, self._leading, self._note = parts[Performing], parts[MissionLeading], ports.note
        self._informed: dict[str, _Informed] = {}
        self._kept: _Kept | None = None
        self._due_us = 0
        parts[Authority].on_over.append(self._on_over)

    def _on_over(self, mission: str, _now_us: int) -> None:
        if self._kept is not None and self._kept.content.mission == mission:
            self._kept = None

    # -- as the leader -----------------------------------------------------------------------------------------

    def _tell(self, name: str, led: LedMission, now_us: int) -> None:
        others = {
            each for each in led.texts.platforms.values() if each != self._unit and self._directory.is_present(each)
        }
        if not others or led.mission is None:
            return
        steps = led.mission.status.replans, tuple(phase for _, _, _, phase, _ in led.mission.status.steps)
        informed = self._informed.setdefault(name, _Informed())
        late = [each for each in sorted(others, key=unit_order) if informed.steps.get(each) != steps]
        left = led.left(now_us) if late else None
        if left is None:
            return
        domain, problem = texts_of(led.texts.domain, left)
        for unit in late:
            content = KeepMission(
                mission=name, delegator=led.order.act.sender.unit, conversation=led.order.conversation, problem=problem,
                domain="" if unit in informed.steps else domain, platforms=dict(led.texts.platforms),
                chain=led.order.chain, timeout_s=led.order.timeout_us / 1e6,
            )  # fmt: skip
            self._agent.tell(unit, content, now_us)
            informed.steps[unit] = steps

    # -- as its successor --------------------------------------------------------------------------------------

    def on_keep(self, act: Act, content: KeepMission, _now_us: int) -> None:
        """`(keep-mission ...)` of the platform that leads the mission of this vehicle."""
        sender, kept = act.sender.unit, self._kept
        if (self._performing.mission, self._performing.leader) != (content.mission, sender):
            return
        if kept is not None and kept.content.mission == content.mission and not content.domain:
            content = content.model_copy(update={"domain": kept.content.domain})
        if content.domain:
            self._kept = _Kept(content, sender, act.boot)

    def on_peer(self, change: PeerChange, now_us: int) -> None:
        """A leader is gone, or is back."""
        for informed in self._informed.values():
            if isinstance(change, PlatformGone | PlatformAppeared):
                informed.steps.pop(change.unit, None)
        kept = self._kept
        if kept is None:
            return
        if isinstance(change, PlatformGone) and change.unit == kept.leader and not kept.leads:
            others = [
                each for each in dict.fromkeys(kept.content.platforms.values()) if self._directory.is_present(each)
            ]
            before = [
                each
                for each in others
                if each not in {self._unit, kept.leader} and unit_order(each) < unit_order(self._unit)
            ]
            kept.due_us = now_us + AFTER_US * (1 + len(before))
        elif isinstance(change, PlatformAppeared) and change.unit == kept.leader and change.boot == kept.boot:
            kept.due_us = None
            led = self._leading.led.get(kept.content.mission)
            if kept.leads and led is not None:
                self._kept, led.is_passed_on = None, True
                led.end(f"platform {kept.leader} is back, and leads it", now_us)

    def _take_over(self, kept: _Kept, now_us: int) -> None:
        content, why = kept.content, f"its leader, platform {kept.leader}, is gone"
        is_led = self._performing.mission == content.mission
        if not is_led and self._performing.permits.turn(content.mission, now_us):
            kept.due_us = now_us + AFTER_US
            return
        kept.due_us = None
        mission = self._performing.mission
        if mission == content.mission and self._performing.leader != kept.leader:
            kept.leader, kept.boot = self._performing.leader, self._performing.leader_boot
            return
        if mission:
            self._note(
                f"mission {content.mission}: {why}; this vehicle takes part in mission {mission} of {self._performing.leader}"
            )
            self._kept = None
            return
        act = Act(
            Performative.REQUEST, AgentName("interface", content.delegator), AgentName("interface", self._unit),
            conversation_id=content.conversation,
        )  # fmt: skip
        chain = (*content.chain, kept.leader)[-4:]
        order = MissionOrder(
            content.mission, act, content.conversation, chain, round(content.timeout_s * 1e6), continues=why
        )
        fly = FlyMission(
            mission=content.mission, domain=content.domain, problem=content.problem, platforms=content.platforms,
            timeout_s=content.timeout_s,
        )  # fmt: skip

        def on_read(texts: MissionTexts | Reason, at_us: int) -> None:
            if self._kept is kept:
                self._lead(kept, order, texts, at_us)

        self._leading.searches.read(kept, fly, on_read)

    def _lead(self, kept: _Kept, order: MissionOrder, texts: MissionTexts | Reason, now_us: int) -> None:
        """Lead it, if its texts can be read and this platform may."""
        why = texts.text if isinstance(texts, Reason) else self._refusal(order, texts, now_us)
        if why:
            self._note(f"mission {order.name}: {order.continues}; this platform cannot lead it: {why}")
            self._kept = None
            return
        kept.leads = True
        self._leading.report(
            self._leading.led[order.name], "leads", f"platform {self._unit}: {order.continues}", now_us
        )

    def _refusal(self, order: MissionOrder, texts: MissionTexts, now_us: int) -> str:
        """Why this platform does not lead it; empty: it does."""
        try:
            self._leading.succeed(order, texts, now_us)
        except Refused as refused:
            return refused.reason
        return ""

    # -- time --------------------------------------------------------------------------------------------------

    @property
    def deadline_us(self) -> int | None:
        due_us = self._due_us if self._leading.led else None
        kept_us = None if self._kept is None else self._kept.due_us
        return min((each for each in (due_us, kept_us) if each is not None), default=None)

    def on_time(self, now_us: int) -> None:
        """Inform the others of changes; take over from a leader that is gone."""
        kept = self._kept
        if kept is not None and kept.due_us is not None and now_us >= kept.due_us:
            self._take_over(kept, now_us)
        if now_us < self._due_us:
            return
        self._due_us = now_us + PERIOD_US
        for name in self._informed.keys() - self._leading.led.keys():
            del self._informed[name]
        for name, led in self._leading.led.items():
            self._tell(name, led, now_us)
