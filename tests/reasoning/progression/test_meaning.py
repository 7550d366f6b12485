"""Every way to progress a formula says what Definition 7.5.2 says: as early as Kleene evaluation, and for good."""

import os
from itertools import product

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dyknow.kpl import read_formula
from tests.reasoning.meaning import Meaning, State, said
from tests.reasoning.typed_formulas import (
    DOMAINS,
    UNIT_US,
    VOCABULARY,
    nested_operators,
    states,
    traces,
    typed_formulas,
)
from tests.reasoning.ways import WAYS

FULL = bool(os.environ.get("DYKNOW_FULL"))
POLICIES = st.sampled_from(["undecided", "undecided", "false", "true", "skip"])
MANY = settings(max_examples=20_000 if FULL else 160)


@st.composite
def cases(draw):
    """A formula, states for it with some that could follow, the period and the policy."""
    missing, nested = draw(st.booleans()), draw(st.booleans())
    text = draw(nested_operators() if nested else typed_formulas())
    trace, period_us = draw(traces(missing=missing, max_size=10 if nested else 7))
    rest = [
        State(trace[-1].valid_us + (at + 1) * UNIT_US, *one)
        for at, one in enumerate(draw(states(draw(st.integers(0, 3)), missing)))
    ]
    return text, trace, rest, period_us, draw(POLICIES) if missing else "undecided"


@given(cases())
@MANY
def test_every_way_says_what_definition_7_5_2_says(case):
    text, trace, rest, period_us, no_value = case
    formula = read_formula(text, VOCABULARY)
    found = {name: way(formula, trace, period_us, no_value) for name, way in WAYS.items()}
    first = found["plain"]
    assert found == dict.fromkeys(found, first)
    meaning = Meaning(formula, [*trace, *rest], period_us=period_us, no_value=no_value)
    for at, verdict in enumerate(first, 1):
        known = meaning.known_after(at, trace)
        eager = said(meaning.verdict(known))
        assert eager in {verdict, "undecided"}, f"state {at - 1}: {verdict}, Kleene evaluation says {eager}"
        if verdict != "undecided":
            later = {meaning.verdict(count, ended=True) for count in range(known, len(meaning.states) + 1)}
            assert later - {None} == {verdict == "true"}, f"state {at - 1}: {verdict}, and a continuation is not"
            assert set(first[at - 1 :]) == {verdict}


SMALL = st.recursive(
    st.sampled_from(["p", "q"]),
    lambda inside: st.one_of(
        inside.map("not ({})".format),
        st.builds("({}) {} ({})".format, inside, st.sampled_from(["and", "or", "->", "until", "until[0, 200]"]), inside),
        st.builds("{} ({})".format, st.sampled_from(["always", "eventually", "always[0, 100]", "eventually[100, 200]"]), inside),
    ),
    max_leaves=4,
)  # fmt: skip


@given(SMALL, st.lists(st.integers(0, 3), min_size=1, max_size=3), st.sampled_from([None, UNIT_US]))
@settings(max_examples=2_000 if FULL else 24)
def test_no_continuation_of_three_states_contradicts_a_verdict(text, seen, period_us):
    formula = read_formula(text, VOCABULARY)

    def trace(bits):
        return [State(at * UNIT_US, {"p": bool(one & 1), "q": bool(one & 2)}) for at, one in enumerate(bits)]

    for way in WAYS.values():
        verdict = way(formula, trace(seen), period_us)[-1]
        if verdict == "undecided":
            continue
        for count in range(4):
            for rest in product(range(4), repeat=count):
                whole = trace([*seen, *rest])
                assert Meaning(formula, whole, period_us=period_us).verdict(len(whole), ended=True) is (
                    verdict == "true"
                )


@pytest.mark.parametrize("name", sorted(WAYS))
def test_domains_that_nobody_gave_are_empty_only_where_they_are_said_to_be(name):
    formula = read_formula("always forall u in none: s[u]", VOCABULARY)
    assert WAYS[name](formula, [State(0, {}, DOMAINS)]) == ["undecided"]
