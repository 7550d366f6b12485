import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from dyknow.model.values import NO_VALUE
from dyknow.reasoning import Monitor, make_progression
from dyknow.reasoning.formulas.tree import (
    LIMIT_NODES,
    Always,
    And,
    Compare,
    Const,
    Domain,
    Eventually,
    Feature,
    Forall,
    Implies,
    Or,
    Variable,
)
from tests.reasoning.meaning import verdict
from tests.reasoning.strategies import UNIT_US, formulas, state_formulas, traces
from tests.strategies import examples

P, Q = Feature("p"), Feature("q")
PERIOD_US, MAX_DELAY_US, STALE_US = UNIT_US, 500_000, 2_000_000
MODERATE = settings(max_examples=examples(200), deadline=None, suppress_health_check=[HealthCheck.too_slow])


def monitor(formula=None, **options):
    options.setdefault("key", ("0", "1"))
    return Monitor("near", formula or Always(P), period_us=PERIOD_US, max_delay_us=MAX_DELAY_US, **options)


def feed(one, text, start=0, name="p"):
    """One state a character, every period: 1, 0, or a blank for no value; the events of each."""
    events = []
    for at, character in enumerate(text, start):
        values = {} if character == " " else {name: character == "1"}
        events += one.on_state(at * PERIOD_US, at * PERIOD_US + 1, values)
    return events


