"""`dyknow kpl run` and `verify`: a specification in an instance of its own, and what a recorded run is worth."""

import json
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from threading import Event
from typing import IO, TYPE_CHECKING, Any, Literal

from console.brought_forth import tell_record
from console.command import Call
from console.errors import DONE, INTERRUPTED, NO, WrongCall
from console.instants import SHORTEST_US, duration_us
from console.output import verbatim
from console.specifications import counted, read_text
from dyknow import earlier
from dyknow.errors import DyknowError, TextErrors
from proxies.named_files import beside
from proxies.watched_file import WatchedFile

if TYPE_CHECKING:
    from dyknow import Network, Prototype, Sample
    from kpl import Hooks, Instance
    from kpl.governor import Governor
    from proxies.sample_file import FedSample, Recorded
    from reasoning import AlarmEvent

MAX_SPEED = 1e6
LOOK_S = 0.2
"""How often a file that is watched is looked at."""


class Run:
    """One specification, stepped through time: what is fed, and the deadlines of streams.

    Args:
        speed: how many times as fast as the wall; 0: as fast as it goes.
    """

    def __init__(
        self, call: Call, path: Path, fed: Sequence["FedSample"], modules: Sequence[str], unit: str, speed: float
    ) -> None:
        from dyknow import Network
        from kpl import Hooks
        from kpl.records import Faults

        self._call, self._path, self._fed, self.speed = call, path, fed, speed
        self.network = Network()
        self.network.on_fault = Faults(lambda said: call.out.note(f"note: {said}")).on_fault
        hooks = Hooks(self._on_sample, self._on_link, self._on_alarm)
        self.instance = instance_of(self.network, hooks, modules, unit)
        self._governor: Governor | None = None
        self._waited_us = 0
        self._record: IO[str] | None = None
        self._recorded = set[Any]()
        self.now_us = 0 if speed == 0 else time.time_ns() // 1000
        self._began_us, self._began_s = self.now_us, time.monotonic()
        self._shown_from_us = self._began_us if speed else 0

    def specify(self, text: str) -> None:
        """Run this text from now on; raises TextErrors, and goes on with what there is."""
        from kpl import parse_specification
        from kpl.governor import listens
        from kpl.suspicions import grid_warnings

        specification = parse_specification(text, str(self._path), beside(self._path))
        if self._governor is None and listens(specification):
            raise WrongCall(
                f"{self._path} takes `refinements`, which a governor tells: give --govern TIME, e.g. 100ms."
            )
        self.instance.change(specification, self.now_us, text, str(self._path))
        for warning in grid_warnings(specification, text, str(self._path)):
            self._call.out.note(f"note: {warning.drawn()}")
        for name, labels in self.instance.lacking.items():
            waiting = ", ".join(map(str, labels[:4]))
            self._call.out.note(f"note: nobody offers {name}: {waiting} and what is made of it wait (--units MODULE).")
        self._watch()

    def govern(self, limit_us: int) -> None:
        """Lengthen the periods of the least important streams while delays are longer than this."""
        from kpl.governor import Governor

        self._governor = Governor(self.instance, lambda: self._waited_us, self.now_us, limit_us)

    def record(self, out: IO[str], text: str) -> None:
        """Write every sample of every generator and stream; what is recorded is computed."""
        out.write(json.dumps({"specification": text, "file": str(self._path), "unit": self.instance.unit}) + "\n")
        self._record = out
        self._watch()

    def go(self, until_us: int | None, reload: Callable[[], None] | None = None) -> None:
        """Step until the feed and the timers are over, or until a time."""
        stop = Event()
        fed = iter(self._fed)
        last_us: int | None = None
        begins_us = self._began_us if self.speed else 0
        following = next(fed, None)
        while True:
            due_us = self.network.deadline_us
            if self._governor is not None:
                due_us = earlier(due_us, self._governor.deadline_us)
            fed_us = None if following is None else following.at_us + begins_us
            times = [each for each in (due_us, fed_us) if each is not None]
            next_us = min(times, default=None)
            if following is None and self.speed == 0 and last_us is None:
                last_us = self._last_us()
            over = last_us is not None and (due_us is None or due_us > last_us)
            if next_us is not None and until_us is not None and next_us > until_us:
                next_us = None
            if over or (next_us is None and (until_us is None or self.speed == 0) and reload is None):
                break
            if not self._wait(next_us, until_us, stop, reload):
                if until_us is not None and self.now_us >= until_us:
                    break
                continue
            if following is not None and fed_us is not None and fed_us <= self.now_us:
                self.instance.push(following.source, following.valid_us + begins_us, following.value, self.now_us)
                following = next(fed, None)
            else:
                self.network.on_time(self.now_us)
                if self._governor is not None:
                    self._governor.on_time(self.now_us)
            self._watch()

    def _last_us(self) -> int:
        """When the last sample of the feed can no longer matter to anybody."""
        from kpl.introspection import awaits_us

        if not self._fed:
            return 0
        return max(self._fed[-1].at_us, max(each.valid_us for each in self._fed) + awaits_us(self.instance))

    def _wait(self, next_us: int | None, until_us: int | None, stop: Event, reload: Callable[[], None] | None) -> bool:
        """Let time pass until something is due; False: something else may have happened."""
        if self.speed == 0:
            before_us, self.now_us = self.now_us, max(self.now_us, next_us or 0)
            self._waited_us += self.now_us - before_us
            return True
        target_us = min((each for each in (next_us, until_us) if each is not None), default=None)
        wall_s = time.monotonic() - self._began_s
        self.now_us = self._began_us + round(wall_s * 1e6 * self.speed)
        if target_us is None or target_us > self.now_us:
            left_s = LOOK_S if target_us is None else (target_us - self.now_us) / 1e6 / self.speed
            began_s = time.monotonic()
            stop.wait(min(left_s, LOOK_S))
            self._waited_us += round((time.monotonic() - began_s) * 1e6 * self.speed)
            if reload is not None:
                reload()
            return False
        return next_us is not None and next_us <= self.now_us

    def _watch(self) -> None:
        """Record generators that are new."""
        if self._record is None:
            return
        from dyknow import Policy

        for label in self.network.labels():
            if label not in self._recorded:
                self._recorded.add(label)
                self.network.connect(label, Policy(), partial(self._keep, "label", label))

    def _keep(self, kind: str, name: object, sample: "Sample") -> None:
        from kpl.records import sample_json

        if self._record is not None:
            self._record.write(json.dumps({kind: str(name), **sample_json(sample)}) + "\n")

    def _on_sample(self, name: str, sample: "Sample") -> None:
        self._keep("stream", name, sample)
        from kpl.introspection import maker_of, origins_of
        from kpl.records import sample_record

        origins = origins_of(self.instance, name, sample.valid_us)
        said = sample_record(name, sample, origins, maker_of(self.instance, name, sample))
        tell_record(self._call, said, begins_us=self._shown_from_us)

    def _on_link(self, name: str, linked: bool) -> None:
        if not linked:
            self._call.out.note(f"note: nobody makes what {name} is made of any more; it goes on when somebody does.")

    def _on_alarm(self, event: "AlarmEvent") -> None:
        from kpl.records import alarm_record

        tell_record(self._call, alarm_record(event), begins_us=self._shown_from_us)


