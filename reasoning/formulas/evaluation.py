"""Formulas about one state, compiled to closures; truth has three values.

True, False, and None for undecided: an atom over `no_value` (F5). Connectives are Kleene's: a conjunction with a false
part is false whatever the others are. Terms that have no value (a missing input, a division by zero, a NaN that came in
or came out) make their atom undecided as well.
"""

import operator
from collections.abc import Callable, Collection, Mapping
from types import MappingProxyType
from typing import Any, Final, Literal, NamedTuple, TypeAlias

from dyknow.model.errors import TextError
from dyknow.model.sample import Value
from dyknow.model.values import NO_VALUE
from reasoning.formulas.tree import (
    LIMIT_NODES,
    Abs,
    And,
    Arithmetic,
    Compare,
    Const,
    Domains,
    Duration,
    Exists,
    Feature,
    Forall,
    Formula,
    Implies,
    Negate,
    Not,
    Now,
    Occurred,
    Or,
    Since,
    domain_members,
    instantiate,
    too_large,
)

Truth: TypeAlias = bool | None
NoValuePolicy: TypeAlias = Literal["undecided", "false", "true", "skip"]
UNKNOWN: Final[dict[str, Truth]] = {"undecided": None, "false": False, "true": True, "skip": None}
"""What an atom over `no_value` is under each policy; `skip` never comes to evaluating one."""


def is_missing(value: Value) -> bool:
    """Whether there is no value: none came, or a NaN, which measures nothing."""
    return value is NO_VALUE or bool(value != value)  # noqa: PLR0124 - a NaN is the only value unequal to itself


class Moment(NamedTuple):
    """What a formula can look at: one state.

    `values` by label; `domains` as they are now, for growing quantifiers; `events` are the labels of what happened;
    `changed_us` when each feature under a `since` last changed.
    """

    valid_us: int
    values: Mapping[str, Value]
    domains: Domains = MappingProxyType({})
    events: Collection[str] = ()
    changed_us: Mapping[str, int] = MappingProxyType({})


Test: TypeAlias = Callable[[Moment], Truth]
Term: TypeAlias = Callable[[Moment], Value]

COMPARE: Final[dict[str, Callable[[Any, Any], Any]]] = {
    "<": operator.lt,
    "<=": operator.le,
    "=": operator.eq,
    "!=": operator.ne,
    ">=": operator.ge,
    ">": operator.gt,
}
_ARITHMETIC: Final[dict[str, Callable[[Any, Any], Any]]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
}


