"""Intents flown ahead: tubes have the flight in them, closeness is symmetric, and what is planned is free of all others."""

from itertools import pairwise
from math import hypot, inf, nan

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dyknow.navigation.intents.candidates import PLANNED_STEPS, Yielding, plan, way_is_free
from dyknow.navigation.intents.intent import Contingency, IntendedPlace, Intent, IntentEnding, IntentSource, RightOfWay
from dyknow.navigation.intents.meeting import MINIMA, WIDER, clearance, closeness, first_meetings
from dyknow.navigation.intents.path import (
    STEP_S,
    STEPS,
    FlatMotion,
    FlatOrigin,
    FlatPlace,
    Performance,
    Tube,
    contingent,
    fly,
    later,
    nominal,
)

HOVER, LAND, OPEN = IntentEnding.HOVER, IntentEnding.LAND, IntentEnding.OPEN
COPTER = Performance(5.0, 2.5, 1.5, 1.0, 0.5)
AT = IntendedPlace(58.0, 15.0, 60.0)
metres = st.floats(-200.0, 200.0)
heights = st.floats(20.0, 110.0)
places = st.builds(FlatPlace, metres, metres, heights)
motions = st.builds(FlatMotion, metres, metres, heights, st.floats(-8, 8), st.floats(-8, 8), st.floats(-2, 2))


def to(north_m: float, east_m: float, up_m: float = 60.0) -> FlatPlace:
    return FlatPlace(north_m, east_m, up_m)


def still(north_m: float, east_m: float, up_m: float = 60.0) -> FlatMotion:
    return FlatMotion(north_m, east_m, up_m, 0.0, 0.0, 0.0)


def north_bound(speed: float = 5.0) -> FlatMotion:
    return FlatMotion(0.0, 0.0, 60.0, speed, 0.0, 0.0)


def free(yielding: Yielding, tube: Tube) -> bool:
    return clearance(closeness(tube, yielding.others[:, :, : tube.shape[1]], MINIMA)) >= 1.0


def yields(motion: FlatMotion, legs: list[FlatPlace], *others: Tube, floor_m: float = 20.0) -> Yielding:
    tubes = np.stack(others) if others else np.empty((0, 5, STEPS))
    return Yielding(motion, legs, HOVER, COPTER, tubes, lambda place, _before: floor_m <= place.altitude_m <= 120.0)


def test_a_leg_is_flown_at_its_speed_and_ends_at_its_place() -> None:
    tube = fly(still(0, 0), [to(100, 0)], HOVER, COPTER)
    speeds = np.diff(tube[0]) / STEP_S
    assert speeds.max() == pytest.approx(5.0, abs=0.01)
    assert tube[0, -1] == pytest.approx(100.0, abs=0.1)
    assert int(np.argmax(tube[0] > 97.0)) * STEP_S == pytest.approx(21.0, abs=1.5)


def test_who_holds_stops_within_its_braking_distance() -> None:
    tube = fly(north_bound(10.0), [], HOVER, COPTER)
    assert tube[0, -1] == pytest.approx(10.0**2 / 5.0, abs=3.0)


def test_a_climb_is_between_at_once_and_along_the_line() -> None:
    tube = fly(north_bound(), [to(100, 0, 80.0)], HOVER, COPTER)
    at = int(8.0 / STEP_S)
    assert tube[3, at] == pytest.approx(80.5, abs=0.1), "at once"
    assert tube[2, at] == pytest.approx(60.0 + 20.0 * tube[0, at] / 100.0 - 0.5, abs=1.0), "along the line"


@given(motions, st.lists(places, max_size=4), st.sampled_from([HOVER, LAND, OPEN]))
@settings(max_examples=60, deadline=None)
def test_a_tube_is_finite_upright_and_never_faster_than_its_vehicle(
    motion: FlatMotion, legs: list[FlatPlace], ending: IntentEnding
) -> None:
    tube = fly(motion, legs, ending, COPTER)
    assert np.isfinite(tube).all()
    assert (tube[3] >= tube[2]).all()
    steps = np.hypot(np.diff(tube[0]), np.diff(tube[1])) / STEP_S
    assert steps.max() <= max(hypot(motion.north_m_s, motion.east_m_s), COPTER.speed_m_s) + 0.01


@pytest.mark.parametrize("bad", [nan, inf])
def test_a_way_that_is_not_finite_is_an_error_and_not_free(bad: float) -> None:
    with pytest.raises(ValueError, match="not finite"):
        fly(still(bad, 0.0), [to(10, 10)], HOVER, COPTER)


@given(motions, motions, places, places)
@settings(max_examples=60, deadline=None)
def test_closeness_is_the_same_from_both_sides(one: FlatMotion, two: FlatMotion, a: FlatPlace, b: FlatPlace) -> None:
    first, second = fly(one, [a], HOVER, COPTER), fly(two, [b], HOVER, COPTER)
    there, back = closeness(first, second[None], MINIMA), closeness(second, first[None], MINIMA)
    assert np.allclose(there, back)
    assert first_meetings(there)[0] == first_meetings(back)[0]


