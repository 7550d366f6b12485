"""Dropped boxes are found by sight: nothing but percepts of a noisy camera says where they are."""

import os
from math import hypot

import numpy as np
import pytest

from dyknow.navigation.searching.landing import Drop, landing
from dyknow.sim_uavs.boxes.bodies import BOX, Air, fall
from dyknow.sim_uavs.boxes.handled import Handling
from tests.sim_uavs.boxes.looking import START_US, Looking, search_for_dropped, seen

CASES = 150 if os.environ.get("DYKNOW_FULL") else 15


def test_of_ten_dropped_boxes_nine_are_found_by_sight() -> None:
    outcomes = [search_for_dropped(seed) for seed in range(CASES)]
    found = [each for each in outcomes if each.off_m is not None and each.off_m < 1.5]
    assert len(found) >= 0.9 * CASES, [each for each in outcomes if each not in found]


def test_a_box_that_has_been_taken_away_is_not_found_and_the_search_ends() -> None:
    outcome = search_for_dropped(3, hidden=True)
    assert outcome.off_m is None
    assert outcome.is_exhausted


def test_priors_hold_the_places_where_boxes_come_to_rest() -> None:
    inside, cases = 0, 200
    for seed in range(cases):
        rng = np.random.default_rng((seed, 5))
        up, speed, wind = rng.uniform(1.0, 30.0), rng.uniform(-8.0, 8.0, 2), rng.normal(0.0, 2.0, 2)
        rests = fall(BOX, (0.0, 0.0, up), (*speed.tolist(), 0.0), rng, Air(*wind.tolist()))[-1]
        prior = landing(Drop(0.0, 0.0, up, *speed.tolist()))
        off = np.array(rests[:2]) - prior.mean
        inside += float(off @ np.linalg.inv(prior.covariance) @ off) <= 9.21
    assert 0.93 * cases <= inside <= cases


@pytest.mark.parametrize("height_m", [10.0, 20.0])
def test_a_box_on_the_ground_is_a_percept_in_its_place_with_its_colour(height_m: float) -> None:
    flown = Looking(4, height_m)
    flown.boxes.do(Handling(START_US, "take", "b1", "1", (-18.0, -8.0, 5.0)))
    flown.boxes.do(Handling(START_US, "release", "b1", "1", (-18.0, -8.0, 5.0)))
    last: dict[str, tuple[float, float, str | None]] = {}
    while flown.now_us < START_US + 10_000_000:
        for look in flown.step():
            last |= {each.symbol: (each.x_m, each.y_m, each.colour) for each in seen(look)}
    x, y, _ = flown.placed("b1").place
    assert [hypot(each[0] - x, each[1] - y) < 1.0 for each in last.values()].count(True) == 1


def test_what_hangs_on_a_line_is_in_no_image() -> None:
    flown = Looking(4)
    flown.boxes.do(Handling(START_US, "take", "b1", "1", (-18.0, -8.0, 0.0)))
    for _ in range(40):
        assert not [each for look in flown.step() for each in seen(look)]
