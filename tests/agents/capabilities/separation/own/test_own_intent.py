"""The intent of the own vehicle: each line of its table."""

import pytest

from dyknow.agents.capabilities.flight.pilot import Pilot
from dyknow.agents.capabilities.separation.own.own_intent import AHEAD_S, OwnIntent
from dyknow.agents.places import FlightPlan
from dyknow.navigation.geodesy import distance_m
from dyknow.navigation.intents.intent import (
    MOST_LEGS,
    Contingency,
    IntendedPlace,
    IntentEnding,
    IntentSource,
    RightOfWay,
)
from dyknow.navigation.vehicle import (
    BatteryReport,
    FailsafeReport,
    GoToOrder,
    HoldOrder,
    LandOrder,
    MissionReport,
    ReturnHomeOrder,
    TargetReport,
)
from tests.agents.capabilities.separation.own.own_flight import (
    FAR,
    FLIES,
    HERE,
    HOME,
    HOME_M,
    LAND_MODES,
    MISSION_MODES,
    NEAR,
    RETURN_MODES,
    TARGET,
    Flown,
    aside,
    hovers,
    line,
    place,
)

# -- the table -----------------------------------------------------------------------------------------------------


def test_without_a_position_there_is_no_intent() -> None:
    assert OwnIntent(Pilot(control=True), may_avoid=True).now(None) is None


@pytest.mark.parametrize("change", [{"armed": False}, {"airborne": False}])
def test_on_the_ground_or_disarmed_it_is_no_traffic(change: dict[str, bool]) -> None:
    flown = Flown(FlightPlan((NEAR, FAR)))
    flown.pilot.on_report(FLIES._replace(**change), 0)
    intent = flown.intent()
    assert not intent.is_airborne
    assert (intent.source, intent.legs, intent.contingency) == (IntentSource.GROUND, (), None)


def test_before_the_first_status_it_is_no_traffic() -> None:
    flown = Flown()
    flown.pilot.status = None
    assert not flown.intent().is_airborne


def test_a_manoeuvre_is_its_places_and_goes_before_those_that_yield_by_name() -> None:
    flown = Flown(FlightPlan((NEAR, FAR)))
    intent = flown.intent((place(FAR), place(NEAR)))
    assert (intent.source, intent.legs, intent.ending) == hovers(IntentSource.MANOEUVRE, place(FAR), place(NEAR))
    assert intent.rank is RightOfWay.COMMITTED
    assert intent.contingency == Contingency(0.0, (place(FAR),), IntentEnding.HOVER), "the order under way"


def test_an_order_is_its_place() -> None:
    flown = Flown()
    flown.pilot.order(GoToOrder(*FAR, 7.0))
    assert flown.way() == hovers(IntentSource.ORDER, place(FAR))
    assert flown.intent().rank is RightOfWay.NAMED
    assert flown.intent().speed_m_s == 7.0


@pytest.mark.parametrize("order", [LandOrder(), ReturnHomeOrder()])
def test_an_order_to_land_or_return_counts_before_the_mode_shows_it(order: LandOrder | ReturnHomeOrder) -> None:
    flown = Flown()
    flown.pilot.order(order)
    before = flown.way()
    flown.mode("LAND" if isinstance(order, LandOrder) else "RTL")
    assert flown.way() == before
    assert before[2] is IntentEnding.LAND


def test_hold_stands() -> None:
    flown = Flown()
    flown.pilot.on_report(TARGET, 0)
    flown.pilot.order(HoldOrder())
    assert flown.way() == hovers(IntentSource.HOVER)


def test_the_target_of_another_station_is_its_place_also_in_a_gap_of_the_link() -> None:
    flown = Flown()
    flown.pilot.on_report(TARGET, 0)
    assert flown.way() == hovers(IntentSource.STATION, place(TARGET))
    flown.at(5_000_000)
    flown.pilot.on_report(FLIES, 5_000_000)
    assert flown.way() == hovers(IntentSource.STATION, place(TARGET))


def test_an_old_target_of_another_station_is_not_taken_for_the_way_after_an_order_of_ours() -> None:
    flown = Flown()
    flown.pilot.on_report(TARGET, 0)
    flown.does(flown.pilot.order(GoToOrder(*FAR)))
    flown.pilot.on_report(TargetReport(0, *FAR), 100_000)
    flown.pilot.standing = None
    flown.at(9_000_000, place(FAR))
    flown.pilot.on_report(FLIES, 9_000_000)
    assert flown.way() == hovers(IntentSource.HOVER)


def test_without_any_target_it_stands_where_it_stands_and_else_may_do_anything() -> None:
    flown = Flown()
    assert flown.way() == hovers(IntentSource.HOVER)
    flown.at(100_000, north_m_s=5.0)
    assert flown.intent().ending is IntentEnding.OPEN
    flown.at(200_000, down_m_s=-2.5)
    assert flown.intent().ending is IntentEnding.OPEN, "it takes off"


