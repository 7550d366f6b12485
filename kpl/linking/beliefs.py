"""Streams of beliefs: the instances of an environment model that is fed by streams of percepts, as records of a sort.

A percept stream is one source, with the stream of its views, if there is one: each view is a look, and an instance in
view without a report was overlooked. Its instances are states of objects; a record is as certain as the instance
exists.
"""

from collections.abc import Callable, Iterable, Sequence
from typing import Final, NamedTuple

import numpy as np

from dyknow import NO_VALUE, US_PER_S, Label, Network, Policy, Sample, Sort
from dyknow.anchoring.belief.files.described import DescribedWorld
from dyknow.anchoring.belief.files.knowledge import print_known, read_knowledge
from dyknow.anchoring.belief.knowledge.memory import MOST_LEARNT
from dyknow.anchoring.belief.knowledge.ontology import KnownInstance
from dyknow.anchoring.belief.live.gathering import LookGatherer
from dyknow.anchoring.belief.live.records import BELIEF_SORT, BeliefRecords, quality_of
from dyknow.anchoring.belief.live.trust import TrustInSource
from dyknow.anchoring.belief.live.watch import ObservingSource, ReportedBelief, WorldWatch
from dyknow.anchoring.percepts.records import PerceptRecords, is_geographic, lacks_of
from dyknow.kpl.linking.roads import APART_M
from dyknow.kpl.syntax import specification as spec
from dyknow.model.errors import TextError, TextErrors, did_you_mean
from dyknow.navigation import LocalFrame
from dyknow.navigation.geodesy import distance_m
from dyknow.network.process import FAR_US, Input
from dyknow.network.processes import OnDemand

__all__ = ["BELIEF_SORT", "BeliefStream", "belief_stream", "trust_in"]
STEP_US: Final = US_PER_S
"""How long after the last look time alone is taken in."""
CORNERS: Final = 4


class BelievedInput(NamedTuple):
    """One input of the process: percepts or the view of a source, or the task; then `source` is -1."""

    label: Label
    source: int
    is_view: bool = False


