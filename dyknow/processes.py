"""Knowledge processes that work on demand: while a stream of theirs is wanted they take streams, and only then (3.3)."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

from dyknow.compunits import ComputationalUnit
from dyknow.errors import SortError, ValueNotAvailable
from dyknow.generator import Generator
from dyknow.instants import print_span
from dyknow.labels import Label
from dyknow.policy import Policy
from dyknow.prototypes import Reading, SourcePrototype, UnitPrototype
from dyknow.sample import SURE, Quality, Sample, Value
from dyknow.sampling import PolicyAdapter
from dyknow.stream_proxy import StreamProxy

if TYPE_CHECKING:
    from dyknow.network import Network

EVER_US = -(2**80)
MAX_FAULT = 200
OnFault: TypeAlias = Callable[[Label, str], None]


class Input(NamedTuple):
    """An input stream: the label of its generator, and a policy."""

    label: Label
    policy: Policy = Policy()


class OnDemand:
    """What the processes have in common; each says what it takes (`_inputs`) and does (`_begin`, `_on_sample`, `_end`).

    A process that begins with a past sees it as if it had been there then: samples of all inputs in the order in which
    they became available. What it makes of them goes to the history of its generator.

    Attributes:
        proxies: its input streams; none while it rests.
    """

    history_us = 0
    samplewise = False

    def __init__(self) -> None:
        self.proxies: tuple[StreamProxy, ...] = ()
        self._network: Network | None = None
        self._generator: Generator | None = None
        self._running = self._in_past = self._changing = False
        self._since_us = EVER_US

    # What a process is

    def inputs(self) -> Sequence[Input]:
        """The streams it takes now."""
        raise NotImplementedError

    def begin(self) -> None:
        """Forget everything: nothing has come yet."""

    def on_sample(self, i: int, sample: Sample) -> None:
        """Input `i`, counted from 0, has a new sample; call `emit` for what comes of it."""
        raise NotImplementedError

    def end(self) -> None:
        """Hold nothing."""

    def emit(self, valid_us: int, value: Value, now_us: int, quality: Quality = SURE) -> None:
        """The process has a new sample."""
        generator = self._generator
        if generator is not None:
            (generator.remember if self._in_past else generator.push)(valid_us, value, now_us, quality)

    def fault(self, said: str) -> None:
        """Something a person wrote does not work: it is told, and the process goes on."""
        if self._network is not None and self._generator is not None:
            self._network.on_fault(self._generator.label, said[:MAX_FAULT])

    # How it works on demand

    @property
    def running(self) -> bool:
        """Whether it computes."""
        return self._running

    def attach(self, network: "Network", generator: Generator) -> None:
        self._network, self._generator = network, generator

    def detach(self) -> None:
        self._rest()
        self._network = self._generator = None

    def on_demand(self) -> None:
        if self._changing or self._generator is None:
            return
        if not self._generator.subscriptions:
            self._rest()
            return
        if not self._running:
            self._start(None)
        if self.samplewise:
            wanted = self._generator.wanted
            for proxy in self.proxies:
                proxy.want(wanted)

    def since_us(self) -> int:
        """The earliest valid time from which what it makes can be had."""
        if self._running:
            return self._since_us
        return max((self._held_since_us(each.label) for each in self.inputs()), default=EVER_US)

    def reach(self, from_us: int | None) -> None:
        """Begin with the past, from a time on or with all that is held.

        Raises:
            ValueNotAvailable: that is not held any more, or the process began without it.
        """
        earliest_us = self.since_us()
        if from_us is not None and from_us < earliest_us:
            raise ValueNotAvailable(
                f"{self._label} cannot begin at {from_us} us: the earliest possible time is {earliest_us} us, "
                f"{print_span(earliest_us - from_us)} later"
            )
        if not self._running:
            self._start(earliest_us if from_us is None else from_us)

    def _start(self, from_us: int | None) -> None:
        self._changing = self._running = True
        self.begin()
        wanted = self.inputs()
        begins_us = self._begins_us(wanted, from_us)
        try:
            proxies = [self._connect(i, each, begins_us) for i, each in enumerate(wanted)]
        finally:
            self._changing = False
        self.proxies = tuple(proxies)
        self._since_us = max(map(self._beginning_us, wanted), default=EVER_US) if from_us is None else from_us
        past = [(sample.available_us, i, sample) for i, proxy in enumerate(proxies) for sample in proxy.take_backlog()]
        self._in_past = True
        for _, i, sample in sorted(past, key=lambda each: each[:2]):
            self.on_sample(i, sample)
        self._in_past = False

    def _connect(self, i: int, wanted: Input, from_us: int | None) -> StreamProxy:
        network = self._network
        assert network is not None  # noqa: S101  (only what is attached starts)
        if from_us is not None and network.has(wanted.label):
            from_us = max(from_us, self._held_since_us(wanted.label))
        return network.connect(wanted.label, wanted.policy, partial(self.on_sample, i), from_us=from_us)

    def _begins_us(self, wanted: Sequence[Input], from_us: int | None) -> int | None:
        """From when on the inputs are taken: also what the process needs to get going, where that is held."""
        if from_us is not None:
            return from_us - self.history_us
        if not self.history_us:
            return None
        newest_us = [valid_us for each in wanted if (valid_us := self._newest_us(each.label)) is not None]
        return max(newest_us) - self.history_us if newest_us else None

    def _beginning_us(self, wanted: Input) -> int:
        """What was valid before is unknown to a process that began just now."""
        newest_us = self._newest_us(wanted.label)
        return self._held_since_us(wanted.label) if newest_us is None else newest_us + 1

    def _newest_us(self, label: Label) -> int | None:
        network = self._network
        if network is None or not network.has(label):
            return None
        history = network.generator(label).history
        return history.get_latest_vtime().valid_us if history.get_size() else None

    def _held_since_us(self, label: Label) -> int:
        network = self._network
        if network is None or not network.has(label):
            return EVER_US
        return network.generator(label).since_us

    def _rest(self) -> None:
        if not self._running:
            return
        self._running = False
        proxies, self.proxies = self.proxies, ()
        for proxy in proxies:
            proxy.cancel()
        self.end()
        if self._generator is not None:
            self._generator.history.reset()
            self._generator.last_us = EVER_US

    @property
    def _label(self) -> str:
        return "" if self._generator is None else str(self._generator.label)


class Refinement(OnDemand):
    """A computational unit over streams (Def. 4.3.15, 4.5.8). What a unit raises is told and ends nothing.

    With an `output` policy, one without approximation, what the unit makes is adapted to it before anybody gets it.
    """

    def __init__(self, prototype: UnitPrototype, inputs: Sequence[Input], output: Policy | None = None) -> None:
        super().__init__()
        self.prototype = prototype
        self._output = output
        self._adapter: PolicyAdapter | None = None
        self.history_us, self.samplewise = prototype.history_us, prototype.samplewise
        self._wanted = tuple(inputs)
        self._unit: ComputationalUnit | None = None

    def inputs(self) -> Sequence[Input]:
        return self._wanted

    def begin(self) -> None:
        self._adapter = None if self._output is None else PolicyAdapter(self._output)
        try:
            self._unit = ComputationalUnit(self.prototype.make(), len(self._wanted))
        except Exception as wrong:  # noqa: BLE001  (it is a user's code)
            self._unit = None
            self.fault(f"{self.prototype.name} cannot be made: {wrong!r}")

    def on_sample(self, i: int, sample: Sample) -> None:
        unit, generator = self._unit, self._generator
        if unit is None or generator is None:
            return
        try:
            output = unit.on_sample(i, sample, sample.available_us)
            if output is None:
                return
            generator.sort.check(output.value)
        except SortError as wrong:
            self.fault(f"{self.prototype.name} made what is not of its sort: {wrong}")
        except Exception as wrong:  # noqa: BLE001  (it is a user's code)
            self.fault(f"{self.prototype.name} raised {wrong!r}")
        else:
            made = [output]
            if self._adapter is not None:
                made = self._adapter.on_sample(output._replace(available_us=sample.available_us), sample.available_us)
            for each in made:
                self.emit(each.valid_us, each.value, sample.available_us, each.quality)

    def end(self) -> None:
        self._unit = None

    def exchange(self, prototype: UnitPrototype) -> None:
        """Let another unit over the same sorts do the work from now on; its memory begins empty."""
        self.prototype = prototype
        self.samplewise = prototype.samplewise
        if self._running:
            self.begin()
            if not self.samplewise:
                for proxy in self.proxies:
                    proxy.want(None)
            self.on_demand()


class Reader(OnDemand):
    """A primitive process: reads a source while somebody wants it, each sample when its valid time has come."""

    def __init__(self, prototype: SourcePrototype) -> None:
        super().__init__()
        self.prototype = prototype
        self._readings: Iterator[Reading] = iter(())
        self._next: tuple[int, Value] | None = None

    def inputs(self) -> Sequence[Input]:
        return ()

    def begin(self) -> None:
        network, read = self._network, self.prototype.read
        if network is None or read is None:
            return
        try:
            self._readings = read(network.now_us)
        except Exception as wrong:  # noqa: BLE001  (it is a user's code)
            self.fault(f"{self.prototype.name} cannot be read: {wrong!r}")
        self._advance()
        network.step(self)

    def since_us(self) -> int:
        if self.running or self._network is None:
            return self._since_us
        return self._network.now_us

    def on_time(self, now_us: int) -> None:
        while self._next is not None and self._next[0] <= now_us:
            (valid_us, value), generator = self._next, self._generator
            self._advance()
            try:
                if generator is not None:
                    generator.sort.check(value)
            except SortError as wrong:
                self.fault(f"{self.prototype.name} made what is not of its sort: {wrong}")
            else:
                self.emit(valid_us, value, now_us)

    @property
    def deadline_us(self) -> int | None:
        return self._next[0] if self.running and self._next is not None else None

    def end(self) -> None:
        self._readings, self._next = iter(()), None

    def _start(self, from_us: int | None) -> None:
        super()._start(from_us)
        if self._network is not None:
            self._since_us = self._network.now_us

    def _advance(self) -> None:
        try:
            self._next = _timed(next(self._readings))
        except StopIteration:
            self._next = None
        except Exception as wrong:  # noqa: BLE001  (it is a user's code)
            self._next = None
            self.fault(f"{self.prototype.name} raised {wrong!r}; it is read no more")


def _timed(reading: Reading) -> tuple[int, Value]:
    valid_us, value = reading
    if valid_us is None:
        raise TypeError("the valid time None, for the time of the reading, is for sources in hosts")
    return int(valid_us), value
