"""Chronicles over the streams of one instance: what happens is what changes in them (thesis 8.7.3).

An attribute `link[car1]:(?, no_link)` is the stream labelled `link[car1]`, or the attribute of a stream of records: a
sample with another value than the one before is an event, the first one a change from unknown (C2). A message
`in_crossing[car1, x2]` is the stream with that label: each sample is one. Streams are taken as they come to be there.

Samples of several streams come in another order than they are valid. They wait for the declared `max delay`, one second
by default, and are then passed on in the order of their valid times; what is later still is ignored and counted (C3).

What is recognised of a chronicle `overtake` is the stream `chronicle[overtake]`, valid at the recognition; its values
are the arguments of the chronicle, then what its variables and its instants (ms) are. `chronicle[overtake, car1, car2]`
is what of that has these arguments.
"""

from collections.abc import Callable
from functools import partial
from heapq import heappop, heappush
from typing import Final, NamedTuple

from dyknow import NO_VALUE, Inputs, Label, Network, Policy, Sample, Sort, UnitPrototype, Value
from dyknow.model.instants import US_PER_MS, US_PER_S
from dyknow.network.process import FAR_US, Input, Process
from dyknow.network.refinement import RefinementProcess
from dyknow.network.stream_proxy import StreamProxy
from kpl.syntax.specification import RECOGNISED, ChronicleDeclaration
from reasoning import chronicles
from reasoning.chronicles.definition.compilation import Pattern
from reasoning.chronicles.recognition.changes import symbol

SORT: Final = Sort("recognition", is_open=True)
MAX_DELAY_US: Final = US_PER_S
MAX_FAULTS: Final = 64


class QueuedSample(NamedTuple):
    """A sample that waits for its turn; `number` keeps the order in which samples of one time came."""

    valid_us: int
    number: int
    label: Label
    value: Value


