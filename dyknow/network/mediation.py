"""Mediation and configuration: inputs, or whole processes, that come and go with a stream of objects (3.3.3, 3.3.4).

And redundancy: one stream of several producers, one of them in use (3.2).
"""

from bisect import bisect_left
from collections import deque
from collections.abc import Callable, Hashable, Iterable, Sequence
from functools import partial
from typing import Generic, TypeVar

from dyknow.model.errors import SortError
from dyknow.model.instants import print_span
from dyknow.model.labels import Label
from dyknow.model.members import members_of
from dyknow.model.sample import Sample, Value
from dyknow.model.values import NO_VALUE
from dyknow.network.process import FAR_US, Input, ProcessNetwork
from dyknow.network.processes import EVER_US, OnDemand
from dyknow.network.stream_proxy import StreamProxy
from dyknow.policies.sampling import Grid

EVER = 2**80
KEPT = 64
PATIENCE_US = 1_000_000
"""Of redundant producers: the period and the delay of one that declares none."""
RETURN = 3
"""How many times as long as a silence a preferred producer is heard before it is used again."""


class Relay(OnDemand):
    """Passes on samples of other streams as they are.

    Attributes:
        recent: valid times and values that were passed on last, each with the label of the stream it came from.
    """

    def __init__(self) -> None:
        super().__init__()
        self.recent: deque[tuple[int, Value, Label]] = deque(maxlen=KEPT)

    def end(self) -> None:
        self.recent.clear()

    def maker_of(self, sample: Sample) -> Label | None:
        """From which stream a sample came that was passed on lately; None: it is not known, or approximated."""
        found = [
            label for valid_us, value, label in self.recent if (valid_us, value) == (sample.valid_us, sample.value)
        ]
        return found[-1] if found else None

    def is_of_sort(self, sample: Sample) -> bool:
        """Whether the value is what this stream has; if not that is a fault."""
        try:
            if self._generator is not None:
                self._generator.sort.check(sample.value)
        except SortError as wrong:
            self.fault(f"a member brings what is not of the sort: {wrong}")
            return False
        return True

    def pass_on(self, label: Label, sample: Sample) -> None:
        """A sample that is of the sort, and came from the stream with that label."""
        self.recent.append((sample.valid_us, sample.value, label))
        self.emit(sample)


class Mediation(Relay):
    """Passes on the samples of the members that a stream names: of all of them (merge), or of the one (select).

    Args:
        domain: the stream that names the members; its newest sample counts from the beginning.
        member: the input of one member.
        single: with more than one member at a time none is selected, and that is a fault.
    """

    def __init__(self, domain: Input, member: Callable[[str], Input], *, single: bool) -> None:
        super().__init__()
        self._domain, self._member, self.single = domain, member, single
        self.members: dict[str, StreamProxy] = {}
        self._past: list[tuple[int, str, Sample]] = []
        self._grid: Grid | None = None
        self._is_told = False

    def inputs(self) -> Sequence[Input]:
        return (self._domain,)

    def taken(self) -> Iterable[Label]:
        return [proxy.label for proxy in (*self.proxies, *self.members.values())]

    def begin(self) -> None:
        self.members = {}

    def want(self, grid: Grid | None) -> bool:
        self._grid = grid
        for proxy in self.members.values():
            proxy.want(grid)
        return grid is not None

    def on_sample(self, i: int, sample: Sample) -> None:
        del i
        self._replay(sample.available_us)
        try:
            members = members_of(sample.value)
        except SortError as wrong:
            self.fault(str(wrong))
            return
        if self.single and len(members) > 1:
            self._is_of_several(len(members))
        elif self.single:
            self._is_told = False
        if self.single and len(members) != 1:
            members = ()
        staying = set(members)
        gone = self.members.keys() - staying
        for member in gone:
            self.members.pop(member).cancel()
        if gone:
            self._past = [each for each in self._past if each[1] not in gone]
        for member in members:
            if member not in self.members:
                self._join(member, sample)
        if self._in_past:
            self._past.sort(key=lambda each: each[:2])

    def _is_of_several(self, named: int) -> None:
        """None of several can be the one that is selected; reported once, until one is named again."""
        if not self._is_told:
            self._is_told = True
            self.fault(
                f"{self._domain.label} names {named} objects at once, so that none is selected: `select` passes one "
                "input at a time, `merge` those of all"
            )

    def end(self) -> None:
        super().end()
        members, self.members = self.members, {}
        self._past.clear()
        for proxy in members.values():
            proxy.cancel()

    def _connect(self, i: int, wanted: Input, from_us: int | None) -> StreamProxy:
        """Take the current members; for the past also the former ones."""
        network, consumer = self._network, partial(self.on_sample, i)
        assert network is not None  # noqa: S101  (only what is attached starts)
        generator = None if from_us is None else network.find(wanted.label)
        if from_us is None or generator is None:
            return network.connect(wanted.label, wanted.policy, consumer, current=True)
        begins_us = generator.prepare(EVER_US)
        if begins_us > EVER_US:
            held = generator.held()
            self._since_us = max(self._since_us, held[0].available_us if held else begins_us)
        return network.connect(wanted.label, wanted.policy, consumer, from_us=begins_us, current=True)

    def _relive(self, _from_us: int | None) -> None:
        for proxy in self.proxies:
            for named in proxy.take_backlog():
                self.on_sample(0, named)
        self._replay(EVER)

    def _join(self, member: str, named: Sample) -> None:
        """A member's stream, from when the member was named."""
        network, wanted = self._network, self._member(member)
        if network is None:
            return
        generator = network.find(wanted.label) if self._in_past else None
        consumer = partial(self._pass, wanted.label)
        if generator is None:
            proxy = network.connect(wanted.label, wanted.policy, consumer)
        else:
            begins_us = generator.prepare(EVER_US)
            held = generator.held()
            if begins_us > EVER_US and (not held or held[0].available_us > named.available_us):
                self._since_us = max(self._since_us, begins_us)
            proxy = network.connect(
                wanted.label, wanted.policy, consumer, from_us=begins_us, after_us=named.available_us
            )
        self.members[member] = proxy
        self._past += [(sample.available_us, member, sample) for sample in proxy.take_backlog()]
        proxy.want(self._grid)

    def _replay(self, until_us: int) -> None:
        """Pass on the members' samples in the past before `until_us`."""
        passed = bisect_left(self._past, until_us, key=lambda each: each[0])
        for _, member, sample in self._past[:passed]:
            self._pass(self._member(member).label, sample)
        del self._past[:passed]

    def _pass(self, label: Label, sample: Sample) -> None:
        if self._generator is not None and self.is_of_sort(sample):
            self.pass_on(label, sample)


