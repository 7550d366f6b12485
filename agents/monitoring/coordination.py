"""The Monitor Coordination Agent: one task over many platforms (thesis 9.4.1).

The coordinator, the recipient of `monitor-proximity`, looks up which platforms are there, has each export what the
formulas need and set up the monitors, does the same itself, and takes newcomers in. Every participant keeps its own
inputs alive (`dyknow.agents.exchange.subscription_keeper`). States and successors of a task: `dyknow.agents.tasks.life`. Times are the
node clock.
"""

from collections.abc import Iterable

from dyknow import US_PER_S, earlier
from dyknow.agents.actions import COORDINATION, FEDERATION, INFORMED, Action, Offer
from dyknow.agents.exchange.federation_agent import FederationAgent
from dyknow.agents.exchange.subscription_keeper import SubscriptionKeeper
from dyknow.agents.monitoring.alarm_log import alarm_content
from dyknow.agents.monitoring.monitor_plans import MonitorPlan, PlanBook, exports_of
from dyknow.agents.monitoring.monitors import UnitMonitors
from dyknow.agents.monitoring.reported_alarms import ReportedAlarms
from dyknow.agents.part import Part, PeerChange
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.agents.tasks.authority import Authority
from dyknow.agents.tasks.command_watch import ABOUT_COMMANDERS
from dyknow.agents.tasks.life import TaskLife
from dyknow.agents.tasks.requests import CREATE_MONITOR, MONITOR_PROXIMITY, REMOVE_MONITOR
from dyknow.agents.tasks.task import Claim, CoordinatedTask, Task
from dyknow.federation.members.directory import unit_order
from dyknow.federation.members.liveness import PlatformGone
from dyknow.federation.members.offers import ServiceAppeared
from dyknow.federation.messages import contents
from dyknow.federation.messages.acts import Act, Performative
from dyknow.model.errors import DyknowError, Refused
from dyknow.reasoning import OF_SEPARATION, AlarmEvent

RETRY_US = 1_000_000
"""How long after a failure or silence a platform gets the next request for its part of a task."""
RENEW_US = 10_000_000
"""How long after it has repeated all its requests, at the word of another platform, a coordinator does so again."""
LED_BY_US = 2_000_000
"""The same, of one that follows another coordinator: that one hands over, or is gone, by then."""


