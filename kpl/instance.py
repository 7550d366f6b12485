"""A running specification: declarations become processes, streams and monitors, and can be changed while they run."""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Literal, NamedTuple, TypeAlias

from dyknow import Label, Network, Sample, Sort, Value
from dyknow.errors import DyknowError, TextError, TooEarly
from dyknow.factory import ProcessFactory
from dyknow.prototypes import Prototype, SourcePrototype, UnitPrototype
from dyknow.stream_proxy import StreamProxy
from kpl.changes import as_text_errors, difference, rank, together, too_early
from kpl.chronicle_streams import ChronicleStreams, recognitions
from kpl.compiling import MAX_DECLARATIONS, Compiler, located, too_many
from kpl.declared import MARGIN, Declared, names_of
from kpl.definitions import Definitions
from kpl.families import Families
from kpl.figures import MEANINGS, figure
from kpl.formula_monitors import FormulaMonitor
from kpl.introspection import proxies_of
from kpl.known import Known
from kpl.parsing import raise_all
from kpl.parts import Parts
from kpl.specification import (
    ChronicleFile,
    Declaration,
    Export,
    ForEach,
    GeneratorDeclaration,
    Import,
    MonitorDeclaration,
    SourceDeclaration,
    Specification,
    StreamDeclaration,
    StreamTerm,
    UnitDeclaration,
)
from kpl.specification_checking import Findings, check_change, check_specification
from kpl.surroundings import Federation, Hooks, Undo, nothing

if TYPE_CHECKING:
    from kpl.governor import Governor

MAX_CONFIGURATIONS = 256


class ConfigurationEntry(NamedTuple):
    """What an instance held from a time on."""

    at_us: int
    specification: Specification


Part: TypeAlias = SourceDeclaration | UnitDeclaration | GeneratorDeclaration
Admission: TypeAlias = Literal["refuse", "longer"]


