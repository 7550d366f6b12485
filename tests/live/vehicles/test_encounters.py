"""Encounters of ArduCopters in the loop, flown by the code of `python -m bench.encounters`, with its bars.

Each takes about two minutes; the bench flies the whole list.
"""

import pytest

from bench.encounters.cases import Case
from bench.encounters.encounters import flown
from bench.encounters.judging import LEAST_M, LONGEST, Flown
from tests.live.vehicles.sitl import absence

pytestmark = [pytest.mark.live, pytest.mark.full, pytest.mark.skipif(bool(absence()), reason=absence())]


def assert_apart_and_in_time(found: Flown) -> None:
    """All pairs kept the distance of the bar, and all vehicles arrived in time."""
    assert found.least_m > LEAST_M
    assert all(factor is not None and factor <= LONGEST for factor in found.factors), found.factors


def heights_m(found: Flown, vehicle: int) -> list[float]:
    return [up_m for _, number, _, _, up_m in found.track if number == vehicle]


def modes(found: Flown, vehicle: int) -> list[tuple[str, int]]:
    """Mode and mission item, each time one changed."""
    return [(mode, item) for _, number, mode, item in found.modes if number == vehicle]


def test_two_that_meet_head_on_pass_apart_and_arrive_in_time_after_one_manoeuvre() -> None:
    found = flown(Case("head-on", 5.0))
    assert_apart_and_in_time(found)
    assert sum(found.stops) == 1, found.notes


def test_three_whose_ways_cross_in_one_place_pass_apart_and_arrive_in_time() -> None:
    assert_apart_and_in_time(flown(Case("crossing", 5.0, 3)))


def test_an_autopilot_that_refuses_every_order_is_told_at_both_and_the_other_does_all_of_it() -> None:
    found = flown(Case("head-on", 5.0, fault="refuses", seed=3))
    assert found.least_m > LEAST_M
    assert found.is_told, found.notes
    assert max(heights_m(found, 1)) - min(heights_m(found, 1)) < 2.0, "it has flown its route"
    assert found.stops[0] >= 1, found.notes


def test_missions_that_may_be_interrupted_are_resumed_at_their_item() -> None:
    found = flown(Case("head-on", 5.0, fault="both AUTO, may interrupt", seed=3))
    assert_apart_and_in_time(found)
    seen = modes(found, 1)
    interrupted = next(at for at, (mode, _) in enumerate(seen) if mode == "GUIDED" and ("AUTO", 2) in seen[:at])
    item = seen[interrupted][1]
    resumed = [mode for mode in seen[interrupted:] if mode[0] == "AUTO"]
    assert resumed, seen
    assert {each for _, each in resumed} == {item}


def test_after_a_pilots_takeover_nothing_is_sent_and_the_other_keeps_away() -> None:
    found = flown(Case("head-on", 5.0, fault="pilot takes over", seed=3))
    assert found.least_m > LEAST_M
    assert found.stops[1] == 1, "it was taken over in the middle of a manoeuvre"
    assert found.after_takeover == 0, found.orders
    assert found.factors[0] is not None, "the other arrives"
