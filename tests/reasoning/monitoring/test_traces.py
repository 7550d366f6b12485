import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow.kpl import read_formula
from dyknow.model.errors import TextError
from dyknow.model.values import NO_VALUE
from dyknow.reasoning import TraceState, read_trace, trace_domains
from tests.traces import check_trace


def lines(*states):
    return [json.dumps(state) for state in states]


def test_states_have_a_time_and_values_by_label():
    trace = read_trace(
        ['{"t_ms": 100, "p": true, "speed[uav1]": 31.2, "x[a,b]": null}', "", '{"t_ms": 100.5, "m": "AUTO"}\n']
    )
    assert trace.states == (
        TraceState(100_000, {"p": True, "speed[uav1]": 31.2, "x[a, b]": NO_VALUE}),
        TraceState(100_500, {"m": "AUTO"}),
    )
    assert trace.labels == ("m", "p", "speed[uav1]", "x[a, b]")


def test_the_outcome_names_the_first_state_that_decided():
    trace = read_trace(lines(*({"t_ms": 100 * at, "speed[uav1]": 30 + at % 14} for at in range(20))))
    assert check_trace(read_formula("always speed[uav1] <= 42"), trace.states) == ("false", 1300, 13)
    assert check_trace(read_formula("eventually speed[uav1] > 100"), trace.states) == ("undecided", None, None)
    assert check_trace(read_formula("always[0, 250] speed[uav1] < 40"), trace.states) == ("true", 300, 3)


def test_times_that_are_no_whole_milliseconds_are_told_as_they_are():
    trace = read_trace(lines({"t_ms": 0.25, "p": False}))
    assert check_trace(read_formula("always p"), trace.states) == ("false", 0.25, 0)


def test_the_policy_for_missing_values_is_an_option():
    trace = read_trace(lines({"t_ms": 0, "p": None}, {"t_ms": 1, "p": True}))
    formula = read_formula("always[0, 1] p")
    assert check_trace(formula, trace.states)[0] == "undecided"
    assert check_trace(formula, trace.states, no_value="false") == ("false", 0, 0)
    assert check_trace(formula, trace.states, no_value="skip")[0] == "undecided"


def test_messages_belong_to_the_first_state_at_or_after_them():
    trace = read_trace(
        lines(
            {"t_ms": 0, "p": True},
            {"t_ms": 50, "message": "landed[uav1]"},
            {"t_ms": 100, "p": True},
            {"t_ms": 200, "p": True},
        )
    )
    assert [state.events for state in trace.states] == [(), ("landed[uav1]",), ()]
    assert check_trace(read_formula("eventually occurred(landed[uav1])"), trace.states) == ("true", 100, 1)


def test_domains_are_stated_or_found_where_the_formula_puts_its_variables():
    formula = read_formula("always forall u in uavs: forall c in cargo: attached[u, c] -> speed[u] < 5")
    states = lines({"t_ms": 0, "attached[uav1, box1]": True, "speed[uav2]": 3, "weight[box2]": 4})
    assert trace_domains(formula, read_trace(states)) == {"uavs": ("uav1", "uav2"), "cargo": ("box1",)}
    stated = read_trace([*lines({"domains": {"uavs": ["uav2"]}}), *states])
    assert trace_domains(formula, stated) == {"uavs": ("uav2",), "cargo": ("box1",)}


def test_objects_of_messages_are_members_too():
    formula = read_formula("forall u in uavs: eventually occurred(landed[u])")
    states = lines({"t_ms": 0, "p": 1}, {"t_ms": 5, "message": "landed[uav1]"}, {"t_ms": 9, "p": 1})
    trace = read_trace(states)
    assert trace_domains(formula, trace) == {"uavs": ("uav1",)}
    assert check_trace(formula, trace.states, trace_domains(formula, trace)) == ("true", 9, 1)


def test_domains_are_stated_from_a_line_on_which_only_growing_quantifiers_follow():
    slow = lines({"domains": {"uavs": ["a"]}}, {"t_ms": 0, "s[a]": 1, "s[b]": 9})
    trace = read_trace([*slow, *lines({"domains": {"uavs": ["a", "b"]}}, {"t_ms": 100, "s[a]": 1, "s[b]": 9})])
    for growing, verdict in (("", "undecided"), (" growing", "false")):
        formula = read_formula(f"always forall u in uavs{growing}: s[u] < 5")
        assert check_trace(formula, trace.states, trace_domains(formula, trace))[0] == verdict


def test_states_that_go_back_in_time_and_values_that_are_no_numbers_are_left_out_and_counted():
    good = lines({"t_ms": 100, "x": 1}, {"t_ms": 200, "x": 2})
    bad = ['{"t_ms": 100, "x": 7}', '{"t_ms": 50, "x": 7}', '{"t_ms": 150, "x": NaN, "y": -1e999}']
    trace = read_trace([good[0], *bad, good[1]])
    assert [state.values for state in trace.states] == [{"x": 1}, {"x": NO_VALUE, "y": NO_VALUE}, {"x": 2}]
    assert trace.left_out == {"duplicate": 1, "out of order": 1}
    assert trace.no_numbers == {"NaN": 1, "infinite": 1}
    assert trace.first_lines == {"duplicate": 2, "out of order": 3, "NaN": 4, "infinite": 4}


def test_a_quantified_formula_is_checked_over_the_domains_of_the_trace():
    formula = read_formula("always forall u in uavs: speed[u] > 0.5 -> winch[u] <= 0.1")
    trace = read_trace(
        lines(
            {"t_ms": 0, "speed[uav1]": 0, "winch[uav1]": 3, "speed[uav2]": 3, "winch[uav2]": 0},
            {"t_ms": 100, "speed[uav1]": 0.6, "winch[uav1]": 3, "speed[uav2]": 3, "winch[uav2]": 0},
        )
    )
    assert check_trace(formula, trace.states, trace_domains(formula, trace)) == ("false", 100, 1)


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        ("{", "no JSON"),
        ("[1, 2]", "a JSON object"),
        ('{"p": true}', "has a time"),
        ('{"t_ms": "soon"}', "has a time"),
        ('{"t_ms": true}', "has a time"),
        ('{"t_ms": 1e300}', "has a time"),
        ('{"t_ms": NaN, "p": true}', "has a time"),
        ('{"t_ms": 200, "p": [NaN]}', "neither a number"),
        ('{"t_ms": 200, "p": [1]}', "neither a number"),
        ('{"t_ms": 200, "p[": 1}', "label"),
        ('{"t_ms": 200, "message": 7}', ""),
        ('{"domains": [1]}', "domains are lists"),
        ("[" * 100_000, "no JSON"),
        ("x" * 1_100_000, "characters"),
        ('{"t_ms": ' + "9" * 5_000 + "}", ""),
    ],
)
def test_a_line_that_is_no_state_is_named_with_its_repair(bad, message):
    with pytest.raises(TextError, match=r"mission\.jsonl:2:") as caught:
        read_trace(['{"t_ms": 100, "p": true}', bad], "mission.jsonl")
    assert message in caught.value.message


@given(st.lists(st.text(max_size=60), max_size=5))
def test_any_lines_are_a_trace_or_a_text_error(found):
    try:
        read_trace(found)
    except TextError as error:
        assert error.line >= 1