class BeliefStream(OnDemand):
    """Makes the stream of beliefs of one environment model.

    Args:
        world: the model and its prior knowledge.
        inputs: its input streams.
        readers: of the percepts of each source.
        sources: the observing ones.
        is_own: of each source, whether all of one time comes at one instant.
        sort: of the records.
        prefix: of the names of instances.
        task: for which knowledge is loaded until a stream names another.
    """

    arity, priority = 1, 0

    def __init__(
        self,
        world: DescribedWorld,
        inputs: Sequence[BelievedInput],
        readers: Sequence[PerceptRecords],
        sources: Sequence[ObservingSource],
        is_own: Sequence[bool],
        sort: Sort,
        frame: LocalFrame | None,
        prefix: str,
        task: str,
    ) -> None:
        super().__init__()
        self._world, self._inputs, self._readers, self._sources = world, tuple(inputs), tuple(readers), tuple(sources)
        self._is_own, self._prefix, self._task = tuple(is_own), prefix, task
        self._records = BeliefRecords(sort, frame)
        self._learnt: dict[str, KnownInstance] = {}
        self._restart()

    def _restart(self) -> None:
        self.watch = WorldWatch(self._world.model, self._world.bundles, self._sources, prefix=self._prefix)
        self.watch.informed.knowledge.learnt.update(self._learnt)
        self._gatherer = LookGatherer(self._is_own)
        self._delay_us = 0
        self._stepped_us: int | None = None
        self._faults = dict[str, int]()
        if self._task:
            self.watch.select(self._task)

    def inputs(self) -> Sequence[Input]:
        return [Input(each.label, Policy()) for each in self._inputs]

    def begin(self) -> None:
        self._restart()
        if self._network is not None:
            self._network.step(self)

    def end(self) -> None:
        self._learnt = dict(self.watch.informed.knowledge.learnt)
        if self._network is not None:
            self._network.unstep(self)

    @property
    def sources(self) -> Sequence[tuple[ObservingSource, TrustInSource]]:
        """The sources, and how far each is trusted now."""
        return list(zip(self._sources, self.watch.trust, strict=True))

    @property
    def beliefs(self) -> WorldWatch:
        """The model's instances, and their events."""
        return self.watch

    # Learnt knowledge

    def remember(self, text: str, file: str) -> None:
        """Know what was learnt before.

        Raises:
            TextErrors: it cannot be that, with place, cause and remedy.
        """
        bundle = read_knowledge(text, self._world.model, file)
        if bundle.classes or bundle.rules or len(bundle.known) > MOST_LEARNT:
            why = f"what was learnt is [[known]] alone, at most {MOST_LEARNT}"
            raise TextErrors((TextError(why, text=text, file=file, repair="another file, or none"),))
        self._learnt |= {each.name: each for each in bundle.known}
        self.watch.informed.knowledge.learnt.update(self._learnt)

    def learnt(self) -> str:
        """The learnt knowledge, the newest last, as `remember` reads it."""
        known = self.watch.informed.knowledge.learnt.values()
        return "\n".join(print_known(each, self._world.model) for each in known)

    # Looks

    def on_sample(self, i: int, sample: Sample) -> None:
        label, source, is_view = self._inputs[i]
        if sample.value is NO_VALUE:
            return
        if source < 0:
            self.watch.select(str(sample.value))
            return
        self._delay_us = max(self._delay_us, sample.available_us - sample.valid_us)
        if is_view:
            corners = np.array(sample.value[: 2 * CORNERS], dtype=np.float64).reshape(CORNERS, 2)
            self._gatherer.on_view(source, sample.valid_us, corners, sample.available_us)
        else:
            percept = self._readers[source].percept(sample)
            if percept is None:
                self._gatherer.left_out[f"percepts of {label} without a place that can be"] += 1
            else:
                certainty = sample.quality.certainty
                self._gatherer.on_percept(source, sample.valid_us, percept, sample.available_us, certainty)
        if self._network is not None:
            self._network.instant.put(self)

    @property
    def rank(self) -> int:
        """After all that it takes."""
        network = self._network
        return 0 if network is None else 1 + max(network.rank(each.label) for each in self._inputs)

    def on_instant(self) -> None:
        self._step(self._now_us() if self._network is None else self._network.now_us)

    def _step(self, now_us: int) -> None:
        for look in self._gatherer.ready(now_us):
            self._stepped_us = look.valid_us
            self._tell(look.valid_us, self.watch.on_look(look), now_us)
        self._report()

    def on_time(self, now_us: int) -> None:
        """Looks that waited long enough; without any, what is believed grows older."""
        self._step(now_us)
        if self._stepped_us is not None and now_us >= self._stepped_us + STEP_US + self._delay_us:
            self._stepped_us = max(self._stepped_us, now_us - self._delay_us)
            self._tell(self._stepped_us, self.watch.on_time(self._stepped_us), now_us)

    @property
    def deadline_us(self) -> int | None:
        if not self.running:
            return None
        waiting_us = self._gatherer.deadline_us
        step_us = None if self._stepped_us is None else self._stepped_us + STEP_US + self._delay_us
        return min([each for each in (waiting_us, step_us) if each is not None], default=FAR_US)

    def _tell(self, valid_us: int, reported: Iterable[ReportedBelief], now_us: int) -> None:
        for each in reported:
            self.emit(Sample(max(now_us, valid_us), valid_us, self._records.value(each), quality_of(each)))

    def _report(self) -> None:
        """Report percepts that were left out: the first of each kind, then whenever the count has doubled."""
        for why, count in (*self._gatherer.left_out.items(), *self.watch.counts.items()):
            if count >= 2 * self._faults.get(why, 0) and count:
                self._faults[why] = count
                self.fault(f"{why}: {count}")


