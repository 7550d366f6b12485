"""The generators of a running specification: what each is made from, and what waits for somebody to make it."""

from collections.abc import Iterable
from functools import partial

from dyknow import Label, Network, SortError, Value
from dyknow.factory import ProcessFactory
from dyknow.prototypes import Prototype, SourcePrototype
from kpl.compiling import Compiler, Made, Members, check_offer
from kpl.declared import Declared
from kpl.specification import (
    Declaration,
    GeneratorDeclaration,
    SourceDeclaration,
    Specification,
    UnitDeclaration,
)
from kpl.surroundings import Undo


class Parts:
    """Makes, replaces and takes away generators as declared.

    Attributes:
        wanted: the specification as it is to be; specified: the same, by what its declarations name and need.
        declared: what declares each generator.
        of_families: how to take away what members of families have.
        withdrawn: sources whose makers may come back: nobody else feeds them meanwhile.
    """

    def __init__(self, network: Network, factory: ProcessFactory, compiler: Compiler) -> None:
        self._network, self._factory, self._compiler = network, factory, compiler
        self.wanted: Specification = ()
        self.specified = Declared()
        self.declared: dict[Label, Declaration] = {}
        self.of_families: dict[Label, Undo] = {}
        self.withdrawn = set[str]()
        self.fed: dict[str, list[Label]] = {}
        self._made_from: dict[str, dict[Label, tuple[GeneratorDeclaration, Members | None]]] = {}

    def offer(self, prototypes: Iterable[Prototype]) -> None:
        """More can be made from now on; streams that waited for it begin.

        Raises:
            PrototypeExists: a name is taken; those before it are offered.
            SortError: it is declared with other sorts; those before it are offered.
        """
        for prototype in prototypes:
            check_offer(prototype, self.wanted)
            self._factory.add_prototype(prototype)
            self.withdrawn.discard(prototype.name)
            for label, (declaration, members) in self._made_from.pop(prototype.name, {}).items():
                self._release(label)
                if self._network.has(label):  # a source that was fed from outside has somebody who reads it
                    making = self._compiler.making(declaration, self.specified, members)
                    self._network.replace_process(label, making.sort, making.process)
                    self._hold(declaration, members, label, making)
                else:
                    self._generate(declaration, members, label)

    def withdraw(self, names: Iterable[str]) -> None:
        """What was made from these prototypes ends; its clients are told, and served again when they are offered again.

        Raises:
            UnknownPrototype: there is none of that name; those before it are withdrawn.
        """
        for name in names:
            if isinstance(self._factory.prototype(name), SourcePrototype):
                self.withdrawn.add(name)
            self._factory.remove_prototype(name)
            for label, (declaration, members) in self._made_from.pop(name, {}).items():
                self._release(label)
                self._network.remove(label)
                self._generate(declaration, members, label)

    @property
    def lacking(self) -> dict[str, tuple[Label, ...]]:
        """Prototypes that nobody offers, and the generators that wait for them."""
        return {
            name: tuple(parts)
            for name, parts in self._made_from.items()
            if self._factory.find(name) is None and not self.fed.get(name)
        }

    def inputs_of(self, label: Label) -> tuple[Label, ...]:
        """What a declared generator is made of, also while nobody makes it."""
        for parts in self._made_from.values():
            if label in parts:
                declaration, members = parts[label]
                return self._compiler.sources(declaration, members)
        return ()

    def push(self, source: str, valid_us: int, value: Value, now_us: int) -> None:
        """A source that is fed from outside has a new sample; where nothing is made from it, it is dropped."""
        for label in tuple(self.fed.get(source, ())):
            generator = self._network.generator(label)
            try:
                generator.sort.check(value)
            except SortError as wrong:
                self._network.on_fault(label, str(wrong))
            else:
                self._network.now_us = now_us
                generator.push(valid_us, value, now_us)

    def sources(self) -> tuple[str, ...]:
        """The declared sources that are fed from outside."""
        return tuple(self.fed)

    def replace(self, new: GeneratorDeclaration) -> bool:
        """Put another process behind a generator, whose subscribers stay; False: that is another stream altogether."""
        making = self._compiler.making(new, self.specified)
        label = self._compiler.label(new.label)
        if making.lacks or not self._network.has(label) or self._network.generator(label).sort != making.sort:
            return False
        self._release(label)
        self._network.replace_process(label, making.sort, making.process)
        self._hold(new, None, label, making)
        return True

    def of_other_sorts(self, changed: Iterable[Declaration]) -> list[GeneratorDeclaration]:
        """The generators that stay, though what they are made from has become another sort."""
        found: dict[int, GeneratorDeclaration] = {}
        waiting: list[Declaration] = [each for each in changed if isinstance(each, SourceDeclaration | UnitDeclaration)]
        while waiting:
            for each in self.specified.dependent(waiting.pop()):
                if isinstance(each, GeneratorDeclaration) and id(each) not in found and self._is_of_other_sort(each):
                    found[id(each)] = each
                    waiting.append(each)
        return list(found.values())

    def _is_of_other_sort(self, declaration: GeneratorDeclaration) -> bool:
        label = self._compiler.label(declaration.label)
        making = self._compiler.making(declaration, self.specified)
        return self._network.has(label) and not making.lacks and self._network.generator(label).sort != making.sort

    def _generate(self, declaration: GeneratorDeclaration, members: Members | None, label: Label) -> None:
        """Make what a declaration says, or wait for who can make it."""
        making = self._compiler.making(declaration, self.specified, members)
        if making.lacks:
            pass
        elif making.process is None:
            self._network.add_source(label, making.sort)
        else:
            self._network.add_process(label, making.sort, making.process)
        self._hold(declaration, members, label, making)

    def add(self, declaration: GeneratorDeclaration, members: Members | None = None) -> Undo:
        label = self._compiler.label(declaration.label, members)
        if members is None and label in self.of_families:
            self.of_families.pop(label)()
        self._generate(declaration, members, label)
        return partial(self.drop, label)

    def drop(self, label: Label) -> None:
        self._release(label)
        if self._network.has(label):
            self._network.remove(label)

    def _hold(self, declaration: GeneratorDeclaration, members: Members | None, label: Label, making: Made) -> None:
        self.declared[label] = declaration
        if making.source:
            self.fed.setdefault(making.source, []).append(label)
        if making.unit:
            self._made_from.setdefault(making.unit, {})[label] = declaration, members

    def _release(self, label: Label) -> None:
        """Nothing is known of the generator any more."""
        self.declared.pop(label, None)
        for source, labels in list(self.fed.items()):
            if label in labels:
                labels.remove(label)
            if not labels and self.specified.maker(source) is None:
                del self.fed[source]
        for name, parts in list(self._made_from.items()):
            parts.pop(label, None)
            if not parts:
                del self._made_from[name]
