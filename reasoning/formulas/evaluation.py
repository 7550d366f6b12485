"""Formulas about one state, compiled to closures over the parts of a `Moment`; truth has three values.

A truth is a digit: 0 false, 1 true, 2 undecided, which is an atom over `no_value` (F5). Connectives are Kleene's: a
conjunction with a false part is false whatever the others are. Terms that have no value (a missing input, a division by
zero, a NaN that came in or came out) make their atom undecided as well. The truth assignment of a state is one number:
the digits of all atoms, atom 0 the lowest. The caller has the parts of a state at hand: a `Moment` is made only
where one is kept.
"""

import operator
from collections.abc import Callable, Collection, Mapping, Sequence
from types import MappingProxyType
from typing import Any, Final, Literal, NamedTuple, TypeAlias

from dyknow.model.errors import TextError
from dyknow.model.sample import Value
from dyknow.model.values import NO_VALUE
from dyknow.reasoning.formulas import tree

NoValuePolicy: TypeAlias = Literal["undecided", "false", "true", "skip"]
Truth: TypeAlias = bool | None
FALSE, TRUE, UNDECIDED = 0, 1, 2
TRUTHS: Final[tuple[Truth, ...]] = (False, True, None)
"""By digit."""
UNKNOWN: Final[dict[str, int]] = {"undecided": UNDECIDED, "false": FALSE, "true": TRUE, "skip": UNDECIDED}
"""The truth of an atom over `no_value` under each policy; with `skip` it is never evaluated."""


def is_missing(value: Value) -> bool:
    """Whether there is no value: none came, or a NaN, which measures nothing."""
    return value is NO_VALUE or bool(value != value)  # noqa: PLR0124 - a NaN is the only value unequal to itself


Values: TypeAlias = Mapping[str, Value]
Events: TypeAlias = Collection[str]
Times: TypeAlias = Mapping[str, int]


class Moment(NamedTuple):
    """The input of a formula: one state.

    `values` by label; `domains` as they are now, for growing quantifiers; `events` are labels of the events;
    `changed_us` when each feature under a `since` last changed.
    """

    valid_us: int
    values: Values
    domains: tree.Domains = MappingProxyType({})
    events: Events = ()
    changed_us: Times = MappingProxyType({})


Test: TypeAlias = Callable[[int, Values, tree.Domains, Events, Times], int]
"""The digit of a formula, or the truth assignment of several, from the parts of a `Moment`."""
Term: TypeAlias = Callable[[int, Values, tree.Domains, Events, Times], Value]

