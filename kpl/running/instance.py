"""A running specification: declarations become processes, streams and monitors, and can be changed while they run."""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

from dyknow import Label, Network, Sample, Sort
from dyknow.anchoring.roads.network import RoadNetwork
from dyknow.kpl.checking.definitions import Definitions
from dyknow.kpl.checking.specifications import Findings, check_change, check_symbols
from dyknow.kpl.checking.symbols import Known, SymbolTable
from dyknow.kpl.running.changes import (
    DeclaredTimes,
    SpecificationChange,
    as_text_errors,
    made_by,
    meanings,
    needed_first,
    rank,
    together,
    too_early,
)  # fmt: skip
from dyknow.kpl.running.chronicle_streams import ChronicleStreams, recognitions
from dyknow.kpl.running.compiling import MAX_DECLARATIONS, Compiler, located, too_many
from dyknow.kpl.running.figures import MEANINGS, InstanceFigures
from dyknow.kpl.running.formula_monitors import FormulaMonitor
from dyknow.kpl.running.parts import Families, Features, HeldGenerator, Parts, inputs_taken
from dyknow.kpl.running.ports import Admission, Federation, Hooks, LoadGovernor, Undo, nothing
from dyknow.kpl.syntax import specification as spec
from dyknow.kpl.syntax.parsing import raise_all
from dyknow.model.errors import DyknowError, Refused, TextError, TextErrors, TooEarly, file_of
from dyknow.model.semantic_labels import SemanticLabel
from dyknow.navigation.geodesy import LocalFrame
from dyknow.network.factory import Prototypes
from dyknow.network.prototypes import Prototype, SourcePrototype, UnitPrototype
from dyknow.network.stream_proxy import StreamProxy
from dyknow.reasoning.features.derived_streams import derived_stream

MAX_CONFIGURATIONS = 256


class ConfigurationEntry(NamedTuple):
    """The specification of an instance from a time on."""

    at_us: int
    specification: spec.Specification


