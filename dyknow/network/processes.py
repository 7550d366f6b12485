"""Knowledge processes that work on demand: while a stream of theirs is wanted they take streams, and only then (3.3)."""

from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from itertools import groupby
from operator import itemgetter

from dyknow.model.errors import SortError, TooEarly, raised
from dyknow.model.labels import Label
from dyknow.model.sample import Sample, Value
from dyknow.network.generator import Generator
from dyknow.network.process import Input, ProcessNetwork
from dyknow.network.prototypes import Reading, SourcePrototype
from dyknow.network.stream_proxy import StreamProxy
from dyknow.policies.sampling import Grid

EVER_US = -(2**80)
MAX_TIMERS = 16_384
"""Timers of the past that go off one by one; after that, time is let pass from sample to sample."""
MAX_FAULT = 200


class OnDemand:
    """The common part of processes; each states its inputs (`inputs`) and its work (`begin`, `on_sample`, `end`).

    A process that begins with a past sees it as if it had been there then: samples of all inputs in the order in which
    they became available, at one instant in the order of the inputs. Their outputs go to the history of its generator.

    Attributes:
        proxies: its input streams; none while it is dormant.
        remembers: how many samples its generator keeps; None: as many as others of the network.
    """

    history_us = 0
    remembers: int | None = None

    def __init__(self) -> None:
        self.proxies: tuple[StreamProxy, ...] = ()
        self._network: ProcessNetwork | None = None
        self._generator: Generator | None = None
        self._running = self._in_past = self._changing = self._settling = self._confined = False
        self._wanted_grid: Grid | None = None
        self._since_us = EVER_US

    # Inputs and work of a process

    def inputs(self) -> Sequence[Input]:
        """The streams it takes now; none, unless it says so."""
        return ()

    def begin(self) -> None:
        """Forget everything: nothing has come yet."""

    def on_sample(self, i: int, sample: Sample) -> None:
        """Input `i`, counted from 0, has a new sample; call `emit` for outputs."""

    def on_instant(self) -> None:
        """All samples of one instant have been taken."""

    def end(self) -> None:
        """Hold nothing."""

    def emit(self, sample: Sample) -> None:
        """The process has a new sample, available now."""
        generator = self._generator
        if generator is None:
            return
        if self._in_past:
            generator.remember(sample)
            return
        generator.push(sample)
        if self._settling:
            self._narrow()

    def want(self, grid: Grid | None) -> bool:
        """Only what lies on `grid` is of use to the subscribers of its stream; whether less is computed for that."""
        del grid
        return False

    def taken(self) -> Iterable[Label]:
        """Where its samples come from."""
        return [proxy.label for proxy in self.proxies]

    def on_time(self, now_us: int) -> None:
        """Time has passed."""

    @property
    def deadline_us(self) -> int | None:
        """When it makes samples by itself."""
        return None

    def fault(self, said: str) -> None:
        """Code of a user failed: it is reported, and the process continues."""
        if self._network is not None and self._generator is not None:
            self._network.on_fault(self._generator.label, said[:MAX_FAULT])

    # How it works on demand

    @property
    def running(self) -> bool:
        """Whether it computes."""
        return self._running

    def attach(self, network: ProcessNetwork, generator: Generator) -> None:
        self._network, self._generator = network, generator

    def detach(self) -> None:
        self._generator = None
        self._rest()
        self._network = None

    def on_demand(self) -> None:
        if self._changing or self._generator is None:
            return
        if not self._generator.subscriptions:
            self._rest()
            return
        if not self._running:
            self._start(None)
        self._narrow()

    def _narrow(self) -> None:
        """Ask for no more than is asked for."""
        if self._generator is not None:
            wanted = self._generator.wanted
            self._settling = wanted is None and any(s.adapter.settling for s in self._generator.subscriptions)
            before, self._confined = self._confined, self.want(wanted)
            if before and wanted != self._wanted_grid:  # the samples computed until now are incomplete
                self._since_us = max(self._since_us, self._now_us())
            self._wanted_grid = wanted

    def since_us(self) -> int:
        """The earliest valid time from which what it makes can be had."""
        if self._running:
            return self._now_us() if self._confined else self._since_us
        return max((self._held_since_us(each.label) for each in self.inputs()), default=EVER_US)

    def reach(self, from_us: int | None) -> None:
        """Begin with the past, from a time on or with all that is held.

        Raises:
            TooEarly: that is no longer held, or the process began without it.
        """
        earliest_us = self.since_us()
        if from_us is not None and from_us < earliest_us:
            raise TooEarly(self._label, from_us, earliest_us)
        if not self._running:
            self._start(earliest_us if from_us is None else from_us)

    def _start(self, from_us: int | None) -> None:
        self._changing = self._running = True
        wanted = self.inputs()
        proxies: list[StreamProxy] = []
        try:
            self._since_us = EVER_US if from_us is None else from_us
            self.begin()
            begins_us = self._begins_us(wanted, from_us)
            for i, each in enumerate(wanted):
                proxies.append(self._connect(i, each, begins_us))
        finally:
            self.proxies = tuple(proxies)
            self._changing = False
            if len(proxies) < len(wanted):
                self._rest()
        if from_us is None:
            self._since_us = self._now_us()
        self._in_past = True
        self._relive(begins_us)
        self._in_past = False

    def _relive(self, from_us: int | None) -> None:
        """Go through what the inputs brought before now; where that is nothing the policies let through, time passed."""
        proxies, now_us = self.proxies, self._network.now_us if self._network is not None else 0
        past = [(sample.available_us, i, sample) for i, proxy in enumerate(proxies) for sample in proxy.take_backlog()]
        past.sort(key=lambda each: each[:2])
        has_come = past or any(self._newest_us(each.label) is not None for each in self.inputs())
        if from_us is None or not has_come or (from_us <= 0 and not past):
            return
        self.on_time(min(from_us, now_us) if from_us > 0 else past[0][0])
        timers = MAX_TIMERS
        for available_us, together in groupby(past, itemgetter(0)):
            timers = self._tick(available_us - 1, timers)
            for _, i, sample in together:
                self.on_sample(i, sample)
            self.on_instant()
        self._tick(now_us - 1, timers)

    def _tick(self, until_us: int, timers: int) -> int:
        """Let time pass from one deadline to the next, at most `timers`; return how many are left."""
        while timers and (due_us := self.deadline_us) is not None and due_us <= until_us:
            self.on_time(due_us)
            timers -= 1
        if not timers:
            self.on_time(until_us)
        return timers

    def _connect(self, i: int, wanted: Input, from_us: int | None) -> StreamProxy:
        network = self._network
        assert network is not None  # noqa: S101  (only what is attached starts)
        generator = None if from_us is None else network.find(wanted.label)
        if from_us is None or generator is None:
            return network.connect(wanted.label, wanted.policy, partial(self.on_sample, i))
        begins_us = generator.prepare(from_us)
        if begins_us > from_us:
            self._since_us = max(self._since_us, begins_us)
        return network.connect(wanted.label, wanted.policy, partial(self.on_sample, i), from_us=begins_us)

    def _begins_us(self, wanted: Sequence[Input], from_us: int | None) -> int | None:
        """From when on the inputs are taken: also what the process needs to get going, where that is held."""
        if from_us is not None:
            return from_us - self.history_us
        if not self.history_us:
            return None
        newest_us = [valid_us for each in wanted if (valid_us := self._newest_us(each.label)) is not None]
        return max(newest_us) - self.history_us if newest_us else None

    def _now_us(self) -> int:
        """Earlier samples are unknown to a process that begins just now."""
        return max(map(self._beginning_us, self.taken()), default=EVER_US)

    def _beginning_us(self, label: Label) -> int:
        newest_us = self._newest_us(label)
        return self._held_since_us(label) if newest_us is None else newest_us + 1

    def _newest_us(self, label: Label) -> int | None:
        network = self._network
        generator = None if network is None else network.behind(label)
        if generator is None:
            return None
        history = generator.history
        return history.get_latest_vtime().valid_us if history.get_size() else None

    def _held_since_us(self, label: Label) -> int:
        generator = None if self._network is None else self._network.behind(label)
        return EVER_US if generator is None else generator.since_us

    def _rest(self) -> None:
        if not self._running:
            return
        self._running = self._settling = self._confined = False
        self._wanted_grid = None
        proxies, self.proxies = self.proxies, ()
        for proxy in proxies:
            proxy.cancel()
        self.end()
        if self._generator is not None:
            self._generator.reset()

    @property
    def _label(self) -> str:
        return "" if self._generator is None else str(self._generator.label)


