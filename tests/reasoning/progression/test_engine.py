"""The ways of the engine against plain progression, and what each keeps."""

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from dyknow.kpl import read_formula
from dyknow.model.values import NO_VALUE
from dyknow.reasoning import Monitor, make_progression
from dyknow.reasoning.formulas.evaluation import Moment
from dyknow.reasoning.formulas.tree import (
    Always,
    Compare,
    Const,
    Domain,
    Eventually,
    Feature,
    Forall,
    Implies,
    Not,
    Or,
    Variable,
    is_temporal,
)
from dyknow.reasoning.monitoring.alarms import Watch
from dyknow.reasoning.progression.automaton import LIMIT_GAPS
from dyknow.reasoning.progression.restarting import restartable
from tests.reasoning import ways
from tests.reasoning.oracle import atom
from tests.reasoning.plain import Restarted
from tests.reasoning.strategies import UNIT_US, formulas, traces
from tests.strategies import examples

DOMAINS = {"d": ("a", "b")}
WAYS = ("object", "deadlines")
MODERATE = settings(max_examples=examples(60), deadline=None, suppress_health_check=[HealthCheck.too_slow])
PERIODS = st.sampled_from([None, UNIT_US])
POLICIES = st.sampled_from(["undecided", "undecided", "false", "true", "skip"])
P = Compare("<=", Feature("speed"), Const(30))
WITHIN_A_SECOND = Always(Eventually(P, 0, 1_000_000))
RECOVERS = Always(Implies(Not(P), Eventually(Always(P, 0, 999_000), 0, 1_000_000)))


def verdicts(formula, states, way, period_us=None, no_value="undecided"):
    one = ways.progression(formula, period_us, no_value, way)
    found = []
    for at_us, values in states:
        one.progress(at_us, values, DOMAINS)
        found.append(one.verdict)
    return found


@given(formulas, traces(gaps=True, missing=True), PERIODS, POLICIES)
@MODERATE
def test_every_way_gives_every_verdict_at_the_same_state(formula, states, period_us, no_value):
    plain = verdicts(formula, states, "plain", period_us, no_value)
    for way in WAYS:
        assert verdicts(formula, states, way, period_us, no_value) == plain, way


@given(formulas, traces(gaps=True, missing=True), traces(gaps=True, missing=True), st.sampled_from(WAYS), POLICIES)
@MODERATE
def test_several_of_one_formula_go_on_as_each_would_alone(formula, one, other, way, no_value):
    first = make_progression(formula, None, no_value, way)
    for states in (one, other, one):
        again, alone = first.again(), make_progression(formula, None, no_value, way)
        for at_us, values in states:
            again.progress(at_us, values, DOMAINS)
            alone.progress(at_us, values, DOMAINS)
            assert (again.verdict, again.way, again.kept) == (alone.verdict, alone.way, alone.kept)
        assert again.explain() == alone.explain()
    assert first.valid_us is None


def test_the_engine_takes_the_automaton_with_a_period_and_deadlines_without():
    assert make_progression(WITHIN_A_SECOND, UNIT_US).way == "object"
    assert make_progression(WITHIN_A_SECOND).way == "deadlines"


def test_sampling_that_turns_out_irregular_goes_on_with_deadlines():
    progression = make_progression(WITHIN_A_SECOND, None, way="object")
    at_us = 0
    for gap_us in range(1, 3 * LIMIT_GAPS):
        at_us += 1000 * gap_us
        progression.progress(at_us, {"speed": 31.0})
        if at_us > 1_000_000:
            break
    assert progression.way == "deadlines"
    assert progression.verdict == "false"


def test_what_is_kept_stays_on_a_plateau():
    progression = make_progression(RECOVERS, UNIT_US)
    kept = []
    for at in range(2_000):
        progression.progress(at * UNIT_US, {"speed": 31.0 if at % 20 < 10 else 29.0})
        kept.append(progression.kept)
    assert progression.verdict == "undecided"
    assert kept[20:40] == kept[1980:2000]
    assert max(kept) <= 3


