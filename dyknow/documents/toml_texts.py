"""TOML from anyone: tables of a text, without keys and numbers that cost far more to read than their length."""

import re
import tomllib
from typing import Any, Final

MOST_PARTS: Final = 32
"""Names that a dotted key has."""
_PART: Final = r"(?:[\w-]{1,200}|\"[^\"\n]{0,200}\"|'[^'\n]{0,200}')[ \t]*\.[ \t]*"
_LONG_KEY = re.compile(rf"(?<![\w.-])(?:{_PART}){{{MOST_PARTS}}}")
MOST_DIGITS: Final = 4300
"""Digits of a number, as Python reads them from a text; to read more takes a hundred bytes of memory each."""
_LONG_NUMBER: Final = rf"(?<![0-9A-Fa-f_])0[xob][0-9A-Fa-f_]{{{MOST_DIGITS}}}|(?<![0-9_])[0-9_]{{{MOST_DIGITS}}}"
_TEXT: Final = (
    r'"""(?:[^"\\]++|\\.|"(?!""))*+(?:"{3,5}|\Z)|"(?:[^"\\\n]++|\\.)*+"?'
    r"|'''(?:[^']++|'(?!''))*+(?:'{3,5}|\Z)|'[^'\n]*+'?|#[^\n]*+"
)
"""A text or a comment, in which digits are no number; an unclosed one extends to the end."""
_TEXTS_AND_LONG_NUMBERS = re.compile(rf"{_TEXT}|(?P<number>{_LONG_NUMBER})", re.DOTALL)


def tables_of(text: str) -> dict[str, Any]:
    """The text as a dictionary.

    Raises:
        tomllib.TOMLDecodeError: it is no TOML, has a key of more parts than `MOST_PARTS`, is nested too deep, or has a number
            of `MOST_DIGITS` digits or more.
    """
    if (long := _LONG_KEY.search(text)) is not None:
        raise _wrong(f"a key of more than {MOST_PARTS} parts", "write tables of their own", text, long.start())
    if (at := _long_number(text)) is not None:
        raise _wrong(f"a number of {MOST_DIGITS} digits or more", "write a shorter one", text, at)
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise tomllib.TOMLDecodeError("nested too deep; write tables of their own") from None
    except tomllib.TOMLDecodeError:
        raise
    except ValueError as wrong:
        raise tomllib.TOMLDecodeError(str(wrong)) from None


def _long_number(text: str) -> int | None:
    """Where the first one begins."""
    if re.search(_LONG_NUMBER, text) is None:
        return None
    return next((each.start() for each in _TEXTS_AND_LONG_NUMBERS.finditer(text) if each["number"]), None)


def _wrong(cause: str, remedy: str, text: str, at: int) -> tomllib.TOMLDecodeError:
    line, column = text.count("\n", 0, at) + 1, at - text.rfind("\n", 0, at)
    return tomllib.TOMLDecodeError(f"{cause} (at line {line}, column {column}); {remedy}")
