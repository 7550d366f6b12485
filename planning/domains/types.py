"""Types of a domain, ordered by their subtypes, with the objects of a problem."""

from collections.abc import Iterator
from typing import Final

from dyknow.planning.domains import model
from dyknow.planning.domains.model import Declarations

_BUILT_IN: Final = {*model.NUMBERS, model.BOOLEAN}


class Types:
    """Types in their order, and the members of each, those of subtypes included."""

    def __init__(self, found: Declarations) -> None:
        self.parents = {one.name: one.parent for one in found.types}
        self.values = {one.name: one.values for one in found.types if one.values}
        members: dict[str, dict[str, None]] = {name: dict.fromkeys(self.values.get(name, ())) for name in self.parents}
        self.sort_of: dict[str, str] = {value: name for name, values in self.values.items() for value in values}
        for each in found.objects:
            for name in each.names:
                self.sort_of[name] = each.sort
            for sort in self.above(each.sort):
                members[sort].update(dict.fromkeys(each.names))
        self.members = {name: tuple(those) for name, those in members.items()}
        self._sets = {name: frozenset(those) for name, those in self.members.items()}

    def above(self, name: str) -> Iterator[str]:
        """The type itself and those above it."""
        met: set[str] = set()
        sort: str | None = name
        while sort is not None and sort in self.parents and sort not in met:
            met.add(sort)
            yield sort
            sort = self.parents[sort]

    def has(self, sort: str, name: object) -> bool:
        return name in self._sets.get(sort, ())

    def of_variable(self, one: model.Parameter) -> str | None:
        """The type of a variable; None for a number."""
        if one.sort is not None:
            return None if one.sort in _BUILT_IN else one.sort
        return model.type_in(one.name, self.parents)
