"""What semantic labels mean on one platform: those that every platform has, those of a file, those of a specification.

Platforms of a group agree on labels by having the same definitions (thesis 9.3.3); `agreement.py` compares them.
"""

import re
import tomllib
from collections.abc import Iterable, Iterator
from functools import cache
from importlib.resources import files
from typing import Any, Final

from dyknow.model.errors import Refused, TextError, TextErrors, UnknownLabel
from dyknow.model.semantic_labels import BUILT_IN, SemanticLabel, definition_errors, plain
from dyknow.model.toml_texts import tables_of
from dyknow.model.values import Field, Sort
from federation.messages.descriptions import MAX_DEFINITIONS, LabelEntry

MAX_FILE: Final = 128 * 1024
"""Characters of an ontology file."""
MAX_OWN_CHARACTERS: Final = 24_000
"""Of their names, sorts and meanings: what a platform says of itself is one message."""
MAX_ERRORS: Final = 50
_KEYS = ("sort", "unit", "fields", "meaning")
_HEADER = re.compile(r"\s*\[\s*[\"']?([^\]\"']*)[\"']?\s*\]")


class Ontology:
    """Semantic labels by name; `ontology[name]` raises UnknownLabel for an unknown one. A sort has the same fields in all of them."""

    def __init__(self, labels: Iterable[SemanticLabel] = ()) -> None:
        self._labels: dict[str, SemanticLabel] = {}
        for label in labels:
            self._labels[label.name] = label

    def __getitem__(self, name: str) -> SemanticLabel:
        try:
            return self._labels[name]
        except KeyError:
            raise UnknownLabel(name, tuple(self._labels)) from None

    def __contains__(self, name: object) -> bool:
        return name in self._labels

    def __iter__(self) -> Iterator[str]:
        return iter(self._labels)

    def __len__(self) -> int:
        return len(self._labels)

    def copy(self) -> "Ontology":
        """One that can be changed without changing this one."""
        return Ontology(self._labels.values())

    def get(self, name: str) -> SemanticLabel | None:
        return self._labels.get(name)

    def entry(self, name: str, period_us: int = 0) -> LabelEntry:
        """How a platform offers a label, with samples so often."""
        label = self[name]
        return LabelEntry(label=name, sort=label.sort.name, type_hash=label.type_hash, period_us=period_us)

    def definitions(self) -> tuple[SemanticLabel, ...]:
        """All of them."""
        return tuple(self._labels.values())

    def own(self) -> tuple[SemanticLabel, ...]:
        """Those that not every platform has anyway."""
        return tuple(label for label in self._labels.values() if label.place != BUILT_IN)

    def sorts(self) -> dict[str, Sort]:
        """The sorts of the labels, by name."""
        return {label.sort.name: label.sort for label in self._labels.values()}

    def define(self, label: SemanticLabel) -> bool:
        """Add a label; False if it is there already, with the same definition.

        Raises:
            Refused: it is no definition, the name or its sort means something else here, or there are too many.
        """
        for message, repair in definition_errors(label):
            raise Refused(f"{message}; write {repair}", "other-sort")
        known = self._labels.get(label.name)
        if known == label:
            return False
        if known is not None:
            raise Refused(f"{label.name} is {known} already ({known.place})", "taken")
        other = next((each for each in self._labels.values() if each.sort.name == label.sort.name), None)
        if other is not None and other.sort != label.sort:
            raise Refused(
                f"the sort {label.sort.name} is {other.sort} already: of {other.name} ({other.place})", "other-sort"
            )
        own = (*self.own(), label)
        size = sum(len(each.name) + len(str(each)) for each in own)
        if len(own) > MAX_DEFINITIONS or size > MAX_OWN_CHARACTERS:
            raise Refused(
                f"a platform has at most {MAX_DEFINITIONS} labels of its own, of {MAX_OWN_CHARACTERS} characters together; "
                f"with {label.name} there are {len(own)}, of {size}",
                "too-many",
            )
        self._labels[label.name] = label
        return True

    def withdraw(self, name: str) -> None:
        """It is defined no longer."""
        self._labels.pop(name, None)

    def extended(self, text: str, file: str = "") -> "Ontology":
        """This ontology with the labels of a TOML text; what both have, must be the same.

        Raises:
            TextErrors: all that is wrong with the text: it is not TOML, a label in it is not described as in
                ontology.toml, or means something else already.
        """
        return self._with(text, file, "")

    def _with(self, text: str, file: str, place: str) -> "Ontology":
        if len(text) > MAX_FILE:
            message = f"{len(text)} characters; an ontology has at most {MAX_FILE}"
            raise TextErrors((TextError(message, file=file, repair="the labels that are shared, and no others"),))
        tables, extended, errors = read_toml(text, file), self.copy(), list[TextError]()
        for name, entry in tables.items():
            found = _Table(name, entry, text, file).read()
            if isinstance(found, SemanticLabel):
                line = wrong_table("", name, text, file).line
                label = SemanticLabel(name, found.sort, found.meaning, place or f"{file}:{line}")
                try:
                    extended.define(label)
                except Refused as refused:
                    errors.append(
                        wrong_table(refused.reason, name, text, file, repair="the same definition, or another name")
                    )
            else:
                errors += found
            if len(errors) >= MAX_ERRORS:
                break
        if errors:
            raise TextErrors(tuple(sorted(errors[:MAX_ERRORS], key=lambda error: (error.line, error.column))))
        return extended


