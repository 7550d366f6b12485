"""Anchoring situations as JSON: a description with percepts is read, what became of them is printed.

    {"description": {"kind": ["gasbottle"], "mark": [true], "height_m": {"from": 1.0, "to": 1.6, "soft": 0.2},
                     "colour": {"degrees": {"red": 1, "orange": 0.6}}, "place_m": {"near": [4, 2], "within_m": 0.5}},
     "definite": true, "functionality": "find", "cautious": false, "no_other_similar": false,
     "threshold": 1.0, "least_confidence": 0.5, "gate_m": 0.5,
     "percepts": {"po1": {"kind": "gasbottle", "mark": null, "colour": {"value": "red", "confidence": 0.9},
                          "place_m": {"value": [4.1, 2.0], "sd_m": 0.3}}}}

`description` and `percepts` are needed; a value alone stands for a set of one. null, or no entry, is unobserved.
"""

from collections.abc import Mapping
from typing import Any, Final, NamedTuple

from dyknow.anchoring.matching.candidates import ObservationGates, ObservedProperty
from dyknow.anchoring.matching.descriptions import (
    Allowed,
    AllowedInterval,
    AllowedPlace,
    AllowedValues,
    ObjectDescription,
    PropertyValue,
)
from dyknow.anchoring.matching.situations import AnchoringSituation, MatchingOptions
from dyknow.documents.documents import json_document
from dyknow.documents.tables import DocumentTable, is_number, shown

MOST_PERCEPTS: Final = 100_000
MOST_PROPERTIES: Final = 64
MOST_VALUES: Final = 1000
MOST_REASONS: Final = 1000
LONGEST_NAME: Final = 256
FARTHEST: Final = 1e9
EXAMPLE: Final = '{"description": {"kind": ["gasbottle"]}, "percepts": {"po1": {"kind": "gasbottle"}}}'
_ALLOWED: Final = (
    '["red"], {"from": 1, "to": 2}, {"near": [4, 2], "within_m": 1} or {"degrees": {"red": 1, "orange": 0.6}}'
)


class MatchingCase(NamedTuple):
    """A situation as it is written; `ignored` has a sentence for each key that means nothing here."""

    description: ObjectDescription
    percepts: Mapping[str, Mapping[str, ObservedProperty | None]]
    options: MatchingOptions
    ignored: tuple[str, ...]


def read_matching(source: str | bytes, file: str = "") -> MatchingCase:
    """The case.

    Raises:
        TextError: something is wrong with it.
    """
    root = DocumentTable(json_document(source, file, EXAMPLE))
    described = root.table("description", EXAMPLE)
    if len(described.entries) > MOST_PROPERTIES:
        raise root.error("description", f"more than {MOST_PROPERTIES} properties", "those that tell objects apart")
    properties = {name: _allowed(described, name) for name in described.entries}
    description = ObjectDescription(properties, root.flag("definite", default=True))
    options = MatchingOptions(
        "reacquire" if root.text("functionality", "find", ("find", "reacquire")) == "reacquire" else "find",
        root.flag("cautious", default=False),
        root.flag("no_other_similar", default=False),
        root.number("threshold", 1.0, 1e-6, 1.0),
        ObservationGates(
            root.number("least_confidence", ObservationGates().confidence, 0.0, 1.0),
            root.number("gate_m", 1.0, 0.0, FARTHEST) if "gate_m" in root else None,
        ),
    )
    seen = root.table("percepts", EXAMPLE)
    if len(seen.entries) > MOST_PERCEPTS:
        raise root.error(
            "percepts", f"{len(seen.entries)} percepts, at most {MOST_PERCEPTS} are read", "fewer percepts"
        )
    percepts = {name: _percept(seen, name) for name in seen.entries}
    return MatchingCase(description, percepts, options, root.ignored())


def situation_json(situation: AnchoringSituation) -> dict[str, Any]:
    """A classified situation as a record; at most `MOST_REASONS` reasons, the others are counted."""
    reasons = list(situation.reasons())
    if (left := len(reasons) - MOST_REASONS) > 0:
        reasons[MOST_REASONS:] = [f"and {left} more reasons"]
    ask = situation.ask
    return {
        "case": situation.case,
        "match": {each.percept: each.status for each in situation.matches},
        "result": situation.result,
        "anchors": [each.percept for each in situation.anchors],
        "recovery": situation.recovery,
        "reasons": reasons,
        "ask": None if ask is None or not ask.name else {"property": ask.name, "values": ask.values},
    }


