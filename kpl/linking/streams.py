"""Streams of linked objects: the states of all objects of one type, as records that begin with the symbol.

Declarations that are chained share one object linkage, which is stepped by the first of their streams that has subscribers,
so that all agree on the symbols. It takes the streams of percepts at the beginning of the chain, and links them as all the
declarations say. A state comes when its tick is complete, at the end of the instant that brought it; objects that no percept
shows have one at the sample period. With the last state of an object the field `end` is true. Of links that are ready the states of
an object from before it was established come when it is, and with the next tick: they are late.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Final, NamedTuple

from dyknow import US_PER_S, Label, Network, Sample, Sort, Value
from dyknow.anchoring.links.beginnings import ObjectBeginnings
from dyknow.anchoring.links.specification import LinkSpecification
from dyknow.anchoring.links.structures import AnySpecification, LinkOutcome, ObjectLinkage, StateRecord, record_of
from dyknow.anchoring.percepts.leaps import PerceptLeaps
from dyknow.anchoring.percepts.records import ObjectRecords, PerceptRecords
from dyknow.kpl.linking.branches import branches
from dyknow.kpl.linking.condition_streams import TakenStreams
from dyknow.kpl.linking.ticks import PerceptTicks
from dyknow.kpl.linking.units import LinkedUnit
from dyknow.kpl.linking.wants import Wanted, Wants
from dyknow.navigation import LocalFrame
from dyknow.network.process import FAR_US, Input
from dyknow.network.processes import OnDemand

AHEAD_US: Final = US_PER_S
"""A state whose valid time is further ahead than this is dropped: it would make all states in between late."""


class PerceptInput(NamedTuple):
    """A stream at the beginning of the chain, and the sort of its records."""

    taken: Input
    sort: Sort


class SharedLinkage:
    """The linkage of declarations that are chained.

    Args:
        inputs: the streams of percepts, in the order of their types.
        declared: the unit and the options of each link, by its name.
        frame: about which positions in degrees are taken.
        wants: objects that are looked for.
        label: of a stream in conditions, with the unit in place of `self`.

    Attributes:
        streams: those with subscribers, in the order in which they had the first.
    """

    def __init__(
        self,
        specifications: Sequence[AnySpecification],
        inputs: Sequence[PerceptInput],
        frame: LocalFrame | None,
        wants: Wants,
        declared: Mapping[str, str],
        label: Callable[[Label], Label] = lambda label: label,
    ) -> None:
        self.specifications, self.inputs, self.frame = tuple(specifications), tuple(inputs), frame
        self.units = tuple(
            (each.target, each.unit)
            for each in self.specifications
            if isinstance(each, LinkSpecification) and isinstance(each.unit, LinkedUnit)
        )
        self._readers = [PerceptRecords(str(each.taken.label), each.sort, frame) for each in inputs]
        self.streams: list[LinkStream] = []
        self.taken = TakenStreams(label, self._fault)
        self._wants, self._declared = wants, declared
        self._types = {each.target for each in self.specifications}
        self._restart()

    def _restart(self) -> None:
        for _, unit in self.units:
            unit.restart()
        self._linkage = ObjectLinkage(self.specifications, streams=self.taken)
        ready = [each for each in self.specifications if isinstance(each, LinkSpecification) and each.is_adaptive]
        self._beginnings = ObjectBeginnings(self._linkage, ready) if ready else None
        self._leaps = PerceptLeaps()
        self._wanted: tuple[Wanted, ...] = ()
        self._ticks = PerceptTicks(len(self.inputs))
        self._latest_us: int | None = None
        self._now_us = 0

    @property
    def linkage(self) -> ObjectLinkage:
        """The linkage, updated to the wants as they are now; its objects begin with the first subscriber."""
        if self._wanted is not self._wants.all:
            before, self._wanted = self._wanted, self._wants.all
            for each in before:
                if each not in self._wanted:
                    self._linkage.unwant(each.symbol)
            for each in self._wanted:
                if each not in before and each.type in self._types:
                    self._linkage.want(each.symbol, each.type, each.description, only=each.only)
        return self._linkage

    def begin(self, stream: "LinkStream") -> None:
        """A stream has a subscriber; the first one starts with no objects."""
        if not self.streams:
            self._restart()
            self.taken.begin(stream.network)
        self.streams.append(stream)

    def end(self, stream: "LinkStream") -> None:
        """It has none left."""
        if stream in self.streams:
            self.streams.remove(stream)
            if not self.streams:
                self.taken.end()

    def take(self, i: int, sample: Sample) -> str:
        """Take a sample of one of the inputs into an incomplete tick; returns its error, or an empty text."""
        percept = self._readers[i].percept(sample)
        if percept is None:
            return ""
        if sample.valid_us > sample.available_us + AHEAD_US:
            return f"a state of {percept.symbol} has a valid time later than now, and is left out"
        if self._latest_us is not None and sample.valid_us <= self._latest_us:
            self._ticks.on_late(sample.available_us - sample.valid_us)
            return f"a state of {percept.symbol} came after those of a later time and is left out"
        if (leap_m := self._leaps.leap_m(percept)) is not None:
            return f"{percept.symbol} is {leap_m:g} m from where it was, farther than it can be, and is left out"
        self._now_us = max(self._now_us, sample.available_us)
        self._ticks.take(i, percept, sample.valid_us, sample.available_us)
        return ""

    def on_instant(self, now_us: int | None = None) -> None:
        """Take the ticks that are complete."""
        now_us = self._now_us if now_us is None else now_us
        for valid_us, percepts in self._ticks.complete(now_us):
            self._latest_us = valid_us
            outcome = self.linkage.on_percepts(valid_us, percepts)
            self._tell(outcome if self._beginnings is None else self._beginnings.completed(percepts, outcome), now_us)

    def on_time(self, now_us: int) -> None:
        """Objects are predicted up to the valid time that percepts cannot come before."""
        self.on_instant(now_us)
        outcome = self.linkage.on_time(now_us - self._ticks.behind_us)
        times_us = [each.valid_us for each in outcome.states] + [each.valid_us for each in outcome.events]
        self._latest_us = max(times_us, default=self._latest_us)
        self._tell(outcome, now_us)

    @property
    def deadline_us(self) -> int:
        """Far away while there is nothing to take or to predict."""
        due_us, deadline_us = self._ticks.deadline_us, self.linkage.deadline_us
        predict_us = FAR_US if deadline_us is None else deadline_us + self._ticks.behind_us
        return predict_us if due_us is None else min(due_us, predict_us)

    def notes(self, type_: str) -> tuple[str, ...]:
        """Of one type: the number of linked objects, by link, and the failures."""
        linkage, found = self.linkage, list[str]()
        for process in linkage.into.get(type_, ()):
            links = [
                one.incoming[process.name] for one in linkage.objects(type_).values() if process.name in one.incoming
            ]
            several = f", {len(process.candidates)} to one of several" if process.candidates else ""
            found.append(f"{process.name} by {self._declared[process.name]}: {len(links)} linked{several}")
        if (composites := linkage.composites.get(type_)) is not None:
            found.append(f"{composites.name}: {len(linkage.objects(type_))} composites")
            if composites.left_out:
                found.append(f"{composites.left_out} pairs of parts were left out, there are too many near each other")
        failed = ((unit.prototype.name, unit.failed) for target, unit in self.units if target == type_ and unit.failed)
        return (*found, *(f"{name} has failed {count} times" for name, count in failed))

    def _tell(self, outcome: LinkOutcome, now_us: int) -> None:
        self._wants.tell(outcome.events)
        for stream in tuple(self.streams):
            stream.tell(outcome, now_us)
        for type_, unit in self.units:
            for said in unit.take_faults():
                next((each for each in self.streams if each.type == type_), self.streams[0]).fault(said)

    def _fault(self, said: str) -> None:
        for stream in self.streams[:1]:
            stream.fault(said)


class LinkStream(OnDemand):
    """Makes the stream of one type.

    Args:
        type_: as it is called in the specifications.
        sort: of the states that it makes.
        most: branches of an object that is not seen; fewer than 2: its most probable state alone.
    """

    arity, priority = 1, 0

    def __init__(self, type_: str, shared: SharedLinkage, sort: Sort, most: int = 0) -> None:
        super().__init__()
        self.type, self._shared, self._most = type_, shared, most
        self._records = ObjectRecords(sort, shared.frame)
        self._held: list[StateRecord] = []

    @property
    def network(self) -> Network | None:
        """Where it is, while it is attached."""
        return self._network if isinstance(self._network, Network) else None

    @property
    def linkage(self) -> ObjectLinkage:
        """Of all declarations that are chained."""
        return self._shared.linkage

    @property
    def specifications(self) -> Sequence[LinkSpecification]:
        """The links of the whole chain."""
        return tuple(each for each in self._shared.specifications if isinstance(each, LinkSpecification))

    def there(self) -> list[tuple[str, Sample]]:
        """The objects of its type that are there while any stream of the chain has a subscriber, with their newest states."""
        records = map(record_of, self.linkage.objects(self.type).values()) if self._shared.streams else ()
        return [(each.symbol, Sample(each.valid_us, each.valid_us, self._value(each))) for each in records]

    def notes(self) -> tuple[str, ...]:
        """The number of linked objects, and the failures."""
        return self._shared.notes(self.type)

    def inputs(self) -> Sequence[Input]:
        return [each.taken for each in self._shared.inputs]

    def begin(self) -> None:
        self._shared.begin(self)
        if self._network is not None:
            self._network.step(self)

    def end(self) -> None:
        self._held.clear()
        self._shared.end(self)
        if self._network is not None:
            self._network.unstep(self)

    @property
    def _steps(self) -> bool:
        """Whether it steps the linkage, for the others as well."""
        return self._shared.streams[:1] == [self]

    def since_us(self) -> int:
        is_new = not self.running and bool(self._shared.streams)
        return self._now_us() if is_new else super().since_us()

    def on_sample(self, i: int, sample: Sample) -> None:
        if not self._steps:
            return
        if wrong := self._shared.take(i, sample):
            self.fault(wrong)
        elif self._network is not None:
            self._network.instant.put(self)

    @property
    def rank(self) -> int:
        """After the streams of percepts."""
        network = self._network
        return 0 if network is None else 1 + max(network.rank(each.label) for each in self.inputs())

    def on_instant(self) -> None:
        self._shared.on_instant()

    def on_time(self, now_us: int) -> None:
        self._shared.on_time(now_us)

    @property
    def deadline_us(self) -> int | None:
        return self._shared.deadline_us if self.running and self._steps else FAR_US if self.running else None

    def _value(self, record: StateRecord) -> Value:
        return self._records.value(record, is_anchored=self.linkage.anchored(record.symbol), ended=False)

    def _in_turn(self, records: Iterable[StateRecord]) -> list[StateRecord]:
        """The records that are due; of an object with states from before it was established only the first, the others
        follow.

        Declarations for each object make its stream in the next instant, and get the other records then.
        """
        due, self._held, new = self._held, [], set[str]()
        for each in records:
            if each.symbol in new:
                self._held.append(each)
            else:
                due.append(each)
                if each.late_us:
                    new.add(each.symbol)
        return due

    def tell(self, outcome: LinkOutcome, now_us: int) -> None:
        """The states of objects of its type."""
        mine = [each for each in outcome.states if each.type == self.type]
        states = {each.symbol: each for each in mine}
        for record in self._in_turn(mine):
            for each, quality in branches(record, self._most):
                self.emit(Sample(max(now_us, record.valid_us), record.valid_us, self._value(each), quality))
        for event in outcome.events:
            if event.kind == "forgotten" and event.target_type == self.type:
                known = states.get(event.target)
                ended = self._records.ended(event.target)
                value = ended if known is None else self._records.value(known, is_anchored=False, ended=True)
                self.emit(Sample(max(now_us, event.valid_us), event.valid_us, value))
