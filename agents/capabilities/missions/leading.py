"""Missions that this platform leads: goals and plans that were delegated to it (thesis 7.2, 9.4).

`(fly-mission ...)` is read, agreed to or refused with a reason, and lasts until it is cancelled or over. The platform's own
vehicle takes part if the problem has it; other platforms are requested to, with the chain of those that have delegated. A plan is
searched for in a process of its own. Progress, questions and the end are reported to the delegator, and listed on request.
"""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Final, Protocol

from dyknow.agents.actions import COORDINATION, QUERIED, Action, Offer, Role
from dyknow.agents.capabilities.missions.led_mission import LedMission, MissionOrder, MissionUnit
from dyknow.agents.capabilities.missions.locating import UnitSights
from dyknow.agents.capabilities.missions.mission_texts import MissionTexts, with_initial
from dyknow.agents.capabilities.missions.mission_units import OtherUnit, OwnUnit
from dyknow.agents.capabilities.missions.performing import Performing
from dyknow.agents.capabilities.missions.searches import MissionSearches
from dyknow.agents.capabilities.missions.sensing import UnitSensors
from dyknow.agents.effects import SearchNews, SearchOver, Tell
from dyknow.agents.exchange.gateway import Gateway
from dyknow.agents.exchange.local_instance import LocalInstance
from dyknow.agents.exchange.subscription_keeper import SubscriptionKeeper
from dyknow.agents.part import Followed, Part
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.agents.tasks.authority import Authority
from dyknow.agents.tasks.life import TaskLife
from dyknow.agents.tasks.task import Task
from dyknow.federation.messages.acts import Act, Performative
from dyknow.federation.messages.contents import (
    AnswerQuestion,
    ControlMission,
    Done,
    FlyMission,
    MissionEntry,
    MissionList,
    MissionQuery,
    Progress,
    Reason,
)
from dyknow.model.errors import Refused
from dyknow.navigation.geodesy import LocalFrame
from dyknow.planning.domains.model import Declarations
from dyknow.planning.execution import events
from dyknow.planning.recovery.options import MissionPhase
from dyknow.planning.search.plans import MissionPlan, plan_of
from dyknow.reasoning.formulas import tree

P = Performative
MOST: Final = 4
"""Missions that one platform leads at once."""
KEPT: Final = 8
"""Missions that are over and still shown."""
LONGEST_SEARCH_US: Final = 120_000_000


class ListedRecovery(Protocol):
    """What else is listed as a mission is, and asks."""

    def entry(self) -> MissionEntry: ...
    def answer(self, number: int, answer: str, by: str, now_us: int, /) -> None: ...