def run(
    call: Call,
    path: Path,
    *,
    feed: Path | None,
    units: Sequence[str],
    unit: str,
    speed: float | None,
    duration: str | None,
    record: Path | None,
    watch: bool,
    govern: str | None,
    admit: Literal["refuse", "longer"],
    graph_form: str | None,
) -> int:
    """Run until the feed is over, the duration has passed, or somebody interrupts."""
    from kpl.specification import Export, Import

    if speed is not None and not 0 <= speed <= MAX_SPEED:
        raise WrongCall(f"--speed is how many times as fast as the wall, 0 for as fast as it goes; got {speed:g}.")
    if record is not None and any(_same(record, each) for each in (path, feed, *map(Path, units)) if each is not None):
        raise WrongCall(f"--record: {record} is read by this run; write to another file.")
    watched = WatchedFile(path) if watch else None  # before it is read: what changes meanwhile is a change
    text = read_text(path)
    fed = [] if feed is None else read_fed(feed)
    going = Run(call, path, fed, units, unit, (0.0 if feed is not None else 1.0) if speed is None else speed)
    lasts_us = None if duration is None else duration_us(duration, option="--duration", least_us=SHORTEST_US)
    with ExitStack() as stack:
        if record is not None:
            going.record(stack.enter_context(_created(record)), text)
        going.instance.admission = admit
        if govern is not None:
            going.govern(duration_us(govern, option="--govern", least_us=SHORTEST_US))
        going.specify(text)
        if any(isinstance(each, Export | Import) for each in going.instance.specification):
            call.out.note(f"note: exports and imports need a federation: dyknow join --unit {unit} --spec {path}.")
        _tell_unfed(call, set(going.instance.sources()), {each.source for each in fed}, feed)
        try:
            going.go(None if lasts_us is None else going.now_us + lasts_us, _reloading(call, going, path, watched))
        except KeyboardInterrupt:
            return INTERRUPTED
        finally:
            if graph_form is not None:
                show_graph(call, going.instance, graph_form)
    return DONE


