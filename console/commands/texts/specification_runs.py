"""`dyknow kpl run`: a specification in an instance of its own."""

import json
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from functools import partial
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import IO, TYPE_CHECKING, Annotated, Any

import typer

from dyknow import Sample, earlier
from dyknow.agents.specification.options import RunOptions
from dyknow.console.arguments import Duration, SpecificationFile
from dyknow.console.command import Call, command
from dyknow.console.commands.texts.graphs import GraphForm, show_graph
from dyknow.console.commands.texts.run_output import tell_record
from dyknow.console.commands.texts.specification_files import instance_of, read_samples, read_text
from dyknow.console.errors import DONE, INTERRUPTED
from dyknow.console.output.shown import line, styled
from dyknow.documents.durations import SHORTEST_US, duration_us
from dyknow.model.errors import DyknowError, TextErrors, WrongCall
from dyknow.proxies.files.named_files import beside
from dyknow.proxies.files.watched_file import WatchedFiles

if TYPE_CHECKING:
    from dyknow import Label
    from dyknow.agents.effects import Computed
    from dyknow.anchoring.links.objects import LinkEvent
    from dyknow.kpl.introspection.governor import Governor
    from dyknow.network.process import Work
    from dyknow.proxies.recordings.sample_file import FedSample
    from dyknow.reasoning import AlarmEvent

MAX_SPEED = 1e6
LOOK_S = 0.2
"""How often a file that is watched is looked at."""
AWAITED_US = 10_000_000
"""How long a unit that is being called is waited for in the end."""