class MissionLeading(Part):
    """See the module.

    Args:
        performing: lends the platform's own vehicle; None: it has none.
        emit: takes searches, and output for followers of this process.

    Attributes:
        listed: recoveries of anchors, by name.
        searches: those of all its missions.
    """

    heeds_samples = True
    offers = (
        Offer(
            COORDINATION,
            (
                Action(FlyMission, "on_fly"),
                Action(ControlMission, "on_control", role=Role.COMMAND_CENTRE),
                Action(AnswerQuestion, "on_answer", role=Role.COMMAND_CENTRE),
                Action(MissionQuery, "on_missions", QUERIED, Role.OBSERVER),
            ),
        ),
    )
    answers = (MissionList,)
    takes = {SearchNews: "on_search_news", SearchOver: "on_search_over"}  # noqa: RUF012  (a declaration)

    def __init__(self, ports: Ports, parts: PartRegistry) -> None:
        self._unit, self._agent, self._clock, self._directory = ports.unit, ports.agent, ports.clock, ports.directory
        self._gateway, self._local, self._keeper = parts[Gateway.of], parts[LocalInstance], parts[SubscriptionKeeper]
        self._performing = parts[Performing]
        self._tasks, self._origin, self._emit, self._note_of = parts[TaskLife], ports.origin, ports.emit, ports.note
        self._authority = parts[Authority]
        parts[Authority].on_over.append(self._on_over)
        self._led: dict[str, LedMission] = {}
        self.listed: dict[str, ListedRecovery] = {}
        self._over: dict[str, LedMission] = {}
        self._reading: dict[tuple[str, str], FlyMission] = {}
        self.searches = MissionSearches(ports.emit)

    # -- delegated ---------------------------------------------------------------------------------------------

    def on_fly(self, act: Act, content: FlyMission, now_us: int) -> None:
        """`(fly-mission ...)`: until it is over or cancelled.

        Raises:
            Refused: the sender may not, or this platform leads enough, or has no origin.
        """
        self._tasks.check_free(act.conversation_id, act.sender.unit)

        def on_read(texts: MissionTexts, at_us: int) -> None:
            self.check(act, content, at_us)
            self._agent.answer(act, P.AGREE, None, at_us)
            self.lead(act, content, texts, None, at_us)

        self.read(act, content, on_read, now_us)

    def read(self, act: Act, content: FlyMission, on_read: Callable[[MissionTexts, int], None], now_us: int) -> None:
        """Have what is delegated read in a worker, if it may be; texts that are wrong are refused.

        Raises:
            Refused: as `on_fly`; `on_read` may do so, too.
        """
        self.check(act, content, now_us)
        owner = self._reading[act.sender.unit, act.conversation_id or ""] = content

        def on_over(texts: MissionTexts | Reason, at_us: int) -> None:
            self._reading.pop((act.sender.unit, act.conversation_id or ""), None)
            if isinstance(texts, Reason):
                self._agent.answer(act, P.REFUSE, texts, at_us)
                return
            try:
                on_read(texts, at_us)
            except Refused as refused:
                self._agent.answer(act, P.REFUSE, Reason(text=refused.reason[:1000], code=refused.code or None), at_us)

        self.searches.read(owner, content, on_over)

    def check(self, act: Act, content: FlyMission, now_us: int) -> None:
        """Raise Refused if the sender may not have that mission flown now, or this platform leads enough, or has no origin."""
        sender = act.sender.unit
        self._performing.permits.check(content.mission, sender, act.boot, now_us)
        self._performing.permits.check_chain(content.chain, sender)
        self._check_free(content.mission)
        if self._origin() is None:
            raise Refused(
                "the home of this platform's vehicle, the origin of places, is not known yet: ask again", "no-origin"
            )

    def _check_free(self, mission: str) -> None:
        begun = {*self._led, *(each.mission for each in self._reading.values())}
        if mission in begun or len(begun) >= MOST:
            raise Refused(f"this platform has mission {mission} already, or {MOST} missions", "busy")

    def problem_now(self, texts: MissionTexts, now_us: int) -> Declarations:
        """The problem with the sensed values of vehicles now, as far as their streams are here."""
        frame = self._origin()
        sensed = {} if frame is None else self._sensors(texts, frame).sample(self.federation_us(now_us))
        return with_initial(texts.problem, sensed)

    def _sensors(self, texts: MissionTexts, frame: LocalFrame) -> UnitSensors:
        return UnitSensors(
            self._unit, frame, texts.platforms, texts.sensors, self._gateway, self._local, self._keeper,
            self._performing.is_airborne,
        )  # fmt: skip

    def lead(self, act: Act, content: FlyMission, texts: MissionTexts, plan: MissionPlan | None, now_us: int) -> None:
        """Begin, with a plan that was consented to, or by searching for one.

        Raises:
            Refused: this platform leads enough by now, or the origin of places is not known.
        """
        self._check_free(content.mission)
        conversation, frame = self._tasks.check_free(act.conversation_id, act.sender.unit), self._origin()
        if frame is None:
            raise Refused("the origin of places is not known", "no-origin")
        timeout_us = min(round(content.timeout_s * 1e6), LONGEST_SEARCH_US)
        chain = content.chain or (act.sender.unit,)
        is_centre = self._authority.is_centre(act.sender.unit)
        permit = None if is_centre else self._performing.permits.of(content.mission, now_us)
        order = MissionOrder(content.mission, act, conversation, chain, timeout_us, plan, permit=permit)
        self._lead(order, texts, frame, now_us)

    @property
    def led(self) -> Mapping[str, LedMission]:
        """The missions that it leads, by name."""
        return self._led

    def succeed(self, order: MissionOrder, texts: MissionTexts, now_us: int) -> None:
        """Lead a mission whose leader is gone.

        Raises:
            Refused: no permit names this platform, by whose word is `order`; it leads enough, or the origin of places is not known.
        """
        self._performing.permits.check_succeeds(order.name, order.act.sender.unit, now_us)
        self._check_free(order.name)
        frame = self._origin()
        if frame is None:
            raise Refused("the origin of places is not known", "no-origin")
        self._tasks.check_free(order.conversation)
        self._lead(order, texts, frame, now_us)
        for one in texts.problem.init:
            if texts.sensors.get(one.target.name) == "attached" and one.value == tree.Const(True):
                self._led[order.name].sensors.take(*(each.name for each in one.target.args))

    def _lead(self, order: MissionOrder, texts: MissionTexts, frame: LocalFrame, now_us: int) -> None:
        """Begin: vehicles are requested to take part, their streams come."""
        units: dict[str, MissionUnit] = {}
        sensors = self._sensors(texts, frame)
        sights = UnitSights(self._unit, frame, texts.platforms, self._gateway, self._local, self._keeper)
        led = self._led[order.name] = LedMission(order, texts, sensors, sights, units, self, now_us)
        for name, platform in texts.platforms.items():
            if platform == self._unit:
                own = units[name] = OwnUnit(self._performing, led.on_performed)
                own.join(order.name, self._unit, now_us)
            else:
                chain = (*order.chain, self._unit)
                shown = self._performing.permits.of(order.name, now_us)
                evidence = b"" if shown is None else shown.payload
                other = units[name] = OtherUnit(platform, self._agent, led.on_performed, order.name, chain, evidence)
                other.join(now_us)
        led.begin(now_us)
        task = Task(
            order.conversation, order.act.sender.unit, FlyMission.head, partial(self._taken_down, order.name),
            since_us=now_us,
        )  # fmt: skip
        self._tasks.add(task)

    def _taken_down(self, name: str, now_us: int) -> tuple[str, ...]:
        led = self._led.get(name)
        if led is not None:
            led.end("it was cancelled", now_us)
        return ()

    def _on_over(self, name: str, now_us: int) -> None:
        """A command centre has ended it at each platform."""
        led = self._led.get(name)
        if led is not None:
            led.end("a command centre ended it", now_us)

    def on_cancel(self, act: Act, now_us: int) -> bool:  # noqa: ARG002  (as every part)
        """Cancel a mission while its texts are read."""
        content = self._reading.pop((act.sender.unit, act.conversation_id or ""), None)
        if content is not None:
            self.searches.end(content)
        return content is not None

    def on_lost(self, act: Act, now_us: int) -> bool:  # noqa: ARG002  (as every part)
        """A delegator that is gone does not end its mission."""
        return any(led.order.act is act for led in self._led.values())

    # -- control and state -------------------------------------------------------------------------------------------

    def on_control(self, act: Act, content: ControlMission, now_us: int) -> None:
        """`(control-mission ...)`: suspend or resume it; raises Refused: another platform has it."""
        led = self._find(content.mission)
        self._agent.done(act, now_us)
        match content.how:
            case "suspend":
                led.take(events.MissionSuspended(f"{act.sender.unit} asked for it"), now_us)
            case "resume":
                led.take(events.MissionResumed(), now_us)

    def on_answer(self, act: Act, content: AnswerQuestion, now_us: int) -> None:
        """`(answer-question ...)`; raises Refused: the question is not open, or that is no answer."""
        asking = self.listed.get(content.mission) or self._find(content.mission)
        asking.answer(content.number, content.answer, act.sender.unit, now_us)
        self._agent.done(act, now_us)

    def _find(self, name: str) -> LedMission:
        if name not in self._led:
            known = ", ".join(self._led) or "none"
            raise Refused(
                f"mission {name} is not one of platform {self._unit}; missions are: {known}", "unknown-mission"
            )
        return self._led[name]

    def halt(self, mission: str, reason: str, now_us: int) -> bool:
        """Have a mission of this platform wait, with its plan; whether there is one."""
        led = self._led.get(mission)
        if led is not None:
            led.take(events.MissionSuspended(reason, keeps_plan=True), now_us)
        return led is not None

    def is_halted(self, mission: str) -> bool:
        """Whether a mission of this platform waits."""
        led = self._led.get(mission)
        return led is not None and led.mission is not None and led.mission.status.phase is MissionPhase.SUSPENDED

    def go_on(self, mission: str, result: str, now_us: int) -> None:
        """The reason for which a mission was halted is over: it continues where it was interrupted."""
        led = self._led.get(mission)
        if led is not None:
            self.report(led, "anchor", result, now_us)
            led.take(events.MissionResumed(), now_us)

    def on_missions(self, act: Act, _content: MissionQuery, now_us: int) -> None:
        """`(missions)`: the running missions, and the last ones that are over."""
        entries = [led.entry() for led in (*self._led.values(), *self.listed.values(), *reversed(self._over.values()))]
        self._agent.answer(act, P.INFORM, MissionList(missions=tuple(entries[:16])), now_us)

    # -- time --------------------------------------------------------------------------------------------------

    @property
    def deadline_us(self) -> int | None:
        return min((led.deadline_us for led in self._led.values()), default=None)

    def on_time(self, now_us: int) -> None:
        for led in list(self._led.values()):
            if self._is_due(led, now_us):
                led.on_time(now_us)

    def _is_due(self, led: LedMission, now_us: int) -> bool:
        """Whether the platform that had it flown may lead it still; when one before that is back, it ends here."""
        order = led.order
        if order.permit is not None:
            try:
                self._authority.check_leads(order.permit, order.act.sender.unit, order.act.boot, now_us)
            except Refused as refused:
                led.is_passed_on = True
                led.end(refused.reason, now_us)
                return False
        return True

    # -- what missions need ------------------------------------------------------------------------------------

    def federation_us(self, now_us: int) -> int:
        return self._clock.federation_us(now_us)

    def search(self, led: LedMission, effect: events.SearchPlan, texts: tuple[str, str], now_us: int) -> None:
        """Search for a plan of a mission in a worker."""
        del now_us
        led.nodes = 0

        def on_over(event: SearchOver, at_us: int) -> None:
            plan: MissionPlan | None = None
            if event.plan is not None:
                plan = plan_of(event.plan, (*effect.domain.operators, *effect.problem.operators))
                took_s, count_of = event.took_us / 1e6, len(plan.actions)
                text = f"{count_of} actions, cost {plan.cost:g}, {event.nodes} nodes in {took_s:.1f} s"
                self.report(led, "searched", text, at_us)
            led.on_searched(effect.search, plan, event.reason, is_certain=event.is_certain, now_us=at_us)

        self.searches.plan(led, texts, effect.units, effect.limit_us, on_over)

    def end_search(self, led: object) -> None:
        """Its searches are wanted no more."""
        self.searches.end(led)

    def on_search_news(self, event: SearchNews, now_us: int) -> Followed:
        """A search has come so far."""
        owner = self.searches.owner(event.number)
        if isinstance(owner, LedMission):
            owner.nodes = event.nodes
            self.report(owner, "searching", f"{event.nodes} nodes", now_us)
        return None

    def on_search_over(self, event: SearchOver, now_us: int) -> Followed:
        """A search has ended."""
        self.searches.on_over(event, now_us)
        return None

    def report(self, led: LedMission, kind: str, text: str, now_us: int) -> None:
        """Tell the delegator, the log, and followers of this process."""
        order = led.order
        self._emit(Tell({"event": "mission", "mission": order.name, "what": kind, "text": text, "at_us": now_us}))
        if kind != "searching":
            self._note_of(f"mission {order.name}: {kind}: {text}"[:400])
        delegator = order.act.sender.unit
        if self._directory.is_present(delegator):
            progress = Progress(step=f"{kind}: {text}"[:1000], unit=self._unit)
            self._agent.tell(delegator, progress, now_us, conversation=order.conversation)

    def ended(self, led: LedMission, effect: events.MissionEnded, now_us: int) -> None:
        """End a mission: inform its delegator, and release its vehicles and streams."""
        order = led.order
        if self._led.pop(order.name, None) is None:
            return
        permit = self._performing.permits.of(order.name, now_us)
        led.release(now_us)
        if permit is not None and not led.is_passed_on:
            self._authority.end(permit, now_us, led.texts.platforms.values())
            self._performing.permits.end(order.name)
        elif permit is not None:
            self._performing.permits.permit(permit, now_us)
        self._over[order.name] = led
        while len(self._over) > KEPT:
            del self._over[next(iter(self._over))]
        left = f"; not reached: {', '.join(effect.unreached)}" if effect.unreached else ""
        text = f"{effect.outcome}: {effect.reason}{left}"
        self._note_of(f"mission {order.name}: {text}")
        self._emit(Tell({"event": "mission", "mission": order.name, "what": "ended", "text": text, "at_us": now_us}))
        if effect.outcome in {"reached", "partly reached"}:
            self._agent.answer(order.act, P.INFORM, Done(text=text[:1000]), now_us)
        else:
            self._agent.answer(
                order.act, P.FAILURE, Reason(text=text[:1000], code=effect.outcome.replace(" ", "-")), now_us
            )
        self._tasks.cancel(order.conversation, now_us)
