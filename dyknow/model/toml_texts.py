"""TOML from anyone: tables of a text, without the keys whose reading costs the square of their length."""

import re
import tomllib
from typing import Any, Final

MOST_PARTS: Final = 32
"""Names that a dotted key has."""
_PART: Final = r"(?:[\w-]{1,200}|\"[^\"\n]{0,200}\"|'[^'\n]{0,200}')[ \t]*\.[ \t]*"
_LONG_KEY = re.compile(rf"(?<![\w.-])(?:{_PART}){{{MOST_PARTS}}}")


def tables_of(text: str) -> dict[str, Any]:
    """The text as a dictionary.

    Raises:
        tomllib.TOMLDecodeError: it is no TOML, has a key of more parts than `MOST_PARTS`, is nested too deep, or has a number
            that is too long.
    """
    long = _LONG_KEY.search(text)
    if long is not None:
        line = text.count("\n", 0, long.start()) + 1
        column = long.start() - text.rfind("\n", 0, long.start())
        raise tomllib.TOMLDecodeError(
            f"a key of more than {MOST_PARTS} parts (at line {line}, column {column}); write tables of their own"
        )
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise tomllib.TOMLDecodeError("nested too deep; write tables of their own") from None
    except tomllib.TOMLDecodeError:
        raise
    except ValueError as wrong:
        raise tomllib.TOMLDecodeError(str(wrong)) from None
