"""What a platform's specification declares beyond its own instance: exports, imports, monitors over other units.

An exported stream is a generator under the label that this platform has for the semantic label, so that whoever asks
for it, queries it or monitors it finds it where every other stream is found. An imported stream is asked for like the
inputs of monitors are (thesis 9.4.1).
"""

from collections.abc import Callable, Iterable
from functools import lru_cache, partial
from typing import TYPE_CHECKING

from agents.derived_states import derived_features
from agents.effects import HostEvent, Specify
from agents.host_desk import HostDesk
from agents.plans import MonitorPlan
from dyknow import NO_VALUE, Inputs, Policy, Sample, UnitPrototype, Value, converted
from dyknow.errors import Refused, TextError, TextErrors, Unmade
from dyknow.generator import Generator
from dyknow.processes import EVER_US, Input, Refinement
from federation import contents
from federation.acts import Act, Performative
from federation.ontology import Convert
from federation.wire import LabelEntry
from kpl import Hooks, Instance, Specification, parse_specification, print_specification
from kpl.governor import Governor
from kpl.introspection import drawn, graph_of, maker_of, origins_of
from kpl.records import Faults, alarm_record, sample_record
from kpl.specification import Import, MonitorDeclaration, StreamTerm
from kpl.surroundings import Undo
from kpl.suspicions import grid_warnings
from reasoning import AlarmEvent
from reasoning.formulas import Formula, split_growing
from reasoning.profiles import Profile

if TYPE_CHECKING:
    from agents.platform import Platform

OWNER = "specification"
PERIOD_US = 100_000
MAX_DELAY_US = 1_000_000
LONGEST_NAME = 64
"""Of a monitor, which others are told of."""
PAGE = 4000
"""Characters of a specification in one answer."""


@lru_cache(maxsize=4)
def read(text: str, file: str, named: tuple[tuple[str, str], ...] = ()) -> Specification:
    """Parse a specification and the files it names; who hands one over reads it first, so that the node need not.

    Raises:
        TextError: something is wrong with it.
    """
    texts = dict(named)

    def read_file(path: str) -> str:
        if path not in texts:
            raise FileNotFoundError("it does not come with the specification")
        return texts[path]

    return parse_specification(text, file, read_file)


