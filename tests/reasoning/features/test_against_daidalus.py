"""Well clear and its bands, compared with what NASA's DAIDALUS (C++, version 2, commit e0439250) made of 10 000 states.

`daidalus.npz` holds one state a row, in millimetres and milliseconds: D, Z, T, T_coa, look-ahead; the own aircraft (north,
east, up, then its velocity); how many others; the others. A fourth of the states has the thresholds of small aircraft, a
fourth those of ASTM F3442, a fourth those of DO-365, the rest drawn ones. Of each state `WCV_interval` and `violation` are
kept with the first of the others, and one sort of bands, all in turn. In the rows `overflowed`, DAIDALUS joins two ranges
whose bounds are far apart, for the difference of their bits overflows in `Util::almost_equals`; `corrected` is what it makes
of them where that difference is taken in 128 bits.
"""

import os
from functools import partial
from math import degrees
from pathlib import Path

import numpy as np
import pytest

from dyknow.reasoning.features.bands import (
    Goal,
    Intruders,
    ValueRange,
    altitude_bands,
    speed_bands,
    track_bands,
    vertical_speed_bands,
)
from dyknow.reasoning.features.well_clear import Thresholds, is_well_clear, time_to_violation_s, violation_interval
from dyknow.reasoning.features.well_clear_arrays import are_well_clear, times_to_violation_s, violation_intervals

KEPT = dict(np.load(Path(__file__).with_name("daidalus.npz")))
STATES = KEPT["states"] / 1000.0
NEAR = 1e-6
EVERY = 1 if os.environ.get("DYKNOW_FULL") else 5
"""Of the bands a fifth are compared in the short form."""


def state_of(row):
    state = STATES[row]
    others = state[12 : 12 + 6 * int(KEPT["states"][row, 11])].reshape(-1, 6)
    own = state[5:11]
    return Goal(Thresholds(*state[:4].tolist()), float(state[4])), own, others[:, :3] - own[:3], others[:, 3:]


def altitudes(traffic, goal, own):
    return altitude_bands(traffic, goal, ValueRange(0.0, 200.0, 4.0), own[2])


def vertical_speeds(rate, traffic, goal, own):
    return vertical_speed_bands(traffic, goal, ValueRange(-5.0, 5.0, 0.25, rate))


def speeds(rate, traffic, goal, own):
    return speed_bands(traffic, goal, ValueRange(0.0, 20.0, 0.5, rate))


def tracks(rate, traffic, goal, own):
    return track_bands(traffic, goal, 2.0, rate, 0.5)


SORTS = {
    "track, at once": partial(tracks, 0.0),
    "speed, at once": partial(speeds, 0.0),
    "vertical speed, at once": partial(vertical_speeds, 0.0),
    "altitude, at once": altitudes,
    "track, 15 deg/s": partial(tracks, 15.0),
    "speed, 2 m/s^2": partial(speeds, 2.0),
    "vertical speed, 1 m/s^2": partial(vertical_speeds, 1.0),
}


def test_violations_and_their_times_are_those_of_daidalus():
    kept = zip(KEPT["is_violated"], KEPT["is_conflict"], KEPT["times_s"], strict=True)
    for row, (is_violated, is_conflict, times_s) in enumerate(kept):
        goal, own, s, v = state_of(row)
        s_m, v_m_s = s[0], v[0] - own[3:]
        found = violation_interval(s_m, v_m_s, *goal)
        assert is_well_clear(s_m, v_m_s, goal.thresholds) != is_violated, row
        assert (found is not None) == is_conflict, row
        if found is not None:
            assert np.abs(found - times_s).max() < NEAR, row
            assert (time_to_violation_s(s_m, v_m_s, *goal) == 0.0) == is_violated, row


def test_violations_of_many_at_once_are_those_of_daidalus():
    by_goal = {}
    for row in range(len(STATES)):
        goal, own, s, v = state_of(row)
        by_goal.setdefault(goal, []).append((row, s[0], v[0] - own[3:]))
    for goal, members in by_goal.items():
        rows, s, v = (np.array(each) for each in zip(*members, strict=True))
        is_conflict, times_s = KEPT["is_conflict"][rows], KEPT["times_s"][rows]
        entries_s, exits_s = violation_intervals(s, v, *goal)
        assert (np.isfinite(entries_s) == is_conflict).all()
        assert (are_well_clear(s, v, goal.thresholds) != KEPT["is_violated"][rows]).all()
        found = np.stack([entries_s, exits_s], axis=1)[is_conflict]
        assert np.abs(found - times_s[is_conflict]).max(initial=0.0) < NEAR
        until_s = np.where(is_conflict, times_s[:, 0], goal.lookahead_s)
        assert np.abs(times_to_violation_s(s, v, *goal) - until_s).max() < NEAR


def kept_bands():
    """Of each row where its bounds and sorts begin, and how many there are; those that are corrected in their place."""
    counts = KEPT["counts"].astype(int)
    starts = np.concatenate([[0], np.cumsum(counts)])
    bands = [
        (KEPT["bounds"][starts[row] + row : starts[row + 1] + row + 1], KEPT["clear"][starts[row] : starts[row + 1]])
        for row in range(len(counts))
    ]
    at = 0
    for n, (row, count) in enumerate(zip(KEPT["overflowed"], KEPT["corrected_counts"].astype(int), strict=True)):
        bounds = KEPT["corrected_bounds"][at + n : at + n + count + 1]
        bands[row] = bounds, KEPT["corrected_clear"][at : at + count]
        at += count
    return bands


@pytest.mark.parametrize("sort", SORTS)
def test_bands_are_those_of_daidalus(sort):
    bands, turn = kept_bands(), list(SORTS).index(sort)
    several = 0
    for row in range(turn, len(STATES), EVERY * len(SORTS)):
        goal, own, s, v = state_of(row)
        found = SORTS[sort](Intruders(own[3:], s, v), goal, own)
        bounds, clear = bands[row]
        if sort.startswith("track"):
            bounds = [degrees(bound) for bound in bounds]
        assert [band.is_clear for band in found] == list(clear), row
        assert max(abs(band.low - low) for band, low in zip(found, bounds, strict=False)) < NEAR, row
        assert abs(found[-1].high - bounds[-1]) < NEAR, row
        several += len(found) > 1
    assert several > 300 / EVERY


def test_the_overflow_of_daidalus_is_rare_and_of_vertical_speeds_alone():
    rows = KEPT["overflowed"]
    assert len(rows) < 10
    assert {list(SORTS)[row % len(SORTS)].split(",", maxsplit=1)[0] for row in rows} == {"vertical speed"}
