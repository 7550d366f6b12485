"""Temporal terms (thesis 7.5.1): bounds of intervals, made of times, numbers and constants, known before there are states."""

from collections.abc import Mapping
from fractions import Fraction

from dyknow.kpl.checking.symbols import Constant
from dyknow.kpl.diagnostics.collector import nearest
from dyknow.kpl.syntax.printing import print_formula
from dyknow.model.errors import TextError
from dyknow.model.instants import MAX_DURATION_US, US_PER_MS
from dyknow.reasoning.formulas import tree

_INTERVAL = "[0, 5s]"


def bound_us(term: tree.Term, constants: Mapping[str, Constant]) -> int:
    """The time of a term in microseconds, counted from the state; a number without a unit is milliseconds.

    Raises:
        TextError: it is no time, or none from 0 to `MAX_DURATION_US`.
    """
    value, is_time = _value(term, constants)
    us = value if is_time else value * US_PER_MS
    if us < 0:
        raise _wrong(term, "the interval begins before the state", _INTERVAL)
    if us > MAX_DURATION_US:
        raise _wrong(term, "the bound is too long a time", "oo")
    if us.denominator != 1:
        raise _wrong(term, "the bound is finer than a microsecond", _INTERVAL)
    return int(us)


def _value(term: tree.Formula, constants: Mapping[str, Constant]) -> tuple[Fraction, bool]:
    """A number, or microseconds and True."""
    match term:
        case tree.Duration(us):
            return Fraction(us), True
        case tree.Const(bool() | str()):
            pass
        case tree.Const(number):
            return Fraction(repr(number)), False
        case tree.Negate(operand):
            value, is_time = _value(operand, constants)
            return -value, is_time
        case tree.Abs(operand):
            value, is_time = _value(operand, constants)
            return abs(value), is_time
        case tree.Arithmetic(operator, left, right):
            return _calculated(term, operator, _value(left, constants), _value(right, constants))
        case tree.Feature(name, (), None) if name in constants:
            constant = constants[name]
            if not isinstance(constant, bool | str):
                return _value(constant if isinstance(constant, tree.Duration) else tree.Const(constant), constants)
    named = print_formula(term)
    near = "oo" if named.lower() in {"inf", "infinity"} else nearest(named, constants, _INTERVAL)
    raise _wrong(term, f"{named} is no time: bounds are times or constants", near)


def _calculated(
    term: tree.Formula, operator: str, left: tuple[Fraction, bool], right: tuple[Fraction, bool]
) -> tuple[Fraction, bool]:
    (first, is_time), (second, also_time) = left, right
    if operator in "+-":
        if is_time != also_time:
            first, second = first if is_time else first * US_PER_MS, second if also_time else second * US_PER_MS
        return first + second if operator == "+" else first - second, is_time or also_time
    if operator == "*" and not (is_time and also_time):
        return first * second, is_time or also_time
    if operator == "/" and second and (is_time or not also_time):
        return first / second, is_time and not also_time
    raise _wrong(term, "a bound is no product of times, and nothing divided by a time or by 0", "2 * 5s")


def _wrong(term: tree.Formula, message: str, repair: str) -> TextError:
    return TextError.at(term.place, message, repair=repair)