class ChronicleWatch:
    """Chronicles recognised over the streams of a network; raises ChronicleError if they cannot be.

    Args:
        delay_us: how late samples may come.
        on_recognised: called with every instance, and when (federation time).
        on_fault: called once for what is wrong with a stream or a chronicle.
        max_age_ms: instances last no longer; None: as their chronicles say.
        initially: the first values of streams have been so since ever (8.4).

    Attributes:
        proxies: the streams that are taken.
        delay_us: how late their samples may come.
        recogniser: what has happened so far; it can be asked for partial instances.
    """

    def __init__(
        self,
        network: Network,
        content: chronicles.ChronicleFile,
        delay_us: int,
        on_recognised: Callable[[chronicles.ChronicleInstance, int], None],
        on_fault: Callable[[Label, str], None],
        limits: chronicles.RecognitionLimits | None = None,
        *,
        max_age_ms: int | None = None,
        initially: bool = False,
    ) -> None:
        compiled = [chronicles.compile_chronicle(each, content, max_age_ms) for each in content.chronicles.values()]
        self.recogniser = chronicles.Recogniser(compiled, limits)
        self._events = chronicles.ChangeEvents(self.recogniser, initially=initially)
        self.proxies: dict[Label, StreamProxy] = {}
        self._network, self.delay_us = network, delay_us
        self._on_recognised, self._on_fault = on_recognised, on_fault
        self._changes: dict[tuple[str, int], list[Pattern]] = {}
        self._messages: dict[tuple[str, int], list[Pattern]] = {}
        for pattern in (pattern for each in compiled for pattern in each.patterns):
            if pattern.change:
                self._changes.setdefault((pattern.name, pattern.arity), []).append(pattern)
            elif pattern.name not in content.chronicles:
                self._messages.setdefault((pattern.name, pattern.arity), []).append(pattern)
        self._waiting: list[QueuedSample] = []
        self._count = 0
        self._told = set[tuple[Label, str]]()
        self._unmeet = network.meet(self._on_label)
        network.step(self)

    @property
    def deadline_us(self) -> int:
        """When something waits no more; `FAR_US`: perhaps later."""
        due_us = self._waiting[0].valid_us if self._waiting else FAR_US
        if self.recogniser.deadline_ms is not None:
            due_us = min(due_us, self.recogniser.deadline_ms * US_PER_MS)
        return min(due_us + self.delay_us, FAR_US)

    def cancel(self) -> None:
        """Take no more streams."""
        self._unmeet()
        self._network.unstep(self)
        for proxy in tuple(self.proxies.values()):
            proxy.cancel()
        self.proxies.clear()

    def on_time(self, now_us: int) -> None:
        """What waited long enough is passed on in its order, and the clock is moved."""
        clock_us = now_us - self.delay_us
        while self._waiting and self._waiting[0].valid_us <= clock_us:
            self._tell(heappop(self._waiting), now_us)
        self._bring(self.recogniser.on_time(clock_us // US_PER_MS), now_us)

    # Which streams

    def _on_label(self, label: Label) -> None:
        """A stream is there: take what of it are events."""
        objects = len(label.objects)
        for name, arity in (*self._changes, *self._messages):
            if arity == objects and (name == label.feature or name.rpartition(".")[0] == label.feature):
                self._take(Label(name, label.objects))

    def _take(self, label: Label) -> None:
        key = (label.feature, len(label.objects))
        patterns = (*self._changes.get(key, ()), *self._messages.get(key, ()))
        if label in self.proxies or not any(_can_be(pattern, label) for pattern in patterns):
            return
        policy = Policy(max_delay_us=self.delay_us)
        consumer, on_link = partial(self._on_sample, label), partial(self._on_link, label)
        self.proxies[label] = self._network.connect(label, policy, consumer, on_link, current=True)

    def _on_link(self, label: Label, linked: bool) -> None:
        if not linked:
            proxy = self.proxies.pop(label, None)
            self._events.forget(label)
            if proxy is not None:
                proxy.cancel()

    # What happens

    def _on_sample(self, label: Label, sample: Sample) -> None:
        self._count += 1
        heappush(self._waiting, QueuedSample(sample.valid_us, self._count, label, sample.value))
        self.on_time(sample.available_us)

    def _tell(self, event: QueuedSample, now_us: int) -> None:
        label, key = event.label, (event.label.feature, len(event.label.objects))
        if key in self._messages and event.value is not NO_VALUE:
            self._bring(self.recogniser.on_message(event.valid_us // US_PER_MS, *label), now_us)
        if key in self._changes:
            if event.value is not NO_VALUE and symbol(event.value) is None:
                self._once(label, f"{event.value!r} is no symbol: what a chronicle speaks of has discrete values")
            self._bring(self._events.on_sample(label, event.valid_us, event.value), now_us)

    def _bring(self, found: list[chronicles.ChronicleInstance], now_us: int) -> None:
        for each in found:
            self._on_recognised(each, now_us)
        for name, reasons in self.recogniser.incomplete.items():
            for reason in reasons:
                self._once(Label(RECOGNISED, (name,)), f"instances may be missing: {reason}")

    def _once(self, label: Label, said: str) -> None:
        """Tell a fault the first time."""
        if len(self._told) < MAX_FAULTS and (label, said) not in self._told:
            self._told.add((label, said))
            self._on_fault(label, said)


class ChronicleStreams:
    """The chronicles of one file in a specification, with the streams of what is recognised."""

    def __init__(self, network: Network, declaration: ChronicleDeclaration, content: chronicles.ChronicleFile) -> None:
        delay_us = declaration.policy.max_delay_us
        self._network, self._content = network, content
        self._out = {name: network.add_source(Label(RECOGNISED, (name,)), SORT) for name in content.chronicles}
        self.watch = ChronicleWatch(
            network,
            content,
            MAX_DELAY_US if delay_us is None else delay_us,
            self._push,
            self._fault,
            max_age_ms=declaration.max_age_ms,
            initially=declaration.since_ever,
        )

    @property
    def labels(self) -> tuple[Label, ...]:
        """The streams of what is recognised."""
        return tuple(each.label for each in self._out.values())

    def cancel(self) -> None:
        """Recognise nothing from now on."""
        self.watch.cancel()
        for generator in self._out.values():
            self._network.remove(generator.label)

    def _fault(self, label: Label, said: str) -> None:
        self._network.on_fault(label, said)

    def _push(self, found: chronicles.ChronicleInstance, now_us: int) -> None:
        parameters = self._content.chronicles[found.chronicle].parameters
        arguments = [
            found.bindings.get(str(one), NO_VALUE) if isinstance(one, chronicles.ChronicleVariable) else one
            for one in parameters
        ]
        value = tuple(arguments), tuple(found.bindings.items()), tuple(found.instants.items())
        self._out[found.chronicle].push(found.recognised_ms * US_PER_MS, value, now_us)


def _can_be(pattern: Pattern, label: Label) -> bool:
    """Whether a stream may bring events of the pattern, by the objects it names."""
    objects = label.objects
    same = [(left, right) for left, right in pattern.equal if max(left, right) < len(objects)]
    named = [(at, symbol) for at, symbol in pattern.constants if at < len(objects)]
    is_so = pattern.name == label.feature and all(objects[at] == symbol for at, symbol in named)
    return is_so and all(objects[left] == objects[right] for left, right in same)


def recognitions(network: Network, label: Label) -> tuple[Sort, Process] | None:
    """The process of `chronicle[NAME, ARGUMENT, ...]`; None if the label is none."""
    every = Label(RECOGNISED, label.objects[:1])
    if label.feature != RECOGNISED or len(label.objects) < 2 or not network.has(every):
        return None
    arguments = label.objects[1:]

    def step(now_us: int, inputs: Inputs, state: Value) -> tuple[Sample | None, Value]:
        (found,) = inputs
        is_so = found is not None and found.value is not NO_VALUE and found.value[0] == arguments
        return (found._replace(available_us=now_us) if found is not None and is_so else None), state

    unit = UnitPrototype("recognised with these arguments", SORT.name, (SORT.name,), lambda: step, cost_us=0)
    return SORT, RefinementProcess(unit, [Input(every)])
