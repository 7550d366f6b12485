"""The pilot: each rule for commanding aircraft in which it refuses, and what it flies when none does."""

from collections.abc import Callable

import pytest

from agents.flight.pilot import RETRY_US, FlightLimits, FlightPlan, Pilot, Waypoint
from dyknow import Sample
from dyknow.model.errors import Refused
from navigation.vehicle import (
    Command,
    CommandResult,
    GoToOrder,
    HoldOrder,
    HomeReport,
    LandOrder,
    Order,
    ReturnHomeOrder,
    StatusReport,
    TargetReport,
)

HOME_M = 50.0
FLIES = StatusReport(0, armed=True, guided=True, airborne=True, mode="GUIDED")
NEAR, FAR = Waypoint(58.001, 15.0, 100.0), Waypoint(58.002, 15.0, 110.0)
ROUTE = FlightPlan((NEAR, FAR))
ORDERS = (GoToOrder(58.0, 15.0, 100.0), HoldOrder(), LandOrder(), ReturnHomeOrder())


def pilot(plan: FlightPlan | None = None, *, control: bool = True) -> Pilot:
    """A pilot whose vehicle flies under guidance, 100 m above the sea and 50 m above its home."""
    found = Pilot(control=control, plan=plan)
    found.on_report(HomeReport(0, 58.0, 15.0, HOME_M), 0)
    found.on_report(FLIES, 0)
    return found


def at(flown: Pilot, now_us: int = 0, latitude: float = 58.0, altitude: float = 100.0) -> list[Order]:
    """What the pilot orders at an estimate."""
    return orders(flown.on_estimate(Sample(now_us, now_us, (latitude, 15.0, altitude, 0.0, 0.0, 0.0))))


def orders(commands: list[Command]) -> list[Order]:
    return [command.order for command in commands]


def leg(waypoint: Waypoint, altitude_m: float | None = None) -> GoToOrder:
    return GoToOrder(*waypoint[:2], waypoint.altitude_m if altitude_m is None else altitude_m, ROUTE.speed_m_s)


# -- each rule refuses -------------------------------------------------------------------------------------------


def no_control(flown: Pilot) -> None:
    flown.control = False


def no_status(flown: Pilot) -> None:
    flown.status = None


def not_armed(flown: Pilot) -> None:
    flown.on_report(FLIES._replace(armed=False), 0)


def not_airborne(flown: Pilot) -> None:
    flown.on_report(FLIES._replace(airborne=False), 0)


def perhaps_airborne(flown: Pilot) -> None:
    flown.on_report(FLIES._replace(airborne=None), 0)


def not_guided(flown: Pilot) -> None:
    flown.on_report(FLIES._replace(guided=False, mode="LOITER"), 0)


RULES = pytest.mark.parametrize(
    ("breaks", "words"),
    [
        (no_control, "not given control"),
        (no_status, "not said in what state"),
        (not_armed, "not armed"),
        (not_airborne, "not airborne"),
        (perhaps_airborne, "not airborne"),
        (not_guided, "in mode LOITER, which takes no positions"),
    ],
)


@RULES
@pytest.mark.parametrize("order", ORDERS)
def test_an_order_is_refused_by_the_rule_it_breaks(breaks: Callable[[Pilot], None], words: str, order: Order) -> None:
    flown = pilot()
    breaks(flown)
    with pytest.raises(Refused, match=words):
        flown.order(order)
    assert flown.flying in {"watching", "holding"}, "a refused order does not stand"


@RULES
@pytest.mark.parametrize("altitude_m", [None, 120.0])
def test_giving_way_is_refused_by_the_same_rules(
    breaks: Callable[[Pilot], None], words: str, altitude_m: float | None
) -> None:
    flown = pilot()
    at(flown)
    breaks(flown)
    with pytest.raises(Refused, match=words):
        flown.divert(altitude_m)
    assert flown.flying != "diverted"


@RULES
def test_the_plan_is_not_flown_while_a_rule_forbids_it(breaks: Callable[[Pilot], None], words: str) -> None:
    flown = pilot(ROUTE)
    breaks(flown)
    assert at(flown) == []
    assert words in (flown.refusal(HoldOrder()) or "")
    flown.control = True
    flown.on_report(FLIES, 1)
    assert at(flown, 100_000) == [leg(NEAR)], "and is flown as soon as none does"