# -- routes --------------------------------------------------------------------------------------------------------


def test_of_a_long_route_the_places_that_are_reached_within_the_time_are_legs() -> None:
    plan = FlightPlan(line(40, 0.0005), speed_m_s=5.0)
    flown = Flown(plan)
    flown.at(100_000, IntendedPlace(58.001, -115.1234567, 100.0))
    legs = flown.intent().legs
    ahead_m = distance_m(58.001, -115.1234567, *legs[-1][:2])
    assert AHEAD_S * 5.0 <= ahead_m <= AHEAD_S * 5.0 + 60.0
    assert legs == tuple(map(place, plan.waypoints[: len(legs)]))


def test_a_route_of_short_legs_has_as_many_as_an_intent_has() -> None:
    flown = Flown(FlightPlan(line(40, 0.00005)))
    flown.at(100_000, IntendedPlace(58.001, -115.1234567, 100.0))
    assert len(flown.intent().legs) == MOST_LEGS


def test_a_route_goes_from_its_present_place_on_at_its_speed() -> None:
    flown = Flown(FlightPlan((NEAR, FAR), speed_m_s=3.0))
    assert flown.way() == hovers(IntentSource.ROUTE, place(NEAR), place(FAR))
    assert flown.intent().speed_m_s == 3.0
    flown.at(100_000, place(NEAR))
    assert flown.way() == hovers(IntentSource.ROUTE, place(FAR))
    assert flown.intent().rank is RightOfWay.NAMED


def test_a_route_that_is_flown_over_and_over_does_not_end_within_the_time() -> None:
    flown = Flown(FlightPlan((NEAR, FAR), loop=True))
    legs = flown.intent().legs
    assert legs[:4] == (place(NEAR), place(FAR), place(NEAR), place(FAR))
    assert 111.0 * len(legs) >= AHEAD_S * 5.0


def test_a_route_that_has_not_begun_and_one_that_is_over_are_none() -> None:
    flown = Flown(FlightPlan((NEAR,), start_us=60_000_000))
    assert flown.way() == hovers(IntentSource.HOVER)
    flown = Flown(FlightPlan((NEAR,)))
    flown.at(100_000, place(NEAR))
    flown.pilot.on_report(TargetReport(0, *NEAR), 100_000)
    assert flown.way() == hovers(IntentSource.HOVER)


@pytest.mark.parametrize("plan", [FlightPlan((NEAR, FAR)), None])
def test_without_control_a_plan_is_not_its_way(plan: FlightPlan | None) -> None:
    flown = Flown(plan, control=False)
    assert flown.way() == hovers(IntentSource.HOVER)
    flown.pilot.on_report(TARGET, 0)
    assert flown.way() == hovers(IntentSource.STATION, place(TARGET))
    assert flown.intent().rank is RightOfWay.CANNOT


# -- modes ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("missions", [False, True])
@pytest.mark.parametrize("mode", MISSION_MODES)
def test_a_mission_flies_to_its_target_and_gives_way_with_leave(mode: str, *, missions: bool) -> None:
    flown = Flown(missions=missions)
    flown.mode(mode)
    assert flown.way() == (IntentSource.MISSION, (), IntentEnding.OPEN)
    flown.pilot.on_report(TARGET, 0)
    assert flown.way() == hovers(IntentSource.MISSION, place(TARGET))
    assert flown.intent().rank is (RightOfWay.NAMED if missions else RightOfWay.CANNOT)


@pytest.mark.parametrize("mode", LAND_MODES)
def test_landing_is_down_to_the_level_of_home(mode: str) -> None:
    flown = Flown()
    flown.mode(mode)
    assert flown.way() == (IntentSource.LANDING, (HERE._replace(altitude_m=HOME_M),), IntentEnding.LAND)
    assert flown.intent().rank is RightOfWay.CANNOT
    with_leave = Flown(missions=True)
    with_leave.mode(mode)
    assert with_leave.intent().rank is RightOfWay.LANDING
    flown.pilot.bounds.forget()
    assert flown.intent().legs[0].altitude_m <= 0.0, "the ground may be far below"


@pytest.mark.parametrize("mode", RETURN_MODES)
@pytest.mark.parametrize("missions", [False, True])
def test_returning_is_up_home_and_down(mode: str, *, missions: bool) -> None:
    flown = Flown(missions=missions)
    flown.mode(mode)
    over = HOME._replace(altitude_m=100.0)
    assert flown.way() == (IntentSource.RETURN, (over, HOME), IntentEnding.LAND), "it is high enough already"
    flown.pilot.on_report(FailsafeReport(0, return_height_m=80.0), 0)
    high_m = HOME_M + 80.0
    legs = HERE._replace(altitude_m=high_m), HOME._replace(altitude_m=high_m), HOME
    assert flown.way() == (IntentSource.RETURN, legs, IntentEnding.LAND)
    assert flown.intent().rank is (RightOfWay.NAMED if missions else RightOfWay.CANNOT)
    flown.pilot.on_report(FailsafeReport(0, return_height_m=10.0, final_height_m=5.0), 0)
    stays = HOME._replace(altitude_m=HOME_M + 5.0)
    assert flown.way() == hovers(IntentSource.RETURN, over, stays)
    flown.at(100_000, HOME._replace(altitude_m=70.0))
    assert flown.way() == hovers(IntentSource.RETURN, stays)


