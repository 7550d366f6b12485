"""Intents as values of the label `intent`, and back; what is no intent is none."""

from math import inf, nan
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dyknow import NO_VALUE, Sample
from dyknow.agents.capabilities.separation.records import FIELDS, INTENT, intent_of, intent_value, legs_of, legs_text
from dyknow.federation.sharing.ontology import default_ontology
from dyknow.navigation.intents.intent import (
    MOST_LEGS,
    Contingency,
    IntendedPlace,
    Intent,
    IntentEnding,
    IntentSource,
    RightOfWay,
)

places = st.builds(
    IntendedPlace,
    st.floats(-90, 90).map(lambda x: round(x, 7)),
    st.floats(-180, 180).map(lambda x: round(x, 7)),
    st.floats(-100, 9000).map(lambda x: round(x, 1)),
)
legs = st.lists(places, max_size=MOST_LEGS).map(tuple)
contingencies = st.none() | st.builds(
    Contingency, st.floats(0, 60).map(lambda x: round(x, 1)), legs, st.sampled_from(IntentEnding)
)
speeds = st.floats(-50, 50)
intents = st.builds(
    Intent, st.just(5), st.floats(-90, 90), st.floats(-180, 180), st.floats(-100, 9000), speeds, speeds, speeds,
    st.sampled_from(IntentSource), st.sampled_from(RightOfWay), legs, st.sampled_from(IntentEnding),
    st.floats(0.5, 50), st.floats(0.1, 20), st.floats(0.1, 20), st.floats(0, 100), st.floats(0, 100), contingencies,
)  # fmt: skip


def of(value: Any) -> Intent | None:
    return intent_of(Sample(6, 5, value))


@given(intents)
@settings(deadline=None)
def test_what_is_written_is_read(intent: Intent) -> None:
    assert of(intent_value(intent)) == intent
    assert all(len(text) <= 1024 for text in intent_value(intent) if isinstance(text, str))


def test_the_ontology_has_its_fields() -> None:
    assert len(default_ontology()[INTENT].sort.fields) == FIELDS == 16


AN_INTENT = Intent(5, 58.0, 15.0, 60.0, 1.0, 0.0, 0.0, IntentSource.ROUTE, RightOfWay.NAMED)


@pytest.mark.parametrize("at", range(FIELDS))
@pytest.mark.parametrize(
    "bad", [None, NO_VALUE, nan, inf, -1e9, True, "", "nobody", "a,b,c", "1,2", (), b"x", "9 hover 1,2"]
)
def test_a_field_that_is_none_of_its_kind_makes_no_intent(at: int, bad: Any) -> None:
    value = [*intent_value(AN_INTENT)]
    value[at] = bad
    found = of(tuple(value))
    assert found is None or (at in {13, 15} and bad == "")


@pytest.mark.parametrize("value", [NO_VALUE, None, (), "intent", (1,) * FIELDS, (*intent_value(AN_INTENT), 1)])
def test_what_is_no_record_is_no_intent(value: Any) -> None:
    assert of(value) is None


@pytest.mark.parametrize("text", ["1,2,3,4", "91,0,0", "0,181,0", "0,0,20000", "nan,0,0", "0,0", ";", "0,0,0;" * 17])
def test_legs_that_are_no_places_are_none(text: str) -> None:
    assert legs_of(text) is None


def test_more_legs_than_are_read_are_not_written() -> None:
    many = tuple(IntendedPlace(58.0, 15.0, float(at)) for at in range(40))
    assert legs_of(legs_text(many)) == many[:MOST_LEGS]