def test_lanes_pass_and_head_on_does_not() -> None:
    own = fly(north_bound(), [to(300, 0)], HOVER, COPTER)
    lane = fly(FlatMotion(200.0, 50.0, 60.0, -5.0, 0.0, 0.0), [to(-100, 50)], HOVER, COPTER)
    head_on = fly(FlatMotion(200.0, 0.0, 60.0, -5.0, 0.0, 0.0), [to(-100, 0)], HOVER, COPTER)
    meets = first_meetings(closeness(own, np.stack([lane, head_on]), MINIMA))
    assert meets[0] == np.inf
    assert meets[1] == pytest.approx((200.0 - 17.0) / 10.0, abs=0.6)


def test_two_that_hover_side_by_side_and_two_that_part_do_not_meet() -> None:
    own = fly(still(0, 0), [], HOVER, COPTER)
    beside = fly(still(12, 0), [], HOVER, COPTER)
    parting = fly(FlatMotion(8.0, 0.0, 60.0, 3.0, 0.0, 0.0), [to(100, 0)], HOVER, COPTER)
    assert (first_meetings(closeness(own, np.stack([beside, parting]), MINIMA)) == np.inf).all()


def test_one_that_lands_on_another_meets_it() -> None:
    own = fly(still(0, 0), [], HOVER, COPTER)
    lands = fly(still(3, 0, 90.0), [to(3, 0, 0.0)], LAND, COPTER)
    assert first_meetings(closeness(own, lands[None], MINIMA))[0] < 40.0


@given(motions, places, st.lists(st.tuples(motions, places), min_size=1, max_size=5))
@settings(max_examples=80, deadline=None)
def test_what_is_planned_is_free_of_all_others_and_stays_in_its_limits(
    motion: FlatMotion, goal: FlatPlace, others: list[tuple[FlatMotion, FlatPlace]]
) -> None:
    tubes = [fly(each, [place], HOVER, COPTER) for each, place in others]
    yielding = yields(motion, [goal], *tubes)
    found = plan(yielding)
    if found is None:
        return
    assert all(20.0 <= place.altitude_m <= 120.0 for place in found.places)
    if found.minima is not None:
        again = fly(motion, found.places, HOVER, COPTER, PLANNED_STEPS)
        assert clearance(closeness(again, yielding.others[:, :, :PLANNED_STEPS], found.minima)) >= 1.0
        begins_clear = (closeness(again[:, :1], yielding.others[:, :, :1], WIDER) >= 1.0).all()
        assert free(yielding, again) or not begins_clear, (
            "of those that are too near already each minima has its own bound"
        )


def test_head_on_in_the_open_something_cheap_is_found() -> None:
    head_on = fly(FlatMotion(110.0, 0.0, 60.0, -5.0, 0.0, 0.0), [to(-100, 0)], HOVER, COPTER)
    found = plan(yields(north_bound(), [to(200, 0)], head_on))
    assert found is not None
    assert found.minima is WIDER
    assert found.cost_s < 10.0


@pytest.mark.parametrize("speed", [0.0, 2.0, 5.0])
def test_a_fast_one_that_crosses_is_veered_from_and_soon_the_own_way_is_free(speed: float) -> None:
    """On one level, where slowing down alone is not enough."""
    crosses = fly(FlatMotion(50.0, -60.0, 60.0, 0.0, 8.0, 0.0), [to(50, 300)], HOVER, COPTER._replace(speed_m_s=8.0))
    level = yields(north_bound(speed), [to(200, 0)], crosses)._replace(
        allowed=lambda place, _before: 55.0 <= place.altitude_m <= 65.0
    )
    found = plan(level)
    assert found is not None
    assert found.minima is WIDER
    assert found.returns
    assert found.cost_s < 6.0


def test_to_stand_is_compared_with_what_leads_round_by_when_its_way_back_is_free() -> None:
    """One climbs slowly through the level ahead: to wait for longer than half a minute costs that, and not for ever."""
    slow = COPTER._replace(speed_m_s=2.0)
    climbs = fly(still(45, 0, 20.0), [to(45, 0, 110.0)], HOVER, COPTER)
    here = yields(still(0, 0), [to(60, 0)], climbs)._replace(
        performance=slow, allowed=lambda place, _before: 55.0 <= place.altitude_m <= 65.0
    )
    found = plan(here)
    assert found is not None
    assert found.cost_s < 45.0
    assert found.is_here(here.motion) or hypot(found.places[-1].north_m, found.places[-1].east_m) < 70.0


def test_under_a_low_ceiling_it_goes_aside() -> None:
    head_on = fly(FlatMotion(110.0, 0.0, 60.0, -5.0, 0.0, 0.0), [to(-100, 0)], HOVER, COPTER)
    low = yields(north_bound(), [to(200, 0)], head_on)._replace(
        allowed=lambda place, _before: 55.0 <= place.altitude_m <= 65.0
    )
    found = plan(low)
    assert found is not None
    assert found.minima is not None
    assert all(place.altitude_m == pytest.approx(60.0) for place in found.places)


