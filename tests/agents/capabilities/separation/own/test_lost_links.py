"""What a vehicle does on a lost link, as its intent has it."""

import pytest

from dyknow.agents.places import FlightPlan, Waypoint
from dyknow.navigation.geodesy import distance_m
from dyknow.navigation.intents.intent import (
    Contingency,
    IntentEnding,
)
from dyknow.navigation.vehicle import (
    FailsafeReport,
    LinkLossAction,
)
from tests.agents.capabilities.separation.own.own_flight import (
    FAR,
    HERE,
    HOME,
    HOME_M,
    LAND_MODES,
    NEAR,
    RETURN_MODES,
    Flown,
    place,
)


def contingency(action: LinkLossAction | None, delay_s: float | None = 5.0) -> Contingency | None:
    flown = Flown(FlightPlan((NEAR, FAR)))
    flown.pilot.on_report(FailsafeReport(0, action, delay_s, LinkLossAction.RETURN), 0)
    return flown.intent().contingency


OVER = HOME._replace(altitude_m=100.0)
CARRIED_OUT = Contingency(0.0, (place(NEAR),), IntentEnding.HOVER)


@pytest.mark.parametrize(
    ("action", "expected"),
    [
        (None, CARRIED_OUT),
        (LinkLossAction.CARRY_ON, CARRIED_OUT),
        (LinkLossAction.HOLD, Contingency(5.0, (), IntentEnding.HOVER)),
        (LinkLossAction.RETURN, Contingency(5.0, (OVER, HOME), IntentEnding.LAND)),
        (LinkLossAction.LAND, Contingency(5.0, (HERE._replace(altitude_m=HOME_M),), IntentEnding.LAND)),
        (LinkLossAction.TERMINATE, Contingency(5.0, (HERE._replace(altitude_m=HOME_M),), IntentEnding.LAND)),
    ],
)
def test_a_lost_link_is_what_the_parameters_say(action: LinkLossAction | None, expected: Contingency) -> None:
    assert contingency(action) == expected


@pytest.mark.parametrize(
    ("speed_m_s", "delay_s", "flown_m"), [(0.0, 20.0, 0.0), (5.0, 10.0, 50.0), (5.0, 600.0, 222.4)]
)
def test_a_failsafe_begins_where_the_vehicle_is_by_then(speed_m_s: float, delay_s: float, flown_m: float) -> None:
    flown = Flown(FlightPlan((NEAR, Waypoint(*FAR[:2], 100.0))))
    flown.at(100_000, HERE, north_m_s=speed_m_s)
    for action in (LinkLossAction.LAND, LinkLossAction.RETURN):
        flown.pilot.on_report(FailsafeReport(0, action, delay_s, return_height_m=80.0), 0)
        found = flown.intent().contingency
        assert found is not None
        assert found.legs[0].longitude_deg == pytest.approx(15.0)
        assert distance_m(*HERE[:2], *found.legs[0][:2]) == pytest.approx(flown_m, abs=1.0)


@pytest.mark.parametrize(("delay_s", "after_s"), [(None, 0.0), (12.5, 12.5), (-3.0, 0.0), (1e9, 3600.0)])
def test_a_delay_that_is_not_known_is_none_and_a_strange_one_is_bounded(delay_s: float | None, after_s: float) -> None:
    found = contingency(LinkLossAction.HOLD, delay_s)
    assert found is not None
    assert found.after_s == after_s


def test_without_parameters_the_order_under_way_is_carried_out_and_of_one_leg_that_is_the_intent_itself() -> None:
    assert Flown(FlightPlan((NEAR, FAR))).intent().contingency == CARRIED_OUT
    assert Flown(FlightPlan((NEAR,))).intent().contingency is None


def test_in_a_mission_and_where_targets_are_streamed_other_parameters_count() -> None:
    flown = Flown(missions=True)
    action = LinkLossAction.RETURN, 5.0, LinkLossAction.CARRY_ON, LinkLossAction.LAND
    flown.pilot.on_report(FailsafeReport(0, *action), 0)
    flown.mode("OFFBOARD", guided=True)
    assert flown.intent().contingency == Contingency(5.0, (HERE._replace(altitude_m=HOME_M),), IntentEnding.LAND)
    flown.mode("AUTO")
    assert flown.intent().contingency is None
    flown.pilot.on_report(FailsafeReport(0, *action[:2], LinkLossAction.HOLD), 0)
    assert flown.intent().contingency == Contingency(5.0, (), IntentEnding.HOVER)


@pytest.mark.parametrize("mode", [*LAND_MODES, *RETURN_MODES])
def test_a_landing_and_a_return_need_no_link(mode: str) -> None:
    flown = Flown()
    flown.pilot.on_report(FailsafeReport(0, LinkLossAction.HOLD, 5.0), 0)
    flown.mode(mode)
    assert flown.intent().contingency is None


def test_a_return_to_a_home_that_is_not_known_may_lead_anywhere() -> None:
    flown = Flown(FlightPlan((NEAR, FAR)))
    flown.pilot.on_report(FailsafeReport(0, LinkLossAction.RETURN, 5.0), 0)
    flown.pilot.bounds.forget()
    assert flown.intent().contingency == Contingency(5.0, (), IntentEnding.OPEN)
