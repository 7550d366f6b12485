"""Letters of many instances at once: atoms over columns, one value per instance, as numpy arrays.

A column is an array of numbers with NaN, or of anything with `NO_VALUE` or None, where an instance has no value; or one
value for all. Truth is a pair of masks, where true and where false; what is neither has no value. Division by zero and
results that are no numbers have no value, as in `evaluation.py`.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dyknow.errors import TextError
from dyknow.values import NO_VALUE
from reasoning.evaluation import COMPARE, Compiler
from reasoning.formulas import (
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
    walk,
)
from reasoning.shapes import Grows

Column: TypeAlias = Any
"""An array, one value per instance, or one value for all."""
Masks: TypeAlias = tuple[Any, Any]


class Scene(NamedTuple):
    """One state of all instances: `since_us` by label, the time since each feature changed, NaN if it has not."""

    valid_us: int
    columns: Mapping[str, Column]
    domains: Domains
    events: Mapping[str, Column]
    since_us: Mapping[str, Column]


Test: TypeAlias = Callable[[Scene], Masks]
Term: TypeAlias = Callable[[Scene], Column]
_WIDEST: Final = 39
"""Atoms of which the letters still fit into 64 bits."""
_CALCULATE: Final[Mapping[str, Callable[[Any, Any], Any]]] = {"+": np.add, "-": np.subtract, "*": np.multiply}


class Reader:
    """Tells the letters of a scene over these atoms: digits 0 false, 1 true, 2 without a value, atom 0 the lowest.

    Attributes:
        since: labels of the features under a `since`.

    Raises:
        Grows: if a `since` stands under a growing quantifier, whose members' past would have to be known.
    """

    def __init__(self, atoms: Sequence[Formula], compiler: Compiler, count: int) -> None:
        self._compiler = compiler
        self.since: set[str] = set()
        self._tests = tuple((self._test(atom), 3**at) for at, atom in enumerate(atoms))
        self._kind = np.dtype(np.intp if len(atoms) <= _WIDEST else object)
        self._one = _compared(atoms[0]) if len(atoms) == 1 else None
        self.resize(count)

    def resize(self, count: int) -> None:
        self._holds = np.empty(count, np.bool_)
        self._letters = np.zeros(count, self._kind)

    def read(self, scene: Scene) -> NDArray[Any]:
        """One letter per instance; the array is used again at the next state."""
        if self._one is not None:
            label, holds, constant = self._one
            column = scene.columns.get(label)
            if column.__class__ is np.ndarray and column.dtype == np.float64 and column.shape == self._holds.shape:
                total = column.dot(column)
                if total == total:  # noqa: PLR0124 - not NaN: no value is missing
                    return holds(column, constant, self._holds)  # type: ignore[no-any-return]
        letters = self._letters
        letters.fill(0)
        with np.errstate(all="ignore"):
            for test, weight in self._tests:
                true, false = test(scene)
                letters += weight * (2 - 2 * np.asarray(false, letters.dtype) - np.asarray(true, letters.dtype))
        return letters

    # -- truth -------------------------------------------------------------------------------------------------

    def _test(self, formula: Formula) -> Test:
        self._compiler.count()
        match formula:
            case Compare():
                return self._compare(formula)
            case Not(operand):
                inside = self._test(operand)
                return lambda scene: inside(scene)[::-1]
            case And(parts):
                return _all([self._test(part) for part in parts])
            case Or(parts):
                return _any([self._test(part) for part in parts])
            case Implies(left, right):
                return self._test(Or((Not(left), right)))
            case Forall() | Exists():
                return self._quantifier(formula)
            case Const(value) if isinstance(value, bool):
                return lambda _scene: (value, not value)
            case Occurred(event):
                label = event.label
                return lambda scene: _occurred(scene.events.get(label))
            case Feature():
                return self._truth(formula.label)
        raise TextError(f"{type(formula).__name__.lower()} is no truth value", line=formula.place.line)

    def _settled(self, true: Any, false: Any) -> Masks:
        """What has no value counts as the policy says."""
        if self._compiler.unknown is True:
            return ~np.asarray(false), false
        return (true, ~np.asarray(true)) if self._compiler.unknown is False else (true, false)

    def _truth(self, label: str) -> Test:
        def test(scene: Scene) -> Masks:
            column = np.asarray(scene.columns.get(label, NO_VALUE))
            if column.dtype == np.bool_:
                return column, ~column
            if column.dtype == object:
                return self._settled(_is(column, True), _is(column, False))
            return self._settled(column == 1, column == 0)

        return test

    def _compare(self, formula: Compare) -> Test:
        holds = COMPARE[formula.operator]
        first, second = self._term(formula.left), self._term(formula.right)

        def test(scene: Scene) -> Masks:
            a, b = first(scene), second(scene)
            if _is_number(a) and _is_number(b):
                true = holds(a, b) & _has_value(a) & _has_value(b)
                return self._settled(true, ~true & _has_value(a) & _has_value(b))
            found = np.frompyfunc(lambda one, other: _held(holds, one, other), 2, 1)(a, b)
            return self._settled(np.asarray(found == 1), np.asarray(found == 0))

        return test

    def _quantifier(self, formula: Forall | Exists) -> Test:
        join = _all if isinstance(formula, Forall) else _any
        variable, body, domain = formula.variable, formula.body, formula.domain
        if not formula.growing:
            members = domain_members(domain, self._compiler.domains)
            return join([self._test(instantiate(body, variable, one)) for one in members])
        if any(isinstance(node, Since) for node in walk(body)):
            raise Grows
        compiled: dict[str, Test] = {}

        def test(scene: Scene) -> Masks:
            tests = []
            for one in domain_members(domain, scene.domains):
                if one not in compiled:
                    compiled[one] = self._test(instantiate(body, variable, one))
                tests.append(compiled[one])
            return join(tests)(scene)

        return test

    # -- values ------------------------------------------------------------------------------------------------

    def _term(self, formula: Formula) -> Term:
        match formula:
            case Const(value):
                return lambda _scene: value
            case Duration(us):
                return lambda _scene: us
            case Feature():
                label = formula.label
                return lambda scene: scene.columns.get(label, NO_VALUE)
            case Now():
                return lambda scene: scene.valid_us
            case Since(feature):
                label = feature.label
                self.since.add(label)
                return lambda scene: scene.since_us[label]
            case Negate(operand):
                return _calculation(lambda one: -one, self._term(operand))
            case Abs(operand):
                return _calculation(np.abs, self._term(operand))
            case Arithmetic("/", left, right):
                return _calculation(_divided, self._term(left), self._term(right))
            case Arithmetic(sign, left, right):
                return _calculation(_CALCULATE[sign], self._term(left), self._term(right))
        test = self._test(formula)

        def truth(scene: Scene) -> Column:
            true, false = test(scene)
            return np.where(true, 1.0, np.where(false, 0.0, np.nan))

        return truth


def _compared(atom: Formula) -> tuple[str, Any, float] | None:
    """(label, comparison, constant) of an atom that compares one feature with a number."""
    if not isinstance(atom, Compare) or not isinstance(atom.left, Feature):
        return None
    if isinstance(atom.right, Duration):
        constant: Any = atom.right.us
    elif isinstance(atom.right, Const) and not isinstance(atom.right.value, bool | str):
        constant = atom.right.value
    else:
        return None
    return atom.left.label, _COMPARE[atom.operator], float(constant)


_COMPARE: Final[Mapping[str, Any]] = {
    "<": np.less,
    "<=": np.less_equal,
    "=": np.equal,
    "!=": np.not_equal,
    ">=": np.greater_equal,
    ">": np.greater,
}


def _all(tests: Sequence[Test]) -> Test:
    def test(scene: Scene) -> Masks:
        true: Any = True
        false: Any = False
        for one in tests:
            holds, fails = one(scene)
            true, false = true & np.asarray(holds), false | np.asarray(fails)
        return true, false

    return test


def _any(tests: Sequence[Test]) -> Test:
    def test(scene: Scene) -> Masks:
        true: Any = False
        false: Any = True
        for one in tests:
            holds, fails = one(scene)
            true, false = true | np.asarray(holds), false & np.asarray(fails)
        return true, false

    return test


def _occurred(column: Column) -> Masks:
    happened = np.zeros((), np.bool_) if column is None else np.asarray(column, np.bool_)
    return happened, ~happened


def is_missing(column: Column) -> Any:
    """Where a column has no value."""
    found = np.asarray(column)
    if found.dtype.kind == "f":
        return np.isnan(found)
    if found.dtype != object:
        return np.zeros(found.shape, np.bool_)
    return np.asarray([one is NO_VALUE or one is None or one != one for one in found.flat], np.bool_).reshape(  # noqa: PLR0124 - NaN
        found.shape
    )


def _is(column: NDArray[Any], value: object) -> NDArray[np.bool_]:
    return np.asarray([one is value for one in column.flat], np.bool_).reshape(column.shape)


def _is_number(value: Column) -> bool:
    return np.asarray(value).dtype.kind in "bif"


def _has_value(value: Column) -> Any:
    return ~np.isnan(value)


def _held(holds: Callable[[Any, Any], Any], one: Any, other: Any) -> int:
    if one is NO_VALUE or other is NO_VALUE or one is None or other is None or one != one or other != other:  # noqa: PLR0124 - NaN
        return 2
    try:
        return 1 if holds(one, other) else 0
    except TypeError:
        return 2


def _divided(one: Any, other: Any) -> Any:
    return np.where(np.asarray(other) == 0, np.nan, np.true_divide(one, other))


def _calculation(calculate: Callable[..., Any], *operands: Term) -> Term:
    def term(scene: Scene) -> Column:
        return calculate(*[_numbers(operand(scene)) for operand in operands])

    return term


def _numbers(column: Column) -> Any:
    """Numbers as they are, truth values as 0 and 1, anything else has no value."""
    found = np.asarray(column)
    if found.dtype.kind in "if":
        return found
    if found.dtype == np.bool_:
        return found.astype(np.int64)
    return np.frompyfunc(_float, 1, 1)(found).astype(float)


def _float(one: Any) -> float:
    try:
        return float(one) if isinstance(one, int | float) else np.nan
    except OverflowError:
        return np.nan
