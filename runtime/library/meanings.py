"""The meanings of semantic labels, to this program and to each platform by its description (thesis 9.3.3)."""

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress

from dyknow import Value, as_json
from dyknow.federation.messages.descriptions import LabelEntry
from dyknow.federation.sharing.agreement import disagreement
from dyknow.model.errors import SortError
from dyknow.model.semantic_labels import SemanticLabel
from dyknow.model.values import NO_VALUE
from dyknow.runtime.client import Client


def meaning_to(client: Client, unit: str, label: str) -> SemanticLabel | None:
    """The label's meaning to a platform: by its description, else the common one; None if it is not known."""
    entry = client.centre.member.directory.entry(unit)
    theirs = None if entry is None else entry.definitions.get(label)
    if theirs is not None:
        return theirs
    ours, offered = client.ontology.get(label), offered_by(client, unit, label)
    is_same = ours is not None and (offered is None or offered.type_hash == ours.type_hash)
    return ours if is_same else None


def offered_by(client: Client, unit: str, label: str) -> LabelEntry | None:
    """The stream of a label that a platform offers."""
    entry = client.centre.member.directory.entry(unit)
    return next((each for each in (entry.labels if entry else ()) if each.label == label), None)


def disagreement_with(client: Client, unit: str, label: str) -> str:
    """Why the label of a platform is not what this program knows under that name; empty if it is, or it knows none."""
    entry, offered = client.centre.member.directory.entry(unit), offered_by(client, unit, label)
    theirs = None if entry is None else entry.definitions.get(label)
    return disagreement(client.ontology.get(label), theirs, offered.type_hash if offered else None)


def record_of(client: Client, unit: str, label: str, value: Value) -> Mapping[str, object]:
    """The fields of a value by name, as the platform that sent it means the label."""
    if value is NO_VALUE:
        return {}
    meaning = meaning_to(client, unit, label)
    if meaning is not None:
        with suppress(SortError):
            return meaning.sort.as_record(value)
    return {"value": as_json(value)}


def meanings(client: Client) -> dict[str, dict[SemanticLabel, list[str]]]:
    """All semantic labels of the federation, by name: each meaning, with the platforms that have it.

    A definition without platforms is this program's own, or one that every member has.
    """
    found: dict[str, dict[SemanticLabel, list[str]]] = {}
    for label in client.ontology.definitions():
        found[label.name] = {label: []}
    for view in client.centre.platforms():
        for name, label in (view.entry.definitions if view.entry is not None else {}).items():
            found.setdefault(name, {}).setdefault(label, []).append(view.unit)
    return found


def differing(client: Client, label: str, units: Iterable[str]) -> str:
    """The differences between these platforms' meanings of a label, in words; empty if there are none."""
    by_meaning: dict[SemanticLabel, list[str]] = {}
    for unit in units:
        meaning = meaning_to(client, unit, label)
        if meaning is not None:
            by_meaning.setdefault(meaning, []).append(unit)
    if len(by_meaning) < 2:
        return ""
    parts = [f"to {_named(units)} {meaning}" for meaning, units in by_meaning.items()]
    return f"{label} does not mean the same: {'; '.join(parts)}"


def offering(client: Client, label: str) -> list[str]:
    """The platforms that offer a stream of the label."""
    return [view.unit for view in client.centre.platforms() if label in view.labels]


def _named(units: Sequence[str]) -> str:
    return f"platform{'s' if len(units) > 1 else ''} {', '.join(units)}"