def _allowed(described: DocumentTable, name: str) -> Allowed:
    value = described.get(name)
    _check_name(described, name)
    if isinstance(value, dict):
        table = described.table(name, _ALLOWED)
        if "near" in table:
            return _allowed_place(table)
        if "degrees" in table:
            return _graded(table)
        if "from" in table or "to" in table:
            return _interval(table)
        raise described.error(name, "neither a set, an interval, a place nor degrees", _ALLOWED)
    values = value if isinstance(value, list) else [value]
    if not values:
        raise described.error(
            name, "no value is allowed: nothing could match", "the values that are allowed, or leave it out"
        )
    if len(values) > MOST_VALUES:
        raise described.error(name, f"more than {MOST_VALUES} values", "an interval, or fewer values")
    found = [
        _value(described, (name, number) if value is values else (name,), each) for number, each in enumerate(values)
    ]
    return AllowedValues(tuple((each, 1.0) for each in found))


def _interval(table: DocumentTable) -> AllowedInterval:
    usual = AllowedInterval()
    low = table.number("from", 0.0, -FARTHEST, FARTHEST) if "from" in table else usual.low
    high = table.number("to", 0.0, -FARTHEST, FARTHEST) if "to" in table else usual.high
    if low > high:
        raise table.error((), f"from {low:g} to {high:g} is empty: nothing could match", '{"from": 1, "to": 2}')
    return AllowedInterval(low, high, table.number("soft", 0.0, 0.0, FARTHEST))


def _allowed_place(table: DocumentTable) -> AllowedPlace:
    at_m = _value(table, ("near",), table.get("near"))
    if not isinstance(at_m, tuple):
        raise table.error("near", "a place is two numbers in metres", '{"near": [4, 2], "within_m": 1}')
    return AllowedPlace(at_m, table.number("within_m", 1.0, 0.0, FARTHEST), table.number("soft_m", 0.0, 0.0, FARTHEST))


def _graded(table: DocumentTable) -> AllowedValues:
    degrees = table.table("degrees", _ALLOWED)
    found = {name: degrees.number(name, 1.0, 0.0, 1.0) for name in degrees.entries}
    if not any(found.values()):
        raise table.error("degrees", "every degree is 0: nothing could match", '{"degrees": {"red": 1}}')
    return AllowedValues(tuple((name, degree) for name, degree in found.items() if degree > 0.0))


def _percept(seen: DocumentTable, name: str) -> Mapping[str, ObservedProperty | None]:
    _check_name(seen, name)
    table = seen.table(name, '{"kind": "gasbottle", "mark": null}')
    if len(table.entries) > MOST_PROPERTIES:
        raise seen.error(name, f"more than {MOST_PROPERTIES} properties", "those that descriptions speak of")
    return {each: _observed(table, each) for each in table.entries}


def _observed(percept: DocumentTable, name: str) -> ObservedProperty | None:
    value = percept.get(name)
    if value is None:
        return None
    if not isinstance(value, dict):
        return ObservedProperty(_value(percept, (name,), value))
    table = percept.table(name, '{"value": "red", "confidence": 0.9}')
    inside = table.get("value")
    if inside is None:
        return None
    found = _value(table, ("value",), inside)
    return ObservedProperty(found, table.number("confidence", 1.0, 0.0, 1.0), table.number("sd_m", 0.0, 0.0, FARTHEST))


def _value(table: DocumentTable, path: tuple[str | int, ...], value: object) -> PropertyValue:
    if isinstance(value, bool):
        return value
    if isinstance(value, str) and len(value) <= LONGEST_NAME:
        return value
    if is_number(value):
        return float(value)  # type: ignore[arg-type]
    if isinstance(value, list) and len(value) == 2 and all(is_number(each) and abs(each) <= FARTHEST for each in value):
        return float(value[0]), float(value[1])
    message = (
        f"text of at most {LONGEST_NAME} characters, true, false, a number or a place is expected, got {shown(value)}"
    )
    raise table.error(path, message, '"red", true, 1.5 or [4.0, 2.0]')


def _check_name(table: DocumentTable, name: str) -> None:
    if not name or len(name) > LONGEST_NAME or not name.isprintable():
        raise table.error(name, f"names have 1 to {LONGEST_NAME} printable characters, got {shown(name)}", '"po1"')