class Declared:
    """The specification of one platform.

    Attributes:
        instance: what runs; it prints back what it was given.
        desk: the operating system processes that offer to make some of it.
        imported: which (semantic label, period, max delay) of which unit it lives on.
    """

    def __init__(self, platform: "Platform") -> None:
        self._p = platform
        self._exported: dict[str, LabelEntry] = {}
        self.imported: dict[str, set[tuple[str, int, int]]] = {}
        self._faults = Faults(platform.note)
        ontology = platform.config.ontology
        self.instance = Instance(
            platform.network,
            unit=platform.unit,
            sorts={ontology[name].sort.name: ontology[name].sort for name in ontology},
            semantic={name: ontology[name].sort.name for name in ontology},
            catalogue=platform.config.catalogue,
            hooks=Hooks(self._on_output, self._on_link, platform.on_alarm),
            federation=self,
            admission=platform.config.admission,
        )
        platform.network.on_fault = self._faults.on_fault
        self.desk = HostDesk(self.instance, platform.clock, platform.note, platform.config.monotonic_offset_us)
        self._waited_us = 0
        self._governor: Governor | None = None
        self._not_taken: Specify | None = None

    def specify(self, given: Specify, now_us: int) -> None:
        """Become this specification; what is wrong with it is told, and what ran goes on. Federation time."""
        self._faults.clear()
        self._govern(now_us)
        self._not_taken = None
        text, file = given.text, given.file
        try:
            self.instance.change(read(text, file, given.named), now_us, text, file)
        except TextError as wrong:
            self._not_taken = given
            runs, awaits = bool(self.instance.specification), _awaited(wrong)
            said = {"file": file, "said": wrong.drawn(), "runs": runs, "awaits": awaits}
            self._p.tell({"event": "not-specified", **said})
            until = f" until a host offers {', '.join(awaits[:8])} (dyknow host MODULE --unit {self._p.unit})"
            self._p.note(f"the specification is not taken{until if awaits else ''}; what ran goes on:\n{wrong.drawn()}")
            return
        imports = [[each.semantic, each.unit] for each in self.instance.specification if isinstance(each, Import)]
        declarations, exports = len(self.instance.specification), sorted(self._exported)
        self._p.tell(
            {
                "event": "specified",
                "file": file,
                "declarations": declarations,
                "exports": exports,
                "imports": imports,
            }
        )
        for warning in grid_warnings(self.instance.specification, text, file):
            self._p.note(warning.drawn())
        for name, labels in self.instance.lacking.items():
            self._p.note(f"nobody offers {name} yet; {', '.join(map(str, labels[:8]))} will begin when somebody does")

    def _govern(self, now_us: int) -> None:
        """A governor, if there is to be one: before the first specification, which may name what it tells."""
        limit_us = self._p.config.govern_us
        if self._governor is None and limit_us is not None:
            self._governor = Governor(self.instance, lambda: self._waited_us, now_us, limit_us)

    def on_waited(self, waited_us: int, now_us: int) -> None:
        """How long this process has waited for something to do: the governor looks. Federation time."""
        self._waited_us = round(waited_us * self._p.clock.speed)
        self._govern(now_us)
        if self._governor is not None:
            self._governor.on_time(now_us)

    def restore(self, number: int, now_us: int) -> None:
        """Hold again what was held in a configuration. Federation time.

        Raises:
            Refused: there is none of that number, or it cannot be any more.
        """
        held = self.instance.configurations
        if number >= len(held):
            raise Refused(f"there are {len(held)} configurations, counted from 0; there is none of number {number}")
        try:
            self.instance.restore(number, now_us)
        except TextError as wrong:
            raise Refused(str(wrong)) from None

    def on_asked(self, act: Act, content: contents.Specification, now_us: int) -> None:
        """Print back what is held, or was."""
        held = self.instance.configurations
        number = len(held) - 1 if content.number is None else content.number
        if not 0 <= number < len(held):
            raise Refused(
                f"there is no configuration {number}; {len(held)} are kept, counted from 0" if held
                else "this platform was given no specification"
            )  # fmt: skip
        desk = self._p.interface
        if content.form == "kpl":
            text = print_specification(held[number].specification)
        else:
            text = drawn(graph_of(self.instance), content.form)
        at_us, last = held[number].at_us, len(held) - 1
        pages = [text[at : at + PAGE] for at in range(0, len(text), PAGE)] or [""]
        for i, page in enumerate(pages):
            said = contents.SpecificationText(text=page, number=number, last=last, at_us=at_us, more=i < len(pages) - 1)
            desk.answer(act, Performative.INFORM, said, now_us)

    def on_host(self, event: HostEvent, now_us: int) -> bool:
        """A host came, said something or left; whether anything follows but what the host is told. Node time."""
        before = len(self.desk.hosts)
        self.desk.on_event(event, now_us)
        if self._not_taken is not None and len(self.desk.hosts) > before:
            self.specify(self._not_taken, self._p.clock.federation_us(now_us))  # it may have waited for this host
        told = self.desk.flush()
        timetable = self._p.timetable
        timetable.hasten(self.desk)
        timetable.hasten_federation(self._p.monitors)
        timetable.hasten_federation(self._p.network)
        is_owing = self._p.is_owing
        self._p.emit(told)
        return is_owing

    def entries(self) -> Iterable[LabelEntry]:
        """The semantic labels that are exported."""
        return tuple(self._exported.values())

    # What `Instance` asks of the federation

    def export(self, semantic: str, term: StreamTerm) -> Undo:
        """Offer a stream under a semantic label; raises Refused if the vehicle's own stream has it."""
        network, translation = self._p.network, self._p.translation
        local = translation.local_label(semantic, self._p.unit)
        entry = self._p.config.ontology[semantic]
        period_us = term.policy.sample_us or 0
        self._exported[semantic] = LabelEntry(
            label=semantic, sort=entry.sort.name, type_hash=entry.type_hash, period_us=period_us
        )
        if local == term.label and term.policy == Policy():
            self._p.offer()
            return partial(self._withdraw, semantic)
        if network.has(local):
            del self._exported[semantic]
            raise Refused(f"{semantic} is the stream {local} here already, made by another; export that one")
        unit = _converting(entry.sort.name, translation.to_local(semantic))
        network.add_process(local, translation.local_sort(semantic), Refinement(unit, [Input(term.label, term.policy)]))

        def undo() -> None:
            network.remove(local)
            self._withdraw(semantic)

        self._p.offer()
        return undo

    def import_(self, semantic: str, unit: str, term: StreamTerm) -> Undo:
        """Have a unit's stream under a label of our own; it is asked for while somebody here takes it."""
        if unit == self._p.unit:
            raise Refused(f"import {semantic} from {unit}: that is this platform; use its stream itself")
        policy = term.policy
        delay_us = MAX_DELAY_US if policy.max_delay_us is None else policy.max_delay_us
        need = (semantic, policy.sample_us or PERIOD_US, delay_us)
        local, to_semantic = self._p.source(semantic, unit)
        network, tell = self._p.network, partial(self._need, unit, need)
        if local == term.label:
            return Asked(network.generator(local), tell).stop
        entry = self._p.config.ontology[semantic]
        imported = Imported(_converting(entry.sort.name, to_semantic), Input(local, policy), tell)
        network.add_process(term.label, entry.sort, imported)
        return partial(network.remove, term.label)

    def monitor(self, declaration: MonitorDeclaration, formula: Formula) -> Undo | None:
        """Monitor a formula over units; None if it is not over what is derived from their streams."""
        if len(declaration.name) > LONGEST_NAME:
            raise Refused(f"a monitor's name has at most {LONGEST_NAME} characters, got {len(declaration.name)}")
        features = derived_features(self.instance, formula, f"monitor {declaration.name}")
        if not features:
            return None
        policy = declaration.policy
        profile = Profile(
            declaration.name,
            " ".join(sorted(features)),
            policy.sample_us or PERIOD_US,
            MAX_DELAY_US if policy.max_delay_us is None else policy.max_delay_us,
            close_after=declaration.close_after,
            no_value=declaration.no_value,
        )
        split = split_growing(formula)
        plan = MonitorPlan(profile, formula, None) if split is None else MonitorPlan(profile, split[2], split[0])
        self._p.monitors.create(plan, OWNER, self._p.network.now_us)
        self._p.wake()

        def undo() -> None:
            self._p.monitors.remove(declaration.name, OWNER)

        return undo

    def _withdraw(self, semantic: str) -> None:
        self._exported.pop(semantic, None)
        self._p.offer()

    def _need(self, unit: str, need: tuple[str, int, int], wanted: bool) -> None:
        needs = {name: set(found) for name, found in self.imported.items()}
        if wanted:
            needs.setdefault(unit, set()).add(need)
        else:
            needs.get(unit, set()).discard(need)
        self.imported = {name: found for name, found in needs.items() if found}
        self._p.wake()

    # What happens in the instance

    def _on_output(self, name: str, sample: Sample) -> None:
        origins = origins_of(self.instance, name, sample.valid_us)
        self._p.tell(sample_record(name, sample, origins, maker_of(self.instance, name, sample)))

    def _on_link(self, name: str, linked: bool) -> None:
        self._p.tell({"event": "stream", "stream": name, "linked": linked})

    def on_alarm(self, event: AlarmEvent) -> None:
        """An alarm of a monitor that the specification declares is told with what else comes of it."""
        named = self._p.monitors.named.get(event.monitor)
        if event.monitor not in self.instance.monitors and (named is None or OWNER not in named.owners):
            return
        self._p.tell(alarm_record(event))


