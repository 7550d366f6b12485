"""Expressions of planning domains from text: the parse tree becomes nodes (grammar: domains.lark).

A time stamp `[start]`, `[t]` or `[t + 1]` is about all that stands to its right, inside the same parentheses, until the
next stamp. In a global formula those of one time variable stand for `always` and `next`: `[t] A & B -> [t + 1] C` is
`always (A & B -> next C)`.
"""

from typing import Any, Final

from dyknow.kpl.diagnostics.collector import ErrorCollector
from dyknow.kpl.syntax.numbers import is_time, parse_number
from dyknow.kpl.syntax.parsing import place_of
from dyknow.model.instants import parse_duration
from dyknow.planning.domains.model import Application, Expression, InGoal, Next, Parameter, Quantified
from dyknow.reasoning.formulas import tree

_CONNECTIVES: Final = ("conjunction", "disjunction", "expr", "negation", "group", "forall", "exists")
_MS: Final = 1000


class ExpressionReader(ErrorCollector):
    """Reads expressions; collects errors of numbers, stamps and intervals."""

    _stamp: tuple[tuple[str, int], ...] | None = None
    """The only stamp that may stand in the expression."""

    def read(self, node: Any) -> Expression:
        place, parts = place_of(node, self.text), node.children
        match node.data:
            case "group":
                return self.read(parts[0])
            case "expr":
                return tree.Implies(self.read(parts[0]), self.read(parts[2]), place=place)
            case "conjunction":
                return tree.And(self._each(parts), place=place)
            case "disjunction":
                return tree.Or(self._each(parts), place=place)
            case "until":
                return self._until(parts, place)
            case "negation":
                return tree.Not(self.read(parts[0]), place=place)
            case "always" | "eventually":
                lo_us, hi_us = self._interval(parts[:-1])
                make = tree.Always if node.data == "always" else tree.Eventually
                return make(self.read(parts[-1]), lo_us, hi_us, place=place)
            case "next":
                return Next(self.read(parts[0]), place=place)
            case "in_goal":
                return InGoal(self.read(parts[0]), place=place)
            case "forall" | "exists":
                return Quantified(node.data, self.variables(parts[0]), self.read(parts[1]), place=place)
            case "stamped":
                self._check_stamp(parts[0], place)
                return self.read(parts[1])
        return self._value(node, place)

    def _value(self, node: Any, place: tree.Place) -> Expression:
        parts = node.children
        match node.data:
            case "comparison":
                return self._comparison(parts, place)
            case "sum" | "product":
                found = self.read(parts[0])
                for sign, part in zip(parts[1::2], parts[2::2], strict=True):
                    found = tree.Arithmetic(str(sign), found, self.read(part), place=place)
                return found
            case "negative":
                inside = self.read(parts[0])
                is_number = isinstance(inside, tree.Const) and not isinstance(inside.value, bool | str)
                return tree.Const(-inside.value, place=place) if is_number else tree.Negate(inside, place=place)
            case "number":
                return self._number(str(parts[0]), place)
            case "true" | "false":
                return tree.Const(node.data == "true", place=place)
        return Application(name_in(parts[0]), self._each(parts[1:]), place=place)

    def _each(self, parts: list[Any]) -> tuple[Expression, ...]:
        return tuple([self.read(part) for part in parts])

    def _until(self, parts: list[Any], place: tree.Place) -> Expression:
        if len(parts) == 1:
            return self.read(parts[0])
        lo_us, hi_us = self._interval(parts[1:-1])
        return tree.Until(self.read(parts[0]), self.read(parts[-1]), lo_us, hi_us, place=place)

    def _comparison(self, parts: list[Any], place: tree.Place) -> Expression:
        """A chain `a <= b <= c` is a conjunction."""
        sides = self._each(parts[::2])
        signs = ["=" if str(sign) == "==" else str(sign) for sign in parts[1::2]]
        found = tuple(
            tree.Compare(sign, left, right, place=place)
            for sign, left, right in zip(signs, sides, sides[1:], strict=False)
        )
        return found[0] if len(found) == 1 else tree.And(found, place=place)

    def _number(self, text: str, place: tree.Place) -> Expression:
        if is_time(text):
            return tree.Duration(self.attempt(lambda: parse_duration(text), place, 0), place=place)
        return tree.Const(self.attempt(lambda: parse_number(text), place, 0.0), place=place)

    def variables(self, node: Any) -> tuple[Parameter, ...]:
        """Variables with the types that are given."""
        names = [[name_in(name) for name in each.children if hasattr(name, "data")] for each in node.children]
        return tuple(Parameter(*each) for each in names)

    def _interval(self, parts: list[Any]) -> tuple[int, int | None]:
        """Microseconds; numbers without a suffix are milliseconds."""
        if not parts:
            return 0, None
        inside = parts[0].children
        if len(inside) != 2:
            self.error("an interval has two bounds", place_of(parts[0], self.text), "always [0, 30s] A")
            return 0, None
        lo_us = self.time_us(inside[0])
        hi_us = None if getattr(inside[1], "type", "") == "OO" else self.time_us(inside[1])
        if hi_us is not None and hi_us < lo_us:
            self.error("the interval ends before it begins", place_of(parts[0], self.text), "[from, to], from <= to")
        return lo_us, hi_us

    def time_us(self, node: Any) -> int:
        """A time that is written as a number or a duration, or as the product of numbers and UNITS_PER_SECOND."""
        found = self._time(self.read(node))
        if found is None:
            self.error("a time is wanted", place_of(node, self.text), "30s, or 30000, which is milliseconds")
            return 0
        return found

    def _time(self, found: Expression) -> int | None:
        if isinstance(found, tree.Duration):
            return found.us
        if isinstance(found, tree.Const) and not isinstance(found.value, bool | str) and 0 <= found.value < 1e15:
            return round(found.value * _MS)
        if isinstance(found, tree.Arithmetic) and found.operator == "*":
            left, right = self._time(found.left), self._time(found.right)
            return None if left is None or right is None else left * right // _MS
        return 1000 * _MS if found == Application("UNITS_PER_SECOND") else None

    def stamp_of(self, node: Any) -> tuple[tuple[str, int], ...]:
        """The time points of a stamp: a name and the milliseconds after it."""
        return tuple(self._time_point(one) for one in node.children)

    def _time_point(self, node: Any) -> tuple[str, int]:
        match self.read(node) if not hasattr(node, "type") else None:
            case Application(name, ()):
                return name, 0
            case tree.Arithmetic(sign, Application(name, ()), later) if (us := self._time(later)) is not None:
                return name, us // _MS if sign == "+" else -us // _MS
            case tree.Const(value) if not isinstance(value, bool | str):
                return "", round(value)
            case tree.Duration(us):
                return "", us // _MS
        self.error("a time point is wanted", place_of(node, self.text), "[start], [end], [start + 500], [t + 1]")
        return "", 0

    def read_at(self, node: Any, wanted: tuple[tuple[str, int], ...]) -> Expression:
        """An expression about one time: its stamps, if there are any, are this one."""
        self._stamp, before = wanted, self._stamp
        try:
            return self.read(node)
        finally:
            self._stamp = before

    def _check_stamp(self, node: Any, place: tree.Place) -> None:
        if self._stamp is None:
            self.error("a time stamp cannot stand here", place, "always A, next A; or [t] A -> [t + 1] B")
        elif self.stamp_of(node) != self._stamp:
            shown = ", ".join(name for name, _ in self._stamp)
            self.error("this is about another time", place_of(node, self.text), f"[{shown}]")

    def over_states(self, node: Any) -> Expression:
        """A global formula; with time stamps `always` over all of it."""
        if not has_stamp(node):
            return self.read(node)
        variables = {self.stamp_of(each.children[0])[0][0] for each in node.iter_subtrees() if each.data == "stamped"}
        if len(variables) > 1:
            self.error("time stamps of two variables", place_of(node, self.text), "[t] A -> [t + 1] B")
        return tree.Always(self._timed(node, 0, variables)[0], place=place_of(node, self.text))

    def _timed(self, node: Any, later: int, times: set[str]) -> tuple[Expression, int]:
        """A part of a formula with stamps, `later` states ahead, and the state of the parts that follow."""
        place, parts = place_of(node, self.text), node.children
        if node.data == "stamped":
            points = self.stamp_of(parts[0])
            if len(points) > 1 or points[0][1] not in {0, 1}:
                self.error("only [t] and [t + 1] can stand in a formula", place, "[t] A -> [t + 1] B")
            return self._timed(parts[1], points[0][1], times)
        if not has_stamp(node) or node.data not in _CONNECTIVES:
            found = self.read(node)
            return (Next(found, place=place) if later else found), later
        if node.data == "group":
            return self._timed(parts[0], later, times)[0], later
        if node.data in {"forall", "exists"}:
            body, last = self._timed(parts[-1], later, times)
            variables = tuple(one for one in self.variables(parts[0]) if one.name not in times)
            return (Quantified(node.data, variables, body, place=place) if variables else body), last
        inside, last = list[Expression](), later
        for part in parts:
            if hasattr(part, "data"):
                found, last = self._timed(part, last, times)
                inside.append(found)
        match node.data:
            case "negation":
                return tree.Not(inside[0], place=place), last
            case "expr":
                return tree.Implies(inside[0], inside[1], place=place), last
        return (tree.And if node.data == "conjunction" else tree.Or)(tuple(inside), place=place), last


def has_stamp(node: Any) -> bool:
    """Whether a time stamp stands in it."""
    return any(each.data == "stamped" for each in node.iter_subtrees())


def name_in(node: Any) -> str:
    """The text of a `name`."""
    return str(node.children[0])
