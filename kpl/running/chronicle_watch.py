"""Changes in the streams of one instance as the events of chronicles, and the recognised instances (thesis 8.7.3).

An attribute `link[car1]:(?, no_link)` is the stream labelled `link[car1]`, or the attribute of a stream of records: a
sample with another value than the one before is an event, the first one a change from unknown (C2). A message
`in_crossing[car1, x2]` is the stream with that label: each sample is one. Streams are taken as they come to be there; one of
records is taken once for all its attributes.

Samples of several streams come in another order than they are valid. They wait for the declared `max delay`, one second
by default, and are then passed on in the order of their valid times; later samples are ignored and counted (C3).
"""

from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from functools import partial
from heapq import heappop, heappush
from typing import Final, NamedTuple, Protocol

from dyknow import NO_VALUE, Label, Network, Policy, Sample, Sort, Value
from dyknow.kpl.running.predicted_events import PredictedEvents
from dyknow.kpl.syntax.specification import RECOGNISED
from dyknow.model.instants import US_PER_MS, US_PER_S
from dyknow.model.members import members_of
from dyknow.model.sample import Predicted
from dyknow.network.mediation import Configuration
from dyknow.network.process import FAR_US, Input
from dyknow.network.stream_proxy import StreamProxy
from dyknow.objects.object_streams import attribute_of, domain_of
from dyknow.reasoning import chronicles
from dyknow.reasoning.chronicles.definition.compilation import Pattern
from dyknow.reasoning.chronicles.recognition.changes import symbol

MAX_FAULTS: Final = 64
NO_EVENTS: Final = frozenset({"no value", "no symbol", "no change"})
"""Reasons for which a sample is not an event, though it came in time."""
PERIOD_US: Final = 100 * US_PER_MS
"""How far apart partial instances are looked for, at least."""
MOST: Final = 64
"""Partial instances that are listed."""
TRIED: Final = 5_000
"""Sets of events that are tried for one list."""


class QueuedSample(NamedTuple):
    """A sample that waits for its turn; `number` keeps the order in which samples of one time came.

    `parts`: the attributes of a record that are taken, with their places in it.
    """

    valid_us: int
    number: int
    label: Label
    value: Value
    prediction: Predicted | None = None
    parts: Sequence[tuple[int, Label]] = ()


class FollowsAttributes(Protocol):
    """Takes what comes of the attributes of chronicles."""

    def on_sample(self, label: Label, valid_us: int, value: Value) -> None: ...

    def forget(self, label: Label) -> None: ...


