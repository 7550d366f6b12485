"""A JSON document from outside: decoded with limits, read key by key, and errors that say which line and key."""

import json
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from difflib import get_close_matches
from math import inf, isfinite
from typing import Any, Final, TypeAlias

from dyknow.model.errors import TextError, did_you_mean
from reasoning.monitoring.json_lines import no_constant

LONGEST: Final = 16 * 2**20
"""Most characters of a document."""
LONGEST_NAME: Final = 256
JsonPath: TypeAlias = tuple[str | int, ...]
_TOKEN = re.compile(r'"(?:[^"\\]|\\.)*"|[{}\[\],:]|[^\s{}\[\],:"]+')


class JsonDocument:
    """One document and its root object. Bytes are UTF-8, and may begin with the mark of that.

    Args:
        example: shown as the repair where the document as a whole is wrong.

    Raises:
        TextError: it is too long, no JSON, no object, or has one key twice.
    """

    def __init__(self, source: str | bytes, file: str, example: str) -> None:
        self.file, self.text, self.ignored = file, "", list[str]()
        if len(source) > LONGEST:
            raise self.error((), f"more than {LONGEST} characters, the most that is read", example)
        try:
            self.text = source.decode("utf-8-sig") if isinstance(source, bytes) else source
            found: Any = json.loads(self.text, parse_constant=no_constant, object_pairs_hook=_distinct)
        except json.JSONDecodeError as wrong:
            raise TextError.at_offset(
                self.text, wrong.pos, f"no JSON: {wrong.msg}", repair=example, file=file
            ) from None
        except RecursionError:
            raise self.error((), "nested too deep", example) from None
        except ValueError as wrong:
            raise self.error((), f"no JSON: {wrong}", example) from None
        if not isinstance(found, dict):
            raise self.error((), "the document is a JSON object", example)
        self.root = JsonTable(self, (), found)

    def error(self, path: JsonPath, message: str, repair: str) -> TextError:
        """An error at the value of a path, or at the nearest value around it."""
        offset, width = place_of(self.text, path)
        named = shown_path(path)
        told = f"{named}: {message}" if named else message
        return TextError.at_offset(self.text, offset, told, width=width, repair=repair, file=self.file)


def shown_path(path: JsonPath) -> str:
    """`hypotheses[3].visible_from.po1`."""
    parts = (f"[{each}]" if isinstance(each, int) else f".{each}" for each in path)
    return "".join(parts).removeprefix(".")


def place_of(text: str, path: JsonPath) -> tuple[int, int]:
    """Offset and width of the value of a path in a JSON text, or of the deepest part of it that there is."""
    place, deepest = (0, 1), -1
    for reached, offset, width in _values(text):
        if len(reached) > deepest and reached == path[: len(reached)]:
            place, deepest = (offset, width), len(reached)
            if deepest == len(path):
                break
    return place


def _values(text: str) -> Iterator[tuple[JsonPath, int, int]]:
    """Every value of a JSON text that can be read: its path, offset and width of its first token."""
    path: list[str | int] = []
    is_key = False
    for token in _TOKEN.finditer(text):
        written = token[0]
        if written in "]}":
            path and path.pop()
        elif written == ",":
            if path and isinstance(path[-1], int):
                path[-1] += 1
            else:
                is_key = True
        elif written == ":":
            is_key = False
        elif is_key:
            path[-1:] = [_name(written)]
        else:
            yield tuple(path), token.start(), len(written)
            if written in "[{":
                path.append(0 if written == "[" else "")
            is_key = written == "{"


def _name(quoted: str) -> str:
    try:
        return str(json.loads(quoted))
    except ValueError:
        return quoted


def _distinct(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    made = dict(pairs)
    if len(made) < len(pairs):
        twice = Counter(name for name, _ in pairs).most_common(1)[0][0]
        raise ValueError(f"key {twice!r} stands twice in one object")
    return made


class JsonTable:
    """One object of a document; a key is taken by reading it."""

    def __init__(self, document: JsonDocument, path: JsonPath, entries: Mapping[str, Any]) -> None:
        self.path, self.entries = path, entries
        self._document, self._taken = document, set[str]()

    def __contains__(self, key: str) -> bool:
        return key in self.entries

    def error(self, key: str | JsonPath, message: str, repair: str) -> TextError:
        """An error at a key of the table, or at a path below it."""
        return self._document.error((*self.path, *((key,) if isinstance(key, str) else key)), message, repair)

    def ignored(self) -> tuple[str, ...]:
        """A sentence for each key that was not taken."""
        left = [key for key in self.entries if key not in self._taken]
        known = sorted(self._taken)
        return tuple(
            f"{shown_path((*self.path, key))} is no known key and is ignored.{_meant(key, known)}" for key in left
        )

    def get(self, key: str) -> Any:
        self._taken.add(key)
        return self.entries.get(key)

    def number(self, key: str, default: float, low: float = -inf, high: float = inf) -> float:
        """A finite number from `low` to `high`."""
        value = self.get(key)
        if value is None and key not in self.entries:
            return default
        if not is_number(value) or not low <= value <= high:
            raise self.error(
                key, f"a number from {low:g} to {high:g} is expected, got {shown(value)}", f'"{key}": {default:g}'
            )
        return float(value)

    def flag(self, key: str, *, default: bool) -> bool:
        """True or false."""
        value = self.get(key)
        if value is None and key not in self.entries:
            return default
        if not isinstance(value, bool):
            raise self.error(key, f"true or false is expected, got {shown(value)}", f'"{key}": {str(default).lower()}')
        return value

    def choice(self, key: str, default: str, allowed: Sequence[str]) -> str:
        """One of `allowed`."""
        value = self.get(key)
        if value is None and key not in self.entries:
            return default
        if value not in allowed:
            hint = did_you_mean(value, allowed) if isinstance(value, str) else ""
            message = f"one of {', '.join(allowed)} is expected, got {shown(value)}.{hint}"
            raise self.error(key, message, f'"{key}": "{default or allowed[0]}"')
        return str(value)

    def table(self, key: str, example: str, *, is_needed: bool = True) -> "JsonTable":
        """An object; empty where it is not needed and not there."""
        value = self.get(key)
        if value is None and not is_needed:
            value = {}
        if not isinstance(value, dict):
            raise self._lacking(key, "an object", example)
        return JsonTable(self._document, (*self.path, key), value)

    def tables(self, key: str, example: str) -> "list[JsonTable]":
        """A list of objects, at least one."""
        value = self.get(key)
        if not isinstance(value, list) or not value:
            raise self._lacking(key, "a list of objects", example)
        for number, each in enumerate(value):
            if not isinstance(each, dict):
                raise self.error((key, number), f"an object is expected, got {shown(each)}", example)
        return [JsonTable(self._document, (*self.path, key, number), each) for number, each in enumerate(value)]

    def _lacking(self, key: str, what: str, example: str) -> TextError:
        if key in self.entries:
            return self.error(key, f"{what} is expected, got {shown(self.entries[key])}", example)
        return self.error((), f"{key} is missing.{_meant(key, list(self.entries))}", example)


def is_number(value: object) -> bool:
    """A finite number; true and false are none."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    try:
        return isfinite(value)
    except OverflowError:
        return False


def shown(value: object) -> str:
    """A value as JSON, cut where it is long."""
    text = json.dumps(value, default=str)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _meant(key: str, known: Sequence[str]) -> str:
    close = get_close_matches(key, known, n=1, cutoff=0.6)
    return f" Did you mean {close[0]!r}?" if close else ""
