"""The local instance: sources, computational units, stream generators and streams, wired (thesis, ch. 4 and 5.4)."""

from collections.abc import Callable

from dyknow.model.errors import LabelAlreadyExists, SortError, UnknownLabel, ValueNotAvailable
from dyknow.model.labels import Label
from dyknow.model.sample import Sample
from dyknow.model.values import Sort
from dyknow.network.computational_unit import component
from dyknow.network.generator import Consumer, Generator, Subscription
from dyknow.network.history import History
from dyknow.network.instant import Instant
from dyknow.network.process import CallsApart, Input, Outcome, Process, TimedProcess
from dyknow.network.processes import OnDemand
from dyknow.network.prototypes import UnitPrototype
from dyknow.network.refinement import RefinementProcess
from dyknow.network.stream_proxy import OnLink, StreamProxy
from dyknow.network.timed import TimedProcesses
from dyknow.policies.policy import Policy


class Network:
    """Samples flow by plain calls: a push returns when every unit and consumer behind it has run.

    A unit names its inputs, which exist already, so what flows never comes back. Consumers may subscribe, cancel,
    add and remove while they are called. Call `on_time` at `deadline_us`. Times: microseconds of federation time.

    Attributes:
        calls: of slow units, in workers, where there are any.
        instant: the samples of one push.
    """

    __slots__ = (
        "_attributes", "_generators", "_history", "_implicit", "_meeting", "_processes", "_ranks", "_timed",
        "_waiting", "calls", "instant", "now_us", "on_fault", "on_producer", "resolve",
    )  # fmt: skip

    def __init__(self, history: int = 4096) -> None:
        self._history = history
        self._generators: dict[Label, Generator] = {}
        self.now_us = 0
        self.on_fault: Callable[[Label, str], None] = lambda _label, _said: None
        self.on_producer: Callable[[Label, Label | None], None] = lambda _label, _producer: None
        self._processes: dict[Label, Process] = {}
        self._attributes: dict[Label, dict[Label, None]] = {}
        self._implicit: dict[Label, None] = {}
        self.resolve: Callable[[Label], tuple[Sort, Process] | None] = lambda _label: None
        self._waiting: dict[Label, list[StreamProxy]] = {}
        self._meeting: dict[int, Callable[[Label], None]] = {}
        self.calls = CallsApart()
        self.instant = Instant()
        self._timed = TimedProcesses(self.instant)
        self._ranks: dict[Label, int] = {}

    def add_source(self, label: Label | str, sort: Sort, history: int | None = None) -> Generator:
        """A generator fed by `push`, with its own length of history if one is given.

        Raises:
            LabelAlreadyExists: the label is taken.
        """
        return self._add(Generator(Label.of(label), sort, history or self._history), None)

    def push(self, label: Label | str, sample: Sample) -> None:
        """A source has a new sample, available now.

        Raises:
            UnknownLabel: no generator carries `label`.
        """
        generator = self._generators.get(label)  # type: ignore[arg-type]
        if generator is None:
            generator = self.generator(label)  # a text is parsed here, off the fast path
        self.now_us = sample.available_us
        generator.push(sample)

    def connect(
        self,
        label: Label | str,
        policy: Policy | str,
        consumer: Consumer,
        on_link: OnLink | None = None,
        *,
        from_us: int | None = None,
        after_us: int | None = None,
        current: bool = False,
    ) -> StreamProxy:
        """A stream for `consumer` whether a generator carries the label yet or not; `on_link` hears when that changes.

        With `from_us` it begins in the past, as if it had been there then (with `after_us`: as if it had begun at that
        available time): take the proxy's backlog first. A `current` one is handed the newest sample there is as soon as
        there is a generator. Label and policy may be text: `network.connect("pos[car1]", "sample every 100ms", print)`.

        Raises:
            ValueNotAvailable: it cannot begin so early.
            TextError, PolicyError: the text is no label, or no policy.
        """
        self._ranks = {}
        label = Label.of(label)
        proxy = StreamProxy(self, label, Policy.of(policy).at(self.now_us), consumer, on_link, current=current)
        generator = self.find(label)
        if generator is None:
            self.wait(proxy)
            return proxy
        try:
            proxy.link(generator, from_us, after_us)
        except ValueNotAvailable:
            self.tidy(generator.label)
            raise
        return proxy

    def add_process(self, label: Label, sort: Sort, process: Process) -> Generator:
        """A generator fed by a process that works on demand.

        Raises:
            LabelAlreadyExists: the label is taken.
        """
        return self._add(Generator(label, sort, getattr(process, "remembers", None) or self._history), process)

    def replace_process(self, label: Label, sort: Sort, process: Process | None) -> Generator:
        """Let another process feed a generator; subscriptions, order and history stay. None: samples are pushed.

        Raises:
            UnknownLabel: no generator carries `label`.
            SortError: the output of the new process is of another sort.
        """
        generator = self.generator(label)
        if generator.sort != sort:
            raise SortError(f"{label} is a stream of {generator.sort.name}, which {sort.name} cannot replace")
        self._take(generator)
        if process is not None:
            if not generator.subscriptions:
                generator.reset()
            generator.succeed()
            self._give(generator, process)
        return generator

    def process(self, label: Label) -> Process | None:
        """The process on demand behind a generator."""
        return self._processes.get(label)

    def snapshot(self, label: Label) -> History:
        """The history of a stream, for the queries of 5.3.2; a stream on demand is computed for it.

        Raises:
            UnknownLabel: no generator carries `label`.
        """
        generator = self.find(label)
        if generator is None:
            raise self._unknown(label)
        if generator.owner is None or generator.subscriptions:
            return generator.history
        generator.owner.reach(None)
        held = generator.history.copy()
        generator.owner.on_demand()
        self.tidy(generator.label)
        return held

    def release(self, label: Label) -> Generator | None:
        """Take the label off its generator, which keeps its process and streams; None: no generator has it (5.4.2)."""
        self._ranks = {}
        self._implicit.pop(label, None)
        self._processes.pop(label, None)
        return self._generators.pop(label, None)

    def remove(self, label: Label) -> None:
        """Take a generator away, with the process that feeds it; its streams end.

        Raises:
            UnknownLabel: no generator carries `label`.
        """
        generator = self.generator(label)
        for attribute in self._attributes.pop(label, ()):
            self.remove(attribute)
        stem = _stem(label)
        if label in self._attributes.get(stem, ()):
            del self._attributes[stem][label]
            if not self._attributes[stem]:
                del self._attributes[stem]
        self._take(generator)
        self.release(label)
        generator.end()

    def generator(self, label: Label | str) -> Generator:
        """The generator that carries `label`.

        Raises:
            UnknownLabel: there is none.
        """
        named = Label.parse(label) if isinstance(label, str) else label
        generator = self._generators.get(named)
        if generator is None:
            raise self._unknown(named)
        return generator

    def find(self, label: Label) -> Generator | None:
        """The generator that carries `label`, or is made because it is asked for; None if there is none."""
        return self._generators.get(label) or self._attribute(label) or self._resolved(label)

    def behind(self, label: Label) -> Generator | None:
        """The generator that carries `label`, or of whose values that is an attribute; none is made."""
        return self._generators.get(label) or self._generators.get(_stem(label))

    def has(self, label: Label) -> bool:
        """Whether a generator carries `label`."""
        return label in self._generators

    def is_implicit(self, label: Label) -> bool:
        """Whether its generator is there on demand, like that of an attribute."""
        return label in self._implicit

    def labels(self) -> tuple[Label, ...]:
        """Every label, in the order they were added."""
        return tuple(self._generators)

    def on_time(self, now_us: int) -> None:
        """Hand on the samples owed at `now_us`. A source that is read gives one sample: call while something is due."""
        self.now_us = now_us
        with self.instant.whole():
            self._timed.on_time(now_us)

    @property
    def deadline_us(self) -> int | None:
        """Next instant at which `on_time` has work, or None."""
        return self._timed.deadline_us

    def rank(self, label: Label) -> int:
        """How many units, at most, lie between a source and this stream."""
        rank = self._ranks.get(label)
        if rank is None:
            process = self._processes.get(label)
            taken = process.taken() if isinstance(process, OnDemand) else ()
            rank = self._ranks[label] = 1 + max(map(self.rank, taken), default=-1)
        return rank

    def on_computed(self, number: int, outcome: Outcome, took_us: int, now_us: int) -> None:
        """A worker has called a unit."""
        self.now_us = max(self.now_us, now_us)
        self.calls.on_computed(number, outcome, took_us, now_us)

    def watch(self, subscription: Subscription) -> Subscription:
        """Remember the streams that make samples when time passes, and forget those that will not again."""
        if subscription.deadline_us is not None:
            subscription.unwatch = self.unstep
            self.step(subscription)
        return subscription

    def step(self, timed: TimedProcess) -> None:
        """Call it at its deadlines, until it has none; `FAR_US` is: perhaps later."""
        self._timed.step(timed)

    def unstep(self, timed: TimedProcess) -> None:
        """Call it no more."""
        self._timed.unstep(timed)

    def wait(self, proxy: StreamProxy) -> None:
        """Link it as soon as a generator carries its label."""
        self._waiting.setdefault(proxy.label, []).append(proxy)

    def recall(self, label: Label | None = None) -> None:
        """The generators of `resolve` can be made now: serve clients that wait for this label, or for any."""
        for each in tuple(self._waiting):
            if label is None or each == label:
                self.find(each)

    def forget(self, proxy: StreamProxy) -> None:
        """It waits no more."""
        waiting = self._waiting.get(proxy.label)
        if waiting is not None and proxy in waiting:
            waiting.remove(proxy)
            if not waiting:
                del self._waiting[proxy.label]

    def meet(self, on_label: Callable[[Label], None]) -> Callable[[], None]:
        """Tell of every label there is, and of every other one as it comes; returns how to stop."""
        self._meeting[id(on_label)] = on_label
        for label in tuple(self._generators):
            on_label(label)

        def stop() -> None:
            self._meeting.pop(id(on_label), None)

        return stop

    def _welcome(self, generator: Generator) -> None:
        """Link the clients that waited for the generator, or for an attribute of its values."""
        label = generator.label
        for proxy in self._waiting.pop(label, ()):
            proxy.link(generator)
        if generator.sort.fields:
            for field in generator.sort.fields:
                attribute = Label(f"{label.feature}.{field.name}", label.objects)
                if attribute in self._waiting:
                    self._attribute(attribute)
        for on_label in tuple(self._meeting.values()):
            on_label(label)

    def _attribute(self, label: Label) -> Generator | None:
        """A generator for `feature.attribute[objects]`, if there is one for `feature[objects]` with such a field."""
        feature, _, attribute = label.feature.rpartition(".")
        stem = self._generators.get(Label(feature, label.objects)) if feature else None
        names = [field.name for field in stem.sort.fields] if stem is not None else []
        if stem is None or attribute not in names:
            return None
        at = names.index(attribute)
        unit = UnitPrototype(
            attribute, stem.sort.fields[at].unit, (stem.sort.name,), lambda: component(at, len(names)), True, cost_us=0
        )
        self._attributes.setdefault(stem.label, {})[label] = None
        self._implicit[label] = None
        return self.add_process(label, Sort(stem.sort.fields[at].unit), RefinementProcess(unit, [Input(stem.label)]))

    def tidy(self, label: Label) -> None:
        """Take it away if it was there on demand, and there is none."""
        if label in self._implicit and not self._generators[label].subscriptions:
            self.remove(label)

    def _resolved(self, label: Label) -> Generator | None:
        """A generator that is there on demand."""
        found = self.resolve(label)
        if found is None:
            return None
        self._implicit[label] = None
        return self.add_process(label, *found)

    def _make_room(self, label: Label) -> None:
        """Remove the implicit generator of `label`; its subscribers move to the declared one."""
        if label in self._generators:
            if label not in self._implicit:
                raise LabelAlreadyExists(str(label))
            self.remove(label)

    def sweep(self) -> None:
        """Take away what was there on demand that has ended."""
        for label in tuple(self._implicit):
            self.tidy(label)

    def _add(self, generator: Generator, process: Process | None) -> Generator:
        self._make_room(generator.label)
        self._ranks = {}
        generator.instant = self.instant
        self._generators[generator.label] = generator
        if process is not None:
            self._give(generator, process)
        self._welcome(generator)
        return generator

    def _give(self, generator: Generator, process: Process) -> None:
        self._ranks = {}
        self._processes[generator.label] = process
        process.attach(self, generator)
        generator.owner = process
        process.on_demand()

    def _take(self, generator: Generator) -> None:
        generator.owner = None
        process = self._processes.pop(generator.label, None)
        if process is not None:
            process.detach()

    def _unknown(self, label: Label) -> UnknownLabel:
        return UnknownLabel(str(label), tuple(map(str, self._generators)))


def _stem(label: Label) -> Label:
    """The label whose attribute this label may be."""
    return Label(label.feature.rpartition(".")[0], label.objects)
