"""Anchoring situations as JSON."""

import json
from typing import Any

import pytest

from dyknow.anchoring.matching.files import MOST_REASONS, read_matching, situation_json
from dyknow.anchoring.matching.situations import classify
from dyknow.model.errors import TextError


def answered(**case: Any) -> dict[str, Any]:
    given = read_matching(json.dumps(case))
    return situation_json(classify(given.description, given.percepts, given.options))


BOTTLES = {"shape": ["gasbottle"], "mark": [True]}


def test_a_situation_is_answered_with_case_match_result_anchors_recovery_and_reasons() -> None:
    assert answered(description=BOTTLES, definite=True, percepts={"po1": {"shape": "gasbottle", "mark": None}}) == {
        "case": 2,
        "match": {"po1": "partial"},
        "result": "temporary",
        "anchors": ["po1"],
        "recovery": "recover",
        "reasons": ["po1: shape gasbottle is as described", "po1: mark was not observed, and is described as true"],
        "ask": None,
    }


def test_sets_intervals_places_and_degrees_are_read() -> None:
    description = {
        "colour": {"degrees": {"red": 1, "orange": 0.6, "blue": 0}},
        "height_m": {"from": 1, "to": 1.5, "soft": 1},
        "place_m": {"near": [4, 2], "within_m": 1, "soft_m": 1},
        "kind": "bottle",
    }
    percepts = {
        "po1": {"colour": "red", "height_m": 1.6, "place_m": [4, 2.5], "kind": "bottle"},
        "po2": {"colour": {"value": "red", "confidence": 0.2}, "height_m": 1, "place_m": [4, 2], "kind": "bottle"},
        "po3": {"colour": "blue", "height_m": 1, "place_m": [4, 2], "kind": "bottle"},
        "po4": {"colour": "red", "height_m": 1, "place_m": {"value": [4, 2], "sd_m": 3}, "kind": "bottle"},
    }
    found = answered(description=description, percepts=percepts, threshold=0.9)
    assert found["match"] == {"po1": "complete", "po2": "partial", "po3": "none", "po4": "partial"}


def test_case_5_says_what_to_ask() -> None:
    red, green = ({"shape": "gasbottle", "mark": True, "colour": colour} for colour in ("red", "green"))
    found = answered(description=BOTTLES, percepts={"po1": red, "po2": green})
    assert (found["case"], found["recovery"]) == (5, "description_insufficient")
    assert found["ask"] == {"property": "colour", "values": {"red": ("po1",), "green": ("po2",)}}


def test_ten_thousand_percepts_are_classified_and_their_reasons_counted() -> None:
    percepts = {f"po{number}": {"shape": "gasbottle", "mark": None, f"p{number}": 1} for number in range(10_000)}
    found = answered(description=BOTTLES, percepts=percepts)
    assert (found["case"], len(found["anchors"])) == (2, 10_000)
    assert len(found["reasons"]) == MOST_REASONS + 1
    assert found["reasons"][-1] == "and 19000 more reasons"
    alike = {name: {"shape": "gasbottle", "mark": True} for name in percepts}
    assert answered(description=BOTTLES, percepts=alike)["case"] == 5


@pytest.mark.parametrize(
    ("text", "place", "message"),
    [
        ("", (1, 1), "no JSON"),
        ("[1]", (1, 1), "the document is a JSON object"),
        ('{"description": {}, "percepts": {}, "description": {}}', (1, 1), "key 'description' stands twice"),
        ('{"description": {}, "percepts": {"po1": {"mark": NaN}}}', (1, 1), "NaN is no value"),
        ("[" * 100_000, (1, 1), "nested too deep"),
        ('{"description": {},\n "percept": {}}', (1, 1), "percepts is missing. Did you mean 'percept'?"),
        ('{"description": {"shape":\n []}, "percepts": {}}', (2, 2), "description.shape: no value is allowed"),
        ('{"description": {"h": {"from": 2, "to": 1}}, "percepts": {}}', (1, 23), "from 2 to 1 is empty"),
        ('{"description": {"h": {"degrees": {"red": 0}}}, "percepts": {}}', (1, 35), "every degree is 0"),
        ('{"description": {"h": {"like": 2}}, "percepts": {}}', (1, 23), "neither a set, an interval"),
        ('{"description": {"h": [[1, 2, 3]]}, "percepts": {}}', (1, 24), "got [1, 2, 3]"),
        ('{"description": {}, "percepts": {"po1":\n {"mark": 1e999}}}', (2, 11), "got Infinity"),
        ('{"description": {}, "percepts": {"po1": 7}}', (1, 41), "percepts.po1: an object is expected, got 7"),
        ('{"description": {}, "percepts": {"": {}}}', (1, 38), "names have 1 to 256 printable characters"),
        ('{"description": {}, "percepts": {}, "definite": 1}', (1, 49), "true or false is expected, got 1"),
        ('{"description": {}, "percepts": {}, "functionality": "fnd"}', (1, 54), "Did you mean 'find'?"),
        ('{"description": {}, "percepts": {}, "threshold": 2}', (1, 50), "a number from 1e-06 to 1 is expected"),
    ],
)
def test_what_is_wrong_is_refused_with_place_cause_and_remedy(text: str, place: tuple[int, int], message: str) -> None:
    with pytest.raises(TextError) as wrong:
        read_matching(text, "case.json")
    assert message in wrong.value.message
    assert (wrong.value.line, wrong.value.column) == place
    assert wrong.value.repair
    assert str(wrong.value).startswith("case.json:")


def test_keys_that_mean_nothing_are_reported() -> None:
    given = read_matching('{"description": {}, "percepts": {}, "cautios": true, "name": "x"}')
    assert given.ignored == (
        "cautios is no known key and is ignored. Did you mean 'cautious'?",
        "name is no known key and is ignored.",
    )


def test_bytes_that_are_no_text_and_documents_that_are_too_long_are_refused() -> None:
    with pytest.raises(TextError, match="no JSON"):
        read_matching(b"\xff\xfe{}")
    with pytest.raises(TextError, match="more than"):
        read_matching(b" " * (16 * 2**20 + 1))
