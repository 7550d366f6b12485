"""Where key paths stand in a text of JSON or TOML: offset and width, of the deepest part of a path that is found."""

import json
import re
from collections.abc import Iterator, Sequence
from typing import TypeAlias

from dyknow.model.semantic_labels import plain

KeyPath: TypeAlias = tuple[str | int, ...]
_TOKEN = re.compile(r'"(?:[^"\\]|\\.)*"|[{}\[\],:]|[^\s{}\[\],:"]+')
_HEADER = re.compile(r"\s*\[{1,2}\s*(.+?)\s*\]{1,2}\s*(?:#.*)?$")
_PART = re.compile(r"\"([^\"]*)\"|'([^']*)'|([^.\s\"']+)")


def shown_path(path: KeyPath) -> str:
    """`hypotheses[3].visible_from.po1`."""
    parts = (f"[{each}]" if isinstance(each, int) else f".{plain(each)}" for each in path)
    return "".join(parts).removeprefix(".")


def json_places(text: str, paths: Sequence[KeyPath]) -> list[tuple[int, int]]:
    """Of the values of paths."""
    return [_json_place(text, path) for path in paths]


def _json_place(text: str, path: KeyPath) -> tuple[int, int]:
    place, deepest = (0, 1), -1
    for reached, offset, width in _values(text):
        if len(reached) > deepest and reached == path[: len(reached)]:
            place, deepest = (offset, width), len(reached)
            if deepest == len(path):
                break
    return place


def _values(text: str) -> Iterator[tuple[KeyPath, int, int]]:
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


def toml_places(text: str, paths: Sequence[KeyPath]) -> list[tuple[int, int]]:
    """Of the last keys of paths, or of the nearest tables around them."""
    lines = text.splitlines(keepends=True)
    starts = [0]
    for line in lines:
        starts.append(starts[-1] + len(line))
    numbers = _lines(lines)
    found = []
    for path in paths:
        named = tuple(map(str, path))
        near = next((named[:size] for size in range(len(named), 0, -1) if named[:size] in numbers), ())
        number = numbers.get(near, 0)
        name = next((each for each in reversed(path) if isinstance(each, str)), "")
        column = lines[number].find(name) if number < len(lines) else -1
        found.append((starts[number] + max(column, 0), len(name) if column >= 0 else 1))
    return found


def toml_lines(text: str, paths: Sequence[KeyPath]) -> list[int]:
    """The line of each path, from 1."""
    return [text.count("\n", 0, offset) + 1 for offset, _ in toml_places(text, paths)]


def _lines(lines: Sequence[str]) -> dict[tuple[str, ...], int]:
    """The line of each key that begins one, from 0; entries of an array of tables are numbered."""
    found: dict[tuple[str, ...], int] = {}
    table: tuple[str, ...] = ()
    counts: dict[tuple[str, ...], int] = {}
    for number, line in enumerate(lines):
        if header := _HEADER.match(line):
            table = _parts(header[1])
            for size in range(1, len(table)):
                if table[:size] in counts:
                    table = (*table[:size], str(counts[table[:size]]), *table[size:])
            if line.lstrip().startswith("[["):
                counts[table] = counts.get(table, -1) + 1
                table = (*table, str(counts[table]))
        elif (key := line.partition("=")[0].strip()) and "=" in line and not key.startswith("#"):
            found.setdefault((*table, *_parts(key)), number)
        found.setdefault(table, number)
    return found


def _parts(dotted: str) -> tuple[str, ...]:
    return tuple("".join(each) for each in _PART.findall(dotted))
