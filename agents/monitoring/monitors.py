"""The monitors of a platform: states out of local and imported streams, formulas over the states (thesis 9.4.2).

A named monitor whose formula quantifies over `units - {self} growing` has one instance per other platform, each with
a state stream of its own: a silent platform makes its own instance stale and no other. This platform's own inputs
to all of them are synchronised once. Federation time.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import partial

from dyknow import Label, Network, Policy, Sample, SharedState, SharedSynchronizer, Strand, earlier
from dyknow.agents.containment import Containment
from dyknow.agents.monitoring.monitor_plans import MonitorPlan, StateMaker
from dyknow.agents.monitoring.taps import Feed, Tap
from dyknow.agents.ports import Needs, PartRegistry, Ports
from dyknow.federation.sharing.translation import LabelConversion
from dyknow.model.errors import DyknowError, Refused, UnknownLabel
from dyknow.reasoning import AlarmEvent, Monitor

MAX_INSTANCES = 4096


@dataclass(slots=True)
class MonitorInstance:
    """One monitor over one set of units, and what feeds it."""

    monitor: Monitor
    maker: StateMaker
    strand: Strand[str] | None = None
    taps: list[tuple["Tap", "Feed"]] = field(default_factory=list)


@dataclass(slots=True)
class NamedMonitor:
    """One named monitor: its instances by member (`""` when it has no members), and its requesters.

    Attributes:
        states: of all instances, while there are any.
        taps: the inputs that all instances share.
        check_us: the inputs of no instance go stale or missing before this.
    """

    plan: MonitorPlan
    owners: set[str]
    instances: dict[str, MonitorInstance] = field(default_factory=dict)
    states: SharedSynchronizer[str] | None = None
    taps: list[tuple["Tap", "Feed"]] = field(default_factory=list)
    check_us: int | None = None

    @property
    def deadline_us(self) -> int | None:
        """When time changes something, or somewhat earlier."""
        return self.check_us if self.states is None else earlier(self.states.deadline_us, self.check_us)

    def wake(self, monitor: Monitor) -> bool:
        """Whether the inputs of `monitor` may go stale or missing earlier than was known; it is seen to."""
        due_us, known_us = monitor.deadline_us, self.check_us
        if due_us is None or (known_us is not None and due_us >= known_us):
            return False
        self.check_us = due_us
        return True


class UnitMonitors:
    """All monitors of one platform.

    Args:
        unit: this platform.
        network: the local instance.
        source: (semantic label, unit) -> its local label, declared if it was not, and how its values become semantic.
        on_alarm: called with every opening, closing and end.
        contain: contains errors of a monitor; None: they are raised.

    Attributes:
        on_members: called when a unit has joined or left.
        on_joined: called with the name of a unit that has joined.
    """

    def __init__(
        self,
        unit: str,
        network: Network,
        source: Callable[[str, str], tuple[Label, LabelConversion]],
        on_alarm: Callable[[AlarmEvent], None],
        contain: Containment | None = None,
    ) -> None:
        self.unit, self._contain = unit, contain
        self.named: dict[str, NamedMonitor] = {}
        self._network, self._source, self._on_alarm = network, source, on_alarm
        self._taps: dict[tuple[str, str, Policy], Tap] = {}
        self._members: dict[str, str | None] = {}
        self._every: dict[tuple[str, str, int], int] = {}
        self._shed = 1
        self.on_members: list[Callable[[], None]] = []
        self.on_joined: list[Callable[[str], None]] = []
        self._needs: dict[str, set[tuple[str, int, int]]] | None = None
        self._count = 0
        self._due_us: int | None = None
        self._is_due_known = True

    @classmethod
    def of(cls, ports: Ports, _parts: PartRegistry) -> "UnitMonitors":
        """Build it from the ports and parts of a platform."""
        return cls(ports.unit, ports.network, ports.source(), ports.on_own_alarm, ports.contain)

    # -- what is monitored -------------------------------------------------------------------------------------

    def create(self, plan: MonitorPlan, owner: str, now_us: int) -> None:
        """`create named monitor(n)` of 9.4.2, for `owner`; a monitor many ask for exists once.

        Raises:
            Refused: the same name is monitored with another period or delay.
        """
        known = self.named.get(plan.name)
        if known is not None:
            if known.plan != plan:
                other = known.plan.describe()
                what = f"with another formula, {other}" if other == plan.describe() else f"as {other}"
                raise Refused(f"{plan.name} is monitored here already, {what}", "taken")
            known.owners.add(owner)
            return
        named = self.named[plan.name] = NamedMonitor(plan, {owner})
        try:
            for member in () if plan.in_instance else self._members if plan.grows else [""]:
                self._begin(named, member, now_us)
        except DyknowError:
            self.remove(plan.name, owner)
            raise

    def remove(self, name: str, owner: str) -> None:
        """`owner` needs the monitor no more; it ends with its last owner."""
        known = self.named.get(name)
        if known is None:
            return
        if known.owners == {owner}:  # who owns it hears that its alarms end
            for member in list(known.instances):
                self._end(known, member)
            del self.named[name]
            self._hasten()
        known.owners.discard(owner)

    def join(self, member: str, now_us: int) -> None:
        """A platform is there: it gets its instances, or its inputs count again (F6 growing).

        Beyond MAX_INSTANCES it gets none: a flood of platforms does not stop the monitors of the others.
        """
        is_new = member not in self._members
        self._members[member] = None
        if is_new:
            self._tell_members()
            for on_joined in self.on_joined:
                on_joined(member)
        for named in self.named.values():
            if not named.plan.grows:
                continue
            if member not in named.instances:
                try:
                    self._begin(named, member, now_us)
                except UnknownLabel as wrong:
                    self._network.on_fault(Label(named.plan.name), f"monitor {named.plan.name} over {member}: {wrong}")
                except Refused:
                    pass
            else:
                monitor = named.instances[member].monitor
                monitor.mark_present(member, now_us)
                named.wake(monitor)
                self._hasten()

    def suspect(self, member: str, reason: str, now_us: int) -> None:
        """The platform is gone or its clock is skewed: its inputs count as missing."""
        if member not in self._members or self._members[member] == reason:
            return
        self._members[member] = reason
        for named in self.named.values():
            found = named.instances.get(member)
            if found is not None:
                found.monitor.mark_missing(member, now_us, reason)
                named.wake(found.monitor)
                self._hasten()

    def leave(self, member: str) -> None:
        """The platform left for good: its instances end."""
        if member in self._members:
            del self._members[member]
            self._tell_members()
        for named in self.named.values():
            if member in named.instances:
                self._end(named, member)

    def _tell_members(self) -> None:
        for listener in tuple(self.on_members):
            listener()

    def needs(self) -> Needs:
        """The streams that they need of other units; the same object while these do not change."""
        if self._needs is None:
            self._needs = self._needed()
        return self._needs

    def _needed(self) -> dict[str, set[tuple[str, int, int]]]:
        found: dict[str, set[tuple[str, int, int]]] = {}
        for named in self.named.values():
            for instance in named.instances.values():
                for label, unit in instance.maker.inputs:
                    if unit != self.unit:
                        found.setdefault(unit, set()).add((label, named.plan.period_us, named.plan.max_delay_us))
        return found

    # -- less often --------------------------------------------------------------------------------------------

    def on_every(self, unit: str, label: str, period_us: int, every: int) -> None:
        """Of a stream of `unit` only each `every`-th sample comes from now on: there are states for these only."""
        if every == 1:
            self._every.pop((unit, label, period_us), None)
        else:
            self._every[unit, label, period_us] = every
        for named in self.named.values():
            if named.plan.period_us == period_us:
                for instance in named.instances.values():
                    if (label, unit) in instance.maker.own:
                        self._thin(named, instance)

    def shed(self, every: int) -> None:
        """Evaluate only each `every`-th state, because of the platform's load; 1: all."""
        self._shed = every
        for named in self.named.values():
            for instance in named.instances.values():
                self._thin(named, instance)

    def _thin(self, named: NamedMonitor, instance: MonitorInstance) -> None:
        period_us, every = named.plan.period_us, self._every
        most = max((every.get((unit, label, period_us), 1) for label, unit in instance.maker.own), default=1)
        if named.states is not None and instance.strand is not None:
            named.states.thin(instance.strand, max(self._shed, most))

    # -- members -----------------------------------------------------------------------------------------------

    def has_member(self, unit: str) -> bool:
        """Whether there are monitors over `unit`, or would be."""
        return unit in self._members

    @property
    def members(self) -> tuple[str, ...]:
        """The other units there are monitors over."""
        return tuple(self._members)

    # -- time --------------------------------------------------------------------------------------------------

    @property
    def deadline_us(self) -> int | None:
        """When `on_time` has work, or somewhat earlier."""
        if not self._is_due_known:
            self._is_due_known, self._due_us = True, None
            for named in self.named.values():
                self._due_us = earlier(self._due_us, named.deadline_us)
        return self._due_us

    def _hasten(self) -> None:
        """Compute the deadline again: a monitor may be due earlier."""
        self._is_due_known = False

    def on_time(self, now_us: int) -> None:
        due_us = self.deadline_us
        if due_us is None or now_us < due_us:
            return
        self._hasten()
        for named in list(self.named.values()):
            if named.states is not None:
                self._take(named, named.states.on_time(now_us), now_us)
            if named.check_us is not None and now_us >= named.check_us:
                self._check(named, now_us)

    def _check(self, named: NamedMonitor, now_us: int) -> None:
        """Whose inputs go stale or missing by now."""
        named.check_us = None
        for instance in list(named.instances.values()):
            try:
                for event in instance.monitor.on_time(now_us):
                    self._on_alarm(event)
                named.wake(instance.monitor)
            except Exception as error:  # noqa: BLE001  (contained)
                self._raised(named, error)

    # -- inside ------------------------------------------------------------------------------------------------

    def _begin(self, named: NamedMonitor, member: str, now_us: int) -> None:
        plan = named.plan
        if self._count >= MAX_INSTANCES:
            raise Refused(
                f"this platform keeps {MAX_INSTANCES} monitors already; end a task (dyknow tasks)", "too-many"
            )
        key = (self.unit, member) if member else (self.unit,)
        maker = StateMaker(plan, member, self.unit)
        for label, unit in (*maker.shared, *maker.own):
            if unit == self.unit:
                self._network.generator(self._source(label, unit)[0])  # it is there, or nothing begins
        monitor = Monitor(
            plan.name,
            maker.formula,
            key,
            plan.period_us,
            plan.max_delay_us,
            plan.profile.no_value,
            plan.profile.close_after,
            inputs=maker.input_names,
            since_us=now_us,
        )
        instance = named.instances[member] = MonitorInstance(monitor, maker)
        self._count, self._needs = self._count + 1, None
        states = named.states
        if states is None:
            shared = len(maker.shared)
            states = named.states = SharedSynchronizer(shared, plan.period_us, plan.max_delay_us, self._hasten)
            for index, (label, unit) in enumerate(maker.shared):
                named.taps.append(self._tap(unit, label, plan, self._shared_feed(named, states, index)))
        strand = instance.strand = states.add(member, len(maker.own))
        self._thin(named, instance)
        for index, (label, unit) in enumerate(maker.own):
            instance.taps.append(self._tap(unit, label, plan, self._feed(named, states, strand, index)))
        reason = self._members.get(member)
        if reason is not None:
            monitor.mark_missing(member, now_us, reason)
        named.wake(monitor)
        self._hasten()

    def _shared_feed(self, named: NamedMonitor, states: SharedSynchronizer[str], index: int) -> Feed:
        def feed(sample: Sample) -> None:
            self._take(named, states.on_shared(index, sample, sample.available_us), sample.available_us)

        return feed

    def _feed(self, named: NamedMonitor, states: SharedSynchronizer[str], strand: Strand[str], index: int) -> Feed:
        return partial(self._on_own, named, states, strand, index)

    def _on_own(
        self,
        named: NamedMonitor,
        states: SharedSynchronizer[str],
        strand: Strand[str],
        index: int,
        sample: Sample,
    ) -> None:
        found = states.on_own(strand, index, sample, sample.available_us)
        if found:
            self._take(named, found, sample.available_us)

    def _tap(self, unit: str, label: str, plan: MonitorPlan, feed: Feed) -> tuple[Tap, Feed]:
        policy = Policy(change="sample", sample_us=plan.period_us, from_us=0, max_delay_us=plan.max_delay_us)
        tap = self._taps.get((unit, label, policy))
        if tap is None:
            local, to_semantic = self._source(label, unit)
            tap = self._taps[unit, label, policy] = Tap()
            tap.subscription = self._network.connect(local, policy, to_semantic.into(tap.on_sample))
        tap.feeds = (*tap.feeds, feed)
        return tap, feed

    def _end(self, named: NamedMonitor, member: str) -> None:
        instance = named.instances.pop(member)
        self._count, self._needs = self._count - 1, None
        ended = instance.taps
        if named.states is not None:
            named.states.remove(member)
        if not named.instances:
            ended, named.taps, named.states, named.check_us = ended + named.taps, [], None, None
        for tap, feed in ended:
            tap.feeds = tuple(other for other in tap.feeds if other is not feed)
        for name in [name for name, tap in self._taps.items() if not tap.feeds]:
            subscription = self._taps.pop(name).subscription
            if subscription is not None:
                subscription.cancel()
        for event in instance.monitor.end(self._network.now_us):
            self._on_alarm(event)

    def _take(self, named: NamedMonitor, states: list[SharedState[str]], now_us: int) -> None:
        for member, valid_us, state in states:
            instance = named.instances.get(member)
            if instance is None:
                continue  # a consequence of an earlier alarm has ended it
            monitor, maker = instance.monitor, instance.maker
            try:
                if not (maker.is_clear(state) and monitor.on_clear(valid_us, now_us)):
                    for event in monitor.on_state(valid_us, now_us, maker.values(state), lacks=maker.lacks(state)):
                        self._on_alarm(_marked(event, (*named.taps, *instance.taps)))
                if named.wake(monitor):
                    self._hasten()
            except Exception as error:  # noqa: BLE001  (contained)
                self._raised(named, error)

    def _raised(self, named: NamedMonitor, error: Exception) -> None:
        """Contain the error of one monitor, so that the others continue."""
        if self._contain is None:
            raise error
        self._contain.caught(f"Monitor of {named.plan.name}", error)


def _marked(event: AlarmEvent, taps: Iterable[tuple[Tap, Feed]]) -> AlarmEvent:
    """The event, with the time of the oldest prediction that its state is computed from, if any."""
    made_us = [tap.made_us[event.valid_us] for tap, _ in taps if event.valid_us in tap.made_us]
    return event._replace(made_us=min(made_us)) if made_us else event