class Coordination(Part):
    """The monitoring tasks of one platform, coordinated or joined."""

    offers = (
        Offer(
            COORDINATION,
            (
                MONITOR_PROXIMITY,
                CREATE_MONITOR,
                REMOVE_MONITOR,
                Action(contents.Alarm, "on_reported_alarm", INFORMED),
                Action(contents.Progress, "on_progress", INFORMED),
                Action(contents.HandOver, "on_hand_over", INFORMED),
            ),
        ),
    )

    def __init__(self, ports: Ports, parts: PartRegistry) -> None:
        self._unit, self._boot, self._clock, self._agent = ports.unit, ports.boot, ports.clock, ports.agent
        self._directory = ports.directory
        self._monitors, self._life, self._plans = parts[UnitMonitors.of], parts[TaskLife], parts[PlanBook.of]
        self._exporting = parts[FederationAgent]
        self._keeper, self._authority, self._reported = parts[SubscriptionKeeper], parts[Authority], ReportedAlarms()

    # -- a task is delegated to this platform -------------------------------------------------------------------

    def on_monitor_proximity(self, act: Act, content: contents.MonitorProximity, now_us: int) -> None:
        """`(monitor-proximity)`: coordinate the task.

        Raises:
            Refused: an unknown profile, or one that cannot be monitored; nothing is set up then.
        """
        conversation = self._life.check_free(act.conversation_id, act.sender.unit)
        if conversation in self._life.coordinated:
            leader = self._life.coordinated[conversation].leader
            raise Refused(f"conversation {conversation} is about a task that {leader} leads", "other-task")
        plans = self._plans.for_task(content.profile, _us(content.sample_period_s), _us(content.delay_s))
        evidence = self._authority.delegated(act, content)
        self._monitor(plans, conversation, now_us)
        self._agent.answer(act, Performative.AGREE, None, now_us)
        self._coordinate(CoordinatedTask(evidence, plans, self._unit, 1, self._boot), now_us)

    def _monitor(self, plans: Iterable[MonitorPlan], owner: str, now_us: int) -> None:
        """Set up these monitors here, all or, if one is refused, none."""
        federation_us = self._clock.federation_us(now_us)
        try:
            for plan in plans:
                self._monitors.create(plan, owner, federation_us)
        except DyknowError:
            for plan in plans:
                self._monitors.remove(plan.name, owner)
            raise

    def _coordinate(self, led: CoordinatedTask, now_us: int) -> None:
        """Coordinate a task whose monitors are set up here."""
        self._life.coordinate(led, lambda at_us: self._take_down(led.task, at_us), now_us)
        self._progress(led, "monitors set up", self._unit, now_us)
        for unit in self._participants():
            self._take_in(led, unit, now_us)

    def _participants(self) -> list[str]:
        """The other platforms that offer the federation service."""
        entries = self._directory.search(service=FEDERATION.service)
        units = {entry.unit for entry in entries if entry.unit != self._unit and entry.kind == "uav"}
        return sorted(units, key=unit_order)

    def _take_in(self, led: CoordinatedTask, unit: str, now_us: int) -> None:
        """Steps 2-3 of figures 9.5 and 9.6 for one platform."""
        if unit in led.members or led.leader != self._unit:
            return
        asked = led.members[unit] = []
        others = tuple(other for other in [self._unit, *led.members] if other != unit)
        for content in exports_of(led.plans, others):
            what = f"export of {', '.join(content.semantic_labels)}"
            asked.append(self._ask(led, unit, content, what, now_us))
        for plan in led.plans:
            part = contents.CreateMonitor(
                name=plan.name,
                task=led.task,
                coordinator=led.leader,
                generation=led.generation,
                sample_period_s=plan.period_us / US_PER_S,
                delay_s=plan.max_delay_us / US_PER_S,
            )
            asked.append(self._ask(led, unit, part, f"monitor {plan.name}", now_us))
        for content in exports_of(led.plans, (unit,)):  # step 3 of figure 9.5: our own streams to the newcomer
            try:
                led.exports += self._exporting.export(content, led.task, now_us)
            except DyknowError as refused:
                self._progress(led, f"no export of ours: {refused}", self._unit, now_us)

    def _ask(self, led: CoordinatedTask, unit: str, content: contents.Content, what: str, now_us: int) -> str:
        """Ask one platform for a part of the task; a request without an answer is repeated while it is there."""
        asked: list[str] = []

        def is_over() -> bool:
            return bool(asked) and asked[0] not in led.members.get(unit, ())

        def on_reply(reply: Act, answer: contents.Content | None, at_us: int) -> None:
            if is_over():
                return
            reason = answer if isinstance(answer, contents.Reason) else contents.Reason(text="no reason given")
            if reply.performative is Performative.INFORM and isinstance(answer, contents.Done):
                self._progress(led, what, unit, at_us)
            elif reply.performative is Performative.FAILURE:
                on_silence(reason.text, at_us)
            elif reply.performative in {Performative.REFUSE, Performative.NOT_UNDERSTOOD}:
                self._declined(led, unit, what, reason, at_us)

        def on_silence(why: str, at_us: int) -> None:
            if not is_over():
                led.again_us[unit] = at_us + RETRY_US
                self._progress(led, f"{what}: {why}", unit, at_us)

        shown = led.evidence.payload
        asked.append(
            self._agent.delegate(unit, content, now_us, on_reply=on_reply, on_silence=on_silence, evidence=shown)
        )
        return asked[0]

    def _ask_again(self, led: CoordinatedTask, unit: str, now_us: int) -> None:
        """Ask for all of it once more; only then end what stood, so that no stream ends in between."""
        before = led.members.pop(unit, [])
        if unit in self._participants():
            self._take_in(led, unit, now_us)
        self._cancel_all({unit: before}, now_us)

    def _renew(self, task: str, now_us: int) -> None:
        """Request everything of the participants again: the set-up by a successor ends with the successor's requests."""
        led = self._life.coordinated.get(task)
        if led is None or led.leader != self._unit or (led.renewed_us is not None and now_us < led.renewed_us):
            return
        due_us = now_us + RETRY_US
        led.renewed_us = due_us if led.renewed_us is None else max(due_us, led.renewed_us + RENEW_US)
        for unit in led.members:
            led.again_us.setdefault(unit, led.renewed_us)

    def _cancel_all(self, members: dict[str, list[str]], now_us: int) -> None:
        for unit, conversations in members.items():
            for conversation in conversations:
                self._agent.cancel(unit, conversation, now_us)

    def _declined(self, led: CoordinatedTask, unit: str, what: str, reason: contents.Reason, now_us: int) -> None:
        """The delegate alone may say that the task was cancelled; no participant deposes its coordinator."""
        self._progress(led, f"{what}: refused, {reason.text}", unit, now_us)
        if reason.code in {"led-by", "succession"}:
            led.again_us[unit] = now_us + LED_BY_US
        elif reason.code == "cancelled" and unit == led.delegate:
            self._life.cancel(led.task, now_us)

    def _progress(self, led: CoordinatedTask, step: str, unit: str, now_us: int) -> None:
        is_ours = led.leader == self._unit and led.task in self._life.coordinated
        if is_ours and self._reachable(led.delegator):
            content = contents.Progress(step=step[:200], unit=unit)
            self._agent.tell(led.delegator, content, now_us, conversation=led.task)

    def _reachable(self, unit: str) -> bool:
        return unit != self._unit and self._directory.is_present(unit)

    def _take_down(self, task: str, now_us: int) -> tuple[str, ...]:
        """Cancel all that the task set up, here and elsewhere."""
        led = self._life.coordinated.pop(task, None)
        if led is None:
            return ()
        for plan in led.plans:
            self._monitors.remove(plan.name, task)
        self._cancel_all(led.members, now_us)
        self._end(led, now_us)
        return (task,)

    def _end(self, led: CoordinatedTask, now_us: int) -> None:
        self._cancel_all(led.former, now_us)
        self._exporting.end_exports(led.exports, now_us)
        self._life.end_parts(now_us)

    # -- a coordinator, or a person, asks this platform for a monitor -------------------------------------------

    def on_create_monitor(self, act: Act, content: contents.CreateMonitor, now_us: int) -> None:
        """`(create-monitor name: proximity)`: set up a monitor here, on its own or as part of a task.

        Raises:
            Refused: unknown name, no evidence for the task, one that was cancelled here, or that another platform coordinates.
        """
        if content.profile is not None or content.parameters is not None:
            raise Refused("a monitor is created by its name alone, without profile or parameters", "contradiction")
        plan = self._plans.named(content.name, _us(content.sample_period_s), _us(content.delay_s))
        conversation = self._life.check_free(act.conversation_id, act.sender.unit)
        requester, task = act.sender.unit, content.task
        owner = conversation if task is None else task
        led = None if task is None else self._led_by_sender(act, content, task, now_us)
        self._monitor([plan], owner, now_us)
        if led is not None:
            self._life.follow(act, led, plan, now_us)

        def take_down(at_us: int) -> tuple[str, ...]:
            return self._leave(owner, plan.name, requester, at_us)

        name, is_part = contents.CreateMonitor.head, task is not None
        self._life.add(
            Task(conversation, requester, name, take_down, since_us=now_us, is_part=is_part, monitor=plan.name)
        )
        self._agent.done(act, now_us)
        self._keeper.wake(now_us)

    def _led_by_sender(self, act: Act, content: contents.CreateMonitor, task: str, now_us: int) -> CoordinatedTask:
        """The task whose coordinator the sender is, by the evidence that it shows.

        Raises:
            Refused: it is not, or shows none.
        """
        requester, generation = act.sender.unit, content.generation or 1
        if content.coordinator not in {None, requester}:
            raise Refused(f"monitors are set up by the coordinator {content.coordinator}, not {requester}", "role")
        evidence = self._authority.proven(act, task, (contents.MonitorProximity,), now_us)
        try:
            self._life.check_claim(Claim(evidence, requester, act.boot, generation), now_us)
        except Refused:
            self._renew(task, now_us)
            raise
        return CoordinatedTask(evidence, (), requester, generation, act.boot)

    def on_remove_monitor(self, act: Act, content: contents.RemoveMonitor, now_us: int) -> None:
        """`(remove-monitor name: proximity)`: end what `create-monitor` set up; see `TaskLife.endable`.

        Raises:
            Refused: there is none that the requester may end.
        """
        name = content.name
        for task in self._life.endable(act, f"monitor {name}", lambda task: task.monitor == name):
            self._life.end(task, act.sender.unit, now_us)
        self._agent.done(act, now_us)

    def on_hand_over(self, act: Act, content: contents.HandOver, now_us: int) -> None:
        """`(hand-over ...)`: the coordinator of a task leaves it to another one.

        Raises:
            Refused: the sender does not coordinate it, or it is not that one's turn.
        """
        led = self._life.coordinated.get(content.task)
        if led is not None and led.leader == self._unit == content.coordinator and act.sender.unit in led.members:
            self._renew(led.task, now_us)
            return
        if led is None or led.leader != act.sender.unit:
            raise Refused(f"{act.sender.unit} does not lead task {content.task} here", "led-by")
        self._authority.check_leads(led.evidence, content.coordinator, content.boot, now_us)
        self._life.lead_by(led, content.coordinator, content.boot, content.generation, now_us)

    def _leave(self, task: str, name: str, by: str, now_us: int) -> tuple[str, ...]:
        """The monitor `name` of a task is needed no more."""
        self._monitors.remove(name, task)
        led = self._life.leave(task, name)
        if led is None:
            return ()
        self._life.end_by(led, by, now_us)
        self._end(led, now_us)
        return (task,)

    # -- peers and time -----------------------------------------------------------------------------------------

    def on_peer(self, change: PeerChange, now_us: int) -> None:
        """Take newcomers in; forget requests to one that is gone, and take over after its coordination."""
        if isinstance(change, ServiceAppeared):
            if change.service.service == FEDERATION.service and change.unit != self._unit:
                entry = self._directory.entry(change.unit)
                if entry is not None and entry.kind == "uav":
                    self._on_present(change.unit, now_us)
        elif isinstance(change, PlatformGone):
            for led in self._life.coordinated.values():
                for of_unit in (led.members, led.former, led.again_us):
                    of_unit.pop(change.unit, None)
                if led.leader == change.unit:
                    self._life.on_leader_gone(led, now_us)

    def _on_present(self, unit: str, now_us: int) -> None:
        for led in list(self._life.coordinated.values()):
            if led.leader == self._unit:
                self._take_in(led, unit, now_us)
            elif self._life.is_led(led):
                led.successor_at_us = None

    def on_time(self, now_us: int) -> None:
        """Repeat requests that failed, and take over where the coordinator died and no participant before us did."""
        due_us = self.deadline_us
        if due_us is None or now_us < due_us:
            return
        for task, alarm in self._reported.unconfirmed(now_us):
            if task in self._life.coordinated:
                self._pass_on(self._life.coordinated[task], alarm, now_us)
        for out in self._reported.left_out(now_us):
            if out.task in self._life.coordinated:
                self._progress(self._life.coordinated[out.task], out.text, out.unit, now_us)
        for led in list(self._life.coordinated.values()):
            for unit in [unit for unit, due_us in led.again_us.items() if due_us <= now_us]:
                del led.again_us[unit]
                self._ask_again(led, unit, now_us)
            if led.successor_at_us is not None and led.successor_at_us <= now_us and self._life.succeeds(led, now_us):
                self._life.take_over(led)
                self._coordinate(led, now_us)

    @property
    def deadline_us(self) -> int | None:
        due_us = self._reported.deadline_us
        for led in self._life.coordinated.values():
            due_us = earlier(due_us, led.deadline_us)
        return due_us

    # -- alarms ------------------------------------------------------------------------------------------------

    def keeps_apart(self) -> bool:
        """Whether some task here wants vehicles to give way."""
        return any(led.keeps_apart for led in self._life.coordinated.values())

    def on_alarm(self, event: AlarmEvent, now_us: int) -> None:
        """Notify the delegator, through the coordinator, and the other platform that the alarm is about."""
        alarm = alarm_content(event, self._unit)
        self._reported.see(self._unit, event.monitor, event.units, is_open=event.event == "opened")
        for led in self._life.coordinated.values():
            if _watches(led, event.monitor):
                self._pass_on(led, alarm, now_us)
        for unit in event.units[1:] if event.monitor not in ABOUT_COMMANDERS else ():
            if self._directory.is_present(unit):
                self._agent.tell(unit, alarm, now_us)

    def on_reported_alarm(self, act: Act, alarm: contents.Alarm, now_us: int) -> None:
        """`(alarm ...)`: a participant of a task we coordinate raised it; alarms of others our own monitors see, too.

        An alarm that no other of its units raises is passed on once more, as the report of that participant alone.

        Raises:
            Refused: `not-a-participant`; or it is no alarm of a monitor of the task about the sender.
        """
        sender = act.sender.unit
        if alarm.by != sender or sender not in alarm.units:
            raise Refused(f"{sender} tells of an alarm of another platform, or about others", "not-its-alarm")
        led = self._life.coordinated.get(act.conversation_id or "")
        if led is None or led.leader != self._unit:
            return
        if sender not in led.members:
            raise Refused(f"{sender} takes no part in task {led.task}", "not-a-participant")
        if not _watches(led, alarm.monitor):
            raise Refused(f"task {led.task} has no monitor {alarm.monitor}", "not-its-alarm")
        if self._reported.admits(led.task, alarm, now_us):
            self._reported.report(led.task, alarm, now_us)
            self._pass_on(led, alarm, now_us)

    def on_progress(self, act: Act, content: contents.Progress, now_us: int) -> None:
        """`(progress ...)`: pass the report of a participant of a task we coordinate on to its delegator."""
        led = self._life.coordinated.get(act.conversation_id or "")
        if led is not None and act.sender.unit in led.members:
            self._progress(led, content.step, act.sender.unit, now_us)

    def report(self, step: str, now_us: int) -> None:
        """Report a step of giving way to the delegators."""
        for led in self._life.coordinated.values():
            if led.avoidance:
                self._pass_on(led, contents.Progress(step=step[:200], unit=self._unit), now_us)

    def _pass_on(self, led: CoordinatedTask, content: contents.Content, now_us: int) -> None:
        to = led.delegator if led.leader == self._unit else led.leader
        if self._reachable(to):
            self._agent.tell(to, content, now_us, conversation=led.task)


def _watches(led: CoordinatedTask, monitor: str) -> bool:
    return led.keeps_apart if monitor in OF_SEPARATION else any(plan.name == monitor for plan in led.plans)


def _us(seconds: float | None) -> int | None:
    return None if seconds is None else round(seconds * US_PER_S)
