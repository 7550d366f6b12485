"""Formulas from text: the parse tree becomes the tree of reasoning/formulas/tree.py (grammar: kpl.lark).

Variables are bound here; other names stay features until `check` knows the vocabulary. All errors of the tree are
reported, not the first. An `always` or `eventually` without parentheses on the left of ->, or, and, until is refused:
it reads as `(always A) -> B`, while the thesis prints its boxes over the whole implication.
"""

import re
from typing import TYPE_CHECKING, Any, Final

from dyknow.kpl.diagnostics.collector import ErrorCollector
from dyknow.kpl.syntax.grammar import parse_tree
from dyknow.kpl.syntax.numbers import is_time, parse_number
from dyknow.model.errors import TextError, TextErrors, file_of
from dyknow.model.instants import parse_duration
from dyknow.reasoning.formulas import tree

if TYPE_CHECKING:
    from lark import Token, Tree

_OBJECT_NUMBER = re.compile(r"0|[1-9][0-9]*")
_PREFIXED: Final = ("always", "eventually")
_CUT: Final = 80
_COMMENT = re.compile(r"#[^\n]*")
MAX_STATES: Final = 1_000_000


def parse_formula(text: str, variables: frozenset[str] = frozenset()) -> tree.Formula:
    """Read one formula, in which these variables are bound.

    Raises:
        TextError: at the first place where the text leaves the grammar or a limit.
        TextErrors: with everything else that is wrong: ambiguous readings, numbers, intervals.
    """
    found, errors = read_tree(text, variables)
    raise_all(errors)
    return found


def read_tree(text: str, variables: frozenset[str] = frozenset()) -> tuple[tree.Formula, list[TextError]]:
    """One formula, and its errors beyond the grammar; raises TextError where it leaves the grammar."""
    parsed = parse_tree(text, "formula_only")
    reader = FormulaReader(text)
    try:
        return reader.read(parsed.children[0], variables), reader.errors
    except RecursionError:
        raise TextError("nested too deep for where this is read", file=file_of(text), repair="nest less") from None


def raise_all(errors: list[TextError]) -> None:
    """Raise TextErrors with all of them, in the order of the text, if there are any."""
    if errors:
        raise TextErrors(tuple(sorted(errors, key=lambda error: (error.line, error.column))))


def place_of(node: "Tree[Token] | Token", text: str) -> tree.Place:
    """Where a tree or token stood; the width ends with its first line."""
    at: Any = getattr(node, "meta", node)
    start, end = int(at.start_pos), int(at.end_pos)
    return tree.Place(int(at.line), int(at.column), line_width(text, start, end), start, end)


def line_width(text: str, start: int, end: int) -> int:
    """Characters from `start` to `end`, or to the end of the line; at least 1."""
    line_end = text.find("\n", start)
    return max(1, min(end, line_end if line_end >= 0 else end) - start)


def unit_text(node: Any) -> str:
    """A unit of measurement: `ppm`, `m/s`, `"1/s"`."""
    return "".join(str(getattr(part, "children", [part])[0]) for part in node.children).strip('"')


def blank(text: str) -> str:
    """The same length on one line, without comments."""
    return (
        _COMMENT.sub(lambda found: " " * len(found[0]), text).replace("\n", " ").replace("\t", " ").replace("\r", " ")
    )