class Imported(Refinement):
    """A stream of another unit under a label of our own; it is asked for while somebody here takes it."""

    def __init__(self, unit: UnitPrototype, taken: Input, ask: Callable[[bool], None]) -> None:
        super().__init__(unit, [taken])
        self._ask = ask

    def begin(self) -> None:
        super().begin()
        self._ask(True)

    def end(self) -> None:
        super().end()
        self._ask(False)


class Asked:
    """Where the source itself has the label: it is asked for while somebody takes it, and what came is kept."""

    def __init__(self, generator: Generator, ask: Callable[[bool], None]) -> None:
        self._generator, self._ask, self._asks = generator, ask, False
        generator.owner = self
        self.on_demand()

    def on_demand(self) -> None:
        """Who takes it has changed."""
        self._tell(bool(self._generator.subscriptions))

    def reach(self, from_us: int | None) -> None:
        """There is no more of the past than what came."""

    def since_us(self) -> int:
        """The history knows."""
        return EVER_US

    def stop(self) -> None:
        """It is imported no more."""
        self._generator.owner = None
        self._tell(False)

    def _tell(self, asks: bool) -> None:
        if asks is not self._asks:
            self._asks = asks
            self._ask(asks)


def _awaited(wrong: TextError) -> list[str]:
    """The labels that a host might yet offer, if nothing else is wrong."""
    errors = wrong.errors if isinstance(wrong, TextErrors) else (wrong,)
    labels = [each.label for each in errors if isinstance(each, Unmade)]
    return list(dict.fromkeys(labels)) if len(labels) == len(errors) else []


def _converting(sort: str, convert: Convert) -> UnitPrototype:
    """Values in other units, with what is said of them."""

    def step(now_us: int, inputs: Inputs, state: Value) -> tuple[Sample | None, Value]:
        (sample,) = inputs
        if sample is None:
            return None, state
        made = sample if sample.value is NO_VALUE else converted(sample, convert(sample.value))
        return made._replace(available_us=now_us), state

    return UnitPrototype("as exported", sort, (sort,), lambda: step, samplewise=True)
