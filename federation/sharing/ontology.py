"""The meanings of semantic labels on one platform: common ones, those of a file, those of a specification.

Platforms of a group agree on labels by having the same definitions (thesis 9.3.3); `agreement.py` compares them.
"""

from collections.abc import Iterable, Iterator
from functools import cache
from importlib.resources import files
from typing import Final

from dyknow.documents.documents import toml_document
from dyknow.documents.places import toml_lines
from dyknow.documents.tables import DocumentTable
from dyknow.federation.messages.descriptions import MAX_DEFINITIONS, LabelEntry
from dyknow.model.errors import Refused, UnknownLabel
from dyknow.model.semantic_labels import BUILT_IN, SemanticLabel, definition_errors
from dyknow.model.values import Field, Sort

MAX_FILE: Final = 128 * 1024
"""Characters of an ontology file."""
MAX_OWN_CHARACTERS: Final = 24_000
"""Most characters of their names, sorts and meanings: a platform's description is one message."""
EXAMPLE: Final = "[gas-level], then sort, unit and meaning, one a line"


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
        """A copy that can be changed without changing this one."""
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
        """The labels that are not common to all platforms."""
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
        """This ontology with the labels of a TOML text; labels of both must be the same.

        Raises:
            TextErrors: every error of the text: it is not TOML, a label in it is not described as in ontology.toml, or
                means something else already.
        """
        return self._with(text, file, "")

    def _with(self, text: str, file: str, place: str) -> "Ontology":
        document, extended = toml_document(text, file, EXAMPLE, MAX_FILE), self.copy()
        root = DocumentTable(document)
        lines = toml_lines(text, [(name,) for name in root.entries])
        for name, line in zip(root.entries, lines, strict=True):
            label = _label(name, root, place or f"{file}:{line}")
            try:
                if label is not None:
                    extended.define(label)
            except Refused as refused:
                root.wrong(name, refused.reason, "the same definition, or another name")
        document.end()
        return extended


@cache
def default_ontology() -> Ontology:
    """The labels of ontology.toml, which comes with this package. All share it: `copy` it to add labels."""
    text = files("dyknow.federation.sharing").joinpath("ontology.toml").read_text("utf-8")
    return Ontology()._with(text, "ontology.toml", BUILT_IN)  # noqa: SLF001  (its own)


def _label(name: str, root: DocumentTable, place: str) -> SemanticLabel | None:
    """The label that one table of an ontology describes; None if the table is wrong."""
    noted = root.document.noted
    table = root.table(name)
    if root.document.noted == noted:
        sort, meaning = table.text("sort", None), table.text("meaning", None)
        unit, fields = table.text("unit", ""), table.table("fields")
        parts = tuple(Field(field, _unit_of(fields, field)) for field in fields.entries)
        if bool(unit) == ("fields" in table):
            message = "has both unit and fields" if unit else "has neither unit nor fields"
            table.wrong("unit" if unit else "", message, 'unit = "ppm", or fields = { north_m_s = "m/s" }')
        elif not unit and not parts:
            table.wrong("fields", "a unit for each field is expected, got none", 'fields = { north_m_s = "m/s" }')
        table.end()
    if root.document.noted > noted:
        return None
    label = SemanticLabel(name, Sort(sort, parts, unit=unit), meaning, place)
    errors = list(definition_errors(label))
    for message, repair in errors:
        table.wrong("", message, repair)
    return None if errors else label


def _unit_of(fields: DocumentTable, field: str) -> str:
    """The unit of a field; empty for a number without one."""
    return "" if fields.get(field) == "" else fields.text(field, None)
