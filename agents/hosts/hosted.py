"""A knowledge process host as its platform sees it, and the processes it runs for it (thesis 5.2, 5.3).

A hosted process is on demand like any other: its input streams end here, its generator is here. Its input samples go
to the host as messages, its output comes back later; so its streams cannot begin in the past.
"""

from collections.abc import Callable, Sequence
from itertools import groupby
from typing import Final, NamedTuple

from dyknow import Label, Policy, Prototype, Sort, SourcePrototype, UnitPrototype
from dyknow.federation.hosts import messages
from dyknow.federation.hosts.codec import encode, inputs_of, pack_sample
from dyknow.model.errors import ContentError, DecodeError, SortError, TooEarly
from dyknow.model.sample import Sample
from dyknow.model.values import Field
from dyknow.network.computational_unit import UnitFunction
from dyknow.network.process import Input
from dyknow.network.processes import OnDemand
from dyknow.policies.sampling import Grid

_EVER: Final = 2**63


class HostLink(NamedTuple):
    """An input that the host takes from another of its processes, `maker`: the outputs from one serial up to another."""

    maker: int
    since: int
    until: int


class Host:
    """One host, while its connection lasts.

    Args:
        number: of the connection.
        registration: its registration message.
        unit: of the platform, for the labels of the host's stream generators.
    """

    def __init__(self, number: int, registration: messages.Register, unit: str) -> None:
        self.number, self.registration = number, registration
        self.present = False
        self.dropped = self.dropped_there = 0
        self.processes: dict[int, HostedProcess] = {}
        self.out: list[bytes] = []
        self.due: dict[HostedProcess, None] = {}
        self.fresh: dict[int, None] = {}  # begun since the last flush: nothing of theirs is under way
        self.loose: dict[HostedProcess, None] = {}
        self.delivering: tuple[int, int] | None = None
        self._processes_begun = self._serial = 0
        self._sorts = {
            each.name: Sort(each.name, tuple(Field(*part) for part in each.fields), unit=each.unit)
            for each in registration.sorts
        }
        if len(self._sorts) < len(registration.sorts):
            raise DecodeError("duplicate sort")
        self.prototypes: list[Prototype] = [
            *map(self._unit, registration.units), *(self._source(each) for each in registration.sources if not each.label)
        ]  # fmt: skip
        labelled = [each for each in registration.sources if each.label]
        self.own = {_own_label(each.label, unit): self._source(each) for each in labelled}
        if len(self.own) < len(labelled):
            raise DecodeError("duplicate label")

    @property
    def name(self) -> str:
        """Name in notes to the user."""
        return f"host {self.registration.pid} ({self.registration.module})"

    @property
    def is_owing(self) -> bool:
        """Whether `flush` has something."""
        return bool(self.out or self.due or self.loose)

    def say(self, message: messages.FromPlatform) -> None:
        self.out.append(encode(message))

    def begin(self, process: "HostedProcess", label: Label, output: Policy | None, now_us: int) -> int:
        """Have a process made; its number."""
        self._processes_begun += 1
        number = self._processes_begun
        self.processes[number] = process
        text = "" if output is None else str(output)
        self.say(messages.Begin(number, process.prototype.name, str(label), now_us, text, process.grid))
        self.fresh[number] = None
        return number

    def end(self, number: int) -> None:
        process = self.processes.pop(number, None)
        if process is not None:
            self.due.pop(process, None)
            self.loose.pop(process, None)
            self.fresh.pop(number, None)
            self.say(messages.End(number))

    def flush(self) -> list[bytes]:
        """Take all messages for the host."""
        if self.registration.train:
            self._chain()
        due, self.due = self.due, {}
        for process in due:
            self.out += process.due()
        out, self.out = self.out, []
        return out

    def on_made(self, made: messages.HostOutput, now_us: int) -> None:
        """Pass on the output of a process, if it still has clients. Raises DecodeError if it is invalid."""
        process = self.processes.get(made.process)
        if process is None:
            return
        self.delivering = (made.process, made.serial)
        try:
            process.on_made(made, now_us)
        finally:
            self.delivering = None

    def _chain(self) -> None:
        """Let processes here that take all another one here makes have it without a detour over the platform.

        Only those that begin together, so that no sample overtakes another that is still on that detour.
        """
        fresh, self.fresh = {number: self.processes[number] for number in self.fresh}, {}
        makers = {process.label: number for number, process in fresh.items()}
        for number, process in fresh.items():
            for i, maker in process.chainable(makers):
                self._say_chain(number, process, i, maker)
        loose, self.loose = self.loose, {}
        for process in loose:
            for i in process.stretched():
                self._say_chain(process.number, process, i, 0)

    def _say_chain(self, number: int, process: "HostedProcess", i: int, maker: int) -> None:
        self._serial += 1
        process.chain(i, maker, self._serial)
        self.say(messages.Chain(number, i, maker, self._serial))

    def _unit(self, offer: messages.UnitOffer) -> UnitPrototype:
        def elsewhere(inputs: Sequence[Input], output: Policy | None) -> OnDemand:
            return HostedProcess(self, prototype, inputs, output)

        prototype = UnitPrototype(
            offer.name,
            offer.sort,
            offer.inputs,
            _not_here(offer.name),
            offer.samplewise,
            offer.history_us,
            offer.cheaper,
            priority=offer.priority,
            elsewhere=elsewhere,
            checked_sorts=self._checked(offer.sort, *offer.inputs),
        )
        return prototype

    def _source(self, offer: messages.SourceOffer) -> SourcePrototype:
        def elsewhere() -> OnDemand:
            return HostedProcess(self, prototype)

        prototype = SourcePrototype(
            offer.name, offer.sort, label=offer.label, elsewhere=elsewhere, checked_sorts=self._checked(offer.sort)
        )
        return prototype

    def _checked(self, *names: str) -> tuple[Sort, ...]:
        """The sorts of these names that the host has declared with units or fields."""
        return tuple(self._sorts[name] for name in dict.fromkeys(names) if name in self._sorts)


