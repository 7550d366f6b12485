"""Features and constants that a specification defines, put in where formulas use them."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import fields, replace
from functools import cached_property
from typing import Any

from dyknow.kpl.checking.domains import over_objects
from dyknow.kpl.checking.formulas import Vocabulary, check
from dyknow.kpl.checking.symbols import DEFINITION, Constant, SymbolTable, constant_of
from dyknow.kpl.syntax.specification import Define, MonitorDeclaration
from dyknow.model.errors import TextError, file_of
from dyknow.reasoning.formulas import tree

LIMIT_EXPANDED = 2 * tree.LIMIT_NODES
"""Limit of the nodes of all formulas of a specification together, with their definitions expanded."""


class Definitions:
    """The definitions of a specification: `define MIN_XY = 15.0` a constant, `define hasCargo[u] = ...` a feature of
    one object.

    Raises:
        TextError: a definition uses itself.
    """

    def __init__(self, symbols: SymbolTable) -> None:
        self._left = LIMIT_EXPANDED
        self._symbols = symbols
        self.constants: dict[str, Constant] = {}
        self.features: dict[tuple[str, int], Define] = {}
        for each in symbols.of_kind(DEFINITION):
            if isinstance(each, Define):
                value = constant_of(each)
                if value is None:
                    self.features[each.feature.name, len(each.feature.objects)] = each
                else:
                    self.constants[each.feature.name] = value

    @cached_property
    def objects(self) -> frozenset[str]:
        """The objects that streams are called by, or that sets list; a stream called so itself is that stream."""
        objects, streams = set[str](), set[str]()
        for each in self._symbols.symbols():
            for need in each.takes:
                objects.update(one for one in need.term.label.objects if one not in need.variables)
            objects.update(one for one in each.label.objects if one not in each.variables)
            streams.update(() if each.label.objects else (each.label.feature,))
            if isinstance(each.declaration, Define | MonitorDeclaration):
                domains = [node for node in tree.walk(each.declaration.formula) if isinstance(node, tree.Domain)]
                listed = (one for each in domains for one in (each.base, *each.minus) if isinstance(one, tuple))
                objects.update(one for members in listed for one in members if isinstance(one, str))
        return frozenset(objects - streams)

    def check(self, definition: Define) -> None:
        """Raise TextError where a definition is made of itself, used or not."""
        if id(definition) not in self._endless:
            return
        path: list[tuple[Define, Iterator[tree.Feature]]] = [(definition, self._uses(definition))]
        seen = {id(definition)}
        while path:
            use = next(path[-1][1], None)
            if use is None:
                path.pop()
                continue
            made_of = self._defined(use)
            if made_of is definition:
                raise _circular(use, (*(each for each, _ in path), definition))
            if made_of is not None and id(made_of) not in seen:
                seen.add(id(made_of))
                path.append((made_of, self._uses(made_of)))

    @cached_property
    def _endless(self) -> frozenset[int]:
        """Ids of definitions whose expansion does not end: circular ones, and those that use a circular one."""
        left: dict[int, int] = {}
        used_by: dict[int, list[int]] = {}
        for definition in self.features.values():
            made_of = [id(found) for use in self._uses(definition) if (found := self._defined(use)) is not None]
            left[id(definition)] = len(made_of)
            for one in made_of:
                used_by.setdefault(one, []).append(id(definition))
        ending = [one for one, count in left.items() if not count]
        for each in ending:
            for user in used_by.get(each, ()):
                left[user] -= 1
                if not left[user]:
                    ending.append(user)
        return frozenset(left) - frozenset(ending)

    def _uses(self, definition: Define) -> Iterator[tree.Feature]:
        return (node for node in tree.walk(definition.formula) if isinstance(node, tree.Feature))

    def _defined(self, use: tree.Feature) -> Define | None:
        return self.features.get((use.name, len(use.objects))) if use.attribute is None else None

    def resolved(self, formula: tree.Formula, unit: str, text: str = "") -> tree.Formula:
        """The formula over streams only: definitions put in, constants and `self` replaced, sorts checked, domains named.

        Raises:
            TextErrors: every error in it.
            TextError: a definition uses itself, or the formula grows too large.
        """
        try:
            whole = self._expand(formula, ())
        except RecursionError:
            raise TextError("nested too deep for where this is read", file=file_of(text), repair="nest less") from None
        vocabulary = Vocabulary(constants={**self.constants, "self": unit}, named=self.objects)
        if sum(1 for _ in tree.walk(whole)) > tree.LIMIT_NODES:
            raise tree.too_large()
        return over_objects(check(whole, vocabulary, text), self._symbols)

    def put_in(self, bound: tree.Bound) -> tree.Bound:
        """The bound of an interval with its names expanded; raises TextError if a definition is circular."""
        found: tree.Bound = self._expand(bound, ())
        return found

    def _expand(self, node: Any, inside: tuple[Define, ...]) -> Any:
        if isinstance(node, tuple):
            return tuple(self._expand(one, inside) for one in node)
        if not isinstance(node, tree.Node):
            return node
        if isinstance(node, tree.Feature):
            definition = self._defined(node)
            return node if definition is None else self._put_in(node, definition, inside)
        changed: Mapping[str, Any] = {
            each.name: found
            for each in fields(node)
            if each.name != "place" and (found := self._expand(old := getattr(node, each.name), inside)) is not old
        }
        return replace(node, **changed) if changed else node

    def _put_in(self, use: tree.Feature, definition: Define, inside: tuple[Define, ...]) -> Any:
        if definition in inside:
            raise _circular(use, (*inside, definition))
        body = definition.formula
        for one in tree.walk(body):
            if isinstance(one, tree.Forall | tree.Exists) and tree.Variable(one.variable) in use.objects:
                raise _wrong(f"{use.name} uses the variable {one.variable} itself", use, "another variable here")
        self._left -= sum(1 for _ in tree.walk(body))
        if self._left < 0:
            raise _wrong(
                f"with its definitions put in the formula has more than {LIMIT_EXPANDED} parts",
                use,
                "define less in terms of more",
            )
        parameters = definition.feature.objects
        for i, parameter in enumerate(parameters):  # first to names that nobody can type, so that none is taken twice
            body = tree.instantiate(body, str(parameter), tree.Variable(f"?{i}"))
        for i, given in enumerate(use.objects):
            body = tree.instantiate(body, f"?{i}", given)
        return self._expand(body, (*inside, definition))


def _circular(use: tree.Feature, around: Iterable[Define]) -> TextError:
    names = " -> ".join(each.feature.name for each in around)
    return _wrong(f"{use.name} is defined by itself: {names}", use, "a definition without itself")


def _wrong(message: str, use: tree.Feature, repair: str) -> TextError:
    return TextError.at(use.place, message, repair=repair)