def test_below_one_that_lands_only_going_aside_is_left() -> None:
    lands = fly(still(2, 0, 80.0), [to(2, 0, 0.0)], LAND, COPTER)
    found = plan(yields(still(0, 0), [], lands))
    assert found is not None
    assert found.minima is not None
    end = found.tube[:2, -1]
    assert hypot(end[0] - 2.0, end[1]) > 20.0


def test_where_nothing_is_allowed_there_is_no_plan() -> None:
    head_on = fly(FlatMotion(110.0, 0.0, 60.0, -5.0, 0.0, 0.0), [to(-100, 0)], HOVER, COPTER)
    found = plan(yields(north_bound(), [to(200, 0)], head_on)._replace(allowed=lambda _place, _before: False))
    assert found is None


def test_each_place_is_judged_from_the_one_before_it() -> None:
    judged: list[tuple[FlatPlace, FlatPlace | None]] = []

    def allowed(place: FlatPlace, before: FlatPlace | None) -> bool:
        judged.append((place, before))
        return True

    head_on = fly(FlatMotion(110.0, 0.0, 60.0, -5.0, 0.0, 0.0), [to(-100, 0)], HOVER, COPTER)
    assert plan(yields(north_bound(), [to(200, 0), to(200, 80)], head_on)._replace(allowed=allowed)) is not None
    assert judged[0][1] is None
    assert any(before is not None for _, before in judged)
    assert all(before in {None, place} for (place, _), (_, before) in pairwise(judged))


def test_the_way_is_free_again_when_the_other_is_past() -> None:
    own = yields(still(20, 0, 74.0), [to(200, 0)])
    coming = fly(FlatMotion(60.0, 0.0, 60.0, -5.0, 0.0, 0.0), [to(-300, 0)], HOVER, COPTER)
    assert not way_is_free(own._replace(others=coming[None]))
    assert way_is_free(own._replace(others=later(coming, 20.0, STEPS)[None]))


def intent(*legs: IntendedPlace, contingency: Contingency | None = None, ending: IntentEnding = HOVER) -> Intent:
    return Intent(
        0, *AT, 5.0, 0.0, 0.0, IntentSource.ROUTE, RightOfWay.NAMED, legs, ending, contingency=contingency
    )  # fmt: skip


def test_a_contingency_begins_after_its_delay_where_the_vehicle_is_then() -> None:
    origin = FlatOrigin.at(*AT[:2])
    north = IntendedPlace(58.01, 15.0, 60.0)
    returns = Contingency(5.0, (AT._replace(altitude_m=90.0), AT), LAND)
    said = intent(north, contingency=returns)
    flown, lost = nominal(said, origin), contingent(said, origin)
    assert lost is not None
    before = int(5.0 / STEP_S)
    assert np.allclose(flown[:, :before], lost[:, :before])
    assert lost[0, before] == pytest.approx(flown[0, before], abs=0.01)
    assert lost[0, -1] < flown[0, -1] - 50.0
    assert lost[3].max() > 85.0


def test_no_contingency_is_the_intent_itself() -> None:
    assert contingent(intent(IntendedPlace(58.01, 15.0, 60.0)), FlatOrigin.at(*AT[:2])) is None


def test_a_tube_goes_on_from_a_later_time_and_stands_at_its_end() -> None:
    tube = fly(north_bound(), [to(100, 0)], HOVER, COPTER)
    assert later(tube, 4.0, 10)[0, 0] == pytest.approx(tube[0, 8])
    assert later(tube, 4.25, 10)[0, 0] == pytest.approx((tube[0, 8] + tube[0, 9]) / 2)
    assert np.allclose(later(tube, 1e6, 10)[0], tube[0, -1])


@pytest.mark.parametrize("north_m", [120.0, 150.0, 180.0])
def test_in_a_corridor_it_flies_on_at_half_its_speed_where_it_is_given_its_own_back_and_else_waits(
    north_m: float,
) -> None:
    """Another one crosses ahead; it may neither leave its track nor its level."""
    performance = Performance(10.0, 2.5, 1.5, 1.0, 0.5)
    crosses = FlatMotion(north_m, -north_m * 0.8, 60.0, 0.0, 8.0, 0.0)
    there = fly(crosses, [FlatPlace(north_m, 300.0, 60.0)], IntentEnding.HOVER, performance._replace(speed_m_s=8.0))
    now = Yielding(
        FlatMotion(0.0, 0.0, 60.0, 10.0, 0.0, 0.0), [FlatPlace(500.0, 0.0, 60.0)], IntentEnding.HOVER, performance,
        there[None], lambda place, _before: abs(place.east_m) < 5.0 and abs(place.altitude_m - 60.0) < 5.0, 5.0,
    )  # fmt: skip
    slower, waits = plan(now), plan(now._replace(slow_m_s=None))
    assert slower is not None
    assert waits is not None
    assert slower.minima == WIDER
    assert slower.speed_m_s == 5.0
    assert slower.cost_s <= waits.cost_s
    assert waits.speed_m_s is None
    speeds = np.hypot(*np.diff(slower.tube[:2])) / STEP_S
    assert speeds[10:30].max() < 5.1
