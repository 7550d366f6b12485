"""Fields of events in a file from anyone: each is of the type that its kind declares, or there is no event.

Checks are made from the annotations of a kind, once; a file obeys the types that hold inside a platform.
"""

from collections.abc import Callable, Mapping
from functools import cache
from math import isfinite
from types import NoneType, UnionType
from typing import Any, Final, TypeAlias, Union, get_args, get_origin, get_type_hints

from dyknow import NO_VALUE
from dyknow.model.errors import DecodeError
from dyknow.model.instants import LATEST_US

LARGEST: Final = 3.5e38
"""Bound of a number, without its sign: a vehicle can report 32 bits; infinity and not-a-number pass as well."""
LONGEST_SHOWN: Final = 40
_Check: TypeAlias = Callable[[Any], bool]
_NAMES: Final[Mapping[type, str]] = {
    int: "a whole number", float: "a number", bool: "true or false", str: "a text", bytes: "bytes", NoneType: "nothing",
}  # fmt: skip


def made(kind: Any, values: list[Any]) -> Any:
    """The named tuple of that kind with these fields, those that have a default may be missing; raises DecodeError."""
    checks = _checks(kind)
    least = len(checks) - len(kind._field_defaults)
    if not least <= len(values) <= len(checks):
        raise DecodeError("journal", f"{kind.__name__} has {len(checks)} fields, got {len(values)}")
    for (name, (wanted, fits)), value in zip(checks.items(), values, strict=False):
        if not fits(value):
            raise DecodeError("journal", f"{kind.__name__}: {name} is {wanted}, got {shown(value)}")
    return kind(*values)


def shown(value: Any) -> str:
    """A value for a message: its kind, and as much of it as fits in."""
    if isinstance(value, list | tuple | dict):
        return f"a {type(value).__name__} of {len(value)}"
    if isinstance(value, bytes):
        return f"{len(value)} bytes"
    text = repr(value[:LONGEST_SHOWN] if isinstance(value, str) else value)
    return text if len(text) <= LONGEST_SHOWN + 2 else f"{text[:LONGEST_SHOWN]}..."


@cache
def _checks(kind: Any) -> dict[str, tuple[str, _Check]]:
    """By field: its type in words, and the check of a value."""
    return {name: _check(hint, name) for name, hint in get_type_hints(kind).items()}


def _check(hint: Any, name: str) -> tuple[str, _Check]:
    origin, arguments = get_origin(hint), get_args(hint)
    if hint is Any:
        return "a value", is_value
    if hint is int and name.endswith("_us"):
        return "an instant in microseconds", lambda value: type(value) is int and -LATEST_US <= value <= LATEST_US
    if hint is float:
        return f"a number up to {LARGEST:g}", _is_number
    if hint in _NAMES:
        return _NAMES[hint], lambda value: type(value) is hint
    if origin in {Union, UnionType}:
        parts = [_check(each, name) for each in arguments]
        first, *others = (wanted for wanted, _ in parts)
        wanted = " or ".join((first, *others)) if len(others) < 3 else f"{first} or one of {len(others)} other kinds"
        return wanted, lambda value: any(fits(value) for _, fits in parts)
    if origin is tuple:
        return _tuple_check(arguments, name)
    if origin is not None and issubclass(origin, Mapping):
        return "a table", lambda value: type(value) is dict and all(type(key) is str for key in value)
    return f"a {hint.__name__}", lambda value: type(value) is hint


def _tuple_check(arguments: tuple[Any, ...], name: str) -> tuple[str, _Check]:
    if arguments[1:] == (Ellipsis,):
        wanted, fits = _check(arguments[0], name)
        return f"a tuple, each of it {wanted}", lambda value: type(value) is tuple and all(map(fits, value))
    parts = [_check(each, name) for each in arguments]
    return (
        f"a tuple of {', '.join(wanted for wanted, _ in parts)}",
        lambda value: (
            type(value) is tuple
            and len(value) == len(parts)
            and all(fits(each) for (_, fits), each in zip(parts, value, strict=True))
        ),
    )


def _is_number(value: Any) -> bool:
    return (type(value) is float or type(value) is int) and (-LARGEST <= value <= LARGEST or not isfinite(value))


def is_value(value: Any) -> bool:
    """Whether it is what a sample can have been written with: simple, no_value, or several of that."""
    if isinstance(value, tuple | list):
        return type(value) in {tuple, list} and all(map(is_value, value))
    if isinstance(value, dict):
        return all(type(key) is str and is_value(each) for key, each in value.items())
    return value is None or value is NO_VALUE or isinstance(value, int | float | str | bytes)
