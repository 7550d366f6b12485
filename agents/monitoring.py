"""The monitors of a platform: states out of local and imported streams, formulas over the states (thesis 9.4.2).

A named monitor whose formula quantifies over `units - {self} growing` has one instance per other platform, each with
a state synchroniser of its own: a silent platform makes its own instance stale and no other. Federation time.
"""

from collections.abc import Callable, Iterable, Mapping
from collections.abc import Set as AbstractSet
from contextlib import suppress
from dataclasses import dataclass, field
from typing import TypeAlias

from agents.plans import MonitorPlan, StateMaker
from dyknow import Label, Network, Policy, Sample, State, StateInput, StatePolicy, Subscription, Synchronizer
from dyknow.errors import DyknowError, Refused
from federation.deadlines import Deadlines
from federation.ontology import Convert
from reasoning import AlarmEvent, Monitor

MAX_INSTANCES = 4096


@dataclass(slots=True)
class Instance:
    """One monitor over one set of units, and what feeds it."""

    monitor: Monitor
    synchronizer: Synchronizer
    maker: StateMaker
    taps: list[tuple["Tap", "Feed"]] = field(default_factory=list)


@dataclass(slots=True)
class Named:
    """One named monitor: its instances by member (`""` when it has no members), and who asked for it."""

    plan: MonitorPlan
    owners: set[str]
    instances: dict[str, Instance] = field(default_factory=dict)


Needs: TypeAlias = Mapping[str, AbstractSet[tuple[str, int, int]]]
"""Which (semantic label, period, max delay) of which other unit the monitors live on."""
Feed = Callable[[Sample], None]


class Tap:
    """One subscription that feeds many synchronisers: every pair needs the platform's own position."""

    def __init__(self, to_semantic: Convert) -> None:
        self.feeds: tuple[Feed, ...] = ()
        self.subscription: Subscription | None = None
        self._to_semantic = to_semantic

    def on_sample(self, sample: Sample) -> None:
        value = self._to_semantic(sample.value)
        if value is not sample.value:
            sample = sample._replace(value=value)
        for feed in self.feeds:
            feed(sample)