def _tell_unfed(call: Call, sources: set[str], fed: set[str], feed: Path | None) -> None:
    """Sources from which nothing will come, and samples that nobody takes."""
    lacking, idle = ", ".join(sorted(sources - fed)), ", ".join(sorted(fed - sources))
    if lacking and feed is None:
        call.out.note(f"note: nothing comes from {lacking}: give --feed FILE.jsonl, or --units with sources so called.")
    elif lacking:
        call.out.note(f"note: {feed} has nothing for {lacking}.")
    if idle:
        call.out.note(
            f"note: {feed} has samples of {idle}, which {'is' if len(fed - sources) == 1 else 'are'} no source here."
        )


def _same(one: Path, other: Path) -> bool:
    return one.exists() and other.exists() and one.samefile(other)


def verify(call: Call, path: Path, *, journal: Path, units: Sequence[str]) -> int:
    """1 if the recorded run breaks the specification; each stream's first difference, each broken constraint."""
    from kpl import parse_specification
    from kpl.verification import broken_streams
    from kpl.verification import verify as violations_of

    specification = parse_specification(read_text(path), str(path), beside(path))
    labels: dict[str, list[Sample]] = {}
    streams: dict[str, list[Sample]] = {}
    if journal.suffix == ".mcap":
        streams = _of_platform(journal, units)
        found = broken_streams(specification, streams)
    else:
        about, recorded = _recorded(journal)
        for each in recorded:
            (labels if each.kind == "label" else streams).setdefault(each.name, []).append(each.sample)

        def make(network: "Network", hooks: "Hooks") -> "Instance":
            return instance_of(network, hooks, units, str(about.get("unit", "0")), reads=False)

        found = violations_of(specification, labels, streams, make)
    for violation in found:
        sample = violation.sample
        call.out.say(
            f"[red]broken[/] {verbatim(str(violation))}",
            event="broken",
            name=violation.name,
            valid_us=None if sample is None else sample.valid_us,
            available_us=None if sample is None else sample.available_us,
            said=violation.said,
        )
    samples = sum(map(len, (*labels.values(), *streams.values())))
    verdict = f"[red]{counted(len(found), 'violation')}[/]" if found else "[green]satisfied[/]"
    looked_at = (
        f"{counted(samples, 'sample')} of {counted(len(labels), 'generator')} and {counted(len(streams), 'stream')}"
    )
    call.out.say(
        f"{verdict}: {looked_at}", event="verified", satisfied=not found, violations=len(found), samples=samples
    )
    return NO if found else DONE