def told(events):
    return [(event.event, event.valid_us // PERIOD_US, (event.detected_us - 1) // PERIOD_US) for event in events]


def alarms_by_the_book(phi, states, k=2):
    """F8 by brute force: [(event, state it is about, state that showed it), ...]."""
    found, start, is_open, counted_from = [], 0, False, 0
    for now in range(len(states)):
        said = {j: verdict(phi, states[: now + 1], j, period_us=PERIOD_US) for j in range(start, now + 1)}
        if False in said.values():
            if not is_open:
                found.append(("opened", now, now))
            is_open, start, counted_from = True, now + 1, now + 1
            continue
        if not is_open:
            continue
        clean = []
        for j in range(counted_from, now + 1):
            if said[j] is None:
                break
            clean.append(j)
        if len(clean) >= k:
            found.append(("closed", clean[0], now))
            is_open = False
    return found


@given(formulas, traces(max_size=12), st.integers(1, 3))
@MODERATE
def test_alarms_open_and_close_as_the_definition_says(phi, states, k):
    states = [(at * PERIOD_US, values) for at, (_, values) in enumerate(states)]
    one, events = monitor(Always(phi), close_after=k), []
    for at_us, values in states:
        events += one.on_state(at_us, at_us + 1, values, lacks=())
    assert told(events) == alarms_by_the_book(phi, states, k)


@given(state_formulas, traces(max_size=12, missing=True))
@MODERATE
def test_the_first_alarm_is_where_progression_turns_false(phi, states):
    one, progression = monitor(Always(phi)), make_progression(Always(phi))
    for at_us, values in states:
        events = one.on_state(at_us, at_us, values)
        progression.progress(at_us, values)
        assert one.verdict == progression.verdict
        assert bool(events) == (progression.verdict == "false")
        if events:
            break


def test_an_alarm_opens_and_closes_at_the_first_of_two_clean_states():
    assert told(feed(monitor(), "1101001011")) == [("opened", 2, 2), ("closed", 8, 9)]


def test_opening_and_closing_share_an_id_that_can_be_computed():
    opened, closed = feed(monitor(), "1011")
    assert opened.id == closed.id == "near/0/0-1/100000"
    assert (opened.units, opened.monitor) == (("0", "1"), "near")


def test_every_alarm_has_an_id_of_its_own():
    assert len({event.id for event in feed(monitor(), "0110110")}) == 3


def test_an_alarm_tells_the_values_that_raised_it():
    one = monitor(Always(Compare(">=", Feature("xy_dist", ("0", "1")), Const(15))))
    (opened,) = one.on_state(0, 0, {"xy_dist[0, 1]": 12.1, "other": 3})
    assert opened.values == {"xy_dist[0, 1]": 12.1}


def test_it_closes_after_as_many_clean_states_as_it_is_told():
    assert told(feed(monitor(close_after=3), "0110111")) == [("opened", 0, 0), ("closed", 4, 6)]
    assert told(feed(monitor(close_after=1), "01")) == [("opened", 0, 0), ("closed", 1, 1)]


def test_a_state_without_value_is_no_clean_state():
    assert told(feed(monitor(), "01 11")) == [("opened", 0, 0), ("closed", 3, 4)]


def test_an_open_alarm_stays_open_while_inputs_are_not_fresh_and_counts_anew_after_that():
    one = monitor()
    assert told(feed(one, "01")) == [("opened", 0, 0)]
    one.on_time(PERIOD_US * 10)
    assert one.inputs == "stale"
    assert one.verdict == "false"
    assert told(feed(one, "11", start=20)) == [("closed", 20, 21)]


def test_a_response_is_violated_when_its_time_is_over():
    late = Always(Implies(P, Eventually(Q, 0, 2 * PERIOD_US)))
    one, events = monitor(late), []
    for at, (p, q) in enumerate([(1, 0), (0, 0), (0, 0), (0, 0), (0, 1)]):
        events += one.on_state(at * PERIOD_US, at * PERIOD_US + 1, {"p": bool(p), "q": bool(q)})
    assert told(events) == [("opened", 2, 2), ("closed", 3, 4)]


def test_a_formula_of_another_form_raises_one_alarm():
    one = monitor(Eventually(P, 0, 2 * PERIOD_US))
    assert told(feed(one, "00011")) == [("opened", 2, 2)]
    assert one.verdict == "false"
    assert one.shows == "alarm"


def test_a_formula_that_came_true_stays_ok():
    one = monitor(Eventually(P))
    feed(one, "010")
    assert (one.verdict, one.shows) == ("true", "ok")


def test_inputs_are_missing_until_the_first_complete_state():
    one = monitor(Always(Or((P, Q))), since_us=7)
    assert (one.inputs, one.inputs_since_us, one.missing_inputs, one.shows) == ("missing", 7, ("p", "q"), "unknown")
    one.on_state(0, 5, {"p": True})
    assert (one.inputs, one.missing_inputs) == ("missing", ("q",))
    one.on_state(PERIOD_US, 9, {"p": True, "q": True})
    assert (one.inputs, one.inputs_since_us, one.missing_inputs, one.shows) == ("fresh", 9, (), "ok")


def test_stale_when_the_last_due_state_is_max_delay_and_one_period_old_and_missing_two_seconds_later():
    one = monitor()
    feed(one, "1")
    stale_us = PERIOD_US + MAX_DELAY_US + PERIOD_US
    assert one.deadline_us == stale_us
    one.on_time(stale_us - 1)
    assert (one.inputs, one.shows) == ("fresh", "ok")
    one.on_time(stale_us)
    assert (one.inputs, one.inputs_since_us, one.shows) == ("stale", stale_us, "unknown")
    assert one.deadline_us == stale_us + STALE_US
    one.on_time(stale_us + STALE_US)
    assert (one.inputs, one.inputs_since_us, one.deadline_us) == ("missing", stale_us + STALE_US, None)


def test_a_late_timer_does_not_move_the_instants():
    one = monitor()
    feed(one, "1")
    one.on_time(60_000_000)
    assert (one.inputs, one.inputs_since_us) == ("missing", 2 * PERIOD_US + MAX_DELAY_US + STALE_US)


def test_states_that_lack_an_input_make_it_stale_and_name_it():
    one = monitor(Always(And((P, Q))))
    one.on_state(0, 0, {"p": True, "q": True})
    for at in range(1, 7):
        one.on_state(at * PERIOD_US, at * PERIOD_US + MAX_DELAY_US, {"p": True, "q": NO_VALUE})
    assert (one.inputs, one.missing_inputs, one.shows) == ("stale", ("q",), "unknown")
    one.on_state(7 * PERIOD_US, 8 * PERIOD_US, {"p": True, "q": True})
    assert one.inputs == "fresh"


def test_a_single_incomplete_state_does_not_make_it_stale():
    one = monitor()
    feed(one, "1 1 1 1")
    assert one.inputs == "fresh"


def test_a_source_that_is_gone_counts_as_missing_whatever_still_comes():
    one = monitor()
    feed(one, "11")
    one.mark_missing("heli-position[1]", 250_000, "skewed")
    assert (one.inputs, one.inputs_since_us, one.missing_inputs) == ("missing", 250_000, ("heli-position[1]",))
    assert dict(one.reasons) == {"heli-position[1]": "skewed"}
    assert feed(one, "000", start=3) == []
    assert one.shows == "unknown"
    one.mark_present("heli-position[1]", 600_000)
    assert one.inputs == "missing"
    feed(one, "1", start=7)
    assert (one.inputs, one.shows) == ("fresh", "ok")


def test_a_second_source_that_is_gone_keeps_it_missing():
    one = monitor()
    feed(one, "1")
    one.mark_missing("a", 10)
    one.mark_missing("b", 20)
    one.mark_present("a", 30)
    feed(one, "1", start=1)
    assert (one.inputs, one.inputs_since_us) == ("missing", 10)
    assert one.missing_inputs == ("b",)


def test_inputs_are_named_by_what_they_are_made_of():
    one = monitor(inputs=("heli-position[0]", "heli-position[1]"))
    assert one.missing_inputs == ("heli-position[0]", "heli-position[1]")
    one.on_state(0, 0, {"p": NO_VALUE}, lacks=("heli-position[1]",))
    assert one.missing_inputs == ("heli-position[1]",)


def test_complete_inputs_that_decide_nothing_do_not_show_safe():
    one = monitor()
    one.on_state(0, 0, {"p": NO_VALUE}, lacks=())
    assert one.inputs == "fresh"
    assert one.shows == "unknown"


def test_a_state_that_is_not_later_is_ignored():
    one = monitor()
    feed(one, "11")
    assert one.on_state(PERIOD_US, 999_999, {"p": False}) == []


@pytest.mark.parametrize(
    ("policy", "expected"),
    [("undecided", []), ("true", []), ("skip", []), ("false", [("opened", 1, 1)])],
)
def test_the_policy_for_missing_values_is_the_monitors(policy, expected):
    assert told(feed(monitor(no_value=policy), "1 1")) == expected


def test_skipped_states_neither_satisfy_nor_interrupt():
    assert told(feed(monitor(no_value="skip"), "01 1")) == [("opened", 0, 0), ("closed", 1, 3)]


def test_quantified_monitors_read_their_domain_with_each_state():
    body = Feature("s", (Variable("v"),))
    one = monitor(Always(Or((Forall("v", Domain("d"), body, growing=True), Q))))
    assert one.on_state(0, 0, {"s[a]": True, "q": False}, domains={"d": ("a",)}) == []
    assert one.inputs == "fresh"
    (opened,) = one.on_state(1, 1, {"s[a]": True, "s[b]": False, "q": False}, domains={"d": ("a", "b")})
    assert opened.values == {"s[a]": True, "s[b]": False, "q": False}


def test_obligations_made_while_an_alarm_was_open_still_hold_after_it_closed():
    late = Always(And((Q, Implies(P, Eventually(Feature("r"), 0, 4 * PERIOD_US)))))
    one, events = monitor(late, close_after=1), []
    for at, (p, q) in enumerate([(0, 0), (0, 1), (1, 1), (0, 1), (0, 1), (0, 1), (0, 1)]):
        events += one.on_state(at * PERIOD_US, at * PERIOD_US + 1, {"p": bool(p), "q": bool(q), "r": False})
    assert told(events) == [("opened", 0, 0), ("closed", 1, 1), ("opened", 6, 6)]


def test_states_out_of_order_doubled_missing_or_without_a_number_are_counted_and_harm_nothing():
    one = Monitor("m", Always(Compare("<", Feature("x"), Const(3))), ("u",), PERIOD_US, PERIOD_US)
    nan = float("nan")
    for at, value in ((2, 1.0), (1, 9.0), (2, 9.0), (3, nan), (4, NO_VALUE), (5, None), (6, 1.0)):
        given = {} if value is None else {"x": value}
        assert one.on_state(at * PERIOD_US, 6 * PERIOD_US, given) == []
    assert one.counted == {"out of order": 1, "duplicate": 1, "missing": 3, "NaN": 1}
    assert (one.shows, one.verdict) == ("ok", "undecided")


def test_an_alarm_names_the_samples_of_its_state_and_no_others() -> None:
    one = Monitor("m", Always(Compare(">=", Feature("a"), Const(1))), (), 10, 20, inputs=("a", "b"))
    (opened,) = one.on_state(10, 12, {"a": 0}, lacks=("b",))
    assert opened.samples_us == {"a": 10}
    assert one.on_state(20, 22, {"a": 2}, samples_us={"a": 17, "b": 20}) == []
    (closed,) = one.on_state(30, 32, {"a": 2}, lacks=())
    assert (closed.valid_us, closed.samples_us) == (20, {"a": 17, "b": 20})


def test_a_margin_is_known_once_it_was_asked_for_and_of_fresh_inputs_only():
    one = monitor(Always(Compare("<=", Feature("v"), Const(15.0))))

    def state(at, speed):
        return one.on_state(at * PERIOD_US, at * PERIOD_US, {} if speed is None else {"v": speed})

    state(1, 11.0)
    assert one.margin() is None
    state(2, 11.0)
    assert one.margin() == 4.0
    state(3, 18.0)
    assert one.margin() == -3.0
    state(4, None)
    assert one.margin() is None
    one.on_time(4 * PERIOD_US + 10 * STALE_US)
    assert one.margin() is None
    assert monitor(Always(Eventually(P, 0, None))).margin() is None


def test_an_alarm_is_explained_as_often_as_is_wanted():
    some = tuple(map(str, range(100)))
    one = monitor(Always(Or((P, *map(Feature, some)))))
    one.on_state(PERIOD_US, PERIOD_US + 1, dict.fromkeys(("p", *some), False))
    first = one.explanation
    assert len(first) == 101
    for _ in range(LIMIT_NODES // 100):
        assert one.explanation == first