class SourceReader(OnDemand):
    """A primitive process: reads a source while there is demand, each sample when its valid time has come."""

    def __init__(self, prototype: SourcePrototype) -> None:
        super().__init__()
        self.prototype = prototype
        self._readings: Iterator[Reading] = iter(())
        self._next: tuple[int, Value | list[Value]] | None = None

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
        """One sample: the caller looks at the clock before the next, and lets others have their turn."""
        if self._next is None or self._next[0] > now_us:
            return
        (valid_us, value), generator = self._next, self._generator
        self._advance()
        if generator is None or self._network is None:
            return
        with self._network.instant.whole():
            for each in value if isinstance(value, list) else (value,):
                try:
                    generator.sort.check(each)
                except SortError as wrong:
                    self.fault(f"{self.prototype.name} made what is not of its sort: {wrong}")
                else:
                    self.emit(Sample(now_us, valid_us, each))

    @property
    def deadline_us(self) -> int | None:
        return self._next[0] if self.running and self._next is not None else None

    def end(self) -> None:
        self._readings, self._next = iter(()), None
        if self._network is not None:
            self._network.unstep(self)

    def _start(self, from_us: int | None) -> None:
        super()._start(from_us)
        if self._network is not None:
            self._since_us = self._network.now_us

    def _advance(self) -> None:
        last_us = EVER_US if self._next is None else self._next[0]
        try:
            self._next = _timed(next(self._readings))
        except StopIteration:
            self._next = None
        except Exception as wrong:  # noqa: BLE001  (it is a user's code)
            self._next = None
            self.fault(f"{raised(self.prototype.name, wrong)}; it is read no more")
        else:
            if self._next[0] < last_us:
                self.fault(f"{self.prototype.name} went back from {last_us} to {self._next[0]} us; it is read no more")
                self._next = None


def _timed(reading: Reading) -> tuple[int, Value | list[Value]]:
    valid_us, value = reading
    if valid_us is None:
        raise TypeError("the valid time None, for the time of the reading, is for sources in hosts")
    return int(valid_us), value