class Heard:
    """The state of one of several producers: when it was heard last, and since when without a silence."""

    __slots__ = ("last_us", "recent", "since_us")

    def __init__(self) -> None:
        self.recent: deque[Sample] = deque(maxlen=KEPT)
        self.last_us = self.since_us = -EVER

    def note(self, sample: Sample, silence_us: int) -> None:
        """A sample counts if it has a value and is newer than the sample before."""
        if sample.value is NO_VALUE or (self.recent and sample.valid_us <= self.recent[-1].valid_us):
            return
        if sample.available_us - self.last_us > silence_us:
            self.since_us = sample.available_us
        self.recent.append(sample)
        self.last_us = sample.available_us


class Failover(Relay):
    """Passes on the samples of one of several redundant producers: of the first, in their order, that is heard (3.2).

    A producer is silent when it has had no new value for its `sample every` and its `max delay` together, `PATIENCE_US`
    each where it declares none. When the one in use is silent the first of the others takes over, beginning with the
    samples that it brought meanwhile; no valid time is passed on again. A preferred producer comes back when it has
    been heard for `RETURN` such times without a silence. No other sample takes a stream over, whatever is in it: a
    sample valid further ahead than that time is refused.

    Attributes:
        used: the input in use, counted from 0; None: all are silent.
    """

    def __init__(self, inputs: Sequence[Input]) -> None:
        super().__init__()
        self._wanted = tuple(inputs)
        self.begin()

    def inputs(self) -> Sequence[Input]:
        return self._wanted

    def begin(self) -> None:
        self.used: int | None = 0
        self._heard = [Heard() for _ in self._wanted]
        self._begins = True
        self._passed_us = self._after_us = -EVER
        if self._network is not None:
            self._network.step(self)

    def end(self) -> None:
        super().end()
        if self._network is not None:
            self._network.unstep(self)

    @property
    def deadline_us(self) -> int | None:
        """When the one in use will be silent; far away, and not none, while all are."""
        if not self.running:
            return None
        if self.used is None:
            return FAR_US
        if self._begins:
            return self._network.now_us if self._network is not None else None
        return self._heard[self.used].last_us + self._silence_us(self.used) + 1

    def on_time(self, now_us: int) -> None:
        if self._begins:  # the preferred one has as long as any to be heard first
            self._begins, self._heard[0].last_us, self._heard[0].since_us = False, now_us, now_us
        self._choose(now_us)

    def on_sample(self, i: int, sample: Sample) -> None:
        silence_us, before = self._silence_us(i), self.used
        if not self.is_of_sort(sample):
            return
        if sample.valid_us > sample.available_us + silence_us:
            self.fault(f"{self._wanted[i].label} says what is valid {print_span(-sample.delay_us)} ahead: refused")
            return
        if self._begins:
            self.on_time(sample.available_us)
        self._heard[i].note(sample, silence_us)
        self._choose(sample.available_us)
        if self.used == i == before:
            self._bring(i, sample)

    @property
    def producer(self) -> Label | None:
        """The stream that this one is from now; None: all are silent, or it has no subscriber."""
        return None if self.used is None or not self.running else self._wanted[self.used].label

    def told(self) -> tuple[str, ...]:
        """Which producer is in use, and which are silent; for users."""
        if self._begins:
            return ()
        now_us = 0 if self._network is None else self._network.now_us
        silent = ", ".join(str(each.label) for i, each in enumerate(self._wanted) if not self._is_heard(i, now_us))
        if self.used is None:
            return ("from none: all are silent",)
        return (f"from {self._wanted[self.used].label}{f'; silent: {silent}' if silent else ''}",)

    def _silence_us(self, i: int) -> int:
        policy = self._wanted[i].policy
        stretched = self.proxies[i].stretched if i < len(self.proxies) else 1
        period_us = PATIENCE_US if policy.sample_us is None else policy.sample_us * stretched
        return period_us + (PATIENCE_US if policy.max_delay_us is None else policy.max_delay_us)

    def _is_heard(self, i: int, now_us: int) -> bool:
        return now_us - self._heard[i].last_us <= self._silence_us(i)

    def _choose(self, now_us: int) -> None:
        used = self.used
        heard = [i for i in range(len(self._wanted)) if self._is_heard(i, now_us)]
        if used not in heard:
            chosen = heard[0] if heard else None
        else:
            back = (i for i in heard if now_us - self._heard[i].since_us >= RETURN * self._silence_us(i))
            chosen = min(used, next(back, used))
        if chosen != used:
            self._use(chosen, now_us)

    def _use(self, chosen: int | None, now_us: int) -> None:
        """Use another producer from now on, and its samples while the one before was silent."""
        self.used, self._after_us = chosen, self._passed_us
        if self._network is not None and self._generator is not None and not self._in_past:
            self._network.on_producer(self._generator.label, None if chosen is None else self._wanted[chosen].label)
        if chosen is not None:
            for sample in tuple(self._heard[chosen].recent):
                self._bring(chosen, sample._replace(available_us=now_us))

    def _bring(self, i: int, sample: Sample) -> None:
        if sample.valid_us > self._after_us:
            self._passed_us = max(self._passed_us, sample.valid_us)
            self.pass_on(self._wanted[i].label, sample)


