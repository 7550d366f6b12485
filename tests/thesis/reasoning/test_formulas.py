"""Numbered examples and definitions of sections 7.5, 7.6 and 9.4.2."""

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from dyknow.kpl import FeatureType, Vocabulary, parse_formula, print_formula, profile_formula, read_formula
from dyknow.reasoning import Monitor, builtin_profiles, make_progression, read_trace, split_growing
from dyknow.reasoning.formulas.tree import Duration
from tests.kpl.instances import Running
from tests.reasoning.meaning import State, verdict
from tests.reasoning.oracle import naive
from tests.reasoning.strategies import UNIT_US, formulas, traces
from tests.reasoning.ways import WAYS
from tests.strategies import examples
from tests.traces import check_trace

UAVS = Vocabulary(
    features={
        "speed": FeatureType(1, "number"),
        "winch": FeatureType(1, "number"),
        "power": FeatureType(1, "number"),
        "altitude": FeatureType(1, "number"),
        "attached": FeatureType(2, "boolean"),
        "executing-detach-box": FeatureType(2, "boolean"),
        "EXEC": FeatureType(0, "boolean"),
        "p": FeatureType(0, "boolean"),
        "on_roadsystem": FeatureType(1, "boolean"),
    },
    objects=("u", "b", "heli1", "bx7", "from"),
    domains=("uavs", "carryable"),
    constants={"T": Duration(1_000_000), "S": Duration(500_000), "M": 20},
)
DOMAINS = {"uavs": ("heli1",), "carryable": ("bx7",)}
PRINTED = {
    "7.5.1": "always forall u in uavs: speed[u] > 0.5 -> winch[u] <= 0.1",
    "7.5.2": "always forall u in uavs: power[u] > 90 -> (power[u] < 108 until[0, 5s] always[0, 10s] power[u] <= 90)",
    "7.6.1": (
        "always forall u in uavs: forall c in carryable: (attached[u, c] and altitude[u] >= 7.0) "
        "-> (attached[u, c] until altitude[u] <= 4.0)"
    ),
    "7.6.2": "eventually[0, 5000] always[0, 1000] attached[u, b]",
    "7.6.3": "EXEC until altitude[u] >= 7.0",
    "7.6.4": "EXEC until[0, 5000] (attached[u, b] until executing-detach-box[u, b])",
    "7.9 a": "always eventually[0, T] speed[u] <= M",
    "7.9 b": "always (speed[u] > M -> eventually[0, T] always[0, S] speed[u] <= M)",
    "7.10 a": "always eventually[0, 1000] p",
    "7.10 b": "always (not p -> eventually[0, 1000] always[0, 999] p)",
    "8.7.2 e": "eventually always[0, 1000] on_roadsystem[from]",
    "8.7.2 r": "false",
    "8.7.2 m": "always eventually[0, 30000] always[0, 5000] on_roadsystem[from]",
}
MODERATE = settings(max_examples=examples(200), deadline=None, suppress_health_check=[HealthCheck.too_slow])


def decided(name, step_ms=500, **series):
    """(verdict, time in ms) of an example over series of values by label, whichever way it goes."""
    labels = [label.replace("__", "[", 1) + "]" if "__" in label else label for label in series]
    states = [
        f'{{"t_ms": {at * step_ms}, '
        + ", ".join(f'"{label}": {value}' for label, value in zip(labels, row, strict=True))
        + "}"
        for at, row in enumerate(zip(*series.values(), strict=True))
    ]
    trace, formula = read_trace(states).states, read_formula(PRINTED[name], UAVS)
    found, t_ms, _ = check_trace(formula, trace, DOMAINS)
    given = [State(*state[:2], DOMAINS) for state in trace]
    for way in WAYS.values():
        said = way(formula, given)
        assert said[-1] == found
        assert found == "undecided" or t_ms == given[said.index(found)].valid_us / 1000
    return found, t_ms


@pytest.mark.parametrize("name", sorted(PRINTED))
def test_every_formula_of_the_thesis_reads_checks_and_prints(name):
    formula = read_formula(PRINTED[name], UAVS)
    assert read_formula(print_formula(formula), UAVS) == formula
    assert parse_formula(print_formula(parse_formula(PRINTED[name]))) == parse_formula(PRINTED[name])


