"""Families of generators: one for each member that a stream names, made and removed with it (thesis 3.3.3)."""

from dyknow import Label, Network
from dyknow.errors import DyknowError, SortError
from dyknow.mediation import Configuration
from kpl.compiling import Compiler
from kpl.parts import Parts
from kpl.specification import ForEach
from kpl.surroundings import Undo, nothing

MAX_OF_FAMILIES = 16_384
"""Generators of all families together."""


class Families:
    """All families of an instance; `members` has who belongs to each, by the label of what it makes."""

    def __init__(self, network: Network, compiler: Compiler, parts: Parts) -> None:
        self._network, self._compiler, self._parts = network, compiler, parts
        self.members: dict[Label, Configuration] = {}

    def renew(self) -> None:
        """Some of what belongs to members may be gone: make it again where it is."""
        for family in self.members.values():
            family.renew()

    def add(self, declaration: ForEach) -> Undo:
        """One process per member; a member for which there is a declaration of its own is left to that."""
        own = set[Label]()
        family_label = declaration.body.label

        def create(member: str) -> None:
            members = {declaration.variable: member}
            label = self._compiler.label(family_label, members)
            if label not in self._parts.declared:
                try:
                    self._parts.of_families[label] = self._parts.add(declaration.body, members)
                    own.add(label)
                except DyknowError as wrong:
                    self._network.on_fault(label, str(wrong))

        def remove(member: str) -> None:
            label = self._compiler.label(family_label, {declaration.variable: member})
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

        domain = self._compiler.input(declaration.domain)
        family = Configuration(self._network, domain, create, remove, admit)
        self.members[family_label] = family

        def undo() -> None:
            self.members.pop(family_label, None)
            family.cancel()

        return undo