class HostedProcess(OnDemand):
    """One process at a host.

    Attributes:
        number: its number at the host; 0 while it is dormant.
        grid: the samples of a source that are wanted, so that no others are sent; None: all.
    """

    def __init__(
        self, host: Host, prototype: Prototype, inputs: Sequence[Input] = (), output: Policy | None = None
    ) -> None:
        super().__init__()
        self.prototype = prototype
        self.grid: Grid | None = None
        self._host, self._wanted, self._output = host, tuple(inputs), output
        if isinstance(prototype, UnitPrototype):
            self._is_samplewise, self.history_us = prototype.samplewise, prototype.history_us
        self.number = self._sent = self._taken = 0
        self._backlog = messages.Backlog()
        self._links: dict[int, HostLink] = {}

    def inputs(self) -> Sequence[Input]:
        return self._wanted

    @property
    def label(self) -> Label:
        """Of its generator."""
        assert self._generator is not None  # noqa: S101  (asked only of processes that run)
        return self._generator.label

    # Demand

    def begin(self) -> None:
        self._sent = self._taken = 0
        self._backlog, self._links = messages.Backlog(), {}
        if self._network is not None and self._generator is not None:
            self.grid = None if self._wanted else self._generator.wanted
            self.number = self._host.begin(self, self._generator.label, self._output, self._network.now_us)

    def end(self) -> None:
        self._host.end(self.number)
        self.number, self._links = 0, {}

    def want(self, grid: Grid | None) -> bool:
        if self._wanted:
            if not self._is_samplewise or self._output is not None:
                grid = None
            for proxy in self.proxies:
                proxy.want(grid)
            if self._links:
                self._host.loose[self] = None
        elif grid != self.grid and self.number:
            self.grid = grid
            self._host.say(messages.Want(self.number, grid))
        return grid is not None

    def since_us(self) -> int:
        if self.running or self._network is None:
            return self._since_us
        return self._network.now_us

    def reach(self, from_us: int | None) -> None:
        earliest_us = self.since_us()
        if from_us is not None and from_us < earliest_us:
            raise TooEarly(self._label, from_us, earliest_us, self._host.name)

    def _start(self, from_us: int | None) -> None:
        super()._start(from_us)
        if self._network is not None and not self._wanted:
            self._since_us = self._network.now_us

    # Samples

    def on_sample(self, i: int, sample: Sample) -> None:
        if self._is_linked(i):
            return
        try:
            dropped = self._backlog.put(self._in_past, pack_sample(sample, i))
        except ContentError as wrong:
            self.fault(str(wrong))
            return
        if dropped and self._host.dropped == 0:
            self.fault(f"{self._host.name} takes samples slower than they come: the oldest are dropped")
        self._host.dropped += dropped
        self._host.due[self] = None

    def due(self) -> list[bytes]:
        """The messages that the host has room for."""
        ready = []
        for past, packed in self._backlog.take(messages.WINDOW - (self._sent - self._taken)):
            self._sent += len(packed)
            ready.append(inputs_of(self.number, packed, past))
        return ready

    def on_made(self, made: messages.HostOutput, now_us: int) -> None:
        if not self._taken <= made.taken <= self._sent:
            raise DecodeError("taken", f"{made.taken} of {self._sent}")
        self._taken = made.taken
        if len(self._backlog):
            self._host.due[self] = None
        for _, together in groupby(made.samples, lambda sample: sample.valid_us):
            if self._network is None:
                return  # who got a sample has ended it
            with self._network.instant.whole():
                for sample in together:
                    self._take(sample, now_us, past=made.past)

    def _take(self, sample: Sample, now_us: int, *, past: bool) -> None:
        generator = self._generator
        if generator is None or not self.number:
            return
        try:
            generator.sort.check(sample.value)
        except SortError as wrong:
            self.fault(f"{self.prototype.name} made what is not of its sort: {wrong}")
            return
        if past:
            generator.remember(sample.available_at(min(sample.available_us, now_us)))
        else:
            self.emit(sample.available_at(now_us))

    # Chains

    def chainable(self, makers: dict[Label, int]) -> list[tuple[int, int]]:
        """(input, number of the process) for the inputs that take all samples of one of these processes."""
        taken = enumerate(zip(self._wanted, self.proxies, strict=True))
        return [(i, makers[each.label]) for i, (each, proxy) in taken if each.label in makers and proxy.adapter.is_open]

    def stretched(self) -> list[int]:
        """The inputs that take all no longer."""
        return [i for i, each in self._links.items() if each.until == _EVER and not self.proxies[i].adapter.is_open]

    def chain(self, i: int, maker: int, serial: int) -> None:
        """Note that an input is chained to a process, 0: to none."""
        if maker:
            self._links[i] = HostLink(maker, serial, _EVER)
        else:
            self._links[i] = self._links[i]._replace(until=serial)

    def _is_linked(self, i: int) -> bool:
        """Whether the host has had the sample that is being delivered already."""
        link, delivering = self._links.get(i), self._host.delivering
        if link is None or self._in_past:
            return False
        if link.until == _EVER and not self.proxies[i].adapter.is_open:
            self._host.loose[self] = None
        return delivering is not None and delivering[0] == link.maker and link.since <= delivering[1] < link.until


def _own_label(text: str, unit: str) -> Label:
    feature, objects = Label.parse(text)
    return Label(feature, tuple(unit if each == "self" else each for each in objects))


def _not_here(name: str) -> Callable[..., UnitFunction]:
    def make() -> UnitFunction:
        raise ContentError(f"{name} runs at a host")

    return make
