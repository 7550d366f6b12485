"""Semantic labels: names that mean the same on every platform of a group (thesis 9.3.3).

A definition is a name, a sort with its units, and a sentence. Two definitions are the same if all three are: their hash
says so. Where it was written is no part of it.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from hashlib import sha256
from typing import Final

from dyknow.model.sample import Value
from dyknow.model.values import Sort

LABEL_NAME: Final = re.compile(r"(?=.{1,64}\Z)[a-z][a-z0-9]*(-[a-z0-9]+)*")
"""Of a semantic label, and of a sort that is shared."""
FIELD_NAME: Final = re.compile(r"(?=.{1,32}\Z)[a-z][a-z0-9]*(_[a-z0-9]+)*")
UNIT_NAME: Final = re.compile(r"[A-Za-z0-9%°µ/*^.·²³_-]{1,24}")
BUILT_IN: Final = "built in"
"""The place of definitions that every platform has."""
MAX_FIELDS: Final = 16
MAX_MEANING: Final = 200


@dataclass(frozen=True, slots=True)
class SemanticLabel:
    """One word of an ontology.

    Attributes:
        sort: of its values, with fields and units.
        meaning: one sentence for users.
        place: where it was defined, `lab.toml:3`; "built in", or empty if another platform defined it.
    """

    name: str
    sort: Sort
    meaning: str
    place: str = field(default="", compare=False)

    @property
    def type_hash(self) -> str:
        """Eight hexadecimal digits that two platforms compare before they exchange the label.

        The meaning of a built-in label may be worded better in a later version, and stays the same.
        """
        return _hash(self.name, self.sort, "" if self.place == BUILT_IN else f" {self.meaning}")

    def check(self, value: Value) -> None:
        """Raises SortError if `value` is not of the sort, nor `no_value`."""
        self.sort.check(value)

    def __str__(self) -> str:
        return f'{self.sort} "{self.meaning}"'


@lru_cache(maxsize=4096)
def _hash(name: str, sort: Sort, meaning: str) -> str:
    fields = ",".join(f"{part.name}:{part.unit}" for part in sort.fields) or sort.unit
    return sha256(f"{name} {sort.name}({fields}){meaning}".encode()).hexdigest()[:8]


def definition_errors(label: SemanticLabel) -> Iterator[tuple[str, str]]:
    """The errors of a definition, with repairs; every platform would refuse it."""
    if not LABEL_NAME.fullmatch(label.name):
        yield (
            f"{plain(label.name)} is no semantic label",
            "lower-case words with hyphens, at most 64 characters: gas-level",
        )
    yield from sort_errors(label.sort)
    if not label.meaning.strip() or label.meaning != label.meaning.strip():
        yield f"{plain(label.name)} has no meaning", "one sentence: gas in the air around the platform"
    elif len(label.meaning) > MAX_MEANING:
        yield f"the meaning has {len(label.meaning)} characters", f"at most {MAX_MEANING}"
    elif not label.meaning.isprintable():
        yield "the meaning has characters that are not shown", "one line of plain text"


def sort_errors(sort: Sort) -> Iterator[tuple[str, str]]:
    """The same of a sort that is to be shared."""
    if not LABEL_NAME.fullmatch(sort.name):
        yield f"{plain(sort.name)} is no name of a sort", "lower-case words with hyphens, at most 64 characters: gas"
    if sort.fields and sort.unit:
        yield f"{plain(sort.name)} has both a unit and fields", "a unit for each field, and none for all"
    if len(sort.fields) > MAX_FIELDS:
        yield f"{len(sort.fields)} fields are too many", f"at most {MAX_FIELDS}"
    names = [part.name for part in sort.fields]
    for part in sort.fields[:MAX_FIELDS]:
        if not FIELD_NAME.fullmatch(part.name):
            yield (
                f"{plain(part.name)} is no name of a field",
                "lower-case words with _, at most 32 characters: north_m_s",
            )
        elif names.count(part.name) > 1:
            yield f"two fields are called {part.name}", "names of their own"
    for unit in (part.unit or "1" for part in sort.fields[:MAX_FIELDS]) if sort.fields else (sort.unit,):
        if not UNIT_NAME.fullmatch(unit):
            yield f"{plain(unit)!r} is no unit", "ppm, m/s, percent, bool, text; 1 for what has none"


def plain(text: str) -> str:
    """A name that may be anything, to be shown in a message."""
    text = "".join(char if char.isprintable() else repr(char)[1:-1] for char in text[:41])
    return text if len(text) <= 40 else f"{text[:37]}..."
