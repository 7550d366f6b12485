"""Numbers and times as people write them in formulas: exact, bounded, milliseconds unless a suffix says otherwise."""

import re
from decimal import Decimal
from typing import Final

from dyknow.errors import TextError
from dyknow.instants import parse_duration

_NUMBER = re.compile(r"(?P<number>[0-9]{1,40}(?:\.[0-9]{1,40})?(?:[eE][+-]?[0-9]{1,3})?)(?P<suffix>us|ms|s|min|h)?")
_LARGEST: Final = Decimal(2) ** 63


def is_time(text: str) -> bool:
    """Whether a NUMBER token carries a suffix."""
    return text[-1] in "smnh"


def parse_number(text: str) -> int | float:
    """A number without suffix; an int if it is written as one.

    Raises:
        ValueError: if it is a time, or beyond 63 bits or 40 digits.
    """
    found = _NUMBER.fullmatch(text)
    if found is None or Decimal(found["number"]) >= _LARGEST:
        raise ValueError("the number is too large")
    if found["suffix"]:
        raise ValueError("a time where a number is wanted")
    return int(text) if text.isdecimal() else float(text)


def parse_time_us(text: str) -> int:
    """A time in microseconds; without suffix the number is milliseconds. Nothing is rounded (F9).

    Raises:
        ValueError: if it is no time, too long, or finer than a microsecond.
    """
    try:
        return parse_duration(text)
    except TextError as error:
        raise ValueError(error.message) from None


def number_time_us(number: float) -> int:
    """A bare number read as milliseconds; raises ValueError as `parse_time_us`."""
    return parse_time_us(repr(number))