def trust_in(network: Network, unit: str) -> float:
    """The trust of the beliefs here in a platform: the least of all models that it is a source of; 1 for others."""
    processes = (network.process(label) for label in network.labels())
    return min(
        (
            trust.value
            for process in processes
            if isinstance(process, BeliefStream)
            for source, trust in process.sources
            if source.name == unit
        ),
        default=1.0,
    )


def belief_stream(
    made: spec.Belief,
    unit: str,
    meant: Callable[[Label], Label],
    sort_of: Callable[[Label], Sort],
    sort: Sort,
    origin: tuple[float, float] | None,
) -> BeliefStream:
    """The process of a `believe` declaration.

    Args:
        made: the declaration.
        unit: of the platform.
        meant: puts the unit into labels.
        sort_of: a stream.
        sort: of the beliefs.
        origin: latitude and longitude of x = y = 0, degrees, if that is known.

    Raises:
        TextError: the model was not read, it has no such sensor, or a stream makes no percepts.
    """
    if made.world is None:
        raise TextError.at(
            made.place, f"{', '.join(made.paths)} was not read", repair="the files, with what names them"
        )
    frame = _frame(made, made.world, origin)
    inputs: list[BelievedInput] = []
    readers: list[PerceptRecords] = []
    sources: list[ObservingSource] = []
    for at, each in enumerate(made.observed):
        label = meant(each.label)
        percept_sort = sort_of(each.label)
        _check(made, each, percept_sort, frame)
        inputs.append(BelievedInput(label, at))
        readers.append(PerceptRecords(str(label), percept_sort, frame))
        sources.append(ObservingSource(label.objects[0] if label.objects else str(label), each.sensor, each.trust))
        if each.view is not None:
            inputs.append(BelievedInput(meant(each.view), at, is_view=True))
    task = "" if isinstance(made.task, Label) else made.task
    if isinstance(made.task, Label):
        inputs.append(BelievedInput(meant(made.task), -1))
    is_own = [not each.label.objects or meant(each.label).objects == (unit,) for each in made.observed]
    return BeliefStream(
        made.world, inputs, readers, sources, is_own, sort, frame, f"i{unit}_" if unit.isalnum() else "i", task
    )


def _frame(made: spec.Belief, world: DescribedWorld, origin: tuple[float, float] | None) -> LocalFrame | None:
    """Where x = y = 0 is: as the specification says, or the model; raises TextError where they disagree."""
    own = world.model.frame
    if origin is None or own is None:
        return own if origin is None else LocalFrame(*origin, 0.0)
    apart_m = distance_m(*origin, own.latitude_deg, own.longitude_deg)
    if apart_m > APART_M:
        raise TextError.at(
            made.place,
            f"[origin] of {made.paths[0]} is {apart_m:.1f} m from that of the specification",
            repair=f"latitude_deg = {origin[0]:.7f} and longitude_deg = {origin[1]:.7f} in [origin], or leave it out",
        )
    return LocalFrame(*origin, 0.0)


def _check(made: spec.Belief, each: spec.Observing, sort: Sort, frame: LocalFrame | None) -> None:
    assert made.world is not None  # noqa: S101  (the caller has looked)
    sensors = made.world.model.sensors
    if each.sensor not in sensors:
        hint = did_you_mean(each.sensor, tuple(sensors))
        raise TextError.at(
            each.place, f"{made.paths[0]} has no sensor {each.sensor}.{hint}", repair=next(iter(sensors))
        )
    if lacking := lacks_of(sort):
        raise TextError.at(
            each.place,
            f"{each.label} are of sort {sort.name}, which has no {', '.join(lacking)}: it makes no percepts",
            repair=f"sort {sort.name}(symbol in text, x_m in m, y_m in m)",
        )
    if frame is None and is_geographic(sort):
        raise TextError.at(
            each.place,
            f"{each.label} are placed in degrees, and it is not known where x_m and y_m are 0",
            repair="define ORIGIN_LATITUDE_DEG = 58.4 and define ORIGIN_LONGITUDE_DEG = 15.6",
        )
