from itertools import pairwise

import pytest
from hypothesis import HealthCheck, given, settings

from dyknow.kpl import read_formula
from dyknow.model.errors import TextError, UnknownLabel
from dyknow.model.values import NO_VALUE
from dyknow.reasoning import make_progression
from dyknow.reasoning.formulas.tree import (
    Always,
    And,
    Compare,
    Const,
    Domain,
    Duration,
    Eventually,
    Exists,
    Feature,
    Forall,
    Now,
    Occurred,
    Or,
    Since,
    Until,
    Variable,
)
from tests.reasoning.oracle import naive
from tests.reasoning.strategies import UNIT_US, formulas, traces
from tests.strategies import examples

SAID = {True: "true", False: "false", None: "undecided"}
P, Q, R = Feature("p"), Feature("q"), Feature("r")
MODERATE = settings(max_examples=examples(300), deadline=None, suppress_health_check=[HealthCheck.too_slow])


def verdicts(formula, states, period_us=None, **options):
    """The verdict after each state."""
    progression = make_progression(formula, period_us, **options)
    found = []
    for at_us, values in states:
        progression.progress(at_us, values)
        found.append(progression.verdict)
    return found


def boolean_states(**features):
    """States at 0, 100, 200 ms, ... from texts of 1 and 0; a blank is no value."""
    length = len(next(iter(features.values())))
    return [
        (at * UNIT_US, {name: text[at] == "1" for name, text in features.items() if text[at] != " "})
        for at in range(length)
    ]


@given(formulas, traces(gaps=True))
@MODERATE
def test_never_later_and_never_different_than_the_printed_progression(formula, states):
    left, steps = formula, [after[0] - before[0] for before, after in pairwise(states)]
    for (_, values), step_us, ours in zip(states, [*steps, UNIT_US], verdicts(formula, states), strict=True):
        left = left if isinstance(left, Const) else naive(left, values, step_us)
        if isinstance(left, Const):
            assert ours == SAID[left.value]


@given(formulas, traces(gaps=True, max_size=6))
@MODERATE
def test_a_known_period_decides_no_later(formula, states):
    without, period = verdicts(formula, states), verdicts(formula, states, UNIT_US)
    for early, late in zip(period, without, strict=True):
        assert late in {"undecided", early}


@pytest.mark.parametrize(
    ("formula", "states", "expected"),
    [
        (Always(P), boolean_states(p="1101"), ["undecided", "undecided", "false", "false"]),
        (Eventually(P), boolean_states(p="0010"), ["undecided", "undecided", "true", "true"]),
        (Always(P, 0, 2 * UNIT_US), boolean_states(p="1110"), ["undecided", "undecided", "true", "true"]),
        (Until(P, Q), boolean_states(p="1100", q="0010"), ["undecided", "undecided", "true", "true"]),
        (Until(P, Q), boolean_states(p="1000", q="0010"), ["undecided", "false", "false", "false"]),
    ],
)
def test_the_operators_say_what_they_are_called(formula, states, expected):
    assert verdicts(formula, states) == expected


def test_until_needs_its_left_side_also_before_the_interval_begins():
    formula = Until(P, Q, 2 * UNIT_US, 5 * UNIT_US)
    assert verdicts(formula, boolean_states(p="0110", q="0011")) == ["false"] * 4
    assert verdicts(formula, boolean_states(p="1100", q="0010"))[-1] == "true"


def test_intervals_select_states_by_their_time_and_gaps_hold_none():
    formula = Always(P, UNIT_US, 2 * UNIT_US)
    progression = make_progression(formula)
    progression.progress(0, {"p": True})
    assert progression.verdict == "undecided"
    progression.progress(10 * UNIT_US, {"p": False})
    assert progression.verdict == "true"


def test_an_operator_is_decided_at_the_state_whose_time_reaches_its_bound():
    states = boolean_states(p="1111")
    assert verdicts(Always(P, 0, 250_000), states)[2] == "undecided"
    assert verdicts(Always(P, 0, 250_000), states)[3] == "true"
    assert verdicts(Always(P, 0, 200_000), states)[2] == "true"


def test_with_a_known_period_it_is_decided_at_the_last_state_that_can_lie_inside():
    states = boolean_states(p="1111")
    assert verdicts(Always(P, 0, 250_000), states, UNIT_US)[2] == "true"
    assert verdicts(Eventually(Q, 150_000, 180_000), states, UNIT_US)[1] == "false"


def test_a_missing_value_leaves_its_state_undecided_for_good():
    assert verdicts(Always(P), boolean_states(p="1 10")) == ["undecided", "undecided", "undecided", "false"]
    assert verdicts(Eventually(P, 0, 200_000), boolean_states(p="0 01"))[-1] == "undecided"
    assert verdicts(Or((P, Q)), boolean_states(p=" ", q="1")) == ["true"]


@pytest.mark.parametrize(("policy", "expected"), [("undecided", "undecided"), ("false", "false"), ("true", "true")])
def test_the_policy_says_what_an_atom_without_value_is(policy, expected):
    assert verdicts(P, boolean_states(p=" "), no_value=policy) == [expected]
    comparison = Compare("<", Feature("x"), Const(3))
    assert verdicts(comparison, [(0, {"x": NO_VALUE})], no_value=policy) == [expected]


def test_skip_leaves_out_states_in_which_a_feature_has_no_value():
    formula = And((Eventually(P, 0, 200_000), Always(Q, 0, 200_000)))
    states = boolean_states(p="0 11", q="1011")
    assert verdicts(formula, states, no_value="skip") == ["undecided", "undecided", "true", "true"]


