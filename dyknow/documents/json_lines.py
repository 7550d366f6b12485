"""Lines of JSON from outside: decoded one by one, with limits, and errors that say where."""

import json
from collections.abc import Callable
from functools import lru_cache
from typing import Any, Final

from dyknow.model.errors import TextError

LIMIT_LINE: Final = 1024 * 1024
"""Most characters of a line, or bytes."""
LATEST_MS: Final = 2**53
"""No time is later, or earlier than this before 0."""


def no_constant(name: str) -> Any:
    """NaN and the infinities are no JSON."""
    raise ValueError(f"{name} is no value")


@lru_cache(maxsize=16)
def _decoder(constant: Callable[[str], Any]) -> json.JSONDecoder:
    """One for all lines: to make one takes as long as to decode a line."""
    return json.JSONDecoder(parse_constant=constant)


class JsonLine:
    """One line, decoded: `record` is its object. Bytes are UTF-8, and may begin with the mark of that.

    Args:
        what: the name of a line's content, `a state`; `example` shows one.
        constant: the replacement of NaN, Infinity and -Infinity, which are no JSON.

    Raises:
        TextError: it is too long, no JSON, or no object.
    """

    def __init__(
        self,
        line: str | bytes,
        number: int,
        file: str,
        what: str,
        example: str,
        constant: Callable[[str], Any] = no_constant,
    ) -> None:
        self._number, self._file, self._what = number, file, what
        if len(line) > LIMIT_LINE:
            raise self.error(f"the line is longer than {LIMIT_LINE} characters", "one JSON object a line")
        try:
            text = line.decode("utf-8-sig") if isinstance(line, bytes) else line
            record: Any = _decoder(constant).decode(text)
        except (ValueError, RecursionError) as error:
            raise self.error(f"no JSON: {error}", example) from None
        if not isinstance(record, dict):
            raise self.error(f"{what} is a JSON object", example)
        self.record: dict[str, Any] = record

    def error(self, message: str, repair: str) -> TextError:
        return TextError(message, line=self._number, repair=repair, file=self._file)

    def time_ms(self) -> float:
        """`t_ms`, a number of milliseconds."""
        t_ms = self.record.get("t_ms")
        if isinstance(t_ms, bool) or not isinstance(t_ms, int | float) or not abs(t_ms) <= LATEST_MS:
            raise self.error(f"{self._what} has a time, t_ms, in milliseconds", '{"t_ms": 100, ...}')
        return t_ms
