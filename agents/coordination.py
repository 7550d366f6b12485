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
from dyknow import US_PER_S, earlier
from dyknow.errors import DyknowError, Refused
from federation.acts import Act, Performative
from federation.contents import Content, CreateMonitor, CreateMulticast, Done, MonitorProximity, Progress, Reason
from federation.directory import unit_order
from reasoning import AlarmEvent

HEIR_STEP_US = 1_000_000
AGAIN_US = 1_000_000
"""How long after a failure or silence a platform is asked again for its part of a task."""


@dataclass(slots=True)
class Led:
    """A task as one participant knows it.

    Attributes:
        task: the conversation in which the delegator asked for it: its name everywhere.
        plans: what is monitored.
        leader_boot: which life of the leader that is: one that was restarted knows nothing of the task.
        members: what was asked of each platform, as (unit, conversations); kept by the leader.
        former: the same, of a leader that stepped down: it goes when the task ends.
        own: by name, the act with which the leader asked this platform for a monitor.
        again_us: when a platform that failed or was silent is asked again.
        heir_at_us: when this platform leads on if no other does.
    """

    task: str
    delegator: str
    plans: tuple[MonitorPlan, ...]
    avoidance: bool
    leader: str
    generation: int
    leader_boot: int = 0
    members: dict[str, list[str]] = field(default_factory=dict)
    former: dict[str, list[str]] = field(default_factory=dict)
    own: dict[str, Act] = field(default_factory=dict)
    exports: list[str] = field(default_factory=list)
    again_us: dict[str, int] = field(default_factory=dict)
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
            Refused: an unknown profile, or one that cannot be monitored; nothing is set up then.
        """
        conversation = self._c.tasks.check_free(act.conversation_id)
        if conversation in self.led:
            raise Refused(f"conversation {conversation} is about a task that {self.led[conversation].leader} leads")
        period_us = None if content.sample_period_s is None else round(content.sample_period_s * US_PER_S)
        delay_us = None if content.delay_s is None else round(content.delay_s * US_PER_S)
        plans = self._plans.for_task(content.profile, period_us, delay_us)
        self._monitor(plans, conversation, now_us)
        self._c.desk.answer(act, Performative.AGREE, None, now_us)
        avoidance = content.avoidance is not False
        self._lead(Led(conversation, act.sender.unit, plans, avoidance, self._c.unit, 1, self._c.boot), now_us)

    def _monitor(self, plans: Iterable[MonitorPlan], owner: str, now_us: int) -> None:
        """Set up these monitors here, all or, if one is refused, none."""
        federation_us = self._c.clock.federation_us(now_us)
        try:
            for plan in plans:
                self._c.gateway.monitors.create(plan, owner, federation_us)
        except DyknowError:
            for plan in plans:
                self._c.gateway.monitors.remove(plan.name, owner)
            raise

    def _lead(self, led: Led, now_us: int) -> None:
        """Lead a task whose monitors are set up here."""
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
        self._progress(led, "monitors set up", self._c.unit, now_us)
        for unit in self._participants():
            self._take_in(led, unit, now_us)

    def _participants(self) -> list[str]:
        """Everybody who offers the federation service, but us."""
        found = self._c.directory.search(service=FEDERATION.service.service)
        return sorted(
            {entry.unit for entry in found if entry.unit != self._c.unit and entry.kind == "uav"}, key=unit_order
        )

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
                delegator=led.delegator or None,
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
        """Ask one platform for a part of the task; what fails in silence is asked again while it is there."""
        asked: list[str] = []

        def is_over() -> bool:
            return bool(asked) and asked[0] not in led.members.get(unit, ())

        def on_reply(reply: Act, said: Content | None, at_us: int) -> None:
            if is_over():
                return
            reason = said.text if isinstance(said, Reason) else "no reason given"
            if reply.performative is Performative.INFORM and isinstance(said, Done):
                self._progress(led, what, unit, at_us)
            elif reply.performative is Performative.FAILURE:
                on_silence(reason, at_us)
            elif reply.performative in {Performative.REFUSE, Performative.NOT_UNDERSTOOD}:
                self._declined(led, unit, what, reason, at_us)

        def on_silence(why: str, at_us: int) -> None:
            if not is_over():
                led.again_us[unit] = at_us + AGAIN_US
                self._progress(led, f"{what}: {why}", unit, at_us)

        asked.append(self._c.desk.delegate(unit, content, now_us, on_reply=on_reply, on_silence=on_silence))
        return asked[0]

    def _ask_again(self, led: Led, unit: str, now_us: int) -> None:
        """Ask for all of it anew; only then end what stood, so that no stream ends in between."""
        before = led.members.pop(unit, [])
        if unit in self._participants():
            self._take_in(led, unit, now_us)
        self._cancel_all({unit: before}, now_us)

    def _cancel_all(self, members: dict[str, list[str]], now_us: int) -> None:
        for unit, conversations in members.items():
            for conversation in conversations:
                self._c.desk.cancel(unit, conversation, now_us)

    def _declined(self, led: Led, unit: str, what: str, reason: str, now_us: int) -> None:
        self._progress(led, f"{what}: refused, {reason}", unit, now_us)
        if reason.startswith("led by "):
            leader = reason.removeprefix("led by ").split(" ", 1)[0]
            if leader in self._participants():
                self._step_down(led, leader)
        elif reason.startswith("cancelled"):
            self._c.tasks.cancel(led.task, now_us)

    def _step_down(self, led: Led, leader: str) -> None:
        """Somebody leads the task after us: stay a participant. What we had asked for goes with the task."""
        led.leader = leader
        for unit, conversations in led.members.items():
            led.former.setdefault(unit, []).extend(conversations)
        led.members.clear()
        led.again_us.clear()
        self._c.tasks.forget(led.task)

    def _progress(self, led: Led, step: str, unit: str, now_us: int) -> None:
        is_led = led.leader == self._c.unit and led.task in self.led
        if is_led and self._reachable(led.delegator):
            self._c.desk.tell(led.delegator, Progress(step=step[:200], unit=unit), now_us, conversation=led.task)

    def _reachable(self, unit: str) -> bool:
        return unit != self._c.unit and self._c.directory.is_present(unit)

    def _take_down(self, task: str, now_us: int) -> None:
        """Cancel everything the task set up, here and elsewhere."""
        led = self.led.pop(task, None)
        if led is None:
            return
        for plan in led.plans:
            self._c.gateway.monitors.remove(plan.name, task)
        self._cancel_all(led.members, now_us)
        self._cancel_all(led.former, now_us)
        self._federation.end_exports(led.exports, now_us)
        self._end_parts(now_us)

    # -- a leader asks this platform for a monitor --------------------------------------------------------------

    def on_create_monitor(self, act: Act, content: CreateMonitor, now_us: int) -> None:
        """`(create-monitor name: proximity)`: set up a monitor here, on its own or as part of a task.

        Raises:
            Refused: unknown name, a task that was cancelled here, or one that somebody else leads.
        """
        if content.profile is not None or content.parameters is not None:
            raise Refused("a monitor is created by its name alone, without profile or parameters")
        period_us = None if content.sample_period_s is None else round(content.sample_period_s * US_PER_S)
        delay_us = None if content.delay_s is None else round(content.delay_s * US_PER_S)
        plan = self._plans.named(content.name, period_us, delay_us)
        owner = conversation = self._c.tasks.check_free(act.conversation_id)
        asker, is_part, name = act.sender.unit, content.task is not None, content.name
        if content.task is not None:
            owner = content.task
            self._check_leader(content.task, asker, content)
        self._monitor([plan], owner, now_us)
        if is_part:
            self._follow(act, content, plan)
        self._c.tasks.add(
            Task(
                conversation,
                asker,
                "create-monitor",
                lambda at_us: self._leave(owner, name, at_us),
                since_us=now_us,
                is_part=is_part,
            )
        )
        self._c.desk.answer(act, Performative.AGREE, None, now_us)
        self._c.desk.answer(act, Performative.INFORM, Done(), now_us)

    def _check_leader(self, task: str, asker: str, content: CreateMonitor) -> None:
        if content.coordinator not in {None, asker}:
            raise Refused(f"the monitors of a task are set up by who leads it: {content.coordinator}, not {asker}")
        if self._c.tasks.was_cancelled(task, asker):
            raise Refused("cancelled: the task was cancelled here")
        led = self.led.get(task)
        if led is None or led.leader == asker:
            return
        generation = content.generation or 1
        if (-generation, unit_order(asker)) > (-led.generation, unit_order(led.leader)):
            raise Refused(f"led by {led.leader} in generation {led.generation}")

    def _follow(self, act: Act, content: CreateMonitor, plan: MonitorPlan) -> None:
        """Take part in a task: from now on its leader is who asked."""
        task, leader, avoidance = content.task or "", act.sender.unit, content.avoidance is not False
        led = self.led.get(task)
        if led is None:
            led = self.led[task] = Led(task, content.delegator or "", (), avoidance, leader, content.generation or 1)
        elif led.leader == self._c.unit:
            self._step_down(led, leader)
        led.leader, led.generation, led.leader_boot = leader, content.generation or 1, act.boot
        led.heir_at_us, led.avoidance = None, avoidance
        self._c.tasks.revive(task)
        if plan not in led.plans:
            led.plans = (*led.plans, plan)
        followed = led.own.get(plan.name)
        if followed is not None and followed.conversation_id is not None:
            self._c.tasks.forget(followed.conversation_id)
        led.own[plan.name] = act

    def _leave(self, task: str, name: str, now_us: int) -> None:
        """The monitor `name` of a task is needed no more."""
        self._c.gateway.monitors.remove(name, task)
        led = self.led.get(task)
        if led is None or led.leader == self._c.unit:
            return
        led.own.pop(name, None)
        led.plans = tuple(plan for plan in led.plans if plan.name != name)
        if not led.plans:
            del self.led[task]
            self._cancel_all(led.former, now_us)
            self._federation.end_exports(led.exports, now_us)
            self._end_parts(now_us)

    def _end_parts(self, now_us: int) -> None:
        """No task is left here: nobody leads on for those that asked for a part of one and are gone."""
        if self.led:
            return
        for part in self._c.tasks.all():
            if part.is_part and not self._c.directory.is_present(part.initiator):
                self._c.tasks.cancel(part.conversation, now_us)

    # -- who comes and goes -------------------------------------------------------------------------------------

    def on_present(self, unit: str, now_us: int) -> None:
        """A platform offers the federation service: newcomers are taken in while the task runs."""
        for led in list(self.led.values()):
            if led.leader == self._c.unit:
                self._take_in(led, unit, now_us)
            elif self._is_back(led):
                led.heir_at_us = None

    def _is_back(self, led: Led) -> bool:
        """Whether the leader is there, in the life in which it leads."""
        entry = self._c.directory.entry(led.leader)
        return entry is not None and entry.boot == led.leader_boot and self._c.directory.is_present(led.leader)

    def on_gone(self, unit: str, now_us: int) -> None:
        """A platform is gone: forget what was asked of it; the first of the others inherits what it led."""
        for led in self.led.values():
            led.members.pop(unit, None)
            led.former.pop(unit, None)
            led.again_us.pop(unit, None)
            if led.leader == unit:
                rank = sorted([self._c.unit, *self._participants()], key=unit_order).index(self._c.unit)
                led.heir_at_us = now_us + (1 + rank) * HEIR_STEP_US

    def on_time(self, now_us: int) -> None:
        """Ask again who failed, and lead on where the leader died and nobody before us did."""
        due_us = self.deadline_us
        if due_us is None or now_us < due_us:
            return
        for led in list(self.led.values()):
            for unit in [unit for unit, due_us in led.again_us.items() if due_us <= now_us]:
                del led.again_us[unit]
                self._ask_again(led, unit, now_us)
            if led.heir_at_us is not None and led.heir_at_us <= now_us:
                led.heir_at_us = None
                if not self._is_back(led):
                    self._inherit(led, now_us)

    def _inherit(self, led: Led, now_us: int) -> None:
        """The monitors stay as they are; who leads, and in whose conversations, changes."""
        led.leader, led.generation, led.leader_boot = self._c.unit, led.generation + 1, self._c.boot
        for act in led.own.values():
            if act.conversation_id is not None:
                self._c.tasks.forget(act.conversation_id)
        led.own.clear()
        self._lead(led, now_us)

    @property
    def deadline_us(self) -> int | None:
        found_us = None
        for led in self.led.values():
            found_us = earlier(found_us, led.heir_at_us)
            if led.again_us:
                found_us = earlier(found_us, min(led.again_us.values()))
        return found_us

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
        """A participant of a task we lead tells of an alarm of its own; what others tell us is in our monitors, too."""
        if getattr(said, "by", None) != act.sender.unit:
            raise Refused(f"{act.sender.unit} tells of an alarm of another platform")
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
