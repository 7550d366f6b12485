import math

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from dyknow.kpl import read_formula
from dyknow.model.errors import TextError
from dyknow.reasoning import Margins, make_progression
from dyknow.reasoning.formulas.tree import Always, Eventually, Until
from tests.reasoning.strategies import UNIT_US, comparisons, connectives, intervals, propositions, traces
from tests.strategies import examples

MODERATE = settings(max_examples=examples(100), deadline=None, suppress_health_check=[HealthCheck.too_slow])


def windows(inside):
    ends = intervals(bounded=True)
    return st.one_of(
        st.builds(lambda one, at: Always(one, *at), inside, ends),
        st.builds(lambda one, at: Eventually(one, *at), inside, ends),
        st.builds(lambda left, right, at: Until(left, right, *at), inside, inside, ends),
    )


bounded = st.recursive(comparisons | propositions, lambda inside: connectives(inside) | windows(inside), max_leaves=5)


@given(bounded, traces(gaps=True, missing=True), st.sampled_from([None, UNIT_US]))
@MODERATE
def test_the_sign_of_a_margin_is_what_the_formula_says_of_that_state(formula, states, period_us):
    margins = Margins(formula, period_us=period_us)
    told = [one for valid_us, values in states for one in margins.progress(valid_us, values)]
    assert [one.valid_us for one in told] == [valid_us for valid_us, _ in states][: len(told)]
    for start, margin in enumerate(told):
        if margin.value is None or margin.value == 0:
            continue
        progression = make_progression(formula, period_us)
        for valid_us, values in states[start:]:
            progression.progress(valid_us, values)
        assert progression.verdict == ("true" if margin.value > 0 else "false")


def told(text, rows, period_us=UNIT_US, **options):
    margins = Margins(read_formula(text), period_us=period_us, **options)
    return [one.value for at, values in enumerate(rows) for one in margins.progress(at * UNIT_US, values)]


def test_a_comparison_is_as_far_from_violation_as_its_sides_are_apart():
    assert told("always xy >= 15", [{"xy": 18.0}, {"xy": 14.0}, {}]) == [3.0, -1.0, None]


@pytest.mark.parametrize("value", [(58.4, 15.0), "near", True, 10**400])
def test_what_has_no_distance_is_far_on_its_side(value):
    assert told("always x != 0", [{"x": value}]) == [math.inf]


def test_the_nearest_of_several_objects_counts_and_the_better_of_two_distances():
    text = "always forall o in units: xy[o] >= 15 or z[o] >= 10"
    values = {"xy[a]": 20.0, "z[a]": 0.0, "xy[b]": 3.0, "z[b]": 12.0}
    assert told(text, [values], domains={"units": ("a", "b")}) == [2.0]


def test_a_window_has_the_margin_of_its_best_state_once_it_is_over():
    speeds = [{"speed": speed} for speed in (31.0, 28.0, 33.0, 34.0)]
    assert told("always eventually[0, 100] speed <= 30", speeds) == [2.0, 2.0, -3.0]


def test_a_window_without_end_has_no_margin():
    with pytest.raises(TextError, match="windows that end"):
        Margins(read_formula("always eventually speed <= 30"))
