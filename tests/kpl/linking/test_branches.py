"""Where an object may be that is hidden in a crossing: branches of predicted samples, with weights (thesis 12.3)."""

from collections import defaultdict

import pytest

from dyknow import Predicted, Sample
from tests.kpl.linking.test_linking import ON_ROAD, PERCEPTS, ROADS, WORLD, OnTheRoad

S = 1_000_000
HIDDEN_MS = range(8000, 12100, 100)
"""With its first state it ends, so that the one before is the last that shows it."""
SEEN_US = HIDDEN_MS[0] * 1000 - 100_000
TEXT = PERCEPTS + WORLD + ROADS + ON_ROAD


def driven(text: str) -> OnTheRoad:
    """A car comes from the west at 10 m/s, and is hidden from before the crossing to behind it."""
    road = OnTheRoad(text)
    for t in range(0, 12000, 100):
        road.wait(t * 1000)
        if t not in HIDDEN_MS[1:]:
            road.push("camera", ("vp0", t / 100 - 100, -1.8, "red", t == HIDDEN_MS[0]), t * 1000)
    assert not road.faults
    return road


def by_time(road: OnTheRoad, name: str) -> dict[int, list[Sample]]:
    """The samples of a stream that are predicted, by their valid times."""
    found = defaultdict[int, list[Sample]](list)
    for stream, sample in road.outputs:
        if stream == name and sample.quality.prediction is not None:
            found[sample.valid_us].append(sample)
    return found


def test_each_way_on_which_a_hidden_object_may_be_is_a_branch_and_the_most_probable_is_the_newest() -> None:
    road = driven(TEXT + " with branches 8\nstream on = on_road\n")
    predicted = by_time(road, "on")
    assert min(predicted) == HIDDEN_MS[0] * 1000
    assert {len(each) for each in predicted.values()} > {1}
    for samples in predicted.values():
        made = [each.quality.prediction for each in samples]
        assert all(isinstance(each, Predicted) and each.made_us == SEEN_US for each in made)
        assert sum(each.weight for each in made if each) == pytest.approx(1.0, abs=0.02)
        assert [each.weight for each in made if each] == sorted(each.weight for each in made if each)
        if len(samples) > 1:
            assert len({each.branch for each in made if each}) == len(samples)
            assert [each.quality.certainty for each in samples] == [each.weight for each in made if each]
    places = {each.value[1:3] for each in predicted[max(predicted)]}
    assert len(places) == len(predicted[max(predicted)]), "each has a place of its own"


def test_no_more_branches_than_are_wanted_and_the_most_probable_ones() -> None:
    all_ways = by_time(driven(TEXT + " with branches 8\nstream on = on_road\n"), "on")
    two = by_time(driven(TEXT + " with branches 2\nstream on = on_road\n"), "on")
    at_us = max(all_ways)
    assert [each.quality for each in two[at_us]] == [each.quality for each in all_ways[at_us]][-2:]


def test_without_them_a_predicted_state_says_when_it_was_made_and_a_policy_leaves_out_what_is_too_old() -> None:
    road = driven(TEXT + "stream on = on_road\nstream fresh = on_road with max age of prediction 1s\n")
    predicted = by_time(road, "on")
    assert {len(each) for each in predicted.values()} == {1}
    assert {each.quality.prediction for (each,) in predicted.values()} == {Predicted(SEEN_US)}
    fresh = by_time(road, "fresh")
    assert fresh
    assert max(fresh) <= SEEN_US + S < max(predicted)


def test_a_formula_over_branches_is_one_over_the_most_probable_and_says_that_it_rests_on_a_prediction() -> None:
    monitor = "monitor near = always forall c in on_road: on_road.x_m[c] < -10\n"
    road = driven(TEXT + " with branches 8\n" + monitor)
    (alarm,) = [each for each in road.alarms if each.event == "opened"]
    assert alarm.valid_us >= 9 * S  # at -10 m