_COMPARE: Final[dict[str, Callable[[Any, Any], Any]]] = {
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

    def __init__(self, domains: tree.Domains | None = None, no_value: NoValuePolicy = "undecided") -> None:
        self.domains = {name: tuple(members) for name, members in (domains or {}).items()}
        self.no_value, self.nodes_left = no_value, tree.LIMIT_NODES
        self._unknown = UNKNOWN[no_value]

    def again(self) -> "EvaluationCompiler":
        """Another one over the same domains, which counts by itself how large formulas are."""
        return EvaluationCompiler(self.domains, self.no_value)

    def count(self) -> None:
        """One more node; raises TextError when the formula has grown too large."""
        self.nodes_left -= 1
        if self.nodes_left < 0:
            raise tree.too_large()

    def assignment(self, atoms: Sequence[tree.Formula]) -> Test:
        """The truth assignment of these atoms."""
        tests = self._tests(atoms)
        if len(tests) == 1:
            return tests[0]
        weighted = tuple((test, 3**at) for at, test in enumerate(tests))

        def read(at_us: int, values: Values, domains: tree.Domains, events: Events, changed_us: Times) -> int:
            number = 0
            for test, weight in weighted:
                number += test(at_us, values, domains, events, changed_us) * weight
            return number

        return read

    def test(self, formula: tree.Formula) -> Test:
        """The truth of a formula without temporal operators.

        Raises:
            TextError: if the formula expands beyond `LIMIT_NODES`, or is no truth value at all.
        """
        self.count()
        match formula:
            case tree.Compare():
                return self._compare(formula)
            case tree.Not(operand):
                return _negation(self.test(operand))
            case tree.And(parts):
                return _joined(self._tests(parts), FALSE)
            case tree.Or(parts):
                return _joined(self._tests(parts), TRUE)
            case tree.Implies(left, right):
                return _joined((_negation(self.test(left)), self.test(right)), TRUE)
            case tree.Forall() | tree.Exists():
                return self._quantifier(formula)
            case tree.Const(value) if isinstance(value, bool):
                return _constant(int(value))
            case tree.Occurred(event):
                label = event.label
                return lambda _at, _values, _domains, events, _changed: int(label in events)
            case tree.Feature():
                return self._boolean(formula.label)
        raise TextError.at(formula.place, f"{type(formula).__name__.lower()} is no truth value")

    def _tests(self, parts: Sequence[tree.Formula]) -> tuple[Test, ...]:
        return tuple([self.test(part) for part in parts])

    def _boolean(self, label: str) -> Test:
        unknown = self._unknown

        def test(_at: int, values: Values, _domains: tree.Domains, _events: Events, _changed: Times) -> int:
            value = values.get(label)
            return 1 if value is True else 0 if value is False else unknown

        return test

    def _compare(self, formula: tree.Compare) -> Test:
        holds, unknown = _COMPARE[formula.operator], self._unknown
        left, right = formula.left, formula.right
        if isinstance(left, tree.Feature) and isinstance(right, tree.Const | tree.Duration):
            constant = right.us if isinstance(right, tree.Duration) else right.value
            return _compare_constant(left.label, holds, constant, unknown)
        first, second = self.term(left), self.term(right)

        def test(at_us: int, values: Values, domains: tree.Domains, events: Events, changed_us: Times) -> int:
            a, b = first(at_us, values, domains, events, changed_us), second(at_us, values, domains, events, changed_us)
            if a is NO_VALUE or b is NO_VALUE or a != a or b != b:  # noqa: PLR0124 - a NaN differs from itself
                return unknown
            try:
                return 1 if holds(a, b) else 0
            except TypeError:
                return unknown

        return test

    def _quantifier(self, formula: tree.Forall | tree.Exists) -> Test:
        settles = FALSE if isinstance(formula, tree.Forall) else TRUE
        variable, body = formula.variable, formula.body
        if not formula.growing:
            members = tree.domain_members(formula.domain, self.domains)
            return _joined(self._tests([tree.instantiate(body, variable, one) for one in members]), settles)
        compiled: dict[str, Test] = {}
        nodes: dict[str, int] = {}
        domain = formula.domain

        def test(at_us: int, values: Values, domains: tree.Domains, events: Events, changed_us: Times) -> int:
            members = tree.domain_members(domain, domains)
            for one in members:
                if one not in compiled:
                    before = self.nodes_left
                    compiled[one] = self.test(tree.instantiate(body, variable, one))
                    nodes[one] = before - self.nodes_left
            if len(compiled) > len(members):
                for gone in compiled.keys() - set(members):
                    del compiled[gone]
                    self.nodes_left += nodes.pop(gone)
            tests = tuple([compiled[one] for one in members])
            return _joined(tests, settles)(at_us, values, domains, events, changed_us)

        return test

    def term(self, formula: tree.Formula) -> Term:
        """The value of a term, `NO_VALUE` if it has none; a truth value that is undecided has none."""
        self.count()
        match formula:
            case tree.Const(value):
                return _constant(value)
            case tree.Duration(us):
                return _constant(us)
            case tree.Feature():
                label = formula.label
                return lambda _at, values, _domains, _events, _changed: values.get(label, NO_VALUE)
            case tree.Now():
                return lambda at_us, _values, _domains, _events, _changed: at_us
            case tree.Since(feature):
                return _since(feature.label)
            case tree.Negate(operand):
                return _calculation(operator.neg, self.term(operand))
            case tree.Abs(operand):
                return _calculation(abs, self.term(operand))
            case tree.Arithmetic(sign, left, right):
                return _calculation(_ARITHMETIC[sign], self.term(left), self.term(right))
        test = self.test(formula)

        def truth(at_us: int, values: Values, domains: tree.Domains, events: Events, changed_us: Times) -> Value:
            digit = test(at_us, values, domains, events, changed_us)
            return NO_VALUE if digit == UNDECIDED else bool(digit)

        return truth


def _constant(value: Any) -> Callable[[int, Values, tree.Domains, Events, Times], Any]:
    return lambda _at, _values, _domains, _events, _changed: value


def _compare_constant(label: str, holds: Callable[[Any, Any], Any], constant: Value, unknown: int) -> Test:
    def test(_at: int, values: Values, _domains: tree.Domains, _events: Events, _changed: Times) -> int:
        value = values.get(label, NO_VALUE)
        if value is NO_VALUE or value != value:  # noqa: PLR0124 - a NaN differs from itself
            return unknown
        try:
            return 1 if holds(value, constant) else 0
        except TypeError:
            return unknown

    return test


def _since(label: str) -> Term:
    def term(at_us: int, values: Values, _domains: tree.Domains, _events: Events, changed_us: Times) -> Value:
        changed = changed_us.get(label)
        return NO_VALUE if changed is None or is_missing(values.get(label, NO_VALUE)) else at_us - changed

    return term


def _calculation(calculate: Callable[..., Any], *operands: Term) -> Term:
    def term(at_us: int, values: Values, domains: tree.Domains, events: Events, changed_us: Times) -> Value:
        given = [operand(at_us, values, domains, events, changed_us) for operand in operands]
        try:
            result = calculate(*given)
        except (TypeError, ArithmeticError):
            return NO_VALUE
        return NO_VALUE if result != result else result  # noqa: PLR0124 - a NaN is the only value unequal to itself

    return term


def _negation(test: Test) -> Test:
    def negation(at_us: int, values: Values, domains: tree.Domains, events: Events, changed_us: Times) -> int:
        digit = test(at_us, values, domains, events, changed_us)
        return UNDECIDED if digit == UNDECIDED else 1 - digit

    return negation


def _joined(tests: tuple[Test, ...], settles: int) -> Test:
    """A conjunction, which a false part settles, or a disjunction, which a true one does."""

    def joined(at_us: int, values: Values, domains: tree.Domains, events: Events, changed_us: Times) -> int:
        result = 1 - settles
        for test in tests:
            digit = test(at_us, values, domains, events, changed_us)
            if digit == settles:
                return settles
            if digit == UNDECIDED:
                result = UNDECIDED
        return result

    return joined