def test_now_is_the_time_of_the_state_and_since_the_time_since_a_change():
    late = Compare(">=", Now(), Duration(200_000))
    assert verdicts(Eventually(late), boolean_states(p="111")) == ["undecided", "undecided", "true"]
    settled = Compare(">=", Since(Feature("speed", ("a",))), Duration(200_000))
    states = [(at * UNIT_US, {"speed[a]": value}) for at, value in enumerate([5, 6, 6, 6])]
    assert verdicts(Eventually(settled), states) == ["undecided", "undecided", "undecided", "true"]


def test_since_says_nothing_before_the_first_value_and_while_there_is_none():
    old = Compare(">=", Since(P), Duration(100_000))
    assert verdicts(Eventually(old), boolean_states(p=" 1 1")) == ["undecided", "undecided", "undecided", "true"]


def test_an_event_occurred_in_the_state_it_belongs_to():
    progression = make_progression(Eventually(Occurred(Feature("landed", ("uav1",)))))
    progression.progress(0, {}, events=["landed[uav2]"])
    assert progression.verdict == "undecided"
    progression.progress(1, {}, events=["landed[uav1]"])
    assert progression.verdict == "true"


GROWING_ALWAYS = Always(Forall("v", Domain("d"), Feature("s", (Variable("v"),)), growing=True))


def test_a_growing_quantifier_takes_its_members_from_each_state():
    progression = make_progression(GROWING_ALWAYS)
    progression.progress(0, {"s[a]": True}, {"d": ("a",)})
    progression.progress(1, {"s[a]": True, "s[b]": True}, {"d": ("a", "b")})
    progression.progress(2, {"s[a]": False, "s[b]": True}, {"d": ("b",)})
    assert progression.verdict == "undecided"
    progression.progress(3, {"s[b]": False}, {"d": ("b",)})
    assert progression.verdict == "false"


def test_a_fixed_quantifier_keeps_the_members_it_was_activated_with():
    progression = make_progression(Always(Forall("v", Domain("d"), Feature("s", (Variable("v"),)))))
    progression.progress(0, {"s[a]": True}, {"d": ("a",)})
    progression.progress(1, {"s[a]": True, "s[b]": False}, {"d": ("a", "b")})
    assert progression.verdict == "undecided"
    progression.progress(2, {"s[a]": False}, {"d": ()})
    assert progression.verdict == "false"


def test_a_growing_quantifier_over_a_temporal_body_adds_newcomers_and_drops_those_that_leave():
    soon = Eventually(Feature("s", (Variable("v"),)), 0, 2)
    progression = make_progression(Forall("v", Domain("d"), soon, growing=True))
    progression.progress(0, {}, {"d": ()})
    assert progression.verdict == "undecided", "it waits for a first member"
    progression.progress(1, {"s[a]": False}, {"d": ("a",)})
    progression.progress(2, {"s[a]": False, "s[b]": False}, {"d": ("a", "b")})
    progression.progress(3, {"s[b]": False}, {"d": ("b",)})
    assert progression.verdict == "undecided", "a left before its time was over"
    progression.progress(4, {"s[b]": True}, {"d": ("b",)})
    assert progression.verdict == "true"


def test_a_growing_exists_is_true_with_the_first_member_that_is():
    soon = Eventually(Feature("s", (Variable("v"),)), 0, 2)
    progression = make_progression(Exists("v", Domain("d"), soon, growing=True))
    progression.progress(0, {"s[a]": False}, {"d": ("a",)})
    progression.progress(1, {"s[a]": False, "s[b]": True}, {"d": ("a", "b")})
    assert progression.verdict == "true"


def test_states_go_forward_in_time():
    progression = make_progression(Always(P))
    progression.progress(5, {"p": True})
    with pytest.raises(ValueError, match="forward"):
        progression.progress(5, {"p": True})


def test_a_domain_nobody_gave_is_named():
    with pytest.raises(UnknownLabel, match="'uavs'"):
        make_progression(Forall("v", Domain("uavs"), P)).progress(0, {})


def test_a_formula_that_explodes_over_its_domains_is_refused():
    formula = P
    for name in ("v", "w", "u"):
        formula = Forall(name, Domain("d"), formula)
    with pytest.raises(TextError, match="expands"):
        make_progression(formula).progress(0, {}, {"d": tuple(map(str, range(100)))})


def test_what_stays_pending_does_not_grow_with_the_trace():
    nested = Until(Eventually(P), Eventually(Q))
    response = Always(Or((P, Eventually(Q))))
    for formula in (nested, response):
        progression = make_progression(formula)
        for at in range(5_000):
            progression.progress(at, {"p": False, "q": False})
        assert progression.verdict == "undecided"
        assert progression.kept < 50


def test_a_long_window_of_obligations_needs_no_deep_recursion():
    formula = Until(Eventually(P, 0, 3_000), Eventually(Q, 0, 3_000))
    progression = make_progression(formula, 1)
    for at in range(1_500):
        progression.progress(at, {"p": False, "q": False})
    assert progression.verdict == "undecided"


@pytest.mark.parametrize("text", ["x < 3", "x != 3", "not x > 3", "x - x = 0", "since(x) >= 0"])
def test_a_nan_is_no_value_whatever_is_asked_of_it(text):
    states = [(0, {"x": float("nan")})]
    assert verdicts(read_formula(text), states) == ["undecided"]
    assert verdicts(read_formula(text), states, no_value="false") == [str(text.startswith("not")).lower()]
    assert verdicts(read_formula(text), [*states, (1, {"x": 1})], no_value="skip") == ["undecided", "true"]