class Run:
    """One specification, stepped through time: its feed, and the deadlines of streams.

    Args:
        speed: how many times as fast as the wall; 0: as fast as it goes.
    """

    def __init__(
        self,
        call: Call,
        path: Path,
        fed: Sequence["FedSample"],
        modules: Sequence[str],
        unit: str,
        speed: float,
        roads: Path | None = None,
    ) -> None:
        from dyknow import Network
        from dyknow.kpl import Hooks
        from dyknow.kpl.introspection.records import FaultLog

        self._call, self._path, self._fed, self.speed = call, path, fed, speed
        self.read_named = beside(path)
        self.network = Network()
        faults = FaultLog(lambda said: call.out.note(f"note: {said}"))
        hooks = Hooks(
            self._on_sample, self._on_link, self._on_alarm, self._on_found, faults.on_fault, self._on_producer
        )
        self.instance = instance_of(self.network, hooks, modules, unit, labels=call.settings.ontology, roads=roads)
        self._governor: Governor | None = None
        self._waited_us = 0
        self._record: IO[str] | None = None
        self._recorded = set[Any]()
        self._unlinked = dict[str, None]()
        self.now_us = 0 if speed == 0 else time.time_ns() // 1000
        self._began_us, self._began_s = self.now_us, time.monotonic()
        self._computed: SimpleQueue[Computed] = SimpleQueue()
        if speed:
            self._work_apart()
        self._shown_from_us = self._began_us if speed else 0

    def _work_apart(self) -> None:
        """Call slow units in workers: time is real."""
        from dyknow.agents.effects import Compute
        from dyknow.runtime.workers import WorkerThreads

        run, note = self, self._call.out.note
        threads = WorkerThreads(self._computed.put, self._wall_us, note)

        class Apart:
            def now_us(self) -> int:
                return run._wall_us()

            def start(self, number: int, work: "Work") -> None:
                threads.perform(Compute(number, work))

        self.network.calls.workers = Apart()

    def _wall_us(self) -> int:
        return self._began_us + round((time.monotonic() - self._began_s) * 1e6 * self.speed)

    def specify(self, text: str) -> None:
        """Run this text from now on; raises TextErrors, and keeps the previous one running."""
        from dyknow.kpl import parse_specification
        from dyknow.kpl.checking.warnings import run_warnings
        from dyknow.kpl.introspection.governor import listens

        specification = parse_specification(text, self.read_named)
        if self._governor is None and listens(specification):
            raise WrongCall(
                f"{self._path} takes `refinements`, which a governor tells: give --govern TIME, e.g. 100ms."
            )
        self.instance.change(specification, self.now_us, text)
        for warning in run_warnings(self.instance.specification, self.instance.current_symbols(), text, self.now_us):
            self._call.out.note(f"note: {warning.drawn()}")
        for name, labels in self.instance.lacking.items():
            waiting = ", ".join(map(str, labels[:4]))
            self._call.out.note(
                f"note: no module offers {name}: {waiting} and what is made of it wait (--units MODULE)."
            )
        self._watch()

    def govern(self, limit_us: int) -> None:
        """Lengthen the periods of the least important streams while delays are longer than this."""
        from dyknow.kpl.introspection.governor import Governor

        self._governor = Governor(self.instance, lambda: self._waited_us, self.now_us, limit_us)

    def record(self, out: IO[str], text: str) -> None:
        """Write every sample of every generator and stream; recording a stream makes it computed."""
        out.write(
            json.dumps(
                {"specification": text, "file": str(self._path), "unit": self.instance.unit, "declared_us": self.now_us}
            )
            + "\n"
        )
        self._record = out
        self._watch()

    def go(self, until_us: int | None, reload: Callable[[], None] | None = None) -> None:
        """Step until the feed and the timers are over, or until a time."""
        fed = iter(self._fed)
        last_us: int | None = None
        begins_us = self._began_us if self.speed else 0
        following = next(fed, None)
        awaited_us = 0
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
            if next_us is not None or not self.network.calls:
                awaited_us = self.now_us + round(AWAITED_US * self.speed)
            ends = until_us is None and self.now_us >= awaited_us
            is_idle = next_us is None and (until_us is None or self.speed == 0) and reload is None
            if over or (is_idle and (ends or not self.network.calls)):
                break
            if not self._wait(next_us, until_us, reload):
                if until_us is not None and self.now_us >= until_us:
                    break
                continue
            if following is not None and fed_us is not None and fed_us <= self.now_us:
                with self.network.instant.whole():
                    at_us = following.at_us
                    while following is not None and following.at_us == at_us:
                        valid_us = following.valid_us + begins_us
                        self.instance.push(following.source, Sample(self.now_us, valid_us, following.value))
                        following = next(fed, None)
            else:
                self.network.on_time(self.now_us)
                if self._governor is not None:
                    self._governor.on_time(self.now_us)
            self._tell_unlinked()
            self._watch()

    def _last_us(self) -> int:
        """When the last sample of the feed can no longer matter."""
        from dyknow.kpl.introspection.graph import awaits_us

        if not self._fed:
            return 0
        return max(self._fed[-1].at_us, max(each.valid_us for each in self._fed) + awaits_us(self.instance))

    def _wait(self, next_us: int | None, until_us: int | None, reload: Callable[[], None] | None) -> bool:
        """Let time pass until something is due; False: something else may have happened."""
        if self.speed == 0:
            before_us, self.now_us = self.now_us, max(self.now_us, next_us or 0)
            self._waited_us += self.now_us - before_us
            return True
        target_us = min((each for each in (next_us, until_us) if each is not None), default=None)
        self.now_us = self._wall_us()
        if target_us is None or target_us > self.now_us:
            left_s = LOOK_S if target_us is None else (target_us - self.now_us) / 1e6 / self.speed
            began_s = time.monotonic()
            self._take_computed(min(left_s, LOOK_S))
            self._waited_us += round((time.monotonic() - began_s) * 1e6 * self.speed)
            if reload is not None:
                reload()
            return False
        self._take_computed(0.0)
        return next_us is not None and next_us <= self.now_us

    def _take_computed(self, wait_s: float) -> None:
        """Take what a worker made, if there is something within that time."""
        with suppress(Empty):
            done = self._computed.get(timeout=wait_s)
            self.now_us = self._wall_us()
            self.network.on_computed(done.number, done.outcome, round(done.took_us * self.speed), self.now_us)

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
        from dyknow.kpl.introspection.records import sample_json

        if self._record is not None:
            self._record.write(json.dumps({kind: str(name), **sample_json(sample)}) + "\n")

    def _on_sample(self, name: str, sample: "Sample") -> None:
        self._keep("stream", name, sample)
        from dyknow.kpl.introspection.graph import maker_of, origins_of
        from dyknow.kpl.introspection.records import sample_record

        origins = origins_of(self.instance, name, sample.valid_us)
        said = sample_record(name, sample, origins, maker_of(self.instance, name, sample))
        tell_record(self._call, said, begins_us=self._shown_from_us)

    def _on_link(self, name: str, linked: bool) -> None:
        if linked:
            self._unlinked.pop(name, None)
        else:
            self._unlinked[name] = None

    def _tell_unlinked(self) -> None:
        """After all of an instant: streams of members that left have ended, which needs no note."""
        unlinked, self._unlinked = self._unlinked, {}
        for name in unlinked:
            if name in self.instance.streams:
                self._call.out.note(
                    f"note: the inputs of {name} have no producer; it continues when they have one again."
                )

    def _on_producer(self, label: "Label", producer: "Label | None") -> None:
        from dyknow.kpl.introspection.records import producer_record

        tell_record(self._call, producer_record(label, producer, self.network.now_us), begins_us=self._shown_from_us)

    def _on_alarm(self, event: "AlarmEvent") -> None:
        from dyknow.kpl.introspection.records import alarm_record

        tell_record(self._call, alarm_record(event), begins_us=self._shown_from_us)

    def _on_found(self, event: "LinkEvent") -> None:
        from dyknow.kpl.introspection.records import found_record

        tell_record(self._call, found_record(event), begins_us=self._shown_from_us)


