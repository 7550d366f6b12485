"""Chronicle files from the parse tree (thesis 8.3, grammar: chronicles.lark), and where each name in them stands."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Final, Literal, TypeAlias

from dyknow.kpl.syntax.chronicle_times import TimeReader
from dyknow.kpl.syntax.parsing import place_of
from dyknow.reasoning.chronicles.definition import model
from dyknow.reasoning.chronicles.definition.domains import (
    RESERVED,
    Combination,
    Complement,
    Domain,
    NamedDomain,
    Symbols,
)
from dyknow.reasoning.chronicles.definition.times import ComplexConstraint, ConstraintUse
from dyknow.reasoning.formulas.tree import Place

MAX_ERRORS: Final = 50
"""Errors of one text that are reported."""
LIMIT_COUNT: Final = 1_000_000
"""Most events that an `occurs` may count."""

Kind: TypeAlias = Literal["domain", "variable", "instant", "event", "part", "conditions", "timing", "condition"]


@dataclass(frozen=True, slots=True)
class Mention:
    """Something that is named at a place: a `Domain`, `Variable`, instant, `EventType`, `Inclusion`, `Use` and so on.

    Attributes:
        needed: of an event type, whether an instance needs an event of it (n1 >= 1); of an instant, whether it is
            where something happens, and not only compared.
    """

    kind: Kind
    what: Any
    place: Place
    needed: bool = False


@dataclass(slots=True)
class ReadChronicle:
    """One declaration, its place, and the names in it; `statements` are the places of those of a chronicle."""

    declaration: model.Declaration
    place: Place
    mentions: list[Mention] = field(default_factory=list)
    statements: list[tuple[model.Statement, Place]] = field(default_factory=list)


class ChronicleReader(TimeReader):
    """Reads declarations; collects the names in them for kpl/syntax/chronicle_checking.py."""

    limit = MAX_ERRORS

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self._mentions: list[Mention] = []

    def declaration(self, node: Any) -> ReadChronicle:
        self._mentions, self.instants = [], []
        statements: list[tuple[model.Statement, Place]] = []
        read: Mapping[str, Callable[[Any], model.Declaration]] = {
            "domain": self._domain_definition,
            "attribute": partial(self._constrained, model.Attribute),
            "message": partial(self._constrained, model.Message),
            "conditions": partial(self._constrained, model.NamedConstraint),
            "timing": self._complex_constraint,
            "chronicle": lambda node: self._chronicle(node, statements),
        }
        found = ReadChronicle(read[node.data](node), place_of(node.children[0], self.text), self._mentions, statements)
        found.mentions += [Mention("instant", name, place) for name, place in self.instants]
        return found

    def _mention(self, kind: Kind, what: Any, node: Any, *, needed: bool = False) -> None:
        self._mentions.append(Mention(kind, what, place_of(node, self.text), needed))

    # Declarations

    def _domain_definition(self, node: Any) -> model.Declaration:
        name, _equals, domain = node.children
        return model.DomainDefinition(self._simple(name), self._domain(domain))

    def _constrained(
        self, make: type[model.Attribute | model.Message | model.NamedConstraint], node: Any
    ) -> model.Declaration:
        signature, *body = node.children
        return make(*self._signature(signature), tuple([self._condition(each) for each in body]))

    def _complex_constraint(self, node: Any) -> model.Declaration:
        name, *rest = node.children
        parameters: tuple[str, ...] = ()
        if rest and rest[0].data == "points":
            parameters = tuple([self.instant(each) for each in rest.pop(0).children])
        timings = [one for each in rest for one in self._timing(each)]
        return ComplexConstraint(self.instant(name, keep=False), parameters, tuple(timings))

    def _chronicle(self, node: Any, statements: list[tuple[model.Statement, Place]]) -> model.Chronicle:
        signature, *rest = node.children
        name, parameters = self._signature(signature)
        if "." in name or "-" in name:
            place = place_of(signature.children[0], self.text)
            self.error("the name of a chronicle is a symbol: letters, digits and _", place, name.replace("-", "_"))
        instants: tuple[str, ...] = ()
        if rest and rest[0].data == "points":
            instants = tuple([self._happens(self.instant(each), each) for each in rest.pop(0).children])
        for each in rest:
            place = place_of(each, self.text)
            statements += [(statement, place) for statement in self._statement(each)]
        return model.Chronicle(name, parameters, instants, tuple([statement for statement, _ in statements]))

    def _statement(self, node: Any) -> tuple[model.Statement, ...]:
        match node.data:
            case "event" | "noevent" | "occurs":
                return (self._predicate(node),)
            case "part":
                return (self._part(node),)
            case "variables":
                *variables, last = node.children
                domain = None if getattr(last, "type", "") == "VARIABLE" else self._domain(last)
                variables += [last] if domain is None else []
                return (model.Variables(tuple([self._variable(each) for each in variables]), domain),)
            case "instants":
                return (model.Instants(tuple([self._happens(self.instant(each), each) for each in node.children])),)
            case "chain" | "within" | "timing_use":
                return self._timing(node)
        return (self._condition(node),)

    def _timing(self, node: Any) -> tuple[Any, ...]:
        found = self.timing(node)
        for one in found:
            if isinstance(one, ConstraintUse):
                self._mention("timing", one, node)
        return found

    # Events

    def _predicate(self, node: Any) -> model.Predicate:
        if node.data == "event":
            type_, point = node.children
            made = model.Event(self._type(type_, needed=True), self.point(point))
            self._happens(made.at.instant, point)
            return made
        *counts, type_, between = node.children
        begin, end = (self.point(each) for each in between.children)
        for point, each in zip((begin, end), between.children, strict=True):
            self._happens(point.instant, each)
        if node.data == "noevent":
            return model.NoEvent(self._type(type_, needed=False), begin, end)
        least = self._count(counts[0])
        most = None if counts[1].type == "OO" else self._count(counts[1])
        if most is not None and most < least:
            self.error(
                f"at least {least} and at most {most} cannot be",
                place_of(counts[1], self.text),
                "the lower number first",
            )
        return model.Occurs(least, most, self._type(type_, needed=least > 0), begin, end)

    def _count(self, token: Any) -> int:
        text = str(token)
        if not text.isdecimal() or len(text) > 10 or int(text) > LIMIT_COUNT:
            self.error(
                f"the number of events is a whole number up to {LIMIT_COUNT}",
                place_of(token, self.text),
                "oo for any number",
            )
            return 0
        return int(text)

    def _type(self, node: Any, *, needed: bool) -> model.EventType:
        signature, *change = node.children
        name, arguments = self._signature(signature)
        made = model.EventType(name, arguments)
        if change:
            old, new = change[0].children
            made = model.EventType(name, arguments, (self._parameter(old), self._parameter(new)))
        self._mention("event", made, node, needed=needed)
        return made

    def _part(self, node: Any) -> model.Inclusion:
        signature, *indexes = node.children
        name, arguments = self._signature(signature)
        points = []
        for each in indexes[0].children if indexes else ():
            is_named = each.data == "named_point"
            point = self.point(each.children[-1] if is_named else each)
            self._happens(point.instant, each)
            points.append((self.instant(each.children[0], keep=False) if is_named else None, point))
        made = model.Inclusion(name, arguments, tuple(points))
        self._mention("part", made, node)
        return made

    def _happens(self, instant: str, node: Any) -> str:
        """Keep that something happens at this instant, or that it is declared."""
        self._mention("instant", instant, node, needed=True)
        return instant

    # Conditions

    def _condition(self, node: Any) -> model.Constraint:
        found = self._conditions(node)
        self._mention("condition", found, node)
        return found

    def _conditions(self, node: Any) -> model.Constraint:
        parts = node.children
        match node.data:
            case "member" | "stranger":
                return model.MemberOf(self._variable(parts[0]), self._domain(parts[1]), node.data == "member")
            case "equal" | "unequal":
                return model.Equal(self._variable(parts[0]), self._parameter(parts[2]), node.data == "equal")
            case "negation":
                return model.Negation(self._conditions(parts[0]))
            case "conditions_use":
                arguments = tuple([self._parameter(each) for each in parts[1:]])
                made = model.Use(self._simple(parts[0]), arguments)
                self._mention("conditions", made, node)
                return made
            case "implies":
                return model.Implication(self._conditions(parts[0]), self._conditions(parts[2]))
            case "same":
                return model.Iff(self._conditions(parts[0]), self._conditions(parts[2]))
            case "choice" if len(parts) == 2:
                return model.Implication(self._conditions(parts[0]), self._conditions(parts[1]))
        inside = [self._conditions(part) for part in parts]
        match node.data:
            case "choice":
                return model.Choice(*inside)
            case "conjunct":
                return model.Conjunction(tuple(inside))
        return model.Disjunction(tuple(inside))

    # Domains

    def _domain(self, node: Any) -> Domain:
        match node.data:
            case "values":
                return Symbols(tuple(self._values(node.children)))
            case "complement":
                return Complement(self._domain(node.children[0]))
            case "named":
                return self._named_domain(node)
            case "intersection":
                found, *others = [self._domain(part) for part in node.children]
                for other in others:
                    found = Combination("&", found, other)
                return found
        found = self._domain(node.children[0])
        for sign, part in zip(node.children[1::2], node.children[2::2], strict=True):
            if part.data == "named" and sign in {"+", "-"}:
                self.goes_on(sign)
            operator = {"+": "|", "\\": "-"}.get(str(sign), str(sign))
            found = Combination(operator, found, self._domain(part))
        return found

    def _named_domain(self, node: Any) -> Domain:
        """`Car-Red`, which is read as one name, is taken apart: the name of a domain is a symbol."""
        first, *others = map(NamedDomain, self._name(node.children[0]).split("-"))
        found: Domain = first
        for other in others:
            found = Combination("-", found, other)
        for one in (first, *others):
            self._mention("domain", one, node)
        return found

    # Names

    def _signature(self, node: Any) -> tuple[str, tuple[model.Parameter, ...]]:
        names = [self._name(part) for part in node.children if part.data == "name"]
        return ".".join(names), tuple([self._parameter(part) for part in node.children if part.data == "parameter"])

    def _simple(self, node: Any) -> str:
        name = self._name(node)
        if "-" in name:
            place = place_of(node, self.text)
            self.error("names of domains and of constraints hold no `-`", place, name.replace("-", "_"))
        return name

    def _name(self, node: Any) -> str:
        name = self.short(node)
        if name in RESERVED:
            self.error(f"`{name}` is a reserved word and cannot be a name", place_of(node, self.text), f"{name}_")
        return name

    def _values(self, nodes: Any) -> list[str]:
        """Symbols; a number may have a minus before it, and quotes go around what is no symbol otherwise."""
        found, sign = [], ""
        for node in nodes:
            kind = getattr(node, "type", "")
            if kind == "MINUS":
                sign = "-"
                continue
            text = self._name(node) if not kind else str(node)[1:-1] if kind == "STRING" else str(node)
            found.append(sign + text)
            sign = ""
        return found

    def _parameter(self, node: Any) -> model.Parameter:
        first = node.children[0]
        if getattr(first, "type", "") == "VARIABLE":
            return self._variable(first)
        if str(first) in {"?", "*"} and hasattr(first, "type"):
            return model.ChronicleVariable("", star=str(first) == "*")
        return self._values(node.children)[0]

    def _variable(self, token: Any) -> model.ChronicleVariable:
        made = model.ChronicleVariable(str(token)[1:], star=str(token)[0] == "*")
        self._mention("variable", made, token)
        return made
