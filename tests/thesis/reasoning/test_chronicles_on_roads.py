"""The chronicles of examples/chronicles/ are recognised in events made from seeded trajectories, and in no others."""

import json
import os
from random import Random

import pytest

from dyknow.kpl import parse_chronicles
from dyknow.reasoning.chronicles import Recogniser
from dyknow.reasoning.chronicles.recognition.events import read_events
from tests.thesis.reasoning import traffic
from tests.thesis.reasoning.traffic import (
    EXAMPLES,
    SHOULDER_M,
    crossing_events,
    following,
    hesitating,
    meeting,
    overtaking,
    road_events,
)

SEEDS = range(100 if os.environ.get("DYKNOW_FULL") else 2)
ON_ROADS = {
    "following": (following, set()),
    "a decent overtake": (overtaking, {("overtake", "a", "b", "e4"), ("passes", "a", "b")}),
    "on the wrong side": (lambda rng: overtaking(rng, SHOULDER_M), {("wrong_side", "a", "b"), ("passes", "a", "b")}),
    "somebody comes, too near": (
        lambda rng: meeting(rng, too_near=True),
        {("overtake", "a", "b", "e4"), ("passes", "a", "b"), ("oncoming_too_near", "a", "b", "c")},
    ),
    "somebody comes, too near from the beginning": (
        lambda rng: meeting(rng, too_near=True, after_s=0.0),
        {("overtake", "a", "b", "e4"), ("passes", "a", "b"), ("oncoming_too_near", "a", "b", "c")},
    ),
    "somebody comes, far away": (
        lambda rng: meeting(rng, too_near=False),
        {("overtake", "a", "b", "e4"), ("passes", "a", "b")},
    ),
    "again and again": (hesitating, {("broken_off", "a", "b"), ("again_and_again", "a", "b")}),
    "only twice": (lambda rng: hesitating(rng, 2), {("broken_off", "a", "b")}),
}


def recognised(name, events):
    """(chronicle, symbols ...) of what is told."""
    path = EXAMPLES / f"{name}.chr"
    recogniser = Recogniser.of(parse_chronicles(path.read_text(encoding="utf-8")))
    told = [one for event in read_events(map(json.dumps, events)) for one in event.told_to(recogniser)]
    assert not recogniser.incomplete
    assert not recogniser.ignored
    return [(one.chronicle, *one.bindings.values()) for one in told]


@pytest.mark.parametrize("situation", ON_ROADS)
def test_examples_8_2_1_and_8_2_2_each_way_to_overtake_is_recognised_and_nothing_else(situation):
    drives, expected = ON_ROADS[situation]
    for seed in SEEDS:
        rng = Random(seed)
        events = road_events(drives(rng), seed, error_m=rng.uniform(0, 1.5), heading_deg=rng.uniform(0, 360))
        assert {*recognised("overtake", events), *recognised("reckless", events)} == expected


@pytest.mark.parametrize(
    ("close_ms", "by_ms", "is_told"),
    [
        (4_000, 6_000, True),
        (7_000, 9_000, True),
        (11_000, 12_500, True),
        (4_000, 4_500, False),
        (12_500, 14_000, False),
    ],
)
def test_example_8_2_2_whoever_comes_is_too_near_if_close_and_still_ahead_while_a_car_passes(close_ms, by_ms, is_told):
    """It passes from 5 s to 8 s; the other one comes close, and goes by."""
    first = {"behind[a, b]": True, "in_front[a, b]": False, "oncoming[a, b]": False}
    first |= {"behind[a, c]": True, "oncoming[a, c]": True, "close[a, c]": False}
    later = [(5_000, "behind[a, b]", False), (8_000, "in_front[a, b]", True)]
    later += [(close_ms, "close[a, c]", True), (by_ms, "behind[a, c]", False), (by_ms + 1_500, "close[a, c]", False)]
    events = [{"t_ms": 0, "attribute": label, "from": None, "to": value} for label, value in first.items()]
    events += [{"t_ms": at, "attribute": one, "from": not new, "to": new} for at, one, new in sorted(later)]
    told = recognised("reckless", [*events, {"t_ms": 20_000}])
    assert (("oncoming_too_near", "a", "b", "c") in told) is is_told


@pytest.mark.parametrize("situation", ON_ROADS)
def test_8_7_5_overtakes_are_recognised_from_relations_of_pairs_of_cars(situation):
    """The thesis does not ask on which side it is, nor that both drive in one direction."""
    drives, expected = ON_ROADS[situation]
    passing = [("overtake", "a", "b")] if ("passes", "a", "b") in expected else []
    for seed in SEEDS:
        events = road_events(drives(Random(seed)), seed, prefix="car_relations.")
        assert [one for one in recognised("relations", events) if "c" not in one] == passing


def turn(name, turns):
    return [(name, car, one, "x1", other) for car, one, other in turns if (one, other) in traffic.LEFT_TURNS]


@pytest.mark.parametrize(
    ("chronicle", "period_ms"), [("turn_left_in_crossing", 100), ("turn_left_in_crossing_predicted", 4_000)]
)
def test_8_7_4_left_turns_are_recognised_or_predicted_and_other_ways_through_a_crossing_are_not(chronicle, period_ms):
    for seed in SEEDS:
        rng = Random(seed)
        turns = [(f"c{number}", *rng.sample(["l1", "l2", "l3", "l4"], 2)) for number in range(4)]
        events = crossing_events(turns, seed, period_ms=period_ms, error_m=rng.uniform(0, 2))
        found = recognised("turns", events)
        if period_ms == 100:
            assert found == turn(chronicle, turns)
        else:
            assert set(found) <= {*turn(chronicle, turns), *turn("turn_left_in_crossing", turns)}
            assert {one[1:] for one in found} == {one[1:] for one in turn(chronicle, turns)}


def test_the_events_of_the_examples_are_those_of_these_trajectories():
    for name, text in traffic.written().items():
        assert (EXAMPLES / name).read_text(encoding="utf-8") == text
