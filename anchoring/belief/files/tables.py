"""Tables of TOML, read key by key; every error is collected with the line in which the key stands."""

import re
import tomllib
from collections.abc import Mapping, Sequence
from math import inf
from typing import Any, Final

import numpy as np

from anchoring.belief.arrays import Floats
from dyknow.model.errors import TextError, TextErrors, did_you_mean
from dyknow.model.toml_texts import tables_of

MOST_CHARACTERS: Final = 4 * 2**20
MOST_ERRORS: Final = 50
_LARGEST: Final = 1e150
_HEADER = re.compile(r"\s*\[{1,2}\s*(.+?)\s*\]{1,2}\s*(?:#.*)?$")
_PART = re.compile(r"\"([^\"]*)\"|'([^']*)'|([^.\s\"']+)")


class TomlText:
    """One text and its errors."""

    def __init__(self, text: str, file: str) -> None:
        self.text, self.file = text, file
        self.errors: list[TextError] = []
        self._lines: dict[tuple[str, ...], int] | None = None

    def root(self, example: str) -> "TomlTable":
        """The text as a table; raises TextErrors if it is none."""
        if len(self.text) > MOST_CHARACTERS:
            raise TextErrors((self._error(f"{len(self.text)} characters, {MOST_CHARACTERS} are allowed", example),))
        try:
            return TomlTable(self, (), tables_of(self.text))
        except tomllib.TOMLDecodeError as wrong:
            place = re.search(r"line (\d+), column (\d+)", str(wrong))
            line, column = (
                (int(place[1]), int(place[2]))
                if place
                else (self.text.count("\n") + 1 if "end of document" in str(wrong) else 1, 1)
            )
            message = re.sub(r" \(at .*\)", "", str(wrong))
            raise TextErrors((self._error(f"no TOML: {message}", example, line, column),)) from None
        except (RecursionError, ValueError) as error:
            why = "nested too deep" if isinstance(error, RecursionError) else f"no TOML: {error}"
            raise TextErrors((self._error(why, example),)) from None

    def wrong(self, path: Sequence[str], message: str, repair: str) -> None:
        """Note an error at a key; further ones are not noted."""
        if len(self.errors) >= MOST_ERRORS:
            return
        line = self._line(tuple(path))
        name = path[-1] if path else ""
        written = self.text.splitlines()[line - 1] if self.text else ""
        column = max(0, written.find(name)) + 1
        place = f"{'.'.join(path)}: " if path else ""
        self.errors.append(self._error(f"{place}{message}", repair, line, column, max(1, len(name))))

    def end(self) -> None:
        """Raise TextErrors if anything is wrong."""
        if self.errors:
            ordered = sorted(self.errors, key=lambda each: (each.line, each.column))
            raise TextErrors(tuple(ordered[:MOST_ERRORS]))

    def _error(self, message: str, repair: str, line: int = 1, column: int = 1, width: int = 1) -> TextError:
        return TextError(message, text=self.text, line=line, column=column, width=width, repair=repair, file=self.file)

    def _line(self, path: tuple[str, ...]) -> int:
        """Of a key, or of the nearest table around it."""
        if self._lines is None:
            self._lines = _lines(self.text)
        while path and path not in self._lines:
            path = path[:-1]
        return self._lines.get(path, 1)


def _lines(text: str) -> dict[tuple[str, ...], int]:
    """The line of each key that begins one; entries of an array of tables are numbered from 0."""
    lines: dict[tuple[str, ...], int] = {}
    table: tuple[str, ...] = ()
    counts: dict[tuple[str, ...], int] = {}
    for number, line in enumerate(text.splitlines(), start=1):
        if header := _HEADER.match(line):
            table = _parts(header[1])
            for size in range(1, len(table)):
                if table[:size] in counts:
                    table = (*table[:size], str(counts[table[:size]]), *table[size:])
            if line.lstrip().startswith("[["):
                counts[table] = counts.get(table, -1) + 1
                table = (*table, str(counts[table]))
        elif (key := line.partition("=")[0].strip()) and "=" in line and not key.startswith("#"):
            lines.setdefault((*table, *_parts(key)), number)
        lines.setdefault(table, number)
    return lines


def _parts(dotted: str) -> tuple[str, ...]:
    return tuple("".join(each) for each in _PART.findall(dotted))


