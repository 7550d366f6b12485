"""The strict way in: plain tuples, dicts and scalars out of untrusted bytes, and the checks every message needs.

Limits come before and during unpacking: 64 KiB, bounded strings, arrays and maps, no extension types, no duplicate
keys, nothing behind the message. Every error is a DecodeError.
"""

import re
from collections.abc import Callable
from typing import Any, Final, NoReturn, TypeAlias, TypeVar

import msgpack

from dyknow.federation.messages.sexpr import MAX_COUNT, MAX_INTEGER, MIN_INTEGER
from dyknow.model.errors import DecodeError, NameRefused
from dyknow.model.instants import LATEST_US
from dyknow.model.sample import MAX_BRANCH, Predicted, Quality, Value
from dyknow.model.values import LARGEST, NO_VALUE, NoValue

VERSION: Final = 1
MAX_BYTES: Final = 65_536
MAX_STRING: Final = 32_768
MAX_ITEMS: Final = 1024
MAX_VALUE_DEPTH: Final = 4
MAX_VALUE_TEXT: Final = 16_384
"""Characters of a text in a sample."""

_HASH = re.compile(r"[0-9a-f]{8}")

Check: TypeAlias = Callable[[Any], Any]
"""Takes a field as it was unpacked and gives it as it is to be used; raises DecodeError."""
M = TypeVar("M", bound=tuple[Any, ...])  # message


def fail(reason: str, detail: str = "") -> NoReturn:
    raise DecodeError(reason, detail)


def _no_extensions(code: int, _data: bytes) -> NoReturn:
    raise ValueError(f"extension type {code}")


def _distinct(pairs: list[tuple[Any, Any]]) -> dict[Any, Any]:
    found = dict(pairs)
    if len(found) != len(pairs):
        fail("duplicate key")
    return found


def unpack(payload: bytes) -> Any:
    """Plain tuples, dicts and scalars out of untrusted bytes, within the limits; numbers and nesting are not checked."""
    if len(payload) > MAX_BYTES:
        fail("oversized", f"{len(payload)} bytes")
    try:
        return msgpack.unpackb(
            payload,
            use_list=False,
            object_pairs_hook=_distinct,
            ext_hook=_no_extensions,
            max_str_len=MAX_STRING,
            max_bin_len=MAX_BYTES,
            max_array_len=MAX_ITEMS,
            max_map_len=MAX_ITEMS,
            max_ext_len=0,
        )
    except (ValueError, TypeError, RecursionError) as malformed:
        raise DecodeError("malformed", str(malformed)[:80]) from None


def _void(value: object) -> None:
    if not isinstance(value, NoValue):
        raise TypeError(f"{type(value).__name__} cannot travel on the wire")


def pack(message: object) -> bytes:
    packed: bytes = msgpack.packb(message, default=_void)
    return packed


def packer() -> Callable[[object], bytes]:
    """`pack` with a kept buffer of its own, for one thread: a third of the time for small, frequent messages."""
    kept: Callable[[object], bytes] = msgpack.Packer(default=_void, buf_size=2048).pack
    return kept


def array(payload: bytes, length: int) -> tuple[Any, ...]:
    """The fields behind the version of a message of `length` fields."""
    return versioned(unpack(payload), length, length)


def versioned(found: Any, least: int, most: int) -> tuple[Any, ...]:
    """The fields behind the version of a message of `least` to `most` fields."""
    if type(found) is not tuple or not least < len(found) <= most + 1:
        fail("shape")
    if type(found[0]) is not int or found[0] != VERSION:
        fail("version")
    return found[1:]


def count(value: Any) -> int:
    """A number of something."""
    if type(value) is not int or not 0 <= value <= MAX_COUNT:
        fail("number")
    return value


def whole(value: int) -> int:
    """An integer that a value has."""
    return value if MIN_INTEGER <= value <= MAX_INTEGER else fail("number")


def instant(value: Any) -> int:
    if type(value) is not int or not -LATEST_US <= value <= LATEST_US:
        fail("number")
    return value


def stamp(value: Any) -> int:
    """An instant of a node clock, after 1970."""
    if type(value) is not int or not 0 <= value <= LATEST_US:
        fail("number")
    return value


def items(value: Any, most: int = MAX_ITEMS) -> tuple[Any, ...]:
    if type(value) is not tuple or len(value) > most:
        fail("shape")
    return value