class Instance:
    """The specification of one network, as it is now.

    Args:
        network, unit: may hold generators of its own, which declarations then use; the meaning of `self`.
        sorts: sorts whose values are checked; any other name is a sort of unchecked values.
        semantic: the semantic labels there are without a declaration; None: any.
        prototypes, catalogue, offered: prototypes of sources and units; a function for other names; the names it has.
        admission: of declarations while a governor sees no time for more: refused, or sampled at a longer period.
        features, is_unit: sort and process of a stream while it is wanted, or None; whether a name is that of a unit.
        roads, frame: the roads of objects unless others are declared; the frame of the platform's cameras.
    """

    def __init__(
        self,
        network: Network,
        *,
        unit: str = "0",
        sorts: Mapping[str, Sort] | None = None,
        semantic: Mapping[str, SemanticLabel] | None = None,
        prototypes: Iterable[Prototype] = (),
        catalogue: Callable[[str], Prototype | None] = lambda _name: None,
        offered: Collection[str] = (),
        hooks: Hooks | None = None,
        federation: Federation | None = None,
        admission: Admission = "refuse",
        features: Features = derived_stream,
        is_unit: Callable[[str], bool] | None = None,
        roads: RoadNetwork | None = None,
        frame: LocalFrame | None = None,
    ) -> None:
        self.governor: LoadGovernor | None = None
        self.network, self.unit, self.hooks = network, unit, hooks or Hooks()
        self.prototypes = Prototypes(prototypes)
        self.specification: spec.Specification = ()
        self.configurations: list[ConfigurationEntry] = []
        self.streams: dict[str, StreamProxy] = {}
        self.monitors: dict[str, FormulaMonitor] = {}
        self.chronicles: dict[str, ChronicleStreams] = {}
        self._catalogue, self._offered, self._roads, self._frame = catalogue, offered, roads, frame
        self._sorts, self._semantic, self._federation = sorts or {}, semantic, federation
        self._undo: dict[spec.Declaration, Undo] = {}
        self._backlog: list[tuple[str, Sample]] = []
        self._file, self._is_going_back = "a specification", False
        self._times, self.symbols = DeclaredTimes(), SymbolTable()
        self.compiler = Compiler(unit, self.prototypes, self.symbols, self.sort, admission)
        self.parts = Parts(network, self.prototypes, self.compiler, is_unit or unit.__eq__)
        self.families = Families(network, self.compiler, self.parts, self._of_member)
        figures = InstanceFigures(network, self.streams, self.monitors)
        network.on_fault, network.on_producer = self.hooks.on_fault, self.hooks.on_producer
        network.resolve = lambda label: (
            figures.find(label) or recognitions(network, label) or self.parts.undeclared(label, features)
        )

    def add(self, declarations: Iterable[spec.Declaration], now_us: int, text: str = "") -> None:
        """Declare more.

        Raises:
            TextErrors: every error; the instance is as it was.
        """
        self.change((*self.specification, *declarations), now_us, text)

    def remove(self, declarations: Iterable[spec.Declaration], now_us: int) -> None:
        """Take declarations back.

        Raises:
            TextErrors: remaining declarations need them; the instance is as it was.
        """
        gone = {id(self.symbols.find(self._times.declared(each))) for each in declarations}
        self.change([each for each in self.specification if id(each) not in gone], now_us)

    def change(self, specification: Iterable[spec.Declaration], now_us: int, text: str = "") -> None:
        """Become another specification; declarations that both have keep running, those that differ are replaced.

        A monitor whose definitions change counts as another monitor.

        Raises:
            TextErrors: every error; the instance is as it was.
        """
        before, self._file = self.specification, file_of(text) or self._file
        every = tuple(specification)
        if len(every) > MAX_DECLARATIONS:
            raise_all([too_many(len(every), text)])
        change = self._times.change(before, every, now_us, text)
        meant = dict(meanings(self.symbols, change, self.unit))
        self.network.now_us = max(self.network.now_us, now_us)
        self._declare(change.gone, change.new)
        try:
            self._check(change, text)
            redefined = [each for each, now in meanings(self.symbols, change, self.unit) if now != meant[each]]
            if self.governor is not None and self.compiler.admission == "refuse":
                raise_all(self.governor.refusals(change.new, text))
        except TextError as wrong:
            self._declare(change.new, change.gone)
            raise as_text_errors(wrong, text) from None
        is_full = self.governor is not None and self.governor.full
        known = {id(proxy) for _, proxy in self.proxies()} if is_full else ()
        self._take_over(change, redefined, text)
        self.specification = change.wanted
        self._times.settle(change.wanted)
        self.network.sweep()
        if self.governor is not None and self.governor.full:
            self.governor.hold_back(known, self.network.now_us)
        self.configurations.append(ConfigurationEntry(now_us, change.wanted))
        del self.configurations[1 : 1 - MAX_CONFIGURATIONS]  # the first one stays

    def restore(self, number: int, now_us: int) -> None:
        """Become configuration `number`, counted from 0, again.

        Raises:
            IndexError: there is none.
            TextErrors: it is no longer possible.
        """
        self.change(self.configurations[number].specification, now_us)

    def offer(self, prototypes: Iterable[Prototype], now_us: int) -> None:
        """Offer more prototypes; streams that waited for them begin; see `Parts.offer`."""
        self.network.now_us = max(self.network.now_us, now_us)
        self.parts.offer(prototypes)

    def withdraw(self, names: Iterable[str], now_us: int) -> None:
        """End what was made from these prototypes until they are offered again; see `Parts.withdraw`."""
        self.network.now_us = max(self.network.now_us, now_us)
        self.parts.withdraw(names)

    @property
    def lacking(self) -> dict[str, tuple[Label, ...]]:
        """Prototypes without an offer, and the generators that wait for them."""
        return self.parts.lacking

    def push(self, source: str, sample: Sample) -> None:
        """A source that is fed from outside has a new sample; where nothing is made from it, it is dropped."""
        self.parts.push(source, sample)

    def sources(self) -> tuple[str, ...]:
        """The declared sources that are fed from outside."""
        return self.parts.sources()

    def lookup(self, name: str) -> Prototype | None:
        """The prototype of sources and units of that name."""
        return self.prototypes.find(name) or self._catalogue(name)

    def sort(self, name: str) -> Sort:
        """A sort by name; unknown ones take any value."""
        return self._sorts.get(name) or Sort(name, is_open=True)

    def current_symbols(self) -> SymbolTable:
        """The symbol table, with the definitions outside the specification as they are now."""
        self.symbols.known = self.known(self.specification)
        return self.symbols

    def known(self, running: Collection[spec.Declaration], unread: Collection[str] = ()) -> Known:
        """Names defined outside the specification `running`; names in `unread` count as defined."""
        prototypes = self.prototypes.all()
        return Known(
            sources={each.name: each.sort for each in prototypes if isinstance(each, SourcePrototype)},
            units={each.name: (each.sort, each.inputs) for each in prototypes if isinstance(each, UnitPrototype)},
            labels={
                label: self.network.generator(label).sort.name
                for label in self.network.labels()
                if label not in self.parts.held and not self.network.is_implicit(label)
            },
            semantic=self._semantic,
            running=running,
            figures=MEANINGS,
            values={**{shape.name: shape for each in prototypes for shape in each.checked_sorts}, **self._sorts},
            roads=self._roads,
            frame=self._frame,
            offered=self._offered,
            unread=unread,
        )

    def proxies(self) -> Iterator[tuple[str, StreamProxy]]:
        """Every stream of the instance, with its subscribers."""
        for label in self.network.labels():
            for proxy in inputs_taken(self.network.process(label)):
                yield str(label), proxy
        yield from self.streams.items()

    # How it becomes so

    def _declare(self, gone: Iterable[spec.Declaration], new: Iterable[spec.Declaration]) -> None:
        for each in gone:
            self.symbols.discard(each)
        for each in new:
            self.symbols.add(each)

    def _check(self, change: SpecificationChange, text: str) -> None:
        """Check a change before anything changes."""
        self._look_up(change.new)
        errors = check_change(self.current_symbols(), change.gone, change.new, text)
        raise_all(together(errors, self.compiler.check(change.new, change.wanted, text)))

    def findings(
        self,
        wanted: spec.Specification,
        running: Collection[spec.Declaration] = (),
        text: str = "",
        unread: Collection[str] = (),
    ) -> Findings:
        """All findings before it runs; `running` does already, nothing called like a word of `unread` is missing."""
        self._look_up(wanted)
        try:
            wanted = DeclaredTimes().change((), wanted, self.network.now_us, text).wanted
        except TextErrors as wrong:
            return Findings(wrong.errors, ())
        symbols = SymbolTable(wanted, self.known(running, unread))
        found = check_symbols(symbols, wanted, text)
        more = self.compiler.over(symbols).check(wanted, wanted, text)
        return Findings(tuple(together(found.errors, more)), found.warnings)

    def _look_up(self, wanted: Iterable[spec.Declaration]) -> None:
        """Offer what the catalogue has under the names that are used."""
        for each in wanted:
            made = spec.making_of(each)
            name = getattr(made, "unit", None) or getattr(made, "source", None)
            if isinstance(name, str) and self.prototypes.find(name) is None:
                prototype = self._catalogue(name)
                if prototype is not None:
                    self.prototypes.add(prototype)

    def _take_over(self, whole: SpecificationChange, redefined: Collection[spec.Declaration], text: str) -> None:
        """Make the change, or undo it; streams that never began have reported nothing."""
        (change, before), self._backlog = made_by(whole, self.specification), []
        gone, new, _ = change
        remade: list[spec.Declaration] = []
        try:
            self._begin_in_past(change)
            other = dict.fromkeys((*redefined, *self._affected((*gone, *new))))
            remade = [each for each in other if each in self._undo and each not in gone]
            self._become(
                [*gone, *remade], sorted([*(each for each in new if each not in self._undo), *remade], key=rank)
            )
        except (DyknowError, RecursionError) as wrong:
            self._is_going_back = True
            self._declare(whole.new, whole.gone)
            done = [each for each in (*new, *remade) if each in self._undo]
            self._become(done[::-1], [each for each in before if each not in self._undo or each in remade])
            self._is_going_back = False
            raise as_text_errors(wrong, text) from wrong
        for name, sample in self._backlog:
            self.hooks.on_output(name, sample)

    def _affected(self, changed: Sequence[spec.Declaration]) -> Iterator[spec.Declaration]:
        """Declarations that stay and are made again: streams of another sort, shared streams under another label."""
        yield from self.parts.of_other_sorts(changed)
        for each in changed:
            if isinstance(each, spec.LabelDeclaration):
                yield from self.symbols.dependent(each)

    def _begin_in_past(self, change: SpecificationChange) -> None:
        """Make the parts that may be refused first, with those that they need, while everything is still as it was."""
        for each in needed_first(change, lambda term: self._past_us(term) is not None):
            if not isinstance(each, spec.GeneratorDeclaration) or each.label not in self.parts.held:
                self._undo[each] = self._realise(each)

    def _become(self, gone: Sequence[spec.Declaration], new: Iterable[spec.Declaration]) -> None:
        replaced = {each.label: each for each in new if isinstance(each, spec.GeneratorDeclaration)}
        successors = list(new)
        for each in gone:
            by = replaced.get(each.label) if isinstance(each, spec.GeneratorDeclaration) else None
            if by is not None and self.parts.replace(by):
                successors.remove(by)
                self._undo[by] = self._undo.pop(each)
            else:
                self._undo.pop(each)()
        for declared in successors:
            self._undo[declared] = self._realise(declared)
        if gone:
            self.families.renew()

    def _of_member(self, declaration: spec.Declaration) -> Undo:
        """Of a member of a family, from when it has come: its past is not looked for."""
        before, self._is_going_back = self._is_going_back, True
        try:
            return self._realise(declaration)
        finally:
            self._is_going_back = before

    def _realise(self, declaration: spec.Declaration) -> Undo:
        self.families.give_way(declaration)
        match declaration:
            case spec.GeneratorDeclaration():
                return self.parts.add(declaration)
            case spec.ForEach():
                return self.families.add(declaration)
            case spec.StreamDeclaration():
                return self._deliver(declaration)
            case spec.MonitorDeclaration():
                return self._monitor(declaration)
            case spec.WantDeclaration():
                return self.parts.want(declaration, self.hooks.on_found)
            case spec.ChronicleDeclaration(path, _, content) if content is not None:
                self.chronicles[path] = ChronicleStreams(self.network, declaration, content)
                return lambda: self.chronicles.pop(path).cancel()
            case spec.LabelDeclaration(name) if self._federation is not None:
                return self._define(declaration)
            case spec.Export(_, term) if self._federation is not None:
                return self._federation.export(declaration, self.compiler.term(term))
            case spec.Import(semantic, unit, term) if self._federation is not None:
                return self._import(semantic, unit, self.compiler.term(term), declaration)
            case spec.SourceDeclaration(_, name) if not isinstance(self.prototypes.find(name), SourcePrototype):
                return self.parts.feed(name)
        return nothing

    def _define(self, declaration: spec.LabelDeclaration) -> Undo:
        label, federation = self.symbols.semantic(declaration.name), self._federation
        assert label is not None and federation is not None  # noqa: S101, PT018  (it is declared, and there is one)
        try:
            return federation.define(replace(label, place=f"{self._file}:{declaration.place.line}"))
        except Refused as refused:
            raise located(declaration, refused.reason) from None

    def _import(self, semantic: str, unit: str, term: spec.StreamTerm, declaration: spec.Declaration) -> Undo:
        assert self._federation is not None  # noqa: S101  (only then it is called)
        take_back = self._federation.import_(semantic, unit, term)
        self.parts.held[term.label] = HeldGenerator(declaration)

        def undo() -> None:
            self.parts.held.pop(term.label, None)
            take_back()

        return undo

    def _past_us(self, term: spec.StreamTerm) -> int | None:
        """When a stream begins that began already."""
        begins_us = term.policy.from_us
        is_past = begins_us is not None and begins_us < self.network.now_us
        return begins_us if is_past and not self._is_going_back else None

    def _deliver(self, declaration: spec.StreamDeclaration) -> Undo:
        name, term = declaration.name, declaration.term
        try:
            proxy = self.network.connect(
                *self.compiler.input(term),
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

    def _monitor(self, declaration: spec.MonitorDeclaration) -> Undo:
        formula, forget = Definitions(self.symbols).resolved(declaration.formula, self.unit), nothing
        network, in_instance = self.network, True
        if self._federation is not None:
            forget, in_instance = self._federation.monitor(declaration, formula)
        if not in_instance:
            return forget
        try:
            monitor = FormulaMonitor(network, declaration, formula, self.unit, self.hooks.on_alarm, network.now_us)
            self.monitors[declaration.name] = monitor
        except DyknowError:
            forget()
            raise
        network.recall(monitor.margin)

        def end() -> None:
            monitor.cancel()
            del self.monitors[declaration.name]
            forget()

        return end
