"""One document from outside, JSON or TOML: decoded with limits, and errors that say which line and key."""

import json
import re
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any, Final, NamedTuple

from dyknow.documents.json_lines import no_constant
from dyknow.documents.places import KeyPath, json_places, shown_path, toml_places
from dyknow.documents.toml_texts import tables_of
from dyknow.model.errors import TextError, TextErrors

LONGEST: Final = 16 * 2**20
"""Most characters of a JSON document."""
MOST_CHARACTERS: Final = 4 * 2**20
"""Most characters of a TOML document."""
MOST_ERRORS: Final = 50


class Notation(NamedTuple):
    """How documents of a kind are written.

    Attributes:
        entry: a key with a value; table: the word for keys with values; header: how a table begins.
        places: offset and width of each key path in a text.
    """

    entry: str
    table: str
    header: Callable[[KeyPath], str]
    places: Callable[[str, Sequence[KeyPath]], list[tuple[int, int]]]


JSON: Final = Notation('"{}": {}', "an object", lambda path: f'"{path[-1]}": {{}}', json_places)
TOML: Final = Notation("{} = {}", "a table", lambda path: f"[{shown_path(path)}]", toml_places)


class Document:
    """One text, decoded, and its errors.

    Args:
        at_once: the first error is raised; else all are noted, and raised by `end`.
    """

    def __init__(self, text: str, file: str, notation: Notation, entries: dict[str, Any], *, at_once: bool) -> None:
        self.text, self.file, self.notation, self.entries, self._at_once = text, file, notation, entries, at_once
        self._noted: list[tuple[KeyPath, str, str]] = []

    def errors(self, *wrong: tuple[KeyPath, str, str]) -> list[TextError]:
        """Errors at paths, or at the nearest keys around them, each a message and a repair, in the order of the text."""
        places = self.notation.places(self.text, [path for path, *_ in wrong])
        found = []
        for (path, message, repair), (offset, width) in sorted(zip(wrong, places, strict=True), key=lambda one: one[1]):
            named = shown_path(path)
            told = message if message.startswith(named) else f"{named}: {message}"
            found.append(TextError.at_offset(self.text, offset, told, width=width, repair=repair, file=self.file))
        return found

    def error(self, path: KeyPath, message: str, repair: str) -> TextError:
        return self.errors((path, message, repair))[0]

    def wrong(self, path: KeyPath, message: str, repair: str) -> None:
        """Raise an error at a path, or note it; many are enough."""
        if self._at_once:
            raise self.error(path, message, repair)
        if len(self._noted) < MOST_ERRORS:
            self._noted.append((path, message, repair))

    @property
    def noted(self) -> int:
        """How many errors there are so far."""
        return len(self._noted)

    def end(self) -> None:
        """Raise TextErrors if anything was noted."""
        if self._noted:
            raise TextErrors(tuple(self.errors(*self._noted)))


def json_document(source: str | bytes, file: str, example: str) -> Document:
    """A JSON object. Bytes are UTF-8, and may begin with the mark of that; errors are raised at once.

    The example is the repair where the document as a whole is wrong.

    Raises:
        TextError: it is too long, no JSON, no object, or has one key twice.
    """
    if len(source) > LONGEST:
        raise TextError(f"more than {LONGEST} characters, the most that is read", repair=example, file=file)
    text = ""
    try:
        text = source.decode("utf-8-sig") if isinstance(source, bytes) else source
        found: Any = json.loads(text, parse_constant=no_constant, object_pairs_hook=_distinct)
    except json.JSONDecodeError as wrong:
        raise TextError.at_offset(text, wrong.pos, f"no JSON: {wrong.msg}", repair=example, file=file) from None
    except RecursionError:
        raise TextError("nested too deep", text=text, repair=example, file=file) from None
    except ValueError as wrong:
        raise TextError(f"no JSON: {wrong}", text=text, repair=example, file=file) from None
    if not isinstance(found, dict):
        raise TextError("the document is a JSON object", text=text, repair=example, file=file)
    return Document(text, file, JSON, found, at_once=True)


def toml_document(text: str, file: str, example: str, most: int = MOST_CHARACTERS) -> Document:
    """A TOML text; errors in it are noted.

    Raises:
        TextErrors: it is longer than `most` characters, or no TOML; the repair is the example.
    """
    line, column = 1, 1
    try:
        if len(text) <= most:
            return Document(text, file, TOML, tables_of(text), at_once=False)
        why, text = f"{len(text)} characters, at most {most} are read", ""
    except (ValueError, RecursionError) as wrong:
        why = "nested too deep" if isinstance(wrong, RecursionError) else f"no TOML: {wrong}"
        if place := re.search(r"line (\d+), column (\d+)", why):
            line, column = int(place[1]), int(place[2])
        elif "end of document" in why:
            lines = text.splitlines() or [""]
            line, column = len(lines), len(lines[-1]) + 1
        why = re.sub(r" \(at [^)]*\)", "", why)
    raise TextErrors((TextError(why, text=text, line=line, column=column, repair=example, file=file),))


def _distinct(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    made = dict(pairs)
    if len(made) < len(pairs):
        twice = Counter(name for name, _ in pairs).most_common(1)[0][0]
        raise ValueError(f"key {twice!r} stands twice in one object")
    return made