class EvaluationCompiler:
    """Turns state formulas into closures; quantifiers that do not grow range over `domains` as they are here (F6)."""

    def __init__(self, domains: Domains | None = None, no_value: NoValuePolicy = "undecided") -> None:
        self.domains = {name: tuple(members) for name, members in (domains or {}).items()}
        self.unknown = UNKNOWN[no_value]
        self.nodes_left = LIMIT_NODES

    def count(self) -> None:
        """One more node; raises TextError when the formula has grown too large."""
        self.nodes_left -= 1
        if self.nodes_left < 0:
            raise too_large()

    def test(self, formula: Formula) -> Test:
        """The truth of a formula without temporal operators.

        Raises:
            TextError: if the formula expands beyond `LIMIT_NODES`, or is no truth value at all.
        """
        self.count()
        match formula:
            case Compare():
                return self._compare(formula)
            case Not(operand):
                return _negation(self.test(operand))
            case And(parts):
                return _conjunction(self._tests(parts))
            case Or(parts):
                return _disjunction(self._tests(parts))
            case Implies(left, right):
                return _disjunction((_negation(self.test(left)), self.test(right)))
            case Forall() | Exists():
                return self._quantifier(formula)
            case Const(value) if isinstance(value, bool):
                return lambda _moment: value
            case Occurred(event):
                label = event.label
                return lambda moment: label in moment.events
            case Feature():
                return self._boolean(formula.label)
        raise TextError(
            f"{type(formula).__name__.lower()} is no truth value", line=formula.place.line, column=formula.place.column
        )

    def _tests(self, parts: tuple[Formula, ...]) -> tuple[Test, ...]:
        return tuple([self.test(part) for part in parts])

    def _boolean(self, label: str) -> Test:
        unknown = self.unknown

        def test(moment: Moment) -> Truth:
            value = moment.values.get(label, NO_VALUE)
            return value if value is True or value is False else unknown

        return test

    def _compare(self, formula: Compare) -> Test:
        holds, unknown = COMPARE[formula.operator], self.unknown
        left, right = formula.left, formula.right
        if isinstance(left, Feature) and isinstance(right, Const | Duration):
            return _compare_constant(
                left.label, holds, right.us if isinstance(right, Duration) else right.value, unknown
            )
        first, second = self.term(left), self.term(right)

        def test(moment: Moment) -> Truth:
            a, b = first(moment), second(moment)
            if a is NO_VALUE or b is NO_VALUE or a != a or b != b:  # noqa: PLR0124 - a NaN differs from itself
                return unknown
            try:
                return True if holds(a, b) else False  # noqa: SIM210 - `bool(...)` is a call, on the hot path
            except TypeError:
                return unknown

        return test

    def _quantifier(self, formula: Forall | Exists) -> Test:
        join = _conjunction if isinstance(formula, Forall) else _disjunction
        variable, body = formula.variable, formula.body
        if not formula.growing:
            members = domain_members(formula.domain, self.domains)
            return join(tuple([self.test(instantiate(body, variable, one)) for one in members]))
        compiled: dict[str, Test] = {}
        domain = formula.domain

        def test(moment: Moment) -> Truth:
            tests = []
            for one in domain_members(domain, moment.domains):
                if one not in compiled:
                    compiled[one] = self.test(instantiate(body, variable, one))
                tests.append(compiled[one])
            return join(tuple(tests))(moment)

        return test

    def term(self, formula: Formula) -> Term:
        """The value of a term, `NO_VALUE` if it has none; a truth value that is undecided has none."""
        self.count()
        match formula:
            case Const(value):
                return lambda _moment: value
            case Duration(us):
                return lambda _moment: us
            case Feature():
                label = formula.label
                return lambda moment: moment.values.get(label, NO_VALUE)
            case Now():
                return lambda moment: moment.valid_us
            case Since(feature):
                return _since(feature.label)
            case Negate(operand):
                return _calculation(operator.neg, self.term(operand))
            case Abs(operand):
                return _calculation(abs, self.term(operand))
            case Arithmetic(sign, left, right):
                return _calculation(_ARITHMETIC[sign], self.term(left), self.term(right))
        test = self.test(formula)

        def truth(moment: Moment) -> Value:
            found = test(moment)
            return NO_VALUE if found is None else found

        return truth


def _compare_constant(label: str, holds: Callable[[Any, Any], Any], constant: Value, unknown: Truth) -> Test:
    def test(moment: Moment) -> Truth:
        value = moment.values.get(label, NO_VALUE)
        if value is NO_VALUE or value != value:  # noqa: PLR0124 - a NaN differs from itself
            return unknown
        try:
            return True if holds(value, constant) else False  # noqa: SIM210 - `bool(...)` is a call, on the hot path
        except TypeError:
            return unknown

    return test


def _since(label: str) -> Term:
    def term(moment: Moment) -> Value:
        changed_us = moment.changed_us.get(label)
        if changed_us is None or is_missing(moment.values.get(label, NO_VALUE)):
            return NO_VALUE
        return moment.valid_us - changed_us

    return term


def _calculation(calculate: Callable[..., Any], *operands: Term) -> Term:
    def term(moment: Moment) -> Value:
        values = [operand(moment) for operand in operands]
        try:
            result = calculate(*values)
        except (TypeError, ArithmeticError):
            return NO_VALUE
        return NO_VALUE if result != result else result  # noqa: PLR0124 - a NaN is the only value unequal to itself

    return term


def _negation(test: Test) -> Test:
    def negation(moment: Moment) -> Truth:
        found = test(moment)
        return None if found is None else not found

    return negation


def _conjunction(tests: tuple[Test, ...]) -> Test:
    def conjunction(moment: Moment) -> Truth:
        result: Truth = True
        for test in tests:
            found = test(moment)
            if found is False:
                return False
            if found is None:
                result = None
        return result

    return conjunction


def _disjunction(tests: tuple[Test, ...]) -> Test:
    def disjunction(moment: Moment) -> Truth:
        result: Truth = False
        for test in tests:
            found = test(moment)
            if found is True:
                return True
            if found is None:
                result = None
        return result

    return disjunction