@command(example="dyknow kpl run cars.kpl --feed cars.jsonl --units cars.py")
def run(
    call: Call,
    file: SpecificationFile,
    *,
    options: RunOptions,
    unit: Annotated[str, typer.Option(metavar="U", help="The unit for `self`.")] = "0",
    pace: Annotated[
        float | None,
        typer.Option(
            "--speed", help="Times as fast as the wall clock; 0: as fast as it goes. [default: 0 with --feed, else 1]"
        ),
    ] = None,
    duration: Duration = None,
    record: Annotated[
        Path | None, typer.Option(metavar="FILE.jsonl", help="Write every sample, for `kpl verify`.")
    ] = None,
    watch: Annotated[
        bool, typer.Option("--watch", help="Load the file again whenever it, or a file it names, is changed.")
    ] = False,
    graph: Annotated[
        GraphForm | None, typer.Option("--graph", help="In the end show the network, with rates, delays and drops.")
    ] = None,
) -> int:
    """Run a specification in an instance of its own and show its streams and alarms; Ctrl-C ends it."""
    if pace is not None and not 0 <= pace <= MAX_SPEED:
        raise WrongCall(f"--speed is how many times as fast as the wall, 0 for as fast as it goes; got {pace:g}.")
    feed = options.feed
    read = (file, feed, options.roads, *map(Path, options.modules))
    if record is not None and any(_same(record, each) for each in read if each is not None):
        raise WrongCall(f"--record: {record} is read by this run; write to another file.")
    watched = WatchedFiles(file) if watch else None  # before it is read, so that a change meanwhile is noticed
    text = read_text(file)
    fed = [] if feed is None else read_samples(feed)
    speed = (0.0 if feed is not None else 1.0) if pace is None else pace
    running = Run(call, file, fed, options.modules, unit, speed, options.roads)
    lasts_us = None if duration is None else duration_us(duration, option="--duration", least_us=SHORTEST_US)
    with ExitStack() as stack:
        if record is not None:
            running.record(stack.enter_context(_created(record)), text)
        running.instance.compiler.admission = options.admit
        if watched is not None:
            running.read_named = watched.read_named
        if options.govern_us is not None:
            running.govern(options.govern_us)
        running.specify(text)
        _tell_idle(call, running, fed, feed, file)
        try:
            running.go(
                None if lasts_us is None else running.now_us + lasts_us, _reloading(call, running, file, watched)
            )
        except KeyboardInterrupt:
            return INTERRUPTED
        finally:
            if graph is not None:
                show_graph(call, running.instance, graph)
    return DONE


def _tell_idle(call: Call, running: Run, fed: "Sequence[FedSample]", feed: Path | None, file: Path) -> None:
    """Note what will not happen: exports and imports, sources without samples, samples without a source."""
    from dyknow.kpl.checking.symbols import OF_A_PLATFORM, symbol_of
    from dyknow.kpl.syntax.specification import Export, ForEach, Import

    every = running.instance.specification
    bodies = (each.body if isinstance(each, ForEach) else each for each in every)
    has_units = any(str(need.term.label) == OF_A_PLATFORM for each in every for need in symbol_of(each).takes)
    if has_units or any(isinstance(each, Export | Import) for each in bodies):
        unit = running.instance.unit
        call.out.note(f"note: exports, imports and `units` need a federation: dyknow join --unit {unit} --spec {file}.")
    sources, sampled = set(running.instance.sources()), {each.source for each in fed}
    lacking, idle = ", ".join(sorted(sources - sampled)), ", ".join(sorted(sampled - sources))
    if lacking and feed is None:
        call.out.note(f"note: no samples of {lacking}: give --feed FILE.jsonl, or --units with sources so called.")
    elif lacking:
        call.out.note(f"note: {feed} has nothing for {lacking}.")
    if idle:
        call.out.note(
            f"note: {feed} has samples of {idle}, which {'is' if len(sampled - sources) == 1 else 'are'} no source here."
        )


def _same(one: Path, other: Path) -> bool:
    return one.exists() and other.exists() and one.samefile(other)


def _created(path: Path) -> IO[str]:
    try:
        return path.open("w", encoding="utf-8")
    except OSError as error:
        raise WrongCall(f"--record: {path} cannot be written ({error}).") from None


def _reloading(call: Call, going: Run, path: Path, watched: WatchedFiles | None) -> Callable[[], None] | None:
    """Load the file when it has changed; if it is wrong, note that and keep the previous specification."""
    if watched is None:
        return None

    def look() -> None:
        if not watched.has_changed():
            return
        watched.begin()
        try:
            going.specify(read_text(path))
        except TextErrors as wrong:
            call.out.note(f"{wrong.drawn()}\nThe specification is rejected; the previous one keeps running.")
        except DyknowError as wrong:
            call.out.note(f"{wrong}\nThe specification is rejected; the previous one keeps running.")
        else:
            call.out.say(line(styled("changed", "green"), f" to {path}"), event="changed", file=str(path))

    return look