def _recorded(journal: Path) -> "tuple[Mapping[str, Any], list[Recorded]]":
    from proxies.sample_file import read_record

    try:
        with journal.open(encoding="utf-8") as lines:
            return read_record(lines, str(journal))
    except (OSError, UnicodeDecodeError) as error:
        raise WrongCall(f"--journal: {journal} cannot be read ({error}); `kpl run --record FILE` makes one.") from None


def _of_platform(journal: Path, units: Sequence[str]) -> "dict[str, list[Sample]]":
    """The streams of a platform, from its journal: their constraints can be looked at, not what they are made of."""
    from runtime.recorded_runs import recorded_streams

    try:
        return recorded_streams(journal, units)
    except OSError as error:
        raise WrongCall(f"--journal: {journal} cannot be read ({error}).") from None


def graph(call: Call, path: Path, *, units: Sequence[str], unit: str, form: str) -> int:
    """The network that a specification makes, before anything runs."""
    from dyknow import Network
    from kpl import Hooks, parse_specification
    from kpl.governor import listens, speaks

    text = read_text(path)
    specification, network = parse_specification(text, str(path), beside(path)), Network()
    if listens(specification):
        speaks(network)
    instance = instance_of(network, Hooks(), units, unit)
    instance.add(specification, 0, text, str(path))
    show_graph(call, instance, form)
    return DONE


def show_graph(call: Call, instance: "Instance", form: str) -> None:
    """Print the network in a form."""
    from kpl.introspection import as_dot, as_json, as_mermaid, as_text, graph_of

    found = graph_of(instance)
    if call.out.json_lines or form == "json":
        call.out.line(as_json(found))
        return
    text = {"text": as_text, "mermaid": as_mermaid, "dot": as_dot}[form](found)
    call.out.plain(text, folds=form == "text")


def instance_of(
    network: "Network", hooks: "Hooks", modules: Iterable[str], unit: str, *, reads: bool = True
) -> "Instance":
    """An empty instance that finds units in modules, the library and installed distributions.

    With `reads` false sources are not read: their samples are pushed.
    """
    from compunits import catalogue
    from federation.keys import unit as unit_name
    from federation.ontology import default_ontology
    from kpl import Instance

    there = catalogue(modules)

    def found(name: str) -> "Prototype | None":
        from dataclasses import replace

        from dyknow import SourcePrototype

        prototype = there.offered(name)
        if isinstance(prototype, SourcePrototype) and not reads:
            return replace(prototype, read=None)
        return prototype

    ontology = default_ontology()
    return Instance(
        network,
        unit=unit_name(unit),
        sorts={ontology[name].sort.name: ontology[name].sort for name in ontology},
        semantic={name: ontology[name].sort.name for name in ontology},
        catalogue=found,
        offered=there.names,
        hooks=hooks,
    )


def read_fed(path: Path) -> "list[FedSample]":
    from proxies.sample_file import read_feed

    try:
        with path.open(encoding="utf-8") as lines:
            return read_feed(lines, str(path))
    except (OSError, UnicodeDecodeError) as error:
        raise WrongCall(f"--feed: {path} cannot be read ({error}); a feed is a text of JSON lines.") from None


def _created(path: Path) -> IO[str]:
    try:
        return path.open("w", encoding="utf-8")
    except OSError as error:
        raise WrongCall(f"--record: {path} cannot be written ({error}).") from None


def _reloading(call: Call, going: Run, path: Path, watched: WatchedFile | None) -> Callable[[], None] | None:
    """Look whether the file has changed; what is wrong with a change is told, and what ran goes on."""
    if watched is None:
        return None

    def look() -> None:
        if not watched.has_changed():
            return
        try:
            going.specify(read_text(path))
        except TextErrors as wrong:
            call.out.note(f"{wrong.drawn()}\nThe specification is not taken; what ran goes on.")
        except DyknowError as wrong:
            call.out.note(f"{wrong}\nThe specification is not taken; what ran goes on.")
        else:
            call.out.say(f"[green]changed[/] to {verbatim(str(path))}", event="changed", file=str(path))

    return look