def test_7_5_1_moving_with_the_winch_lowered_is_a_violation():
    assert decided("7.5.1", speed__heli1=[0, 0.4, 3], winch__heli1=[2, 2, 0]) == ("undecided", None)
    assert decided("7.5.1", speed__heli1=[0, 0.4, 3], winch__heli1=[2, 2, 2]) == ("false", 1000)


def test_7_5_2_too_much_power_for_too_long_or_without_rest_is_a_violation():
    rest = [80] * 21
    assert decided("7.5.2", power__heli1=[80, 100, 100, *rest, 80]) == ("undecided", None)
    assert decided("7.5.2", power__heli1=[80, 100, 110, *rest]) == ("false", 1000)
    assert decided("7.5.2", power__heli1=[80, *[100] * 12]) == ("false", 5500)
    relapse = [80, 100, *[80] * 9, *[100] * 13]
    assert decided("7.5.2", power__heli1=relapse) == ("false", 5500)


def test_7_6_1_a_carryable_dropped_in_flight_is_a_violation():
    labels = {"attached__heli1, bx7": ["true"] * 4, "altitude__heli1": [3, 8, 9, 4]}
    assert decided("7.6.1", **labels) == ("undecided", None)
    dropped = {"attached__heli1, bx7": ["true", "true", "false", "false"], "altitude__heli1": [3, 8, 9, 4]}
    assert decided("7.6.1", **dropped) == ("false", 1000)


def test_7_6_2_attached_within_five_seconds_and_for_one_second():
    formula = {"attached__u, b": ["false"] * 3 + ["true"] * 3}
    assert decided("7.6.2", **formula) == ("true", 2500)
    assert decided("7.6.2", **{"attached__u, b": ["false", "true"] * 7}) == ("false", 5000)


def test_7_6_3_the_flag_holds_until_the_altitude_is_reached():
    assert decided("7.6.3", EXEC=["true", "true", "false"], altitude__u=[1, 5, 7]) == ("true", 1000)
    assert decided("7.6.3", EXEC=["true", "false", "false"], altitude__u=[1, 5, 7]) == ("false", 500)


def test_7_6_4_attached_within_five_seconds_and_until_detached():
    series = {
        "EXEC": ["true", "true", "false", "false"],
        "attached__u, b": ["false", "false", "true", "false"],
        "executing-detach-box__u, b": ["false", "false", "false", "true"],
    }
    assert decided("7.6.4", **series) == ("true", 1500)
    assert decided("7.6.4", **series | {"executing-detach-box__u, b": ["false"] * 4}) == ("false", 1500)
    never = {label: ["true" if label == "EXEC" else "false"] * 12 for label in series}
    assert decided("7.6.4", **never) == ("false", 5000)


def test_7_9_one_measurement_within_the_time_is_enough_for_the_first_pattern():
    assert decided("7.9 a", speed__u=[25, 25, 19, 25, 25, 19]) == ("undecided", None)
    assert decided("7.9 a", speed__u=[19, 25, 25, 25, 19]) == ("false", 1500)


def test_7_9_the_second_pattern_wants_an_interval_of_calm():
    assert decided("7.9 b", speed__u=[25, 25, 19, 19, 25, 19, 19]) == ("undecided", None)
    assert decided("7.9 b", speed__u=[25, 19, 25, 19, 25, 19, 19]) == ("false", 1000)


def test_8_7_2_a_vision_object_is_a_car_once_it_was_on_the_road_for_a_second():
    on = "on_roadsystem__from"
    assert decided("8.7.2 e", **{on: ["true"] * 2}) == ("undecided", None)
    assert decided("8.7.2 e", **{on: ["true"] * 3}) == ("true", 1000)
    assert decided("8.7.2 e", **{on: ["true", "true", "false", "true", "true", "true"]}) == ("true", 2500)


def test_8_7_2_anchors_are_never_reestablished():
    assert decided("8.7.2 r", on_roadsystem__from=["true"]) == ("false", 0)