class FormulaReader(ErrorCollector):
    """Reads the tree from the top, so that every name meets the variables bound around it."""

    def read(self, node: Any, bound: frozenset[str]) -> tree.Formula:
        place, parts = place_of(node, self.text), node.children
        match node.data:
            case "group":
                return self.read(parts[0], bound)
            case "expr":
                self._readings(node)
                return tree.Implies(self.read(parts[0], bound), self.read(parts[1], bound), place=place)
            case "disjunction" | "conjunction":
                self._readings(node)
                inside = self._each(parts, bound)
                return tree.Or(inside, place=place) if node.data == "disjunction" else tree.And(inside, place=place)
            case "until":
                self._readings(node)
                lo_us, hi_us = self._interval(parts[1:-1])
                return tree.Until(self.read(parts[0], bound), self.read(parts[-1], bound), lo_us, hi_us, place=place)
            case "always" | "eventually":
                lo_us, hi_us = self._interval(parts[:-1])
                make = tree.Always if node.data == "always" else tree.Eventually
                return make(self.read(parts[-1], bound), lo_us, hi_us, place=place)
            case "negation":
                return tree.Not(self.read(parts[0], bound), place=place)
            case "forall" | "forall_growing" | "exists" | "exists_growing":
                return self._quantifier(node, bound, place)
        return self._value(node, bound, place)

    def _value(self, node: Any, bound: frozenset[str], place: tree.Place) -> tree.Formula:
        parts = node.children
        match node.data:
            case "comparison":
                left, right = self.read(parts[0], bound), self.read(parts[2], bound)
                return tree.Compare(str(parts[1]), left, right, place=place)
            case "sum" | "product":
                return self._calculation(parts, bound, place)
            case "negative":
                inside = self.read(parts[0], bound)
                if isinstance(inside, tree.Const) and not isinstance(inside.value, bool | str):
                    return tree.Const(-inside.value, place=place)
                return tree.Negate(inside, place=place)
            case "number":
                return self._number(parts[0], place)
            case "string":
                return tree.Const(str(parts[0])[1:-1], quoted=True, place=place)
            case "true" | "false":
                return tree.Const(node.data == "true", place=place)
            case "abs":
                return tree.Abs(self.read(parts[0], bound), place=place)
            case "since":
                return tree.Since(self.feature(parts[0], bound), place=place)
            case "occurred":
                return tree.Occurred(self.feature(parts[0], bound), place=place)
        return self._label(node, bound, place)

    def _each(self, parts: list[Any], bound: frozenset[str]) -> tuple[tree.Formula, ...]:
        return tuple([self.read(part, bound) for part in parts])

    def _calculation(self, parts: list[Any], bound: frozenset[str], place: tree.Place) -> tree.Formula:
        """A - b + c is (a - b) + c."""
        found = self.read(parts[0], bound)
        for sign, part in zip(parts[1::2], parts[2::2], strict=True):
            found = tree.Arithmetic(str(sign), found, self.read(part, bound), place=place)
        return found

    def _quantifier(self, node: Any, bound: frozenset[str], place: tree.Place) -> tree.Formula:
        name, domain, body = node.children
        variable = str(name.children[0])
        make = tree.Forall if node.data.startswith("forall") else tree.Exists
        inside = self.read(body, bound | {variable})
        return make(variable, self._domain(domain, bound), inside, node.data.endswith("growing"), place=place)

    def _domain(self, node: Any, bound: frozenset[str]) -> tree.Domain:
        sets: list[tree.DomainSet] = []
        for each in node.children:
            if each.data == "members":
                sets.append(tuple(self.object(one, bound) for one in each.children))
            else:
                sets.append(".".join(str(part.children[0]) for part in each.children if part is not None))
        return tree.Domain(sets[0], tuple(sets[1:]), place=place_of(node, self.text))

    def _label(self, node: Any, bound: frozenset[str], place: tree.Place) -> tree.Formula:
        feature = self.feature(node, bound)
        if feature.objects or feature.attribute:
            return feature
        if feature.name in bound:
            return tree.Variable(feature.name, place=place)
        return tree.Now(place=place) if feature.name == "now" else feature

    def feature(self, node: Any, bound: frozenset[str]) -> tree.Feature:
        names = [str(part.children[0]) for part in node.children if part.data == "name"]
        objects = tuple(self.object(part, bound) for part in node.children if part.data == "object")
        attribute = names[1] if len(names) > 1 else None
        return tree.Feature(names[0], objects, attribute, place=place_of(node, self.text))

    def object(self, node: Any, bound: frozenset[str]) -> tree.Object:
        inside = node.children[0]
        name = str(inside if not hasattr(inside, "children") else inside.children[0])
        if name in bound:
            return tree.Variable(name, place=place_of(node, self.text))
        if name[0].isdecimal() and not _OBJECT_NUMBER.fullmatch(name):
            self.error("objects are names or whole numbers", place_of(node, self.text), "speed[uav1], xy_dist[0, 1]")
        return name

    def _number(self, token: "Token", place: tree.Place) -> tree.Duration | tree.Const:
        if is_time(str(token)):
            return tree.Duration(self.attempt(lambda: parse_duration(str(token)), place, 0), place=place)
        return tree.Const(self.attempt(lambda: parse_number(str(token)), place, 0.0), place=place)

    def age(self, node: Any) -> int | None:
        """An option that is a time, microseconds; None: it is none."""
        place = place_of(node, self.text)
        age_us = self.attempt(lambda: parse_duration(str(node.children[0])), place, 1)
        if age_us == 0:
            self.error("what lasts no time has no events but at one instant", place, "max age 1min")
        return age_us

    def states(self, token: "Token") -> int:
        """An option that is a number of states; 1 where it is none."""
        place = place_of(token, self.text)
        found = -1 if is_time(str(token)) else self.attempt(lambda: parse_number(str(token)), place, None)
        if found is None:
            return 1
        if not isinstance(found, int) or not 1 <= found <= MAX_STATES:
            self.error(f"a number of states is from 1 to {MAX_STATES}", place, "close after 3")
            return 1
        return found

    def _interval(self, parts: list[Any]) -> tuple[tree.Bound, tree.Bound | None]:
        """(lo, hi) in microseconds; no interval is [0, oo]."""
        if not parts:
            return 0, None
        first, last = parts[0].children
        lo_us = self._bound(first)
        hi_us = None if getattr(last, "type", "") == "OO" else self._bound(last)
        if isinstance(lo_us, int) and isinstance(hi_us, int) and hi_us < lo_us:
            self.error("the interval ends before it begins", place_of(parts[0], self.text), "[from, to], from <= to")
        return lo_us, hi_us

    def _bound(self, node: Any) -> tree.Bound:
        (term,) = node.children
        if term.data == "number":
            return self.attempt(lambda: parse_duration(str(term.children[0])), place_of(node, self.text), 0)
        return self._time_term(term)

    def _time_term(self, node: Any) -> tree.Term:
        """A term of times and names; definitions may say what a name is."""
        place = place_of(node, self.text)
        if node.data == "number":
            return self._number(node.children[0], place)
        if node.data == "time_name":
            return tree.Feature(str(node.children[0].children[0]), place=place)
        found = self._time_term(node.children[0])
        for sign, part in zip(node.children[1::2], node.children[2::2], strict=True):
            found = tree.Arithmetic(str(sign), found, self._time_term(part), place=place)
        return found

    def _readings(self, node: Any) -> None:
        """Refuse an always or eventually without parentheses as a left operand."""
        text, whole = self.text, place_of(node, self.text)
        for part in node.children[:-1]:
            if part.data not in _PREFIXED:
                continue
            left, operand = place_of(part, text), place_of(part.children[-1], text)
            rest = text[left.end : whole.end]
            narrow = f"({text[left.start : left.end]}){rest}"
            wide = f"{text[left.start : operand.start]}({text[operand.start : left.end]}{rest})"
            self.error(
                f"`{part.data}` on the left of `{_operator(rest)}` can be read in two ways",
                left,
                f"{_line(narrow)}   or   {_line(wide)}",
            )


def _operator(rest: str) -> str:
    found = re.match(r"\s*(->|or|and|until)", re.sub(r"#[^\n]*", "", rest))
    return found[1] if found else "->"


def _line(text: str) -> str:
    """One line, cut where it is long."""
    short = " ".join(_COMMENT.sub("", text).split())
    return short if len(short) <= _CUT else f"{short[: _CUT - 3]}..."
