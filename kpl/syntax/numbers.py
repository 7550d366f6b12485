"""Numbers and times as users write them in formulas: exact, bounded, milliseconds unless a suffix says otherwise."""

import re
from decimal import Decimal
from typing import Final

from dyknow.model.errors import TextError
from dyknow.model.instants import US_PER_MS, US_PER_UNIT, parse_duration

_NUMBER = re.compile(r"(?P<number>[0-9]{1,40}(?:\.[0-9]{1,40})?(?:[eE][+-]?[0-9]{1,3})?)(?P<suffix>us|ms|s|min|h)?")
_LARGEST: Final = Decimal(2) ** 63
_LONGEST_MS: Final = 2**53


def is_time(text: str) -> bool:
    """Whether a NUMBER token carries a suffix."""
    return text[-1] in "smnh"


def parse_number(text: str) -> int | float:
    """A number without suffix; an int if it is written as one.

    Raises:
        TextError: if it is a time, or beyond 63 bits or 40 digits.
    """
    found = _NUMBER.fullmatch(text)
    if found is None or Decimal(found["number"]) >= _LARGEST:
        raise TextError("the number is too large")
    if found["suffix"]:
        raise TextError("a time where a number is wanted")
    return int(text) if text.isdecimal() else float(text)


def parse_time_ms(text: str) -> int:
    """A time in whole milliseconds, in which chronicles tick (C1); without suffix the number is milliseconds.

    Raises:
        TextError: if it is no time, beyond 2**53 ms, or finer than a millisecond.
    """
    found = _NUMBER.fullmatch(text)
    ms = Decimal(found["number"]) * US_PER_UNIT[found["suffix"] or "ms"] / US_PER_MS if found else None
    if ms is None or ms > _LONGEST_MS:
        raise TextError(f"a time is at most {_LONGEST_MS} ms")
    if ms != int(ms):
        raise TextError(f"chronicles tick in milliseconds, {text} is finer")
    return int(ms)


def number_time_us(number: float) -> int:
    """A bare number read as milliseconds; raises TextError as `parse_duration`."""
    return parse_duration(repr(number))