@cache
def default_ontology() -> Ontology:
    """The labels of ontology.toml, which comes with this package. All share it: `copy` it to add labels."""
    text = files("federation.sharing").joinpath("ontology.toml").read_text("utf-8")
    return Ontology()._with(text, "ontology.toml", BUILT_IN)  # noqa: SLF001  (its own)


def read_toml(text: str, file: str) -> dict[str, Any]:
    """The tables of a TOML text; raises TextErrors at the place where it is none."""
    try:
        return tables_of(text)
    except tomllib.TOMLDecodeError as wrong:
        place = re.search(r"line (\d+), column (\d+)", str(wrong))
        lines = text.splitlines() or [""]
        line, column = (int(place[1]), int(place[2])) if place else (len(lines), len(lines[-1]) + 1)
        said = re.sub(r" \(at (line \d+, column \d+|end of document)\)", "", str(wrong))
        repair = "[gas-level], then sort, unit and meaning, one a line"
        error = TextError(f"not TOML: {said}", text=text, line=line, column=column, file=file, repair=repair)
    except RecursionError:
        error = TextError("nested too deep", text=text, file=file, repair="tables without lists in lists")
    raise TextErrors((error,)) from None


def wrong_table(message: str, name: str, text: str, file: str, *, key: str = "", repair: str = "") -> TextError:
    """The error about a table, at its header, or at one of its keys."""
    inside, found, width = False, (1, 1), max(1, len(name))
    for number, line in enumerate(text.splitlines(), start=1):
        header = _HEADER.match(line)
        if header:
            inside = header[1].strip() == name
            if inside:
                found = number, line.find(name) + 1
        elif inside and key and re.match(rf"\s*[\"']?{re.escape(key)}[\"']?\s*=", line):
            found, width = (number, line.find(key) + 1), len(key)
    if found == (1, 1) and name in text:
        at = text.find(name)
        found = text.count("\n", 0, at) + 1, at - text.rfind("\n", 0, at)
    return TextError(message, text=text, line=found[0], column=found[1], width=width, repair=repair, file=file)


class _Table:
    """One table of an ontology file."""

    def __init__(self, name: str, entry: Any, text: str, file: str) -> None:
        self._name, self._entry, self._text, self._file = name, entry, text, file
        self._shown = plain(name)
        self._errors: list[TextError] = []

    def read(self) -> SemanticLabel | list[TextError]:
        """The label, or all that is wrong with it."""
        if not isinstance(self._entry, dict):
            self._wrong(f"{self._shown} is no label", "", f"[{self._shown}], with sort, unit and meaning below it")
            return self._errors
        for key in self._entry:
            if key not in _KEYS:
                self._wrong(f"a label has no {key!r}", key, f"one of {', '.join(_KEYS)}")
        sort, meaning = self._text_of("sort", '"gas"'), self._text_of("meaning", '"gas in the air around the platform"')
        unit, fields = self._entry.get("unit"), self._entry.get("fields")
        if (unit is None) == (fields is None):
            said = "has both unit and fields" if unit is not None else "has neither unit nor fields"
            self._wrong(f"{self._shown} {said}", "unit", 'unit = "ppm", or fields = { north_m_s = "m/s" }')
        elif unit is not None and not isinstance(unit, str):
            self._wrong(f"the unit of {self._shown} is no text", "unit", 'unit = "ppm"')
        elif fields is not None and not (isinstance(fields, dict) and fields):
            self._wrong(f"the fields of {self._shown} are no table", "fields", 'fields = { north_m_s = "m/s" }')
        parts = []
        for field, of in fields.items() if isinstance(fields, dict) else ():
            if isinstance(of, str):
                parts.append(Field(field, of))
            else:
                self._wrong(f"the field {plain(field)} of {self._shown} has no unit", "fields", f'{field} = "m/s"')
        if self._errors:
            return self._errors
        label = SemanticLabel(self._name, Sort(sort, tuple(parts), unit=unit or ""), meaning)
        for message, repair in definition_errors(label):
            self._wrong(message, "", repair)
        return self._errors or label

    def _text_of(self, key: str, example: str) -> str:
        found = self._entry.get(key)
        if not isinstance(found, str):
            what = f"has no {key}" if found is None else f"has a {key} that is no text"
            self._wrong(f"{self._shown} {what}", key, f"{key} = {example}")
            return ""
        return found

    def _wrong(self, message: str, key: str, repair: str) -> None:
        self._errors.append(wrong_table(message, self._name, self._text, self._file, key=key, repair=repair))