class Instance:
    """The specification of one network, as it is now.

    Args:
        network: may hold generators of its own, which declarations then use.
        unit: what `self` means.
        sorts: sorts whose values are checked; any other name is a sort of unchecked values.
        semantic: sorts of the semantic labels there are; None: any.
        prototypes: what sources and units can be made from.
        catalogue: asked for others by name; None: there is none.
        offered: names of what the catalogue has.
        admission: what becomes of declarations while a governor sees no time for more: they are refused, or their
            sampled streams begin at a longer period.
    """

    def __init__(
        self,
        network: Network,
        *,
        unit: str = "0",
        sorts: Mapping[str, Sort] | None = None,
        semantic: Mapping[str, str] | None = None,
        prototypes: Iterable[Prototype] = (),
        catalogue: Callable[[str], Prototype | None] = lambda _name: None,
        offered: Collection[str] = (),
        hooks: Hooks | None = None,
        federation: Federation | None = None,
        admission: Admission = "refuse",
    ) -> None:
        self.admission: Admission = admission
        self.governor: Governor | None = None
        self.network, self.unit, self.hooks = network, unit, hooks or Hooks()
        self.factory = ProcessFactory(network)
        for prototype in prototypes:
            self.factory.add_prototype(prototype)
        self.specification: Specification = ()
        self.configurations: list[ConfigurationEntry] = []
        self.streams: dict[str, StreamProxy] = {}
        self.monitors: dict[str, FormulaMonitor] = {}
        self.chronicles: dict[str, ChronicleStreams] = {}
        self._catalogue, self._offered = catalogue, offered
        self._sorts, self._semantic, self._federation = sorts or {}, semantic, federation
        self._undo: dict[Declaration, Undo] = {}
        self._backlog: list[tuple[str, Sample]] = []
        self._is_going_back = False
        self._compiler = Compiler(self)
        self.parts = Parts(network, self.factory, self._compiler)
        self.families = Families(network, self._compiler, self.parts)
        network.resolve = lambda label: figure(self, label) or recognitions(network, label)

    # What a specification says

    def add(self, declarations: Iterable[Declaration], now_us: int, text: str = "", file: str = "") -> None:
        """Declare more.

        Raises:
            TextErrors: with everything that is wrong; the instance is as it was.
        """
        self.change((*self.specification, *declarations), now_us, text, file)

    def remove(self, declarations: Iterable[Declaration], now_us: int) -> None:
        """Take declarations back.

        Raises:
            TextErrors: what stays needs them; the instance is as it was.
        """
        gone = {id(self.parts.specified.find(each)) for each in declarations}
        self.change([each for each in self.specification if id(each) not in gone], now_us)

    def change(self, specification: Iterable[Declaration], now_us: int, text: str = "", file: str = "") -> None:
        """Become another specification; what both declare goes on untouched, what both make differently is replaced.

        Raises:
            TextErrors: with everything that is wrong; the instance is as it was.
        """
        before = self.specification
        every = tuple(specification)
        if len(every) > MAX_DECLARATIONS:
            raise_all([too_many(len(every), file)])
        gone, new, wanted = difference(before, every)
        self.network.now_us = max(self.network.now_us, now_us)
        self._declare(gone, new)
        try:
            self._check(gone, new, wanted, text, file)
            if self.governor is not None and self.admission == "refuse":
                raise_all(self.governor.refusals(new, text, file))
            known = {id(proxy) for _, proxy in proxies_of(self)} if self._is_full() else ()
            gone.sort(key=rank, reverse=True)
            new.sort(key=rank)
            self._take_over(gone, new, wanted, text, file)
        except TextError:
            self._declare(new, gone)
            raise
        self.specification = wanted
        self.network.sweep()
        if self.governor is not None and self._is_full():
            self.governor.hold_back(known, self.network.now_us)
        self.configurations.append(ConfigurationEntry(now_us, wanted))
        del self.configurations[:-MAX_CONFIGURATIONS]

    def restore(self, number: int, now_us: int) -> None:
        """Become configuration `number`, counted from 0, again.

        Raises:
            IndexError: there is none.
            TextErrors: it cannot be any more.
        """
        self.change(self.configurations[number].specification, now_us)

    # Who makes it

    def offer(self, prototypes: Iterable[Prototype], now_us: int) -> None:
        """More can be made from now on; streams that waited for it begin.

        Raises:
            PrototypeExists: a name is taken; those before it are offered.
            SortError: it is declared with other sorts; those before it are offered.
        """
        self.network.now_us = max(self.network.now_us, now_us)
        self.parts.offer(prototypes)

    def withdraw(self, names: Iterable[str], now_us: int) -> None:
        """What was made from these prototypes ends; its clients are told, and served again when they are offered again.

        Raises:
            UnknownPrototype: there is none of that name; those before it are withdrawn.
        """
        self.network.now_us = max(self.network.now_us, now_us)
        self.parts.withdraw(names)

    @property
    def lacking(self) -> dict[str, tuple[Label, ...]]:
        """Prototypes that nobody offers, and the generators that wait for them."""
        return self.parts.lacking

    # What runs

    def push(self, source: str, valid_us: int, value: Value, now_us: int) -> None:
        """A source that is fed from outside has a new sample; where nothing is made from it, it is dropped."""
        self.parts.push(source, valid_us, value, now_us)

    def sources(self) -> tuple[str, ...]:
        """The declared sources that are fed from outside."""
        return self.parts.sources()

    def lookup(self, name: str) -> Prototype | None:
        """The same, or what the catalogue has."""
        return self.factory.find(name) or self._catalogue(name)

    def sort(self, name: str) -> Sort:
        """A sort by name; unknown ones take any value."""
        return self._sorts.get(name) or Sort(name, is_open=True)

    def known(self, running: Collection[Declaration], unread: Collection[str] = ()) -> Known:
        """What is there beside what is declared, which `running` is; nothing called like a word of `unread` is missing."""
        prototypes = self.factory.prototypes()
        return Known(
            sources={each.name: each.sort for each in prototypes if isinstance(each, SourcePrototype)},
            units={each.name: (each.sort, each.inputs) for each in prototypes if isinstance(each, UnitPrototype)},
            labels={
                label: self.network.generator(label).sort.name
                for label in self.network.labels()
                if label not in self.parts.declared and not self.network.is_implicit(label)
            },
            semantic=self._semantic,
            running=running,
            figures=MEANINGS,
            values=self._sorts,
            offered=self._offered,
            unread=unread,
        )

    # How it becomes so

    def _declare(self, gone: Iterable[Declaration], new: Iterable[Declaration]) -> None:
        for each in gone:
            self.parts.specified.discard(each)
        for each in new:
            self.parts.specified.add(each)

    def _check(
        self, gone: Sequence[Declaration], new: Sequence[Declaration], wanted: Specification, text: str, file: str
    ) -> None:
        """What is said of a change before anything changes."""
        self._look_up(new)
        specified = self.parts.specified
        errors = check_change(specified, gone, new, self.known(self.specification), text, file)
        raise_all(together(errors, self._compiler.check(new, wanted, specified, text, file)))

    def findings(
        self,
        wanted: Specification,
        running: Collection[Declaration] = (),
        text: str = "",
        file: str = "",
        unread: Collection[str] = (),
    ) -> Findings:
        """All that can be said before it runs; `running` does already, nothing called like a word of `unread` is missing."""
        self._look_up(wanted)
        found = check_specification(wanted, self.known(running, unread), text, file)
        more = self._compiler.check(wanted, wanted, Declared(wanted), text, file)
        return Findings(tuple(together(found.errors, more)), found.warnings)

    def _is_full(self) -> bool:
        return self.governor is not None and self.governor.full

    def _look_up(self, wanted: Iterable[Declaration]) -> None:
        """Offer what the catalogue has under the names that are used."""
        for each in wanted:
            made = each.body.made if isinstance(each, ForEach) else getattr(each, "made", None)
            name = getattr(made, "unit", None) or getattr(made, "source", None)
            if isinstance(name, str) and self.factory.find(name) is None:
                prototype = self._catalogue(name)
                if prototype is not None:
                    self.factory.add_prototype(prototype)

    def _take_over(
        self, gone: Sequence[Declaration], new: Sequence[Declaration], wanted: Specification, text: str, file: str
    ) -> None:
        """Become what is wanted, or stay; what was never begun has told nothing."""
        before, self._backlog = self.specification, []
        try:
            self._begin_in_past(gone, new, wanted)
            other = self.parts.of_other_sorts((*gone, *new))
            remade = [each for each in other if each in self._undo and each not in gone]
            rest = [each for each in new if each not in self._undo]
            self._become([*gone, *remade], sorted([*rest, *remade], key=rank), wanted)
        except (DyknowError, RecursionError) as wrong:
            self._is_going_back = True
            done = [each for each in new if each in self._undo]
            self._become(done[::-1], [each for each in before if each not in self._undo], before)
            self._is_going_back = False
            raise as_text_errors(wrong, text, file) from wrong
        for name, sample in self._backlog:
            self.hooks.on_output(name, sample)

    def _begin_in_past(self, gone: Sequence[Declaration], new: Sequence[Declaration], wanted: Specification) -> None:
        """What may be refused comes first, with what it needs, while everything is still as it was."""
        past = [each for each in new if isinstance(each, StreamDeclaration) and self._past_us(each.term) is not None]
        if not past:
            return
        self.parts.wanted = wanted
        taken = {name for each in gone for name in names_of(each)}
        for each in (*(each for each in new if isinstance(each, Part)), *past):
            label = each.label if isinstance(each, GeneratorDeclaration) else None
            if taken.isdisjoint(names_of(each)) and (label is None or label not in self.parts.declared):
                self._undo[each] = self._realise(each)

    def _become(self, gone: Sequence[Declaration], new: Iterable[Declaration], wanted: Specification) -> None:
        self.parts.wanted = wanted
        replaced = {each.label: each for each in new if isinstance(each, GeneratorDeclaration)}
        successors = list(new)
        for each in gone:
            by = replaced.get(each.label) if isinstance(each, GeneratorDeclaration) else None
            if by is not None and self.parts.replace(by):
                successors.remove(by)
                self._undo[by] = self._undo.pop(each)
            else:
                self._undo.pop(each)()
        for declared in successors:
            self._undo[declared] = self._realise(declared)
        if any(isinstance(each, GeneratorDeclaration) for each in gone):
            self.families.renew()

    def _realise(self, declaration: Declaration) -> Undo:
        match declaration:
            case GeneratorDeclaration():
                return self.parts.add(declaration)
            case ForEach():
                return self.families.add(declaration)
            case StreamDeclaration():
                return self._deliver(declaration)
            case MonitorDeclaration():
                return self._monitor(declaration)
            case ChronicleFile(path, _, content) if content is not None:
                chronicles = self.chronicles[path] = ChronicleStreams(self.network, declaration, content)
                return partial(_end, self.chronicles, path, chronicles)
            case Export(semantic, term) if self._federation is not None:
                return self._federation.export(semantic, self._compiler.term(term))
            case Import(semantic, unit, term) if self._federation is not None:
                return self._import(semantic, unit, self._compiler.term(term), declaration)
            case SourceDeclaration(_, name) if not isinstance(self.factory.find(name), SourcePrototype):
                self.parts.fed.setdefault(name, [])
                return partial(_forget, self.parts.fed, name)
        return nothing

    def _import(self, semantic: str, unit: str, term: StreamTerm, declaration: Declaration) -> Undo:
        assert self._federation is not None  # noqa: S101  (only then it is called)
        take_back = self._federation.import_(semantic, unit, term)
        self.parts.declared[term.label] = declaration

        def undo() -> None:
            self.parts.declared.pop(term.label, None)
            take_back()

        return undo

    def _past_us(self, term: StreamTerm) -> int | None:
        """When a stream begins that began already."""
        begins_us = term.policy.from_us
        is_past = begins_us is not None and begins_us < self.network.now_us
        return begins_us if is_past and not self._is_going_back else None

    def _deliver(self, declaration: StreamDeclaration) -> Undo:
        name, term = declaration.name, declaration.term
        wanted = self._compiler.input(term)
        try:
            proxy = self.network.connect(
                wanted.label,
                wanted.policy,
                lambda sample: self.hooks.on_output(name, sample),
                lambda linked: self.hooks.on_link(name, linked),
                from_us=self._past_us(term),
            )
        except TooEarly as wrong:
            raise located(declaration, *too_early(wrong, self.network.now_us)) from wrong
        self.streams[name] = proxy
        self._backlog += [(name, sample) for sample in proxy.take_backlog()]

        def undo() -> None:
            self.streams.pop(name, None)
            proxy.cancel()

        return undo

    def _monitor(self, declaration: MonitorDeclaration) -> Undo:
        formula = Definitions(self.parts.wanted).resolved(declaration.formula, self.unit)
        if self._federation is not None:
            undo = self._federation.monitor(declaration, formula)
            if undo is not None:
                return undo
        monitor = FormulaMonitor(
            self.network,
            declaration,
            formula,
            self.unit,
            self.hooks.on_alarm,
            self.network.now_us,
        )
        self.monitors[declaration.name] = monitor
        margin = Label(MARGIN, (declaration.name,))
        self.network.recall(margin)

        def end() -> None:
            self.monitors.pop(declaration.name, None)
            if self.network.has(margin):
                self.network.remove(margin)
            monitor.cancel()

        return end


def _end(held: dict[str, ChronicleStreams], path: str, chronicles: ChronicleStreams) -> None:
    del held[path]
    chronicles.cancel()


def _forget(fed: dict[str, list[Label]], name: str) -> None:
    if not fed.get(name):
        fed.pop(name, None)