@given(formulas, traces(gaps=True, max_size=14), PERIODS, st.integers(1, 3))
@MODERATE
def test_a_watch_on_the_automaton_tells_the_same_alarms_as_a_plain_one(phi, states, period_us, close_after):
    shared = Watch(restartable(phi, {}, period_us), close_after)
    plain = Watch(Restarted(phi, period_us), close_after)
    for at, (valid_us, values) in enumerate(states):
        moment = Moment(valid_us, values)
        assert shared.on_moment(moment) == plain.on_moment(moment)
        assert (shared.open, shared.doubtful) == (plain.open, plain.doubtful)
        if at % 5 == 4:
            shared.forget_clean()
            plain.forget_clean()


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("grows", ["", " growing"])
def test_since_of_a_quantified_feature_is_known_whichever_way(way, grows):
    formula = read_formula(f"always forall v in d{grows}: since(s[v]) < 100ms")
    states = [(0, {"s[a]": 1, "s[b]": 1}), (UNIT_US // 2, {"s[a]": 1, "s[b]": 2}), (UNIT_US, {"s[a]": 1, "s[b]": 2})]
    assert verdicts(formula, states, way) == ["undecided", "undecided", "false"]


@pytest.mark.parametrize("way", WAYS)
def test_a_verdict_is_explained_by_the_member_the_part_the_time_and_the_samples(way):
    fast = Compare("<=", Feature("speed", (Variable("u"),)), Const(30))
    formula = Always(Forall("u", Domain("uavs"), Eventually(fast, 0, 2 * UNIT_US)))
    progression = make_progression(formula, UNIT_US, way=way)
    for at, speed in enumerate([29.0, 31.0, 31.5, 32.0]):
        progression.progress(at * UNIT_US, {"speed[a]": 29.0, "speed[b]": speed}, {"uavs": ("a", "b")})
    assert progression.verdict == "false"
    (reason,) = progression.explain()
    assert reason.part == Compare("<=", Feature("speed", ("b",)), Const(30))
    assert not reason.holds
    assert reason.binding == (("u", "b"),)
    assert reason.obligation == Eventually(reason.part, 0, 2 * UNIT_US)
    assert (reason.since_us, reason.until_us, reason.valid_us) == (UNIT_US, 3 * UNIT_US, 3 * UNIT_US)
    assert reason.samples == {"speed[b]": 32.0}


def test_a_monitor_explains_its_alarm_down_to_the_comparison_that_failed():
    near = Or(
        (
            Compare(">=", Feature("xy", ("a", Variable("o"))), Const(15)),
            Compare(">=", Feature("z", ("a", Variable("o"))), Const(10)),
        )
    )
    formula = Always(Forall("o", Domain("units", (("a",),)), near))
    monitor = Monitor("apart", formula, ("a",), UNIT_US, 0, domains={"units": ("a", "b", "c")})
    values = {"xy[a, b]": 100.0, "z[a, b]": 0.0, "xy[a, c]": 5.0, "z[a, c]": 1.0}
    assert [event.event for event in monitor.on_state(0, 0, values)] == ["opened"]
    assert [reason.samples for reason in monitor.explanation] == [{"xy[a, c]": 5.0}, {"z[a, c]": 1.0}]
    assert {reason.binding for reason in monitor.explanation} == {(("o", "c"),)}


@pytest.mark.parametrize(
    ("text", "verdict", "until_us"),
    [
        ("eventually[250, 290] x > 0", "false", 290_000),
        ("always[250, 290] x < 0", "true", 290_000),
        ("always[0, 50] x > 0", "true", 50_000),
        ("not always[250, 290] x < 0", "false", 290_000),
        ("p -> eventually[250, 290] x > 0", "false", 290_000),
        ("x > 0 until[250, 290] x > 1", "false", 290_000),
    ],
)
def test_a_window_that_is_over_explains_itself_and_by_no_sample_outside_of_it(text, verdict, until_us):
    progression = make_progression(read_formula(text))
    for at in range(4):
        progression.progress(at * UNIT_US, {"x": 3 if at == 3 else 1, "p": not at})
    assert progression.verdict == verdict
    (reason,) = progression.explain()
    assert is_temporal(reason.part)
    assert (reason.since_us, reason.until_us, reason.samples) == (0, until_us, {})


@given(formulas, traces(gaps=True, missing=True), PERIODS)
@MODERATE
def test_whatever_decides_a_formula_is_explained_by_what_the_deciding_state_brought(formula, states, period_us):
    progression = make_progression(formula, period_us)
    for valid_us, values in states:
        if progression.verdict == "undecided":
            progression.progress(valid_us, values)
            decided_us, brought = valid_us, values
    for reason in progression.explain():
        assert reason.valid_us == decided_us
        assert all(brought.get(label, NO_VALUE) == value for label, value in reason.samples.items())
        if reason.samples:
            assert atom(reason.part, brought) is reason.holds


@pytest.mark.parametrize("way", ["object", "deadlines"])
def test_a_disjunction_of_many_conjunctions_stays_small(way):
    formula = read_formula("exists v in d: (eventually[0, 1s] s[v]) and (always[0, 500ms] eventually[0, 300ms] t[v])")
    domains = {"d": tuple(f"m{number}" for number in range(100))}
    progression = make_progression(formula, UNIT_US, way=way)
    for at in range(5):
        values = {f"{name}[{one}]": (at + len(one)) % 3 == 0 for one in domains["d"] for name in "st"}
        progression.progress(at * UNIT_US, values, domains)
        assert progression.kept <= 300


@pytest.mark.parametrize("way", ["object", "deadlines"])
def test_a_formula_over_nine_thousand_members_is_within_the_limit_whichever_way(way):
    formula = read_formula("always forall u in uavs: p[u] -> eventually[0, 1s] q[u]")
    progression = make_progression(formula, UNIT_US, way=way)
    progression.progress(0, {}, {"uavs": tuple(f"u{at}" for at in range(9_000))})
    assert progression.verdict == "undecided"
