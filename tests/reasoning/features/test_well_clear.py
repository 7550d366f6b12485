"""Well clear: what it means, by its definition word by word and by flying on."""

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from dyknow.reasoning.features.bands import Goal, Intruders, ValueRange, altitude_bands, speed_bands, track_bands
from dyknow.reasoning.features.well_clear import (
    AMONG_SMALL,
    FROM_CREWED,
    Thresholds,
    is_well_clear,
    time_to_violation_s,
    violation_interval,
)
from dyknow.reasoning.features.well_clear_arrays import are_well_clear, times_to_violation_s, violation_intervals
from tests.strategies import examples

PLACES = st.tuples(st.floats(-200, 200), st.floats(-200, 200), st.floats(-40, 40))
VELOCITIES = st.tuples(*[st.integers(-120, 120).map(lambda each: each / 8)] * 3)
ANY = st.sampled_from([0.0, 1e-320, 1e-170, -1e-14, 1e-9, 1.0, -12.0, 3e4])
VOLUMES = st.sampled_from(
    [AMONG_SMALL, FROM_CREWED, Thresholds(30.0, 5.0, 20.0, 0.0), Thresholds(10.0, 10.0, 0.0, 15.0)]
)
SLACK_S = 1e-6


def after(s, v, t):
    return tuple(place + speed * t for place, speed in zip(s, v, strict=True))


@settings(max_examples=examples(200))
@given(PLACES, VELOCITIES, VOLUMES)
def test_both_sides_see_the_same(s, v, volume):
    there = tuple(-each for each in s), tuple(-each for each in v)
    assert is_well_clear(s, v, volume) == is_well_clear(*there, volume)
    assert violation_interval(s, v, volume) == violation_interval(*there, volume)


@settings(max_examples=examples(200))
@given(PLACES, VELOCITIES, VOLUMES, st.floats(0, 60))
def test_flown_on_well_clear_is_lost_within_the_interval_and_nowhere_else(s, v, volume, t):
    violation = violation_interval(s, v, volume, 60.0)
    if violation is not None:
        assume(min(abs(t - violation.time_in_s), abs(t - violation.time_out_s)) > SLACK_S)
    within = violation is not None and violation.time_in_s < t < violation.time_out_s
    if is_well_clear(after(s, v, t), v, volume) == within:
        near = [after(s, v, t + delta) for delta in (-SLACK_S, SLACK_S)]
        assert any(is_well_clear(each, v, volume) != within for each in near), "it is no matter of rounding"


@settings(max_examples=examples(200))
@given(PLACES, VELOCITIES, VOLUMES)
def test_no_time_is_left_exactly_while_well_clear_is_lost(s, v, volume):
    left_s = time_to_violation_s(s, v, volume)
    if is_well_clear(s, v, volume):
        assert left_s > 0.0 or not is_well_clear(after(s, v, SLACK_S), v, volume)
    else:
        assert left_s == 0.0


@settings(max_examples=examples(200))
@given(PLACES, VELOCITIES, VOLUMES, st.floats(1, 100), st.floats(0, 100))
def test_looking_further_ahead_finds_what_was_found_and_no_earlier(s, v, volume, ahead_s, more_s):
    short, long = (violation_interval(s, v, volume, each) for each in (ahead_s, ahead_s + more_s))
    if short is not None:
        assert long is not None
        assert abs(long.time_in_s - short.time_in_s) < SLACK_S
        assert long.time_out_s >= short.time_out_s - SLACK_S
    elif long is not None:
        assert long.time_in_s >= ahead_s - SLACK_S


@settings(max_examples=examples(200))
@given(PLACES, VELOCITIES, VOLUMES)
def test_wider_thresholds_lose_well_clear_no_later(s, v, volume):
    wider = Thresholds(*(1.5 * each for each in volume))
    assert is_well_clear(s, v, volume) or not is_well_clear(s, v, wider)
    assert time_to_violation_s(s, v, wider) <= time_to_violation_s(s, v, volume) + SLACK_S


@settings(max_examples=examples(200))
@given(
    st.lists(st.tuples(*[PLACES | st.tuples(ANY, ANY, ANY), VELOCITIES | st.tuples(ANY, ANY, ANY)]), min_size=1),
    VOLUMES,
)
def test_many_at_once_are_as_each_by_itself(pairs, volume):
    s, v = (np.array(each) for each in zip(*pairs, strict=True))
    entries_s, exits_s = violation_intervals(s, v, volume, 60.0)
    clear, left_s = are_well_clear(s, v, volume), times_to_violation_s(s, v, volume, 60.0)
    for i, (place, velocity) in enumerate(pairs):
        one = violation_interval(place, velocity, volume, 60.0)
        assert (one is not None) == np.isfinite(entries_s[i])
        if one is not None:
            assert abs(one.time_in_s - entries_s[i]) < SLACK_S
            assert abs(one.time_out_s - exits_s[i]) < SLACK_S
        assert clear[i] == is_well_clear(place, velocity, volume)
        assert abs(left_s[i] - time_to_violation_s(place, velocity, volume, 60.0)) < SLACK_S


def test_of_two_head_on_the_tracks_ahead_are_no_longer_clear():
    traffic = Intruders((10.0, 0.0, 0.0), np.array([[200.0, 0.0, 0.0]]), np.array([[-10.0, 0.0, 0.0]]))
    goal = Goal(AMONG_SMALL, 30.0)
    tracks = track_bands(traffic, goal, 1.0)
    assert [band.is_clear for band in tracks] == [False, True, False]
    assert tracks[0].low == 0.0
    assert tracks[0].high == 360.0 - tracks[2].low, "left and right are alike"
    speeds = speed_bands(traffic, goal, ValueRange(0.0, 15.0, 0.5))
    assert [band.is_clear for band in speeds] == [False], "even standing still it is met"
    altitudes = altitude_bands(traffic, goal, ValueRange(20.0, 120.0, 1.0), 60.0)
    assert altitudes == ((20.0, 51.0, True), (51.0, 69.0, False), (69.0, 120.0, True))


@settings(max_examples=examples(50))
@given(st.lists(st.tuples(PLACES, VELOCITIES), min_size=1, max_size=4), VELOCITIES)
def test_a_track_is_clear_where_no_other_is_met_on_it(others, own):
    s, v = (np.array(each) for each in zip(*others, strict=True))
    speed = float(np.hypot(*own[:2]))
    assume(speed > 0.5)
    bands = track_bands(Intruders(own, s, v), Goal(AMONG_SMALL, 30.0), 5.0)
    assert (bands[0].low, bands[-1].high) == (0.0, 360.0)
    for band in bands:
        middle = np.radians((band.low + band.high) / 2)
        if band.is_clear and band.high - band.low > 10.0:
            heading = np.degrees(np.arctan2(own[1], own[0]))
            steps = round((np.degrees(middle) - heading) / 5.0)
            track = np.radians(heading + 5.0 * steps)
            velocity = np.array([speed * np.cos(track), speed * np.sin(track), own[2]])
            for place, each in zip(s, v, strict=True):
                met = violation_interval(place, each - velocity, AMONG_SMALL, 30.0)
                assert met is None or met.time_out_s - met.time_in_s < SLACK_S