@pytest.mark.parametrize(
    ("height_m", "words"),
    [(9.9, "9.9 m above home is below the floor of 10 m"), (120.1, "120.1 m above home is above the ceiling of 120 m")],
)
def test_no_order_and_no_manoeuvre_leads_below_the_floor_or_above_the_ceiling(height_m: float, words: str) -> None:
    flown = pilot()
    at(flown)
    with pytest.raises(Refused, match=words):
        flown.order(GoToOrder(58.0, 15.0, HOME_M + height_m))
    with pytest.raises(Refused, match=words):
        flown.divert(HOME_M + height_m)


@pytest.mark.parametrize("height_m", [10.0, 120.0])
def test_the_floor_and_the_ceiling_themselves_are_allowed(height_m: float) -> None:
    assert orders(pilot().order(GoToOrder(58.0, 15.0, HOME_M + height_m))) == [GoToOrder(58.0, 15.0, HOME_M + height_m)]


def test_floor_and_ceiling_are_those_of_the_platform() -> None:
    flown = pilot()
    flown.limits = FlightLimits(floor_m=30.0, ceiling_m=60.0)
    assert "below the floor of 30 m" in (flown.refusal(GoToOrder(58.0, 15.0, HOME_M + 29.0)) or "")
    assert "above the ceiling of 60 m" in (flown.refusal(GoToOrder(58.0, 15.0, HOME_M + 61.0)) or "")


def test_a_waypoint_below_the_floor_is_not_flown_to() -> None:
    assert at(pilot(FlightPlan((Waypoint(58.001, 15.0, HOME_M + 5.0),)))) == []


def test_without_a_home_no_altitude_is_promised_but_holding_is() -> None:
    flown = pilot()
    flown.home = None
    with pytest.raises(Refused, match="home is not known"):
        flown.order(GoToOrder(58.0, 15.0, 100.0))
    assert orders(flown.order(HoldOrder())) == [HoldOrder()]


def test_an_order_is_refused_while_the_vehicle_gives_way_but_landing_is_not() -> None:
    flown = pilot()
    at(flown)
    flown.divert(None)
    for order in (GoToOrder(58.0, 15.0, 100.0), HoldOrder()):
        with pytest.raises(Refused, match="giving way to another"):
            flown.order(order)
    assert orders(flown.order(LandOrder())) == [LandOrder()]
    assert flown.flying == "order"


# -- what is flown -----------------------------------------------------------------------------------------------


def test_the_plan_is_flown_leg_by_leg_and_ends_in_holding() -> None:
    flown = pilot(ROUTE)
    assert at(flown, 0) == [leg(NEAR)]
    assert at(flown, 100_000, 58.0005) == [], "what is under way is not ordered again"
    assert at(flown, 200_000, NEAR.latitude_deg) == [leg(FAR)]
    assert flown.flying == "plan"
    assert at(flown, 300_000, FAR.latitude_deg) == [HoldOrder()]
    assert at(flown, 400_000, FAR.latitude_deg) == []
    assert flown.flying == "holding"


def test_a_plan_that_loops_begins_again() -> None:
    flown = pilot(FlightPlan((NEAR, FAR), loop=True))
    at(flown, 0)
    at(flown, 100_000, NEAR.latitude_deg)
    assert at(flown, 200_000, FAR.latitude_deg) == [leg(NEAR)]


def test_a_plan_is_not_flown_before_its_start() -> None:
    flown = pilot(FlightPlan((NEAR,), start_us=1_000_000))
    assert at(flown, 999_999) == []
    assert at(flown, 1_000_000) == [leg(NEAR)]


def test_a_denied_command_is_tried_again_after_a_while() -> None:
    flown = pilot(ROUTE)
    (command,) = flown.on_estimate(Sample(0, 0, (58.0, 15.0, 100.0, 0.0, 0.0, 0.0)))
    flown.on_report(CommandResult(50_000, command.number, accepted=False, reason="denied"), 50_000)
    assert at(flown, 50_000 + RETRY_US - 1) == []
    assert at(flown, 50_000 + RETRY_US) == [leg(NEAR)]
    assert at(flown, 60_000 + RETRY_US) == []


@pytest.mark.parametrize("start", ["order", "divert"])
def test_a_denied_order_and_a_denied_diversion_are_tried_again(start: str) -> None:
    flown = pilot()
    at(flown)
    (command,) = flown.order(HoldOrder()) if start == "order" else flown.divert(130.0)
    flown.on_report(CommandResult(0, command.number, accepted=False, reason="timed out"), 0)
    assert at(flown, RETRY_US) == [command.order]


