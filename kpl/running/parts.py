"""The generators of a running specification: the maker of each, and generators that wait for a producer."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from typing import NamedTuple, TypeAlias

from dyknow import DyknowError, Label, Network, Policy, Sample, Sort, SortError, Value
from dyknow.anchoring.links.objects import LinkEvent
from dyknow.kpl.checking.definitions import Definitions
from dyknow.kpl.checking.streams import origin_of
from dyknow.kpl.checking.symbols import symbol_of
from dyknow.kpl.linking.streams import LinkStream
from dyknow.kpl.linking.wants import Wanted
from dyknow.kpl.running.compiling import CompiledGenerator, Compiler, Members, check_offer
from dyknow.kpl.running.ports import Undo, nothing
from dyknow.kpl.syntax import specification as spec
from dyknow.kpl.syntax.listing import print_declaration
from dyknow.model.errors import Refused
from dyknow.model.members import tuples_of
from dyknow.network.factory import Prototypes
from dyknow.network.mediation import Configuration, Mediation
from dyknow.network.process import Process
from dyknow.network.processes import OnDemand
from dyknow.network.prototypes import Prototype, SourcePrototype
from dyknow.network.stream_proxy import StreamProxy
from dyknow.objects.object_streams import ObjectProcess, ObjectStreams
from dyknow.reasoning.features.objects import quantities

Objects: TypeAlias = tuple[str, ...]
"""A member of a family: one object, or a pair of them."""
Features: TypeAlias = Callable[[Label], tuple[Sort, Process] | None]

MAX_OF_FAMILIES = 16_384
"""Generators of all families together."""


class HeldGenerator(NamedTuple):
    """A generator that is declared: how, for which members, and from which source and prototype; empty: from none."""

    declaration: spec.Declaration
    members: Members | None = None
    source: str = ""
    unit: str = ""


class Parts:
    """Makes, replaces and takes away generators as declared.

    Attributes:
        held: the declared generators, by label.
        of_families: how to take away what members of families have.
        fed: the generators of each source that is fed from outside.
        objects: makes streams about the objects in streams of object states.
    """

    def __init__(
        self, network: Network, prototypes: Prototypes, compiler: Compiler, is_unit: Callable[[str], bool]
    ) -> None:
        self._network, self._prototypes, self._compiler = network, prototypes, compiler
        self.objects = ObjectStreams(network, quantities(lambda: origin_of(compiler.symbols)), is_unit)
        self.held: dict[Label, HeldGenerator] = {}
        self.of_families: dict[Label, Undo] = {}
        self.fed: dict[str, list[Label]] = {}

    def offer(self, prototypes: Iterable[Prototype]) -> None:
        """More can be made from now on; streams that waited for it begin.

        Raises:
            PrototypeExists: a name is taken; those before it are offered.
            SortError: it is declared with other sorts; those before it are offered.
        """
        for prototype in prototypes:
            check_offer(prototype, self._compiler.symbols)
            self._prototypes.add(prototype)
            self._compiler.withdrawn.discard(prototype.name)
            for label, declaration, members in self._made_from(prototype.name):
                self._release(label)
                if self._network.has(label):  # a source that was fed from outside has somebody who reads it
                    making = self._compiler.making(declaration, members)
                    self._network.replace_process(label, making.sort, making.process)
                    self._hold(declaration, members, label, making)
                else:
                    self._generate(declaration, members, label)

    def withdraw(self, names: Iterable[str]) -> None:
        """End the processes of these prototypes; their clients are notified, and served again when the prototypes come
        back.

        Raises:
            UnknownPrototype: there is none of that name; those before it are withdrawn.
        """
        for name in names:
            if isinstance(self._prototypes.remove(name), SourcePrototype):
                self._compiler.withdrawn.add(name)
            for label, declaration, members in self._made_from(name):
                self._release(label)
                self._network.remove(label)
                self._generate(declaration, members, label)

    @property
    def lacking(self) -> dict[str, tuple[Label, ...]]:
        """Prototypes without an offer, and the generators that wait for them; those of members as they are declared."""
        waiting: dict[str, dict[Label, None]] = {}
        for label, held in self.held.items():
            if held.unit and self._prototypes.find(held.unit) is None and not self.fed.get(held.unit):
                declared = held.declaration
                if held.members is not None and isinstance(declared, spec.GeneratorDeclaration):
                    label = declared.label  # noqa: PLW2901  (as it is written)
                waiting.setdefault(held.unit, {})[label] = None
        for each in self._compiler.symbols.symbols():  # a family may have no members yet
            if each.variables and isinstance(each.made, spec.Refinement) and self._prototypes.find(each.uses) is None:
                waiting.setdefault(each.uses, {})[each.label] = None
        return {name: tuple(labels) for name, labels in waiting.items()}

    @property
    def wanted(self) -> tuple[Wanted, ...]:
        """The wanted objects."""
        return self._compiler.wants.all

    def want(self, want: spec.WantDeclaration, on_event: Callable[[LinkEvent], None], only: str | None = None) -> Undo:
        """Look for an object of a stream of linked objects, which is made for that.

        `only`: which object it is, where that is decided elsewhere; empty: that is not decided yet.

        Raises:
            Refused: nothing links objects of that stream, the symbol is that of an object, or too many are looked for.
        """
        symbol, label = want.symbol, self._compiler.label(want.stream)
        process = self._network.process(label) if self._network.has(label) else None
        if not isinstance(process, LinkStream):
            raise Refused(f"no link makes {label} here", "no-link")
        if process.running and process.linkage.find(symbol) is not None:
            raise Refused(f"{symbol} is the symbol of an object: give what is wanted another", "taken")
        description = Definitions(self._compiler.symbols).resolved(want.description, self._compiler.unit)
        forget = self._compiler.wants.add(Wanted(symbol, str(label), description, on_event, self._network.now_us, only))
        proxy = self._network.connect(label, Policy(), lambda _sample: None)

        def undo() -> None:
            forget()
            proxy.cancel()

        return undo

    def _made_from(self, name: str) -> list[tuple[Label, spec.GeneratorDeclaration, Members | None]]:
        """The generators that are made from a prototype, or wait for it."""
        return [
            (label, held.declaration, held.members)
            for label, held in self.held.items()
            if held.unit == name and isinstance(held.declaration, spec.GeneratorDeclaration)
        ]

    def inputs_of(self, label: Label) -> tuple[Label, ...]:
        """The inputs of a declared generator, also without a producer."""
        held = self.held.get(label)
        if held is None or not isinstance(held.declaration, spec.GeneratorDeclaration):
            return ()
        return self._compiler.sources(held.declaration, held.members)

    def undeclared(self, label: Label, features: Features) -> tuple[Sort, Process] | None:
        """A stream that is there while it is wanted; where the specification declares streams of that name, of objects only."""
        is_declared = bool(self._compiler.symbols.of_feature(label.feature))
        return self.objects.find(label, named=is_declared) or (None if is_declared else features(label))

    def push(self, source: str, sample: Sample) -> None:
        """A source that is fed from outside has a new sample; where nothing is made from it, it is dropped."""
        with self._network.instant.whole():
            for label in tuple(self.fed.get(source, ())):
                generator = self._network.generator(label)
                try:
                    generator.sort.check(sample.value)
                except SortError as wrong:
                    self._network.on_fault(label, str(wrong))
                else:
                    self._network.now_us = sample.available_us
                    generator.push(sample)

    def sources(self) -> tuple[str, ...]:
        """The declared sources that are fed from outside."""
        return tuple(self.fed)

    def replace(self, new: spec.GeneratorDeclaration) -> bool:
        """Put another process behind a generator, whose subscribers stay; False: that is another stream altogether."""
        making = self._compiler.making(new)
        label = self._compiler.label(new.label)
        if making.lacks or not self._network.has(label) or self._network.generator(label).sort != making.sort:
            return False
        self._release(label)
        self._network.replace_process(label, making.sort, making.process)
        self._hold(new, None, label, making)
        return True

    def of_other_sorts(self, changed: Iterable[spec.Declaration]) -> list[spec.GeneratorDeclaration]:
        """The generators that stay, though what they are made from has become another sort."""
        found: dict[int, spec.GeneratorDeclaration] = {}
        waiting: list[spec.Declaration] = [
            each for each in changed if isinstance(each, spec.SourceDeclaration | spec.UnitDeclaration)
        ]
        if any(isinstance(each, spec.SortDeclaration | spec.LabelDeclaration) for each in changed):
            generators = [one.declaration for one in self._compiler.symbols.symbols()]
            all_of_them = (each for each in generators if isinstance(each, spec.GeneratorDeclaration))
            found.update((id(each), each) for each in all_of_them if self._is_of_other_sort(each))
        while waiting:
            for each in self._compiler.symbols.dependent(waiting.pop()):
                if (
                    isinstance(each, spec.GeneratorDeclaration)
                    and id(each) not in found
                    and self._is_of_other_sort(each)
                ):
                    found[id(each)] = each
                    waiting.append(each)
        return list(found.values())

    def _is_of_other_sort(self, declaration: spec.GeneratorDeclaration) -> bool:
        label = self._compiler.label(declaration.label)
        making = self._compiler.making(declaration)
        return self._network.has(label) and not making.lacks and self._network.generator(label).sort != making.sort

    def _generate(self, declaration: spec.GeneratorDeclaration, members: Members | None, label: Label) -> None:
        """Make what a declaration says, or wait for a producer."""
        making = self._compiler.making(declaration, members)
        if making.lacks:
            pass
        elif making.process is None:
            self._network.add_source(label, making.sort)
        else:
            self._network.add_process(label, making.sort, making.process)
        self._hold(declaration, members, label, making)

    def add(self, declaration: spec.GeneratorDeclaration, members: Members | None = None) -> Undo:
        label = self._compiler.label(declaration.label, members)
        if members is None and label in self.of_families:
            self.of_families.pop(label)()
        self._generate(declaration, members, label)
        return partial(self.drop, label)

    def feed(self, source: str) -> Undo:
        """A declared source is fed from outside."""
        self.fed.setdefault(source, [])

        def forget() -> None:
            if not self.fed.get(source):
                self.fed.pop(source, None)

        return forget

    def drop(self, label: Label) -> None:
        self._release(label)
        if self._network.has(label):
            self._network.remove(label)

    def _hold(
        self, declaration: spec.GeneratorDeclaration, members: Members | None, label: Label, making: CompiledGenerator
    ) -> None:
        self.held[label] = HeldGenerator(declaration, members, making.source, making.unit)
        if making.source:
            self.fed.setdefault(making.source, []).append(label)

    def _release(self, label: Label) -> None:
        """Forget the generator."""
        held = self.held.pop(label, None)
        if held is not None and held.source:
            labels = self.fed[held.source]
            labels.remove(label)
            if not labels and self._compiler.symbols.maker(held.source) is None:
                del self.fed[held.source]


class Families:
    """All families of an instance; `members` has the members of each, by the label of its streams."""

    def __init__(
        self,
        network: Network,
        compiler: Compiler,
        parts: Parts,
        realise: Callable[[spec.Declaration], Undo],
    ) -> None:
        self._network, self._compiler, self._parts = network, compiler, parts
        self._realise = realise
        self.members: dict[Label, Configuration[Objects]] = {}
        self.others: dict[str, Configuration[Objects]] = {}
        self._made: dict[tuple[object, ...], Undo] = {}

    def renew(self) -> None:
        """Some of what belongs to members may be gone: make it again where it is."""
        for family in (*self.members.values(), *self.others.values()):
            family.renew()

    def give_way(self, declaration: spec.Declaration) -> None:
        """Remove a member's declaration in favour of a declaration of its own."""
        self._made.pop(_called(declaration), nothing)()

    def add(self, declaration: spec.ForEach) -> Undo:
        """Make the body once per member; a member with a declaration of its own is left out."""
        if isinstance(declaration.body, spec.GeneratorDeclaration):
            return self._add_generators(declaration, declaration.body)
        own = dict[Objects, tuple[object, ...]]()

        def create(member: Objects) -> None:
            each = spec.of_member(declaration, member)
            called = _called(each)
            if called in self._made or self._is_declared(each):
                return
            if isinstance(each, spec.Import) and each.unit == self._compiler.unit:
                return  # of itself a platform imports nothing
            try:
                self._made[called], own[member] = self._realise(each), called
            except DyknowError as wrong:
                self._network.on_fault(declaration.domain.label, f"`{print_declaration(each)}`: {wrong}")

        def remove(member: Objects) -> None:
            if member in own:
                self._made.pop(own.pop(member), nothing)()

        def admit(more: int) -> None:
            if more > 0 and len(self._made) + more > MAX_OF_FAMILIES:
                raise SortError(f"{more} more members; families of an instance have {MAX_OF_FAMILIES} at most")

        text = print_declaration(declaration)
        self.others[text] = Configuration(
            self._network, self._compiler.domain(declaration.domain), create, remove, self._tuples(declaration), admit
        )
        return lambda: self.others.pop(text).cancel()

    def _tuples(self, family: spec.ForEach) -> Callable[[Value], Sequence[Objects]]:
        """The members that a value names, without those in which an object is left out."""
        left_out = {*self._compiler.label(Label("", family.left_out)).objects}
        return lambda value: [
            each for each in tuples_of(value, len(family.variables)) if not left_out.intersection(each)
        ]

    def _is_declared(self, declaration: spec.Declaration) -> bool:
        """Whether what a member would have is declared by itself."""
        symbol = symbol_of(declaration)
        return any(self._compiler.symbols.named(symbol.kind, name) is not None for name in symbol.names)

    def _add_generators(self, declaration: spec.ForEach, body: spec.GeneratorDeclaration) -> Undo:
        own = set[Label]()
        family_label = body.label

        def create(member: Objects) -> None:
            members = declaration.members(member)
            label = self._compiler.label(family_label, members)
            if label not in self._parts.held:
                try:
                    self._parts.of_families[label] = self._parts.add(body, members)
                    own.add(label)
                except DyknowError as wrong:
                    self._network.on_fault(label, str(wrong))

        def remove(member: Objects) -> None:
            label = self._compiler.label(family_label, declaration.members(member))
            if label in own:
                own.discard(label)
                self._parts.of_families.pop(label, nothing)()
                for other, family in self.members.items():
                    if other.feature == family_label.feature and other != family_label:
                        family.renew()

        def admit(more: int) -> None:
            there = len(self._parts.of_families)
            if more > 0 and there + more > MAX_OF_FAMILIES:
                raise SortError(
                    f"{more} more members of {family_label.feature}, where families have {there} generators already; "
                    f"an instance holds at most {MAX_OF_FAMILIES}"
                )

        domain = self._compiler.domain(declaration.domain)
        family = Configuration(self._network, domain, create, remove, self._tuples(declaration), admit)
        self.members[family_label] = family

        def undo() -> None:
            self.members.pop(family_label, None)
            family.cancel()

        return undo


def _called(declaration: spec.Declaration) -> tuple[object, ...]:
    """The key of a declaration that no other one of an instance may have."""
    match declaration:
        case spec.Import(_, _, term):
            return (spec.Import, term.label)
        case spec.Export(semantic):
            return (spec.Export, semantic)
        case spec.StreamDeclaration(name) | spec.MonitorDeclaration(name):
            return (type(declaration), name)
    return ()


def inputs_taken(process: object) -> Iterator[StreamProxy]:
    """The streams that a process takes now."""
    if isinstance(process, OnDemand):
        yield from process.proxies
    if isinstance(process, Mediation):
        yield from process.members.values()
    if isinstance(process, ObjectProcess):
        yield from (table.proxy for table in process.tables if table.proxy is not None)
