from math import inf, nan

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dyknow import NO_VALUE
from dyknow.kpl import profile_formula, read_formula, unit_vocabulary
from dyknow.reasoning import (
    Derivation,
    Monitor,
    builtin_profiles,
    clearance,
    instantiate,
    required_labels,
    split_growing,
)
from tests.strategies import examples

SPLIT = {name: split_growing(profile_formula(each, "0")) for name, each in builtin_profiles().items()}
FORMULAS = {name: instantiate(found[2], found[0], "1") for name, found in SPLIT.items() if found is not None}


def of(text):
    return clearance(read_formula(text, unit_vocabulary("0")))


def test_beyond_the_distances_and_times_of_a_formula_it_holds():
    assert of("always (xy_dist[0, 1] >= 15 or z_dist[0, 1] >= 10)") == (16.0, 0.0)
    assert clearance(FORMULAS["proximity-warn"]) == (61.0, 10.0)
    assert of("always not (cpa_time[0, 1] <= 30s and cpa_xy[0, 1] < 100)") == (101.0, 30.0)
    assert of("always (xy_dist[0, 1] > -5)") == (1.0, 0.0)


def test_well_clear_holds_beyond_its_distance_and_the_way_of_its_modified_tau():
    assert of("always well_clear[0, 1] = 1") == (13.0, 6.0)
    assert of("always time_to_violation[0, 1] > 30s") == (13.0, 36.0)
    assert of("always time_to_violation[0, 1] >= 300s") is None, "no time is longer than 180 s"
    crewed = builtin_profiles()["well-clear-crewed"]
    assert clearance(FORMULAS["well-clear-crewed"], crewed.volume) == (pytest.approx(610.6), 60.0)


@pytest.mark.parametrize(
    "text",
    [
        "always z_dist[0, 1] >= 10",
        "always (xy_dist[0, 1] >= 15 and z_dist[0, 1] >= 10)",
        "always xy_dist[0, 1] <= 500",
        "always cpa_xy[0, 1] >= 15",
        "always hmd[0, 1] >= 15",
        "always cpa_time[0, 1] > 10s",
        "always abs(xy_dist[0, 1] - 100) >= 5",
        "always (xy_dist[0, 1] >= 15 or xy_dist[0, 2] >= 15)",
        "always (xy_dist[0, 1] < 15 -> eventually[0, 2s] xy_dist[0, 1] >= 15)",
        "always[0, 10s] xy_dist[0, 1] >= 15",
        "eventually xy_dist[0, 1] >= 15",
        "xy_dist[0, 1] >= 15",
    ],
)
def test_where_distance_alone_does_not_decide_there_is_no_clearance(text):
    assert of(text) is None


LATITUDES = st.floats(58.3, 58.5) | st.floats(-90, 90) | st.sampled_from([58.4, nan, inf, 1e308])
LONGITUDES = st.floats(15.4, 15.6) | st.floats(-180, 180) | st.sampled_from([15.5, nan, inf, -1e308])
SPEEDS = st.tuples(*[st.floats(-40, 40) | st.sampled_from([0.0, nan, inf, 1e308])] * 3)
NUMBERS = st.floats(0, 200) | st.sampled_from([nan, inf, 1e308])
NOTHING = st.just(NO_VALUE)
INPUTS = {
    "heli-position": NOTHING | st.tuples(LATITUDES, LONGITUDES),
    "heli-altitude": NOTHING | st.tuples(NUMBERS),
    "heli-velocity": NOTHING | SPEEDS,
}


@settings(max_examples=examples(300))
@given(st.data(), st.sampled_from(sorted(name for name, one in FORMULAS.items() if clearance(one) is not None)))
def test_a_pair_that_is_beyond_violates_nothing_and_lacks_nothing(data, name):
    formula, profile = FORMULAS[name], builtin_profiles()[name]
    derivation = Derivation(required_labels(formula), profile.vertical, volume=profile.volume)
    state = tuple(data.draw(INPUTS[each.label]) for each in derivation.inputs)
    if derivation.beyond(clearance(formula, profile.volume))(state):
        one = Monitor(name, formula, ("0", "1"), 100_000, 500_000, inputs=derivation.input_names)
        assert one.on_state(0, 0, derivation.values(state), lacks=derivation.lacks(state)) == []
        assert one.shows == "ok"


def test_a_clear_state_is_taken_only_where_it_can_change_nothing_but_freshness():
    formula = FORMULAS["proximity"]
    one = Monitor("proximity", formula, ("0", "1"), 100_000, 500_000)
    near, far = ({"xy_dist[0, 1]": metres, "z_dist[0, 1]": 0.0} for metres in (5.0, 500.0))
    assert not one.on_clear(0, 0), "its first state"
    one.on_state(0, 0, far)
    assert one.on_clear(100_000, 100_000)
    assert not one.on_clear(100_000, 100_000), "no later state"
    one.on_time(1_000_000)
    assert one.inputs == "stale"
    assert one.on_clear(900_000, 1_000_000)
    assert (one.inputs, one.shows) == ("fresh", "ok")
    assert [event.event for event in one.on_state(1_000_000, 1_000_000, near)] == ["opened"]
    assert not one.on_clear(1_100_000, 1_100_000), "its alarm is open"
    one.on_state(1_100_000, 1_100_000, far)
    assert [event.event for event in one.on_state(1_200_000, 1_200_000, far)] == ["closed"]
    one.mark_missing("1", 1_200_000)
    assert not one.on_clear(1_300_000, 1_300_000), "its source is gone"