def test_what_an_older_command_came_to_and_what_was_accepted_is_not_tried_again() -> None:
    flown = pilot(ROUTE)
    at(flown)
    (hold,) = flown.order(HoldOrder())
    flown.on_report(CommandResult(0, hold.number - 1, accepted=False, reason="denied"), 0)
    flown.on_report(CommandResult(0, hold.number, accepted=True, reason=""), 0)
    assert at(flown, RETRY_US) == []


def test_an_order_stands_until_resume_and_then_the_plan_goes_on() -> None:
    flown = pilot(ROUTE)
    at(flown)
    assert orders(flown.order(HoldOrder())) == [HoldOrder()]
    assert at(flown, 100_000) == []
    assert flown.flying == "order"
    assert orders(flown.resume()) == [leg(NEAR)]


def test_a_diversion_stops_where_the_vehicle_is_and_the_route_is_resumed_after_it() -> None:
    flown = pilot(ROUTE)
    at(flown, 0, 58.0005)
    assert orders(flown.divert(130.0)) == [GoToOrder(58.0005, 15.0, 130.0)]
    assert at(flown, 100_000, 58.0006) == []
    assert flown.flying == "diverted"
    assert orders(flown.resume()) == [leg(NEAR)]
    assert flown.flying == "plan"


def test_the_route_is_resumed_above_or_below_the_other_while_that_is_asked() -> None:
    flown = pilot(ROUTE)
    at(flown)
    flown.divert(130.0)
    assert orders(flown.resume(raised_to_m=130.0)) == [leg(NEAR, 130.0)]
    assert orders(flown.resume(lowered_to_m=80.0)) == [leg(NEAR, 80.0)]
    assert orders(flown.resume()) == [leg(NEAR)]


def test_an_order_that_stood_before_a_diversion_stands_after_it() -> None:
    flown = pilot(ROUTE)
    at(flown)
    flown.order(HoldOrder())
    flown.divert(130.0)
    assert orders(flown.resume()) == [HoldOrder()]


def test_who_had_arrived_returns_to_where_it_was() -> None:
    flown = pilot(FlightPlan((NEAR,)))
    at(flown, 0, NEAR.latitude_deg)
    flown.divert(None)
    at(flown, 100_000, 58.0005)
    assert orders(flown.resume()) == [leg(NEAR)]


def test_a_vehicle_that_somebody_else_guides_is_sent_back_to_where_that_one_had_sent_it() -> None:
    flown = pilot()
    at(flown)
    flown.on_report(TargetReport(0, 58.01, 15.0, 100.0), 0)
    flown.divert(130.0)
    flown.on_report(TargetReport(0, 58.0, 15.0, 130.0), 0)
    assert orders(flown.resume()) == [GoToOrder(58.01, 15.0, 100.0)], "not to where giving way had sent it"


TAKEN_OVER = StatusReport(0, armed=True, guided=False, airborne=True, mode="LOITER")
LANDED = StatusReport(0, armed=False, guided=True, airborne=False, mode="GUIDED")


def test_a_vehicle_that_was_taken_over_and_given_back_is_told_again_where_to_go() -> None:
    flown = pilot(ROUTE)
    assert at(flown) == [leg(NEAR)]
    flown.on_report(TAKEN_OVER, 1)
    assert at(flown, 1) == []
    flown.on_report(FLIES, 2)
    assert at(flown, 2) == [leg(NEAR)]
    order = GoToOrder(58.0, 15.0, 90.0)
    assert orders(flown.order(order)) == [order]
    flown.on_report(TAKEN_OVER, 3)
    flown.on_report(FLIES, 4)
    assert at(flown, 4) == [order]


@pytest.mark.parametrize("order", ORDERS)
def test_an_order_is_not_repeated_in_another_flight_nor_against_who_ended_a_landing(order: Order) -> None:
    flown = pilot()
    flown.order(order)
    if isinstance(order, LandOrder | ReturnHomeOrder):
        flown.on_report(TAKEN_OVER, 1)
        flown.on_report(FLIES, 2)
        assert at(flown, 2) == []
    flown.on_report(TAKEN_OVER, 3)
    flown.on_report(LANDED, 4)
    flown.on_report(FLIES, 5)
    assert at(flown, 5) == []


def test_without_control_the_pilot_watches() -> None:
    flown = pilot(ROUTE, control=False)
    assert at(flown) == []
    assert flown.resume() == []
    assert flown.flying == "watching"
