"""Values as numbers: inputs may be anything, computations are with finite numbers."""

import math
from collections.abc import Callable, Sequence
from functools import wraps
from typing import Any, TypeAlias

from dyknow import NO_VALUE, Value

Numbers: TypeAlias = tuple[float, ...]
Guarded: TypeAlias = Callable[..., Value]
_DEEPEST = 16


def numbers_of(value: Value, count: int | None = None) -> Numbers | None:
    """The components of a record, or the one number of a simple value, if all are finite and there are `count`."""
    components = value if isinstance(value, tuple) else (value,)
    if not components or (count is not None and len(components) != count):
        return None
    try:
        numbers = tuple([float(each) for each in components if is_number(each)])
    except OverflowError:
        return None
    return numbers if len(numbers) == len(components) and all(map(math.isfinite, numbers)) else None


def is_number(component: Value) -> bool:
    """A truth value is none."""
    return isinstance(component, float | int) and not isinstance(component, bool)


def in_shape_of(value: Value, numbers: Sequence[float]) -> Value:
    """A record if `value` is one, else a simple value; `NO_VALUE` if a number is not finite."""
    if not all(map(math.isfinite, numbers)):
        return NO_VALUE
    return tuple(numbers) if isinstance(value, tuple) else numbers[0]


def is_sound(value: Value, depth: int = _DEEPEST) -> bool:
    """Whether it is a value of some sort (Def. 4.3.3): `NO_VALUE`, simple and finite, or a record of such."""
    if isinstance(value, tuple):
        return depth > 0 and all(is_sound(each, depth - 1) for each in value)
    return value is NO_VALUE or isinstance(value, str | bool) or numbers_of(value) is not None


def numeric(*counts: int) -> Callable[[Guarded], Guarded]:
    """Call a function or method with the numbers of its last arguments: a float where `counts` says 1, else a tuple.

    `NO_VALUE` where an argument is not that number of finite numbers, or the result is not finite or not defined.
    """

    def guard(function: Guarded) -> Guarded:
        @wraps(function)
        def guarded(*arguments: Any) -> Value:
            first = len(arguments) - len(counts)
            numbers: list[Any] = []
            for value, count in zip(arguments[first:], counts, strict=True):
                found = numbers_of(value, count)
                if found is None:
                    return NO_VALUE
                numbers.append(found[0] if count == 1 else found)
            try:
                made = function(*arguments[:first], *numbers)
            except (ArithmeticError, ValueError):
                return NO_VALUE
            return made if is_sound(made) else NO_VALUE

        return guarded

    return guard


def positive(name: str, number: float) -> float:
    """A setting that has to be more than 0.

    Raises:
        ValueError: it is not, or not finite.
    """
    if not (is_number(number) and 0.0 < number < math.inf):
        raise ValueError(f"{name} must be a number > 0, got {number!r}")
    return float(number)