class ChronicleWatch:
    """Chronicles recognised over the streams of a network; raises ChronicleError if they cannot be.

    Args:
        delay_us: how late samples may come.
        on_recognised: called with every instance, the prediction that it uses, if any, and when (federation time).
        on_fault: called once for each error of a stream or a chronicle.
        max_age_ms: instances last no longer; None: as their chronicles say.
        initially: the first values of streams have been so since ever (8.4); names: of these streams.
        refusal: why a stream is not taken, a fault of it; empty if it is.

    Attributes:
        proxies: the streams that are taken.
        delay_us: how late their samples may come.
        recogniser: the recogniser, with the events so far; it can be asked for partial instances.
        listeners: called when the clock has moved, with the present time.
        initially: as above.
    """

    def __init__(
        self,
        network: Network,
        content: chronicles.ChronicleFile,
        delay_us: int,
        on_recognised: Callable[[chronicles.ChronicleInstance, Predicted | None, int], None],
        on_fault: Callable[[Label, str], None],
        limits: chronicles.RecognitionLimits | None = None,
        *,
        max_age_ms: int | None = None,
        initially: bool | Collection[str] = False,
        refusal: Callable[[Label], str] = lambda _label: "",
    ) -> None:
        compiled = [chronicles.compile_chronicle(each, content, max_age_ms) for each in content.chronicles.values()]
        self.recogniser = chronicles.Recogniser(compiled, limits)
        self._predicted, self.initially = PredictedEvents(compiled), initially
        self._followers: list[FollowsAttributes] = []
        self._events = chronicles.ChangeEvents(self.recogniser, initially=initially)
        self.proxies: dict[Label, StreamProxy] = {}
        self.network, self.delay_us = network, delay_us
        self.listeners: list[Callable[[int], None]] = []
        self._dropped = Counter[str]()
        self._look_us = self._ignored_said = 0
        self._clock_ms: int | None = None
        self._on_recognised, self._on_fault, self._refusal = on_recognised, on_fault, refusal
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
        self._families: dict[Label, Configuration[str]] = {}
        self._taking: Label | None = None
        self._parts: dict[Label, list[tuple[int, Label]]] = {}
        self._records: dict[Label, Value] = {}
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
        for family in self._families.values():
            family.cancel()
        self.network.unstep(self)
        for proxy in tuple(self.proxies.values()):
            proxy.cancel()
        self.proxies.clear()

    def on_time(self, now_us: int) -> None:
        """Pass on the samples that have waited long enough, in their order, and move the clock."""
        clock_us = now_us - self.delay_us
        self._clock_ms = clock_us // US_PER_MS
        while self._waiting and self._waiting[0].valid_us <= clock_us:
            self._tell(heappop(self._waiting), now_us)
        self._bring(self.recogniser.on_time(clock_us // US_PER_MS), now_us)
        if now_us >= self._look_us:
            self._look_us = now_us + US_PER_S
            self._tell_ignored()
        for listener in tuple(self.listeners):
            listener(now_us)

    @property
    def ignored(self) -> Counter[str]:
        """Counts of samples that made no events: later than `delay_us`, out of order, no value, no symbol (C3)."""
        counts = self._dropped + self._events.ignored + self.recogniser.ignored
        for proxy in self.proxies.values():
            counts += proxy.adapter.dropped
        return counts

    @property
    def values(self) -> Mapping[Label, str]:
        """The last value of each stream."""
        return self._events.values

    def follow(self, follower: FollowsAttributes) -> bool:
        """Tell it each sample of an attribute in its order, from now on; False: it is so already."""
        if any(each is follower for each in self._followers):
            return False
        self._followers.append(follower)
        return True

    def _tell_ignored(self) -> None:
        """At the first, and whenever there are ten times as many as were reported; values that are no events are not lost."""
        ignored = Counter({reason: count for reason, count in self.ignored.items() if reason not in NO_EVENTS})
        if ignored.total() >= max(1, 10 * self._ignored_said):
            self._ignored_said = ignored.total()
            reasons = ", ".join(f"{count} {reason}" for reason, count in ignored.items())
            self._on_fault(Label(RECOGNISED), f"ignored until now: {reasons}; `max delay` says how late samples may be")

    # Which streams

    def _on_label(self, label: Label) -> None:
        """A stream is there: take what of it are events."""
        objects = len(label.objects)
        sort = self.network.generator(label).sort
        names = [field.name for field in sort.fields]
        parts: list[tuple[int, Label]] = []
        for name, arity in (*self._changes, *self._messages):
            stem, _, attribute = name.rpartition(".")
            if arity != objects or label.feature not in {name, stem}:
                continue
            if name != label.feature and attribute in names and (name, arity) not in self._messages:
                parts.append((names.index(attribute), Label(name, label.objects)))
            else:
                self._take(Label(name, label.objects))
        self._take_parts(label, parts)
        if sort.is_of_objects and not objects:
            for family in self._families.values():
                family.renew()
            if label not in self._families:
                self._follow_objects(label, sort)

    def _follow_objects(self, label: Label, sort: Sort) -> None:
        """Take what patterns name of the objects of a stream, of each while it is there."""
        names = [
            name
            for name, arity in (*self._changes, *self._messages)
            if arity == 1 and (name.rpartition(".")[0] == label.feature or attribute_of(sort, name) is not None)
        ]
        if names:
            begin, end = partial(self._on_object, names, True), partial(self._on_object, names, False)
            self._families[label] = Configuration(self.network, Input(domain_of(label)), begin, end, members_of)

    def _on_object(self, names: Sequence[str], appeared: bool, symbol: str) -> None:
        for name in names:
            if appeared:
                self._take(Label(name, (symbol,)))
            else:
                self._on_link(Label(name, (symbol,)), linked=False)

    def _take(self, label: Label) -> None:
        is_taken = label in self.proxies or label == self._taking or self._is_part(label)
        if not is_taken and self._is_wanted(label):
            self._connect(label)

    def _take_parts(self, label: Label, parts: Sequence[tuple[int, Label]]) -> None:
        """A stream of records whose attributes are events."""
        if label in self.proxies or label == self._taking:
            return
        wanted = [each for each in parts if each[1] not in self.proxies and self._is_wanted(each[1])]
        if wanted:
            self._parts[label] = wanted
            self._connect(label)

    def _is_part(self, label: Label) -> bool:
        """Whether it is taken as an attribute of a stream of records."""
        stem = Label(label.feature.rpartition(".")[0], label.objects)
        return any(part == label for _, part in self._parts.get(stem, ()))

    def _is_wanted(self, label: Label) -> bool:
        key = (label.feature, len(label.objects))
        if not any(_can_be(pattern, label) for pattern in (*self._changes.get(key, ()), *self._messages.get(key, ()))):
            return False
        if why := self._refusal(label):
            self._once(label, why)
        return not why

    def _connect(self, label: Label) -> None:
        policy = Policy(max_delay_us=self.delay_us)
        consumer, on_link = partial(self._on_sample, label), partial(self._on_link, label)
        self._taking = label  # it may be made because it is asked for, which `_on_label` is told
        self.proxies[label] = self.network.connect(label, policy, consumer, on_link, current=True)
        self._taking = None

    def _on_link(self, label: Label, linked: bool) -> None:
        if not linked:
            proxy = self.proxies.pop(label, None)
            for part in (label, *(part for _, part in self._parts.pop(label, ()))):
                self._events.forget(part)
                for follower in self._followers:
                    follower.forget(part)
            self._records.pop(label, None)
            if proxy is not None:
                self._dropped += proxy.adapter.dropped
                proxy.cancel()

    # Samples and events

    def _on_sample(self, label: Label, sample: Sample) -> None:
        if self._is_past(sample):
            return
        self._count += 1
        prediction, parts = sample.quality.prediction, self._parts.get(label, ())
        queued = QueuedSample(sample.valid_us, self._count, label, sample.value, prediction, parts)
        heappush(self._waiting, queued)
        if (sample.available_us - self.delay_us) // US_PER_MS != self._clock_ms:
            self.on_time(sample.available_us)

    def _is_past(self, sample: Sample) -> bool:
        """Whether a sample in time is of the time before its stream was taken, such as the first one of a new pair."""
        clock_ms = self.recogniser.clock_ms
        is_before = clock_ms is not None and sample.valid_us // US_PER_MS < clock_ms
        return is_before and sample.available_us - sample.valid_us <= self.delay_us

    def _tell(self, event: QueuedSample, now_us: int) -> None:
        label, key = event.label, (event.label.feature, len(event.label.objects))
        if event.parts:
            self._tell_parts(event, now_us)
            return
        if key in self._messages and event.value is not NO_VALUE:
            self._predicted.on_event(event.valid_us // US_PER_MS, *label, event.prediction)
            self._bring(self.recogniser.on_message(event.valid_us // US_PER_MS, *label), now_us)
        if key in self._changes:
            self._tell_change(label, event.valid_us, event.value, event.prediction, now_us)

    def _tell_parts(self, event: QueuedSample, now_us: int) -> None:
        """The attributes of a record; where none has changed, time has passed."""
        label, value, parts, clock_ms = event.label, event.value, event.parts, self.recogniser.clock_ms
        is_same = value is NO_VALUE or value == self._records.get(label, NO_VALUE)
        if value is not NO_VALUE and (clock_ms is None or event.valid_us // US_PER_MS >= clock_ms):
            self._records[label] = value
        for at, part in parts[:1] if is_same else parts:
            one = NO_VALUE if value is NO_VALUE else value[at]
            self._tell_change(part, event.valid_us, one, event.prediction, now_us)

    def _tell_change(
        self, label: Label, valid_us: int, value: Value, prediction: Predicted | None, now_us: int
    ) -> None:
        new, old = symbol(value), self._events.values.get(label)
        if value is not NO_VALUE and new is None:
            self._once(label, f"{value!r} is no symbol: what a chronicle speaks of has discrete values")
        if new is not None and new != old:
            self._predicted.on_event(valid_us // US_PER_MS, label.feature, (*label.objects, old, new), prediction)
        for follower in self._followers:
            follower.on_sample(label, valid_us, value)
        self._bring(self._events.on_sample(label, valid_us, value), now_us)

    def _bring(self, found: list[chronicles.ChronicleInstance], now_us: int) -> None:
        for each in found:
            self._on_recognised(each, self._predicted.of(each), now_us)
        if self.recogniser.is_complete:
            return
        for name, reasons in self.recogniser.incomplete.items():
            for reason in reasons:
                self._once(Label(RECOGNISED, (name,)), f"instances may be missing: {reason}")

    def _once(self, label: Label, said: str) -> None:
        """Tell a fault the first time."""
        if len(self._told) < MAX_FAULTS and (label, said) not in self._told:
            self._told.add((label, said))
            self._on_fault(label, said)


class PartialWatch:
    """Lists what may become an instance when the clock of a watch has moved, and when one is given up.

    Args:
        name: of the chronicle; None: of all.
        on_partials: called with the list, the valid time and the present time, where the list differs from the last one.
    """

    def __init__(
        self,
        network: Network,
        watch: ChronicleWatch,
        name: str | None,
        on_partials: Callable[[tuple[chronicles.Partial, ...], int, int], None],
    ) -> None:
        self._network, self._watch, self._name, self._on_partials = network, watch, name, on_partials
        self._last: tuple[chronicles.Partial, ...] | None = None
        self._due_us = network.now_us
        self._next_us = network.now_us
        watch.listeners.append(self._on_clock)
        network.step(self)

    def cancel(self) -> None:
        """Look no more."""
        self._watch.listeners.remove(self._on_clock)
        self._network.unstep(self)

    @property
    def deadline_us(self) -> int:
        """When to look, or when one is given up; `FAR_US`: perhaps later."""
        return self._due_us

    def on_time(self, now_us: int) -> None:
        """Move the clock of the watch, and look."""
        self._due_us = self._next_us = now_us
        self._watch.on_time(now_us)

    def _on_clock(self, now_us: int) -> None:
        if now_us < self._next_us:
            self._due_us = min(self._due_us, self._next_us)
            return
        self._next_us = now_us + PERIOD_US
        recogniser = self._watch.recogniser
        found = tuple(recogniser.partial_instances(MOST, self._name, TRIED))
        ends_us = (each.dies_ms * US_PER_MS + self._watch.delay_us for each in found if each.dies_ms is not None)
        self._due_us = min((each for each in ends_us if each > now_us), default=FAR_US)
        if found != self._last:
            self._last = found
            clock_us = now_us - self._watch.delay_us
            self._on_partials(found, clock_us // US_PER_MS * US_PER_MS, now_us)


def _can_be(pattern: Pattern, label: Label) -> bool:
    """Whether a stream may bring events of the pattern, by the objects it names."""
    objects = label.objects
    same = [(left, right) for left, right in pattern.equal if max(left, right) < len(objects)]
    named = [(at, symbol) for at, symbol in pattern.constants if at < len(objects)]
    is_so = pattern.name == label.feature and all(objects[at] == symbol for at, symbol in named)
    return is_so and all(objects[left] == objects[right] for left, right in same)