class Monitors:
    """All monitors of one platform.

    Args:
        unit: this platform.
        network: the local instance.
        source: (semantic label, unit) -> its local label, declared if it was not, and how its values become semantic.
        on_alarm: told every opening and closing.
    """

    def __init__(
        self,
        unit: str,
        network: Network,
        source: Callable[[str, str], tuple[Label, Convert]],
        on_alarm: Callable[[AlarmEvent], None],
    ) -> None:
        self.unit = unit
        self.named: dict[str, Named] = {}
        self._network, self._source, self._on_alarm = network, source, on_alarm
        self._taps: dict[tuple[str, str, Policy], Tap] = {}
        self._members: dict[str, str | None] = {}
        self._deadlines: Deadlines[tuple[str, str, bool]] = Deadlines()
        self._needs: dict[str, set[tuple[str, int, int]]] | None = None
        self._count = 0

    # -- what is monitored -------------------------------------------------------------------------------------

    def create(self, plan: MonitorPlan, owner: str, now_us: int) -> None:
        """`create named monitor(n)` of 9.4.2, for `owner`; a monitor many ask for exists once.

        Raises:
            Refused: the same name is monitored with another period or delay.
        """
        known = self.named.get(plan.name)
        if known is not None:
            if known.plan != plan:
                raise Refused(f"{plan.name} is monitored here already, as {known.plan.describe()}")
            known.owners.add(owner)
            return
        named = self.named[plan.name] = Named(plan, {owner})
        try:
            for member in self._members if plan.grows else [""]:
                self._begin(named, member, now_us)
        except DyknowError:
            self.remove(plan.name, owner)
            raise

    def remove(self, name: str, owner: str) -> None:
        """`owner` needs the monitor no more; it ends with its last owner."""
        known = self.named.get(name)
        if known is None:
            return
        known.owners.discard(owner)
        if not known.owners:
            for member in list(known.instances):
                self._end(known, member)
            del self.named[name]

    def join(self, member: str, now_us: int) -> None:
        """A platform is there: it gets its instances, or its inputs count again (F6 growing).

        Beyond MAX_INSTANCES it gets none: who floods a federation with platforms does not stop the others' monitors.
        """
        self._members[member] = None
        for named in self.named.values():
            if not named.plan.grows:
                continue
            if member not in named.instances:
                with suppress(Refused):
                    self._begin(named, member, now_us)
            else:
                named.instances[member].monitor.mark_present(member, now_us)
                self._schedule(named, member)

    def doubt(self, member: str, reason: str, now_us: int) -> None:
        """The platform is gone or its clock is skewed: its inputs count as missing."""
        if member not in self._members or self._members[member] == reason:
            return
        self._members[member] = reason
        for named in self.named.values():
            found = named.instances.get(member)
            if found is not None:
                found.monitor.mark_missing(member, now_us, reason)
                self._schedule(named, member)

    def leave(self, member: str) -> None:
        """The platform left for good: its instances end."""
        self._members.pop(member, None)
        for named in self.named.values():
            if member in named.instances:
                self._end(named, member)

    def needs(self) -> Needs:
        """What they live on; the same object while that does not change."""
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
        return self._deadlines.next_us

    def on_time(self, now_us: int) -> None:
        for name, member, of_states in self._deadlines.pop_due(now_us):
            named = self.named.get(name)
            instance = None if named is None else named.instances.get(member)
            if named is None or instance is None:
                continue
            if of_states:
                self._take(instance, instance.synchronizer.on_time(now_us), now_us)
            else:
                for event in instance.monitor.on_time(now_us):
                    self._on_alarm(event)
            self._schedule(named, member)

    # -- inside ------------------------------------------------------------------------------------------------

    def _begin(self, named: Named, member: str, now_us: int) -> None:
        plan = named.plan
        if self._count >= MAX_INSTANCES:
            raise Refused(f"this platform keeps {MAX_INSTANCES} monitors already")
        key = (self.unit, member) if member else (self.unit,)
        maker = StateMaker(plan, member)
        wanted = Policy(change="sample", sample_us=plan.period_us, from_us=0, max_delay_us=plan.max_delay_us)
        given = Policy(change="sample", sample_us=plan.period_us, max_delay_us=plan.max_delay_us)
        synchronizer = Synchronizer(
            [StateInput(name, given) for name in maker.input_names],
            StatePolicy(plan.period_us, plan.max_delay_us, approximation="none"),
        )
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
        instance = named.instances[member] = Instance(monitor, synchronizer, maker)
        self._count, self._needs = self._count + 1, None
        for index, (label, unit) in enumerate(maker.inputs):
            self._tap(unit, label, wanted, instance, self._feed(named, member, instance, index))
        reason = self._members.get(member)
        if reason is not None:
            monitor.mark_missing(member, now_us, reason)
        self._schedule(named, member)

    def _feed(self, named: Named, member: str, instance: Instance, index: int) -> Feed:
        synchronizer, take, schedule = instance.synchronizer, self._take, self._schedule
        on_sample = synchronizer.on_sample

        def feed(sample: Sample) -> None:
            waits = synchronizer.sync_us is not None
            states = on_sample(index, sample, sample.available_us)
            if states:
                take(instance, states, sample.available_us)
            if states or not waits:  # else it is due no earlier than before
                schedule(named, member)

        return feed

    def _tap(self, unit: str, label: str, policy: Policy, instance: Instance, feed: Feed) -> None:
        tap = self._taps.get((unit, label, policy))
        if tap is None:
            local, to_semantic = self._source(label, unit)
            tap = self._taps[unit, label, policy] = Tap(to_semantic)
            tap.subscription = self._network.subscribe(local, policy, tap.on_sample)
        tap.feeds = (*tap.feeds, feed)
        instance.taps.append((tap, feed))

    def _end(self, named: Named, member: str) -> None:
        instance = named.instances.pop(member)
        self._count, self._needs = self._count - 1, None
        for tap, feed in instance.taps:
            tap.feeds = tuple(other for other in tap.feeds if other is not feed)
        for of_states in (True, False):
            self._deadlines.set((named.plan.name, member, of_states), None)
        for name in [name for name, tap in self._taps.items() if not tap.feeds]:
            subscription = self._taps.pop(name).subscription
            if subscription is not None:
                subscription.cancel()

    def _take(self, instance: Instance, states: Iterable[State], now_us: int) -> None:
        maker, monitor = instance.maker, instance.monitor
        for state in states:
            values, lacks = maker.values(state)
            for event in monitor.on_state(state.valid_us, now_us, values, lacks=lacks):
                self._on_alarm(event)

    def _schedule(self, named: Named, member: str) -> None:
        instance = named.instances.get(member)
        if instance is None:
            return
        name = named.plan.name
        self._deadlines.set((name, member, True), instance.synchronizer.deadline_us)
        self._deadlines.set((name, member, False), instance.monitor.deadline_us)