def fields(value: Any, number: int) -> tuple[Any, ...]:
    """The fields of a record."""
    if type(value) is not tuple or len(value) != number:
        fail("shape")
    return value


def many(check: Check, most: int = MAX_ITEMS) -> Check:
    """Check of a sequence of at most `most` items."""
    return lambda value: tuple([check(item) for item in items(value, most)])


def optional(check: Check) -> Check:
    """Check of a field that may be None."""
    return lambda value: None if value is None else check(value)


def record(kind: Callable[..., M], *checks: Check) -> Callable[[Any], M]:
    """Check of a record: a tuple with one field for each check."""
    return lambda value: kind(*[check(field) for check, field in zip(checks, fields(value, len(checks)), strict=True)])


def codec(kind: Callable[..., M], *checks: Check) -> tuple[Callable[[M], bytes], Callable[[bytes], M]]:
    """Encoder and decoder of a message: an array of the version and one field for each check."""
    checked = record(kind, *checks)
    return lambda message: pack((VERSION, *message)), lambda payload: checked(array(payload, len(checks)))


def named(check: Callable[[str], str], value: Any) -> str:
    if type(value) is not str:
        fail("name")
    try:
        return check(value)
    except NameRefused:
        fail("name")


def digest(value: Any) -> str:
    if type(value) is not str or not _HASH.fullmatch(value):
        fail("name")
    return value


def sampled(value: Any) -> Value:
    """The value of a sample, checked; records of floats, the common case, in one pass."""
    if type(value) is tuple:
        for member in value:
            if type(member) is not float or not -LARGEST <= member <= LARGEST:
                return _odd(value, 0)
        return value
    return _odd(value, 0)


MAX_EVIDENCE: Final = 16_384
"""Bytes of an act that another one carries as evidence: an area of 32 corners has about 1 300."""


def evidence(value: Any) -> bytes:
    """An act as bytes, not read yet."""
    if type(value) is not bytes:
        fail("evidence")
    return value if 0 < len(value) <= MAX_EVIDENCE else fail("oversized")


MAX_COMPONENTS: Final = 16
"""Components of a covariance at most."""


def qualified(certainty: Any, covariance: Any) -> tuple[float, tuple[tuple[float, ...], ...]]:
    """A certainty in [0, 1] and a square covariance, checked."""
    if type(certainty) is not float or not 0.0 <= certainty <= 1.0:
        fail("number")
    if type(covariance) is not tuple or len(covariance) > MAX_COMPONENTS:
        fail("shape")
    for row in covariance:
        if type(row) is not tuple or len(row) != len(covariance):
            fail("shape")
        for component in row:
            if type(component) is not float or not -LARGEST <= component <= LARGEST:
                fail("number")
    return certainty, covariance


def plain_quality(quality: Quality) -> tuple[Any, ...]:
    """The fields of a quality, in floats, as `quality_of` asks for them."""
    made, rows = quality.prediction, [list(map(float, row)) for row in quality.covariance]
    return float(quality.certainty), rows, *(() if made is None else (*made[:2], float(made.weight)))


def quality_of(found: Any) -> Quality:
    """A quality of two fields, or of five if the value is predicted: certainty, covariance, when it was made, branch, weight."""
    if type(found) is not tuple or len(found) not in (2, 5):
        fail("shape")
    certainty, covariance = qualified(*found[:2])
    if len(found) == 2:
        return Quality(certainty, covariance)
    made_us, branch, weight = found[2:]
    instant(made_us)
    if type(branch) is not str or len(branch) > MAX_BRANCH or not branch.isprintable():
        fail("name")
    if type(weight) is not float or not 0.0 <= weight <= 1.0:
        fail("number")
    return Quality(certainty, covariance, Predicted(made_us, branch, weight))


def _odd(value: Any, depth: int) -> Value:
    kind = type(value)
    if kind is float:
        return value if -LARGEST <= value <= LARGEST else fail("number")
    if kind is int:
        return whole(value)
    if kind is bool or (kind is str and len(value) <= MAX_VALUE_TEXT):
        return value
    if value is None:
        return NO_VALUE
    if kind is not tuple:
        fail("type")
    if depth >= MAX_VALUE_DEPTH:
        fail("nesting")
    return tuple([_odd(member, depth + 1) for member in value])