Member = TypeVar("Member", bound=Hashable)


class Configuration(Generic[Member]):
    """Sees to it that for each member that a stream names there is what belongs to it (Def. 3.3.4).

    Args:
        create: a member came, or may lack what belongs to it; `remove`: it went.
        named: the members that a value of the stream names; raises SortError.
        admit: called before any change with the number of newcomers; raises SortError, and all stays.
    """

    def __init__(
        self,
        network: ProcessNetwork,
        domain: Input,
        create: Callable[[Member], None],
        remove: Callable[[Member], None],
        named: Callable[[Value], Sequence[Member]],
        admit: Callable[[int], None] = lambda _more: None,
    ) -> None:
        self._network, self.domain, self._create, self._remove, self._admit = network, domain, create, remove, admit
        self._named = named
        self.members: dict[Member, None] = {}
        self.proxy = network.connect(domain.label, domain.policy, self._on_sample, current=True)

    def renew(self) -> None:
        """Some of what belongs to the members may be gone: create it again where it is."""
        for member in tuple(self.members):
            self._create(member)

    def cancel(self) -> None:
        """All members go."""
        self.proxy.cancel()
        self._set(())

    def _on_sample(self, sample: Sample) -> None:
        try:
            members = self._named(sample.value)
            self._admit(len(members) - len(self.members))
        except SortError as wrong:
            self._network.on_fault(self.domain.label, str(wrong))
        else:
            self._set(members)

    def _set(self, members: Sequence[Member]) -> None:
        staying = set(members)
        for gone in [member for member in self.members if member not in staying]:
            del self.members[gone]
            self._remove(gone)
        for new in members:
            if new not in self.members:
                self.members[new] = None
                self._create(new)