def test_where_home_is_not_known_and_back_the_way_it_came_it_may_fly_anywhere() -> None:
    flown = Flown()
    flown.mode("SMART_RTL")
    assert flown.way() == (IntentSource.RETURN, (), IntentEnding.OPEN)
    flown.mode("RTL")
    flown.pilot.bounds.forget()
    assert flown.way() == (IntentSource.RETURN, (), IntentEnding.OPEN)


def test_the_mode_in_which_a_vehicle_takes_off_is_no_mission() -> None:
    flown = Flown()
    flown.mode("AUTO.TAKEOFF")
    assert flown.way() == (IntentSource.TAKE_OFF, (), IntentEnding.OPEN)


@pytest.mark.parametrize("mode", ["LOITER", "POSCTL"])
def test_in_a_mode_of_its_pilot_it_may_do_anything(mode: str) -> None:
    flown = Flown(FlightPlan((NEAR, FAR)))
    flown.mode(mode)
    assert flown.way() == (IntentSource.PILOT, (), IntentEnding.OPEN)
    assert flown.intent().rank is RightOfWay.CANNOT
    flown.mode("GUIDED", guided=True)
    assert flown.way() == (IntentSource.PILOT, (), IntentEnding.OPEN), "until a user asks for it"
    assert flown.intent().rank is RightOfWay.CANNOT


# -- right of way --------------------------------------------------------------------------------------------------


def test_one_that_may_not_give_way_cannot() -> None:
    assert Flown(may_avoid=False).intent().rank is RightOfWay.CANNOT


def test_one_that_is_not_heard_and_one_that_may_be_on_the_ground_cannot_be_commanded() -> None:
    flown = Flown()
    flown.at(9_000_000)
    assert flown.intent().rank is RightOfWay.CANNOT
    flown.pilot.on_report(FLIES, 9_000_000)
    assert flown.intent().rank is RightOfWay.NAMED
    flown.pilot.on_report(FLIES._replace(airborne=None), 9_000_000)
    intent = flown.intent()
    assert intent.is_airborne
    assert intent.rank is RightOfWay.CANNOT


@pytest.mark.parametrize(("fraction", "rank"), [(0.5, RightOfWay.NAMED), (0.15, RightOfWay.URGENT)])
def test_one_whose_battery_is_low_goes_first(fraction: float, rank: RightOfWay) -> None:
    flown = Flown(FlightPlan((NEAR, FAR)))
    flown.pilot.on_report(BatteryReport(0, fraction), 0)
    assert flown.intent().rank is rank
    assert flown.intent((place(FAR),)).rank is min(rank, RightOfWay.COMMITTED)
    flown.mode("LOITER")
    assert flown.intent().rank is RightOfWay.CANNOT
    assert flown.intent((place(FAR),)).rank is RightOfWay.CANNOT


# -- while it gives way --------------------------------------------------------------------------------------------


def test_the_way_without_others_is_what_it_flew_before_it_gave_way() -> None:
    flown = Flown(FlightPlan((NEAR, FAR)))
    assert aside(flown) == hovers(IntentSource.ROUTE, place(NEAR), place(FAR))
    flown = Flown()
    flown.does(flown.pilot.order(GoToOrder(*FAR)))
    assert aside(flown) == hovers(IntentSource.ORDER, place(FAR))
    flown = Flown()
    flown.pilot.on_report(TARGET, 0)
    assert aside(flown) == hovers(IntentSource.STATION, place(TARGET))
    flown = Flown()
    assert aside(flown) == hovers(IntentSource.HOVER)


def test_one_that_had_flown_its_route_returns_to_where_it_stood() -> None:
    flown = Flown(FlightPlan((NEAR,)))
    flown.at(100_000, place(NEAR))
    assert aside(flown) == hovers(IntentSource.ROUTE, place(NEAR))


@pytest.mark.parametrize("mode", MISSION_MODES)
def test_a_mission_that_is_interrupted_is_the_way_without_others(mode: str) -> None:
    flown = Flown(missions=True)
    flown.mode(mode)
    flown.pilot.on_report(MissionReport(0, 3), 0)
    flown.pilot.on_report(TARGET, 0)
    assert aside(flown) == hovers(IntentSource.MISSION, place(TARGET))


@pytest.mark.parametrize("mode", [*RETURN_MODES, *LAND_MODES])
def test_a_return_and_a_landing_that_are_interrupted_are_the_way_without_others(mode: str) -> None:
    flown = Flown(missions=True)
    flown.mode(mode)
    before = flown.way()
    assert aside(flown) == before
    assert before[2] is IntentEnding.LAND