def test_8_7_2_it_remains_one_while_five_seconds_on_the_road_begin_within_thirty():
    on = "on_roadsystem__from"
    assert decided("8.7.2 m", **{on: ["false"] * 60 + ["true"] * 11}) == ("undecided", None)
    assert decided("8.7.2 m", **{on: ["false"] * 61}) == ("false", 30_000)
    assert decided("8.7.2 m", **{on: ["false"] * 58 + ["true"] * 10 + ["false"] * 5}) == ("false", 34_000)


def test_7_10_the_worst_sequences_stay_undecided_until_their_time_is_over():
    assert decided("7.10 a", step_ms=100, p=["false"] * 10) == ("undecided", None)
    assert decided("7.10 a", step_ms=100, p=["false"] * 11) == ("false", 1000)
    late = ["false"] * 10 + ["true"] * 10 + ["false"]
    assert decided("7.10 b", step_ms=100, p=["true", *late]) == ("undecided", None)
    assert decided("7.10 b", step_ms=100, p=["true", "false", *["true", "false"] * 6])[0] == "false"


@given(formulas, traces(max_size=6), st.integers(1, 5))
@MODERATE
def test_definition_7_5_3_a_formula_holds_iff_its_progression_holds_in_the_rest(formula, states, seen):
    progression, left = make_progression(formula), formula
    for at_us, values in states[:seen]:
        progression.progress(at_us, values)
        left = naive(left, values, UNIT_US)
    whole = verdict(formula, states, ended=True)
    if states[seen:]:
        assert verdict(left, states[seen:], ended=True) == whole
    for at_us, values in states[seen:]:
        progression.progress(at_us, values)
    assert progression.verdict in {"undecided", "true" if whole else "false"}


@given(formulas, traces(max_size=6))
@MODERATE
def test_7_5_1_eventually_is_true_until_and_always_is_not_eventually_not(formula, states):
    for text, same in (
        ("eventually[0, 200] ({})", "true until[0, 200] ({})"),
        ("always[100, oo] ({})", "not eventually[100, oo] not ({})"),
    ):
        inside = print_formula(formula)
        one, other = (read_formula(each.format(inside)) for each in (text, same))
        first, second = make_progression(one), make_progression(other)
        for at_us, values in states:
            first.progress(at_us, values)
            second.progress(at_us, values)
            assert first.verdict == second.verdict


def test_9_4_2_the_named_monitor_proximity_as_printed():
    formula = profile_formula(builtin_profiles()["proximity-thesis"], "0")
    assert split_growing(formula) is not None
    printed = read_formula("always (xy_dist[0, 1] >= 15.0 and z_dist[0, 1] >= 10.0)")
    monitor = Monitor("proximity", printed, ("0", "1"), 1_000_000, 1_000_000)
    assert monitor.on_state(0, 0, {"xy_dist[0, 1]": 500.0, "z_dist[0, 1]": 12.0}) == []
    (opened,) = monitor.on_state(1_000_000, 1_000_000, {"xy_dist[0, 1]": 500.0, "z_dist[0, 1]": 3.0})
    assert (opened.event, opened.units) == ("opened", ("0", "1"))


def test_definition_7_5_1_terms_are_bounds_of_intervals_and_objects_are_values_in_a_running_monitor() -> None:
    """Temporal terms are made of times and constants; value terms are numbers, truth values and objects."""
    running = Running(
        "source object links\nstrmgen link[a] = links\ndefine PERIOD = 100ms\ndefine WINDOW = 2 * PERIOD\n"
        'define l2 = "l2"\n'
        "monitor soon = always eventually[0, WINDOW + 100] link[a] = l2 with max delay 0\n"
        "monitor sooner = always eventually[0, WINDOW] link[a] = l2 with max delay 0\n"
    )
    for at, link in enumerate(["l2", "l1", "l1", "l1", "l2", "l2", "l2"]):
        running.push("links", link, at * 100_000)
    running.wait(1_000_000)
    opened = [(event.monitor, event.valid_us // 1000) for event in running.alarms if event.event == "opened"]
    assert opened == [("sooner", 300)], "the state at 100 ms has 300 ms of l1 before it, not more"
