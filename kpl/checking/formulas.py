"""Checks of a formula against a vocabulary: names, numbers of objects, sorts, intervals; every error, not the first.

A name resolves to a bound variable, else a constant or object, else a feature without arguments, else it is an error.
Sorts are `boolean`, `number`, `duration`, `object`, `record` (a value of several components, which a formula reads by their
names) and `any` (what is not known fits everywhere). A duration and a
bare number meet only where the number is a literal: it is milliseconds then.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import Final, Literal, TypeAlias

from dyknow.kpl.checking.bounds import bound_us
from dyknow.kpl.checking.symbols import Constant
from dyknow.kpl.diagnostics.collector import ErrorCollector, nearest
from dyknow.kpl.syntax.numbers import number_time_us
from dyknow.kpl.syntax.parsing import raise_all, read_tree
from dyknow.model.errors import TextError, file_of
from dyknow.reasoning.formulas import tree

Sort: TypeAlias = Literal["boolean", "number", "duration", "object", "record", "any"]
_MEASURED: Final = ("number", "duration", "any")


@dataclass(frozen=True, slots=True)
class FeatureType:
    """How many objects a feature takes (None: any number), and the sort of its value."""

    arity: int | None = None
    sort: Sort = "any"


@dataclass(frozen=True, slots=True)
class Vocabulary:
    """The meaning of names. None for features, objects or domains: all names are taken as they come.

    `constants` may hold `self`, the platform's own unit; a text constant stands for an object, a number as a bound of
    an interval for milliseconds. Features with attributes are named `cars.link`. `named` are objects, not
    necessarily all.
    """

    features: Mapping[str, FeatureType] | None = None
    objects: Collection[str] | None = None
    domains: Collection[str] | None = None
    constants: Mapping[str, Constant] = field(default_factory=dict)
    named: Collection[str] = ()


def read_formula(text: str, vocabulary: Vocabulary | None = None) -> tree.Formula:
    """Parse and check in one go; raises TextError with everything that is wrong."""
    formula, errors = read_tree(text)
    checker = Checker(vocabulary or Vocabulary(), text)
    found = checker.resolve(formula)
    raise_all(errors + checker.errors)
    return found


def check(formula: tree.Formula, vocabulary: Vocabulary, text: str = "") -> tree.Formula:
    """The formula with its names resolved; `text` is what it was read from, for the carets.

    Raises:
        TextErrors: with every error, in the order of the text.
    """
    checker = Checker(vocabulary, text)
    found = checker.resolve(formula)
    raise_all(checker.errors)
    return found


class Checker(ErrorCollector):
    """Walks one formula. Subclasses may look features, objects and domains up elsewhere."""

    def __init__(self, vocabulary: Vocabulary, text: str) -> None:
        super().__init__(text)
        self._known = vocabulary

    def resolve(self, formula: tree.Formula) -> tree.Formula:
        """The whole formula; the errors met are in `errors`."""
        depth, place = tree.deepest_temporal(formula)
        if depth > tree.LIMIT_TEMPORAL:
            self.error(tree.too_deep(depth), place, "say it with fewer of them")
        try:
            return self.truth(formula)
        except RecursionError:
            raise TextError(
                "nested too deep for where this is checked", file=file_of(self.text), repair="nest less"
            ) from None

    def truth(self, node: tree.Formula) -> tree.Formula:
        """A node where a truth value is wanted."""
        match node:
            case tree.Not(operand):
                return replace(node, operand=self.truth(operand))
            case tree.And(parts) | tree.Or(parts):
                return replace(node, parts=self._each(parts))
            case tree.Implies(left, right):
                return replace(node, left=self.truth(left), right=self.truth(right))
            case tree.Until(left, right, lo_us, hi_us):
                lo_us, hi_us = self._interval(lo_us, hi_us, node.place)
                return replace(node, left=self.truth(left), right=self.truth(right), lo_us=lo_us, hi_us=hi_us)
            case tree.Always(operand, lo_us, hi_us) | tree.Eventually(operand, lo_us, hi_us):
                lo_us, hi_us = self._interval(lo_us, hi_us, node.place)
                return replace(node, operand=self.truth(operand), lo_us=lo_us, hi_us=hi_us)
            case tree.Forall(_, domain, body) | tree.Exists(_, domain, body):
                return replace(node, domain=self._domain(domain), body=self.truth(body))
        found, sort = self.term(node)
        calculated = isinstance(found, tree.Arithmetic | tree.Negate | tree.Abs)
        if calculated or sort not in {"boolean", "any"}:
            named = "a number" if calculated and sort == "any" else _named(sort)
            self.error(
                f"a truth value is wanted, this is {named}", node.place, self._part(node, sort) or "compare it: ... > 0"
            )
        return found

    def _part(self, node: tree.Formula, sort: Sort) -> str:
        """A suggestion in place of a record: one of its fields."""
        return self.part_of(node) if sort == "record" and isinstance(node, tree.Feature) else ""

    def part_of(self, feature: tree.Feature) -> str:
        """A component of a record, as a formula reads it."""
        return tree.label_text(f"{feature.name}.FIELD", feature.objects)

    def _each(self, parts: tuple[tree.Formula, ...]) -> tuple[tree.Formula, ...]:
        return tuple([self.truth(part) for part in parts])

    def term(self, node: tree.Formula) -> tuple[tree.Formula, Sort]:
        """A node where a value is wanted, and its sort."""
        match node:
            case tree.Const(value):
                return node, _sort_of(value)
            case tree.Duration() | tree.Now():
                return node, "duration"
            case tree.Variable():
                return node, "object"
            case tree.Feature():
                return self._name(node)
            case tree.Since(feature):
                return replace(node, feature=self.feature(feature)[0]), "duration"
            case tree.Occurred(event):
                return replace(node, event=replace(event, objects=self._objects(event.objects, event.place))), "boolean"
            case tree.Negate(operand) | tree.Abs(operand):
                inside, sort = self._measured(operand)
                return replace(node, operand=inside), sort
            case tree.Arithmetic():
                return self._arithmetic(node)
            case tree.Compare():
                return self._compare(node), "boolean"
        if isinstance(node, tree.TEMPORAL) or tree.is_temporal(node):
            self.error(
                "a formula over several states has no value in one of them", node.place, "put the comparison inside it"
            )
            return node, "any"
        return self.truth(node), "boolean"

    def _measured(self, node: tree.Formula) -> tuple[tree.Formula, Sort]:
        found, sort = self.term(node)
        if sort not in _MEASURED:
            self.error(f"a number is wanted, this is {_named(sort)}", node.place, self._part(node, sort))
            return found, "any"
        return found, sort

    def _arithmetic(self, node: tree.Arithmetic) -> tuple[tree.Formula, Sort]:
        (left, first), (right, second) = self._measured(node.left), self._measured(node.right)
        if node.operator in "+-":
            left, right, first, second = self._meet(left, right, first, second, node.place)
        sort: Sort = "any"
        if "any" not in {first, second}:
            sort = "duration" if "duration" in {first, second} else "number"
        if node.operator in "*/" and second == "duration":
            if node.operator == "/" and first == "duration":
                sort = "number"
            elif node.operator == "/" or first == "duration":
                self.error("a time cannot be multiplied by a time, nor divide a number", node.place)
        return replace(node, left=left, right=right), sort

    def _compare(self, node: tree.Compare) -> tree.Formula:
        (left, first), (right, second) = self.term(node.left), self.term(node.right)
        left, right, first, second = self._meet(left, right, first, second, node.place)
        ordered = node.operator not in {"=", "!="}
        for sort, side in ((first, left), (second, right)):
            if ordered and sort in {"boolean", "object", "record"}:
                repair = self._part(side, sort) or "compare with = or !="
                self.error(f"{_named(sort)} has no order", side.place, repair)
                break
        return replace(node, left=left, right=right)

    def _meet(
        self, left: tree.Formula, right: tree.Formula, first: Sort, second: Sort, place: tree.Place
    ) -> tuple[tree.Formula, tree.Formula, Sort, Sort]:
        """Two values that must be of one sort; literal numbers become times or numbered objects next to such."""
        if "any" in {first, second} or first == second:
            return left, right, first, second
        if second == "number" and (other := self._literal_as(right, first)) is not None:
            return left, other, first, first
        if first == "number" and (other := self._literal_as(left, second)) is not None:
            return other, right, second, second
        repair = self._part(left, first) or self._part(right, second)
        if {first, second} == {"number", "duration"}:
            repair = "give the number a suffix: us ms s min h"
        self.error(f"{_named(first)} meets {_named(second)}", place, repair)
        return left, right, "any", "any"

    def _literal_as(self, node: tree.Formula, sort: Sort) -> tree.Formula | None:
        if not isinstance(node, tree.Const) or isinstance(node.value, bool | str):
            return None
        if sort == "object" and isinstance(node.value, int) and node.value >= 0:
            return tree.Const(str(node.value), place=node.place)
        if sort != "duration":
            return None
        number = node.value
        us = self.attempt(lambda: number_time_us(abs(number)), node.place, 0)
        return tree.Duration(us if node.value >= 0 else -us, place=node.place)

    def _name(self, node: tree.Feature) -> tuple[tree.Formula, Sort]:
        """A bare name may be a constant or an object before it is a feature."""
        bare = not node.objects and node.attribute is None
        if bare and node.name in self._known.constants:
            value = self._known.constants[node.name]
            if isinstance(value, tree.Duration):
                return replace(value, place=node.place), "duration"
            return tree.Const(value, place=node.place), _sort_of(value)
        if bare and (node.name in self._known.named or node.name in (self._known.objects or ())):
            return tree.Const(node.name, place=node.place), "object"
        return self.feature(node)

    def feature(self, node: tree.Feature) -> tuple[tree.Feature, Sort]:
        found = replace(node, objects=self._objects(node.objects, node.place))
        features = self._known.features
        if features is None:
            return found, "any"
        stem = node.stem
        kind = features.get(stem)
        if kind is None:
            return found, self._unknown(node, stem, features)
        if kind.arity is not None and kind.arity != len(node.objects):
            self.takes(node, stem, kind.arity)
        return found, kind.sort

    def takes(self, node: tree.Feature, stem: str, arity: int) -> None:
        """It has another number of objects."""
        names = ", ".join(f"object{i + 1}" for i in range(arity))
        said = f"{stem} takes {_count(arity)}, here are {len(node.objects)}"
        self.error(said, node.place, tree.label_text(stem, [names]) if names else stem)

    def _unknown(self, node: tree.Feature, stem: str, features: Mapping[str, FeatureType]) -> Sort:
        near = nearest(stem, [*features, *self._known.constants])
        have = f"there are {', '.join(sorted(features)[:8])}" if features else "there are none"
        if node.objects or node.attribute:
            self.error(f"there is no feature {stem}", node.place, near or have)
        else:
            self.error(
                f"{stem} is no variable, constant, object or feature; a free variable must be bound",
                node.place,
                near or f"forall {stem} in DOMAIN: ...",
            )
        return "any"

    def _objects(self, objects: tuple[tree.Object, ...], place: tree.Place) -> tuple[tree.Object, ...]:
        return tuple(one if isinstance(one, tree.Variable) else self._object(one, place) for one in objects)

    def _object(self, name: str, place: tree.Place) -> str:
        value = self._known.constants.get(name)
        if isinstance(value, str):
            return value
        if value is not None:
            self.error(f"the constant {name} is no object", place)
        elif self._known.objects is not None and name not in self._known.objects:
            near = nearest(name, self._known.objects)
            self.error(
                f"{name} is free: no quantifier binds it and no object has that name",
                place,
                near or f"forall {name} in DOMAIN: ...",
            )
        return name

    def _domain(self, domain: tree.Domain) -> tree.Domain:
        base, *minus = (self._set(one, domain.place) for one in (domain.base, *domain.minus))
        return replace(domain, base=base, minus=tuple(minus))

    def _set(self, found: tree.DomainSet, place: tree.Place) -> tree.DomainSet:
        if not isinstance(found, str):
            return self._objects(found, place)
        if self._known.domains is not None and found not in self._known.domains:
            near = nearest(found, self._known.domains)
            have = f"there are {', '.join(sorted(self._known.domains)) or 'none'}; or list members: {{a, b}}"
            self.error(f"there is no domain {found}", place, near or have)
        return found

    def _interval(self, lo_us: tree.Bound, hi_us: tree.Bound | None, place: tree.Place) -> tuple[int, int | None]:
        low = self.bound(lo_us)
        high = None if hi_us is None else self.bound(hi_us)
        are_terms = not isinstance(lo_us, int) or not isinstance(hi_us, int)
        if are_terms and high is not None and high < low:
            self.error("the interval ends before it begins", place, "[from, to], from <= to")
        return low, high

    def bound(self, bound: tree.Bound) -> int:
        """Microseconds of a temporal term."""
        if isinstance(bound, int):
            return bound
        try:
            return bound_us(bound, self._known.constants)
        except TextError as wrong:
            self.error(wrong.message, tree.Place(wrong.line, wrong.column, wrong.width), wrong.repair)
            return 0


def _sort_of(value: bool | float | str) -> Sort:
    if isinstance(value, bool):
        return "boolean"
    return "object" if isinstance(value, str) else "number"


def _named(sort: Sort) -> str:
    return {"boolean": "a truth value", "object": "an object"}.get(sort, f"a {sort}")


def _count(arity: int) -> str:
    return {0: "no object", 1: "one object"}.get(arity, f"{arity} objects")
