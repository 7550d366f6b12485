"""The Monitor Coordination Agent: one task over many platforms (thesis 9.4.1).

Whoever is asked to `monitor-proximity` leads the task: it looks up who is there, has each platform export what the
formulas need and set up the monitors, does the same itself, and takes newcomers in. Every participant keeps its own
inputs alive (`agents.supply`). When the leader dies the participant that sorts first leads on, and the next if that
one is silent; of two leaders (after a partition) the one of the higher generation stays, then the unit that sorts
first. Times are the node clock.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field

from agents.context import Context
from agents.federation_agent import FederationAgent
from agents.plans import MonitorPlan, PlanBook
from agents.services import FEDERATION
from agents.tasks import Task
from dyknow import US_PER_S
from dyknow.errors import DyknowError, Refused
from federation.acts import Act, Performative
from federation.contents import Content, CreateMonitor, CreateMulticast, Done, MonitorProximity, Progress, Reason
from federation.directory import unit_order
from reasoning import AlarmEvent

HEIR_STEP_US = 1_000_000


@dataclass(slots=True)
class Led:
    """A task as one participant knows it.

    Attributes:
        task: the conversation in which the delegator asked for it: its name everywhere.
        delegation: that act, where this platform received it.
        plans: what is monitored.
        members: what was asked of each platform, as (unit, conversation); kept by the leader.
        own: by name, the act with which the leader asked this platform for a monitor.
        heir_at_us: when this platform leads on if no other does.
    """

    task: str
    delegator: str
    plans: tuple[MonitorPlan, ...]
    avoidance: bool
    leader: str
    generation: int
    delegation: Act | None = None
    members: dict[str, list[str]] = field(default_factory=dict)
    own: dict[str, Act] = field(default_factory=dict)
    exports: list[str] = field(default_factory=list)
    heir_at_us: int | None = None


class Coordination:
    """The monitoring tasks of one platform, led or joined."""

    def __init__(self, context: Context, plans: PlanBook, federation: FederationAgent) -> None:
        self._c, self._plans, self._federation = context, plans, federation
        self.led: dict[str, Led] = {}

    # -- a task is delegated to this platform -------------------------------------------------------------------

    def on_monitor_proximity(self, act: Act, content: MonitorProximity, now_us: int) -> None:
        """`(monitor-proximity)`: lead the task.

        Raises:
            Refused: an unknown profile, or one that cannot be monitored.
        """
        conversation = act.conversation_id or ""
        period_us = None if content.sample_period_s is None else round(content.sample_period_s * US_PER_S)
        delay_us = None if content.delay_s is None else round(content.delay_s * US_PER_S)
        plans = self._plans.for_task(content.profile, period_us, delay_us)
        avoidance = content.avoidance is not False
        led = Led(conversation, act.sender.unit, plans, avoidance, self._c.unit, 1, delegation=act)
        self._c.desk.answer(act, Performative.AGREE, None, now_us)
        self._lead(led, now_us)

    def _lead(self, led: Led, now_us: int) -> None:
        self.led[led.task] = led
        self._c.tasks.add(
            Task(
                led.task,
                led.delegator,
                "monitor-proximity",
                lambda at_us: self._take_down(led.task, at_us),
                since_us=now_us,
            )
        )
        self._join_self(led, now_us)
        for unit in self._participants():
            self._take_in(led, unit, now_us)

    def _participants(self) -> list[str]:
        """Everybody who offers the federation service, but us."""
        found = self._c.directory.search(service=FEDERATION.service.service)
        return sorted(
            {entry.unit for entry in found if entry.unit != self._c.unit and entry.kind == "uav"}, key=unit_order
        )

    def _join_self(self, led: Led, now_us: int) -> None:
        federation_us = self._c.clock.federation_us(now_us)
        for plan in led.plans:
            self._c.gateway.monitors.create(plan, led.task, federation_us)
        self._progress(led, "monitors set up", self._c.unit, now_us)

    def _take_in(self, led: Led, unit: str, now_us: int) -> None:
        """Steps 2-3 of figures 9.5 and 9.6 for one platform."""
        if unit in led.members or led.leader != self._c.unit:
            return
        asked = led.members[unit] = []
        others = tuple(other for other in [self._c.unit, *led.members] if other != unit)
        for labels, period_us, delay_us in _streams(led.plans):
            content = CreateMulticast(
                semantic_labels=labels,
                sample_period_s=period_us / US_PER_S,
                delay_s=delay_us / US_PER_S,
                to_units=others,
            )
            asked.append(self._ask(led, unit, content, f"export of {', '.join(labels)}", now_us))
        for plan in led.plans:
            content_of = CreateMonitor(
                name=plan.name,
                task=led.task,
                coordinator=led.leader,
                generation=led.generation,
                sample_period_s=plan.period_us / US_PER_S,
                delay_s=plan.max_delay_us / US_PER_S,
                avoidance=led.avoidance,
            )
            asked.append(self._ask(led, unit, content_of, f"monitor {plan.name}", now_us))
        self._export_to(led, unit, now_us)

    def _export_to(self, led: Led, unit: str, now_us: int) -> None:
        """Step 3 of figure 9.5: our own streams to the newcomer."""
        content = [
            CreateMulticast(
                semantic_labels=labels, sample_period_s=p / US_PER_S, delay_s=d / US_PER_S, to_units=(unit,)
            )
            for labels, p, d in _streams(led.plans)
        ]
        for one in content:
            try:
                led.exports += self._federation.export(one, led.task, now_us)
            except DyknowError as refused:
                self._progress(led, f"no export of ours: {refused}", self._c.unit, now_us)

    def _ask(self, led: Led, unit: str, content: Content, what: str, now_us: int) -> str:
        def on_reply(reply: Act, said: Content | None, at_us: int) -> None:
            if reply.performative is Performative.INFORM and isinstance(said, Done):
                self._progress(led, what, unit, at_us)
            elif reply.performative in {Performative.REFUSE, Performative.FAILURE, Performative.NOT_UNDERSTOOD}:
                reason = said.text if isinstance(said, Reason) else "no reason given"
                self._declined(led, unit, what, reason, at_us)

        def on_silence(why: str, at_us: int) -> None:
            led.members.pop(unit, None)
            self._progress(led, f"{what}: {why}", unit, at_us)

        return self._c.desk.delegate(unit, content, now_us, on_reply=on_reply, on_silence=on_silence)

    def _declined(self, led: Led, unit: str, what: str, reason: str, now_us: int) -> None:
        self._progress(led, f"{what}: refused, {reason}", unit, now_us)
        if reason.startswith("led by "):
            self._step_down(led, reason.removeprefix("led by ").split(" ", 1)[0])
        elif reason.startswith("cancelled"):
            self._c.tasks.cancel(led.task, now_us)

    def _step_down(self, led: Led, leader: str) -> None:
        """Somebody leads the task after us: stay a participant."""
        led.leader = leader
        led.members.clear()
        self._c.tasks.forget(led.task)

    def _progress(self, led: Led, step: str, unit: str, now_us: int) -> None:
        if led.leader == self._c.unit and self._reachable(led.delegator):
            self._c.desk.tell(led.delegator, Progress(step=step[:200], unit=unit), now_us, conversation=led.task)

    def _reachable(self, unit: str) -> bool:
        return unit != self._c.unit and self._c.directory.is_present(unit)

    def _take_down(self, task: str, now_us: int) -> None:
        """Cancel everything the task set up, here and elsewhere."""
        led = self.led.pop(task, None)
        if led is None:
            return
        for unit, conversations in led.members.items():
            for conversation in conversations:
                self._c.desk.cancel(unit, conversation, now_us)
        for plan in led.plans:
            self._c.gateway.monitors.remove(plan.name, task)
        self._federation.end_exports(led.exports, now_us)

    # -- a leader asks this platform for a monitor --------------------------------------------------------------

    def on_create_monitor(self, act: Act, content: CreateMonitor, now_us: int) -> None:
        """`(create-monitor name: proximity)`: set up a monitor here, on its own or as part of a task.

        Raises:
            Refused: unknown name, a task that was cancelled here, or one that somebody else leads.
        """
        period_us = None if content.sample_period_s is None else round(content.sample_period_s * US_PER_S)
        delay_us = None if content.delay_s is None else round(content.delay_s * US_PER_S)
        plan = self._plans.named(content.name, period_us, delay_us)
        conversation = act.conversation_id or ""
        owner = conversation
        if content.task is not None:
            owner = content.task
            self._follow(act, content, plan)
        self._c.gateway.monitors.create(plan, owner, self._c.clock.federation_us(now_us))
        name = content.name

        def take_down(_at_us: int) -> None:
            self._leave(owner, name)

        is_part = content.task is not None
        self._c.tasks.add(
            Task(conversation, act.sender.unit, "create-monitor", take_down, since_us=now_us, is_part=is_part)
        )
        self._c.desk.answer(act, Performative.AGREE, None, now_us)
        self._c.desk.answer(act, Performative.INFORM, Done(), now_us)

    def _follow(self, act: Act, content: CreateMonitor, plan: MonitorPlan) -> None:
        task, leader = content.task or "", content.coordinator or act.sender.unit
        generation = content.generation or 1
        if self._c.tasks.was_cancelled(task):
            raise Refused("cancelled: the task was cancelled here")
        led = self.led.get(task)
        if led is None:
            led = self.led[task] = Led(task, "", (), content.avoidance is not False, leader, generation)
        elif (led.generation, unit_order(leader)) != (generation, unit_order(led.leader)):
            newer = generation > led.generation or (
                generation == led.generation and unit_order(leader) < unit_order(led.leader)
            )
            if not newer:
                raise Refused(f"led by {led.leader} in generation {led.generation}")
            if led.leader == self._c.unit:
                self._step_down(led, leader)
            led.leader, led.generation = leader, generation
        led.heir_at_us = None
        led.avoidance = content.avoidance is not False
        if plan not in led.plans:
            led.plans = (*led.plans, plan)
        earlier = led.own.get(plan.name)
        if earlier is not None and earlier.conversation_id is not None:
            self._c.tasks.forget(earlier.conversation_id)
        led.own[plan.name] = act

    def _leave(self, task: str, name: str) -> None:
        self._c.gateway.monitors.remove(name, task)
        led = self.led.get(task)
        if led is None or led.leader == self._c.unit:
            return
        led.own.pop(name, None)
        led.plans = tuple(plan for plan in led.plans if plan.name != name)
        if not led.plans:
            del self.led[task]
            self._c.tasks.bury(task)

    # -- who comes and goes -------------------------------------------------------------------------------------

    def on_present(self, unit: str, now_us: int) -> None:
        """A platform offers the federation service: newcomers are taken in while the task runs."""
        for led in list(self.led.values()):
            if led.leader == self._c.unit:
                self._take_in(led, unit, now_us)
            elif led.leader == unit:
                led.heir_at_us = None

    def on_gone(self, unit: str, now_us: int) -> None:
        """A platform is gone: forget what was asked of it; the first of the others inherits what it led."""
        for led in self.led.values():
            led.members.pop(unit, None)
            if led.leader == unit:
                rank = sorted([self._c.unit, *self._participants()], key=unit_order).index(self._c.unit)
                led.heir_at_us = now_us + (1 + rank) * HEIR_STEP_US

    def on_time(self, now_us: int) -> None:
        """Lead on where the leader died and nobody before us did."""
        for led in list(self.led.values()):
            if led.heir_at_us is None or led.heir_at_us > now_us:
                continue
            led.heir_at_us = None
            if self._c.directory.is_present(led.leader):
                continue
            led.leader, led.generation = self._c.unit, led.generation + 1
            for act in led.own.values():
                if act.conversation_id is not None:
                    self._c.tasks.forget(act.conversation_id)
            led.own.clear()
            self._lead(led, now_us)

    @property
    def deadline_us(self) -> int | None:
        return min((led.heir_at_us for led in self.led.values() if led.heir_at_us is not None), default=None)

    # -- alarms ------------------------------------------------------------------------------------------------

    def avoids(self, monitor: str) -> bool:
        """Whether some task here wants platforms to give way when `monitor` raises an alarm."""
        return any(led.avoidance and any(p.name == monitor for p in led.plans) for led in self.led.values())

    def on_alarm(self, event: AlarmEvent, said: Content, now_us: int) -> None:
        """Tell the delegator what this platform's monitors found; a participant tells its leader, who passes it on."""
        for led in self.led.values():
            if not any(plan.name == event.monitor for plan in led.plans):
                continue
            if led.leader == self._c.unit:
                self._pass_on(led, said, now_us)
            else:
                self._c.desk.tell(led.leader, said, now_us, conversation=led.task)

    def on_told(self, act: Act, said: Content, now_us: int) -> None:
        """A participant of a task we lead tells of an alarm."""
        led = self.led.get(act.conversation_id or "")
        if led is not None and led.leader == self._c.unit:
            self._pass_on(led, said, now_us)

    def _pass_on(self, led: Led, said: Content, now_us: int) -> None:
        if self._reachable(led.delegator):
            self._c.desk.tell(led.delegator, said, now_us, conversation=led.task)


def _streams(plans: Iterable[MonitorPlan]) -> list[tuple[tuple[str, ...], int, int]]:
    """(labels, period, delay) of all streams the plans need of each platform, one entry per period and delay."""
    found: dict[tuple[int, int], dict[str, None]] = {}
    for plan in plans:
        found.setdefault((plan.period_us, plan.max_delay_us), {}).update(dict.fromkeys(plan.labels))
    return [(tuple(labels), period_us, delay_us) for (period_us, delay_us), labels in found.items()]
