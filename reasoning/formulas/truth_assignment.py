"""The truth assignment of a state, as a number: the truth of each atom as a digit, 0 false, 1 true, 2 without a value, atom 0 the lowest.

A reader is compiled once per formula. Comparisons of one feature with a constant, and features that are truth values
themselves, read the values directly; any other atom sees the whole moment.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any, TypeAlias

from dyknow.model.sample import Value
from dyknow.model.values import NO_VALUE
from reasoning.formulas.evaluation import COMPARE, EvaluationCompiler, Moment, Truth
from reasoning.formulas.tree import Compare, Const, Domains, Duration, Feature, Formula

Reader: TypeAlias = Callable[[int, Mapping[str, Value], Domains, Collection[str], Mapping[str, int]], int]
"""(valid time, values, domains, events, changed_us) -> truth assignment; the parts of a `Moment`, which most need not make."""

_new = tuple.__new__


def reader(atoms: Sequence[Formula], compiler: EvaluationCompiler) -> Reader:
    """Return the function that gives the truth assignment of a state over these atoms."""
    if len(atoms) == 1:
        return _simple(atoms[0], compiler.unknown) or _any([compiler.test(atoms[0])])
    return _any([compiler.test(atom) for atom in atoms])


def _simple(atom: Formula, unknown: Truth) -> Reader | None:
    """A reader of one atom that looks at one value, else None."""
    missing = digit(unknown)
    if isinstance(atom, Compare) and isinstance(atom.left, Feature) and isinstance(atom.right, Const | Duration):
        constant = atom.right.us if isinstance(atom.right, Duration) else atom.right.value
        return _comparison(atom.left.label, COMPARE[atom.operator], constant, missing)
    return _truth(atom.label, missing) if isinstance(atom, Feature) else None


def digit(truth: Truth) -> int:
    return 2 if truth is None else int(truth)


def _comparison(label: str, holds: Callable[[Any, Any], Any], constant: Value, missing: int) -> Reader:
    def read(
        _valid_us: int, values: Mapping[str, Value], _domains: Domains, _events: Collection[str], _changed: object
    ) -> int:
        value = values.get(label, NO_VALUE)
        if value is NO_VALUE or value != value:  # noqa: PLR0124 - a NaN is the only value unequal to itself
            return missing
        try:
            return 1 if holds(value, constant) else 0
        except TypeError:
            return missing

    return read


def _truth(label: str, missing: int) -> Reader:
    def read(
        _valid_us: int, values: Mapping[str, Value], _domains: Domains, _events: Collection[str], _changed: object
    ) -> int:
        value = values.get(label)
        return 1 if value is True else 0 if value is False else missing

    return read


def _any(tests: Sequence[Callable[[Moment], Truth]]) -> Reader:
    weighted = tuple((test, 3**at) for at, test in enumerate(tests))

    def read(
        valid_us: int,
        values: Mapping[str, Value],
        domains: Domains,
        events: Collection[str],
        changed_us: Mapping[str, int],
    ) -> int:
        moment = _new(Moment, (valid_us, values, domains, events, changed_us))
        letter = 0
        for test, weight in weighted:
            truth = test(moment)
            if truth is None:
                letter += 2 * weight
            elif truth:
                letter += weight
        return letter

    return read
