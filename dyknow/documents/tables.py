"""Tables of a document, read key by key: a key is taken by reading it, and keys that are not taken mean nothing."""

import json
from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from math import inf
from typing import Any, Final, Self

from dyknow.documents.documents import Document
from dyknow.documents.places import KeyPath, shown_path
from dyknow.model.errors import TextError, did_you_mean

LARGEST: Final = 1e150
"""Numbers are finite, and so are their squares."""


class DocumentTable:
    """One table. A wrong value is an error of the document; where errors are noted, a default is returned."""

    def __init__(self, document: Document, path: KeyPath = (), entries: Mapping[str, Any] | None = None) -> None:
        self.path, self.entries = path, document.entries if entries is None else entries
        self.document, self._taken = document, set[str]()

    def __contains__(self, key: str) -> bool:
        return key in self.entries

    def error(self, key: str | KeyPath, message: str, repair: str) -> TextError:
        """An error at a key of the table, or at a path below it."""
        return self.document.error(self._below(key), message, repair)

    def wrong(self, key: str | KeyPath, message: str, repair: str) -> None:
        """Raise or note an error at a key of the table; at the table itself where it is empty."""
        self.document.wrong(self._below(key or ()), message, repair)

    def _below(self, key: str | KeyPath) -> KeyPath:
        return (*self.path, *((key,) if isinstance(key, str) else key))

    def _expected(self, key: str, what: str, example: str, choices: Sequence[str] = ()) -> None:
        """It is missing, or something else."""
        if key in self.entries:
            value = self.entries[key]
            hint = f".{meant}" if isinstance(value, str) and (meant := _meant(value, choices)) else ""
            self.wrong((key,), f"{what} is expected, got {shown(value)}{hint}", example)
        else:
            self.wrong("", f"{key} is missing.{_meant(key, list(self.entries), 0.85)}", example)

    def _entry(self, key: str, value: object) -> str:
        return self.document.notation.entry.format(key, json.dumps(value))

    def ignored(self) -> tuple[str, ...]:
        """A sentence for each key that was not taken."""
        left, known = [key for key in self.entries if key not in self._taken], sorted(self._taken)
        return tuple(
            f"{shown_path((*self.path, key))} is no known key and is ignored.{_meant(key, known)}" for key in left
        )

    def end(self, *known: str) -> None:
        """Note the keys that mean nothing here."""
        for key in self.entries:
            if key not in self._taken:
                hint = did_you_mean(key, sorted({*self._taken, *known}))
                self.wrong((key,), f"unknown key.{hint}", "a key that is known, or leave it out")

    def get(self, key: str) -> Any:
        self._taken.add(key)
        return self.entries.get(key)

    def is_given(self, key: str) -> bool:
        """Whether it is there; it is taken."""
        self._taken.add(key)
        return key in self.entries

    def number(
        self, key: str, default: float | None, low: float = -inf, high: float = inf, *, above: bool = False
    ) -> float:
        """A finite number from `low`, itself excluded with `above`, to `high`; `default` None: it has to be given."""
        if not self.is_given(key) and default is not None:
            return default
        value: Any = self.entries.get(key)
        example = default or _example(low, high, above=above)
        if is_number(value) and low <= value <= high and not (above and value == low):
            return float(value)
        example = example if abs(example) < inf else _example(low, high, above=above)
        self._expected(key, f"a number{_bounds(low, high, above=above)}", self._entry(key, example))
        return example if default is None else default

    def whole(self, key: str, default: int, low: int, high: int) -> int:
        if not self.is_given(key):
            return default
        value = self.entries[key]
        if is_number(value) and low <= value <= high and value == int(value):
            return int(value)
        self._expected(key, f"a whole number from {low} to {high}", self._entry(key, default))
        return default

    def flag(self, key: str, *, default: bool = False) -> bool:
        if not self.is_given(key):
            return default
        value = self.entries[key]
        if isinstance(value, bool):
            return value
        self._expected(key, "true or false", self._entry(key, default))
        return default

    def text(self, key: str, default: str | None, choices: Sequence[str] = ()) -> str:
        """A text, one of `choices` where there are any; `default` None: it has to be given."""
        if not self.is_given(key) and default is not None:
            return default
        value, usual = self.entries.get(key), default or (*choices, "name")[0]
        if isinstance(value, str) and value and (not choices or value in choices):
            return value
        what = f"one of {', '.join(choices)}" if choices else "a text"
        self._expected(key, what, self._entry(key, usual), choices)
        return usual

    def texts(self, key: str) -> tuple[str, ...]:
        """A list of different texts."""
        if not self.is_given(key):
            return ()
        value = self.entries[key]
        is_right = isinstance(value, list) and all(isinstance(each, str) and each for each in value)
        if is_right and len(set(value)) == len(value):
            return tuple(value)
        self._expected(key, "a list of different texts", self._entry(key, ["red", "blue"]))
        return ()

    def table(self, key: str, example: str = "") -> Self:
        """A table below this one; where it is not given, it is empty, or with an example it is missing."""
        value = self.get(key)
        if not isinstance(value, dict) and (example or value is not None):
            kind = self.document.notation
            self._expected(key, kind.table, example or kind.header((*self.path, key)))
        return self._inside((key,), value if isinstance(value, dict) else {})

    def tables(self, key: str) -> dict[str, Self]:
        """The tables below a table, by name."""
        return self.table(key).named()

    def named(self) -> dict[str, Self]:
        """Its entries that are tables, by name."""
        return {name: self.table(name) for name in self.entries}

    def list(self, key: str, example: str = "") -> "list[Self]":
        """A list of tables; with an example there is at least one."""
        value, kind = self.get(key), self.document.notation.table
        rows = value if isinstance(value, list) else []
        if (example and not rows) or (value is not None and not isinstance(value, list)):
            what = f"a list of {kind.rpartition(' ')[2]}s"
            self._expected(key, what, example or f"[[{shown_path((*self.path, key))}]]")
        for number, each in enumerate(rows):
            if not isinstance(each, dict):
                self.wrong((key, number), f"{kind} is expected, got {shown(each)}", example or f"[[{key}]]")
        return [self._inside((key, at), each) for at, each in enumerate(rows) if isinstance(each, dict)]

    def _inside(self, path: KeyPath, entries: Mapping[str, Any]) -> Self:
        return type(self)(self.document, (*self.path, *path), entries)


def is_number(value: Any) -> bool:
    """A finite number, and no square of it is too large; true and false are none."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= LARGEST


def shown(value: object) -> str:
    """A value as JSON, cut where it is long."""
    try:
        text = json.dumps(value, default=str)
    except ValueError:
        return "a number beyond all bounds"
    return text if len(text) <= 60 else f"{text[:57]}..."


def _meant(key: str, known: Sequence[str], cutoff: float = 0.6) -> str:
    close = get_close_matches(key, known, n=1, cutoff=cutoff)
    return f" Did you mean {close[0]!r}?" if close else ""


def _bounds(low: float, high: float, *, above: bool) -> str:
    if low == -inf and high == inf:
        return ""
    if low > -inf and high < inf and not above:
        return f" from {low:g} to {high:g}"
    return f" {'above' if above else 'of at least'} {low:g}" + (f" and at most {high:g}" if high < inf else "")


def _example(low: float, high: float, *, above: bool) -> float:
    if low < 1.0 < high:
        return 1.0
    if high < inf:
        return (low + high) / 2.0 if low > -inf else high
    return low + above