class TomlTable:
    """One table; a key is taken by reading it, and `end` reports those that are left."""

    def __init__(self, source: TomlText, path: tuple[str, ...], entries: Mapping[str, Any]) -> None:
        self.path, self.entries = path, entries
        self._source, self._taken = source, set[str]()

    def __contains__(self, key: str) -> bool:
        return key in self.entries

    def wrong(self, key: str, message: str, repair: str) -> None:
        """Note an error at a key of the table; at the table itself where it is empty."""
        self._source.wrong((*self.path, key) if key else self.path, message, repair)

    def end(self, *known: str) -> None:
        """Report the keys that mean nothing here."""
        for key in self.entries:
            if key not in self._taken:
                hint = did_you_mean(key, sorted({*self._taken, *known}))
                self.wrong(key, f"unknown key.{hint}", "a key that is known, or leave it out")

    def get(self, key: str) -> Any:
        self._taken.add(key)
        return self.entries.get(key)

    def number(
        self, key: str, default: float | None, low: float = -inf, high: float = inf, *, above: bool = False
    ) -> float:
        """A finite number from `low`, itself excluded with `above`, to `high`; `default` None: it has to be given."""
        value = self.get(key)
        if value is None and default is not None:
            return default
        example = f"{key} = {_example(low, high, above=above)}"
        if not is_finite(value):
            self.wrong(key, "is missing" if value is None else f"is a number, got {_shown(value)}", example)
        elif not low <= value <= high or (above and value == low):
            bounds = f"{'above' if above else 'at least'} {low:g}" + (f" and at most {high:g}" if high < inf else "")
            self.wrong(key, f"is {bounds}, got {value:g}", example)
        else:
            return float(value)
        return _example(low, high, above=above) if default is None else default

    def whole(self, key: str, default: int, low: int, high: int) -> int:
        value = self.get(key)
        if value is None:
            return default
        if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
            self.wrong(key, f"is a whole number from {low} to {high}, got {_shown(value)}", f"{key} = {default}")
            return default
        return value

    def flag(self, key: str, *, default: bool = False) -> bool:
        value = self.get(key)
        if value is None or isinstance(value, bool):
            return default if value is None else value
        self.wrong(key, f"is true or false, got {_shown(value)}", f"{key} = true")
        return default

    def text(self, key: str, default: str | None, choices: Sequence[str] = ()) -> str:
        """A text, one of `choices` where there are any."""
        value = self.get(key)
        if value is None and default is not None:
            return default
        example = f'{key} = "{(*choices, default or "name")[0]}"'
        if not isinstance(value, str) or not value:
            self.wrong(key, "is missing" if value is None else f"is a text, got {_shown(value)}", example)
        elif choices and value not in choices:
            self.wrong(key, f"{value!r} is none of {', '.join(choices)}.{did_you_mean(value, choices)}", example)
        else:
            return value
        return default or (choices[0] if choices else "name")

    def texts(self, key: str) -> tuple[str, ...]:
        """A list of different texts."""
        value = self.get(key)
        if value is None:
            return ()
        is_right = isinstance(value, list) and all(isinstance(each, str) and each for each in value)
        if not is_right or len(set(value)) < len(value):
            self.wrong(key, f"is a list of different texts, got {_shown(value)}", f'{key} = ["red", "blue"]')
            return ()
        return tuple(value)

    def numbers(self, key: str, count: int | None = None) -> Floats | None:
        """A list of finite numbers, or a single one; None where it is not given, or wrong."""
        value = self.get(key)
        if value is None:
            return None
        found = _array(value if isinstance(value, list) else [value], 1)
        if found is None or (count is not None and len(found) != count):
            want = "numbers" if count is None else f"{count} number{'s' * (count != 1)}"
            shown = ", ".join(["1.0"] * (count or 2))
            self.wrong(key, f"is a list of {want}, got {_shown(value)}", f"{key} = [{shown}]")
            return None
        return found

    def matrix(self, key: str, width: int) -> Floats | None:
        """Rows of numbers, (R, width); None where it is not given, or wrong."""
        value = self.get(key)
        if value is None:
            return None
        found = _array(value, 2)
        if found is None or found.shape[1] != width:
            row = f"[{', '.join(['1.0'] * width)}]"
            self.wrong(key, f"is a list of rows of {width} numbers, got {_shown(value)}", f"{key} = [{row}, ...]")
            return None
        return found

    def table(self, key: str) -> "TomlTable":
        """A table below this one; empty where it is not given, or wrong."""
        value = self.get(key)
        if value is not None and not isinstance(value, dict):
            self.wrong(key, f"is a table, got {_shown(value)}", f"[{'.'.join((*self.path, key))}]")
            value = None
        return TomlTable(self._source, (*self.path, key), value or {})

    def tables(self, key: str) -> dict[str, "TomlTable"]:
        """The tables below a table, by name."""
        above = self.table(key)
        return {name: above.table(name) for name in above.entries}

    def list(self, key: str) -> list["TomlTable"]:
        """An array of tables."""
        value = self.get(key)
        if value is None:
            return []
        if not isinstance(value, list) or not all(isinstance(each, dict) for each in value):
            self.wrong(key, f"is a list of tables, got {_shown(value)}", f"[[{'.'.join((*self.path, key))}]]")
            return []
        return [TomlTable(self._source, (*self.path, key, str(index)), each) for index, each in enumerate(value)]

    def shares(self, key: str, values: Sequence[str], what: str, *, rest: bool = False) -> Floats | None:
        """Probabilities by name, (K,), that sum to 1; with `rest` to at most 1, and the others share what remains."""
        if key not in self.entries:
            return None
        table = self.table(key)
        found = np.zeros(len(values))
        for name in table.entries:
            if name in values:
                found[values.index(name)] = table.number(name, 0.0, 0.0, 1.0)
            else:
                table.get(name)
                table.wrong(name, f"is no {what}.{did_you_mean(name, values)}", "one that is declared")
        total = float(found.sum())
        others = np.array([name not in table.entries for name in values])
        if rest and total < 1.0 and others.any():
            found[others] = (1.0 - total) / others.sum()
            total = 1.0
        if abs(total - 1.0) > 1e-6:
            self.wrong(key, f"probabilities sum to {total:g}, not to 1", "probabilities that sum to 1")
            return None
        return found / total


def is_finite(value: Any) -> bool:
    """Whether it is a number, and no square of it is too large."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= _LARGEST


def _array(value: Any, dimensions: int) -> Floats | None:
    if not isinstance(value, list) or not value:
        return None
    if dimensions == 1:
        return np.array(value, dtype=np.float64) if all(map(is_finite, value)) else None
    if any(not isinstance(row, list) or len(row) != len(value[0]) or not all(map(is_finite, row)) for row in value):
        return None
    return np.array(value, dtype=np.float64)


def _example(low: float, high: float, *, above: bool) -> float:
    if high < inf:
        return (low + high) / 2.0 if low > -inf else high
    return 1.0 if low == -inf else low + above


def _shown(value: Any) -> str:
    text = repr(value) if not isinstance(value, int) or abs(value) <= _LARGEST else "a number beyond all bounds"
    return text if len(text) <= 40 else f"{text[:37]}..."
