"""The pilot: each rule for commanding aircraft in which it refuses, and what it flies when none does."""

from collections.abc import Callable

import pytest

from dyknow import Sample
from dyknow.agents.capabilities.flight.arbiter import HEARD_WITHIN_US
from dyknow.agents.capabilities.flight.commanded import ATTEMPTS, FORGETS_US, RETRY_US
from dyknow.agents.capabilities.flight.errand import OrderProgress
from dyknow.agents.capabilities.flight.pilot import Pilot
from dyknow.agents.places import FlightLimits, FlightPlan, Waypoint
from dyknow.model.errors import Refused
from dyknow.navigation.vehicle import (
    NO_ANSWER,
    Command,
    CommandResult,
    GoToOrder,
    HoldOrder,
    HomeReport,
    InterruptOrder,
    LandOrder,
    MissionItemOrder,
    MissionReport,
    Order,
    PositionReport,
    ResumeMissionOrder,
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
        (no_status, "not reported its state"),
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
    if breaks is not_guided:
        assert at(flown, 100_000) == [], "a mode that was changed in flight is the pilot's hands"
        assert orders(flown.proceed()) == [leg(NEAR)]
    else:
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
    flown.bounds.forget()
    with pytest.raises(Refused, match="home is not known"):
        flown.order(GoToOrder(58.0, 15.0, 100.0))
    assert orders(flown.order(HoldOrder())) == [HoldOrder()]


@pytest.mark.parametrize("order", [LandOrder(), HoldOrder()])
def test_an_order_is_refused_while_the_vehicle_gives_way_but_landing_and_stopping_are_not(
    order: LandOrder | HoldOrder,
) -> None:
    flown = pilot()
    at(flown)
    flown.divert(None)
    with pytest.raises(Refused, match="giving way to another"):
        flown.order(GoToOrder(58.0, 15.0, 100.0))
    assert orders(flown.order(order)) == [order]
    assert flown.flying == "order"


def test_a_manoeuvre_after_one_at_half_speed_is_given_the_speed_of_the_plan_again() -> None:
    flown = pilot(ROUTE)
    at(flown)
    (slow,) = orders(flown.divert(100.0, (58.001, 15.0), ROUTE.speed_m_s / 2.0))
    (next_one,) = orders(flown.divert(120.0, (58.001, 15.0)))
    assert isinstance(slow, GoToOrder)
    assert isinstance(next_one, GoToOrder)
    assert (slow.speed_m_s, next_one.speed_m_s) == (ROUTE.speed_m_s / 2.0, ROUTE.speed_m_s)


# -- what is flown -----------------------------------------------------------------------------------------------


def test_the_plan_is_flown_leg_by_leg_and_ends_in_holding() -> None:
    flown = pilot(ROUTE)
    assert at(flown, 0) == [leg(NEAR)]
    assert at(flown, 100_000, 58.0005) == [], "what is under way is not ordered again"
    assert at(flown, 200_000, NEAR.latitude_deg) == [leg(FAR)]
    assert flown.flying == "plan"
    assert at(flown, 300_000, FAR.latitude_deg) == [], "there, but not yet at its altitude"
    assert at(flown, 400_000, FAR.latitude_deg, FAR.altitude_m) == [HoldOrder()]
    assert at(flown, 500_000, FAR.latitude_deg, FAR.altitude_m) == []
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


def told(flown: Pilot, command: Command, reason: str = "", now_us: int = 0, *, accepted: bool = False) -> None:
    flown.on_report(CommandResult(now_us, command.number, accepted, reason), now_us)


def test_a_leg_without_an_answer_is_ordered_a_few_times_and_then_never_again() -> None:
    flown = pilot(ROUTE)
    found = [command for at_us in range(0, 40_000_000, 100_000) for command in unanswered(flown, at_us)]
    assert [command.order for command in found] == [leg(NEAR)] * ATTEMPTS


def unanswered(flown: Pilot, at_us: int) -> list[Command]:
    flown.on_report(FLIES, at_us)
    commands = flown.on_estimate(Sample(at_us, at_us, (58.0, 15.0, 100.0, 0.0, 0.0, 0.0)))
    for command in commands:
        told(flown, command, NO_ANSWER, at_us)
    return commands


def test_a_leg_that_the_autopilot_denies_ends_the_plan_and_is_told() -> None:
    flown, notes = pilot(ROUTE), []
    flown.note = notes.append
    (command,) = flown.on_estimate(Sample(0, 0, (58.0, 15.0, 100.0, 0.0, 0.0, 0.0)))
    told(flown, command, "denied")
    assert not any(at(flown, at_us) for at_us in range(0, 3_000_000, 100_000))
    assert any("the plan is not flown: autopilot: denied" in note for note in notes)


@pytest.mark.parametrize("start", ["order", "divert"])
@pytest.mark.parametrize("reason", ["denied", "unsupported", "failed", NO_ANSWER])
def test_an_order_and_a_diversion_are_never_repeated_by_the_pilot(start: str, reason: str) -> None:
    flown = pilot()
    at(flown)
    (command,) = flown.order(HoldOrder()) if start == "order" else flown.divert(130.0)
    told(flown, command, reason)
    assert not any(at(flown, at_us) for at_us in range(0, 3 * RETRY_US, 100_000))
    errand = flown.errand if start == "order" else flown.diversion
    assert errand is not None
    assert errand.has_failed
    assert errand.reason == (NO_ANSWER if reason == NO_ANSWER else f"autopilot: {reason}")


def test_an_answer_to_an_older_command_says_nothing_of_the_newer_one() -> None:
    flown = pilot(ROUTE)
    (older,) = flown.on_estimate(Sample(0, 0, (58.0, 15.0, 100.0, 0.0, 0.0, 0.0)))
    flown.divert(130.0)
    told(flown, older, "denied")
    assert flown.diversion is not None
    assert flown.diversion.progress is OrderProgress.SENT


def test_an_order_stands_until_resume_and_then_the_plan_goes_on() -> None:
    flown = pilot(ROUTE)
    at(flown)
    assert orders(flown.order(HoldOrder())) == [HoldOrder()]
    assert at(flown, 100_000) == []
    assert flown.flying == "order"
    assert orders(flown.proceed()) == [leg(NEAR)]


def test_a_diversion_stops_where_the_vehicle_is_and_the_route_is_resumed_after_it() -> None:
    flown = pilot(ROUTE)
    at(flown, 0, 58.0005)
    assert orders(flown.divert(130.0)) == [GoToOrder(58.0005, 15.0, 130.0, stops=True)]
    assert at(flown, 100_000, 58.0006) == []
    assert flown.flying == "diverted"
    assert orders(flown.resume()) == [leg(NEAR)]
    assert flown.flying == "plan"


def test_an_order_that_stood_before_a_diversion_is_said_once_after_it() -> None:
    flown = pilot(ROUTE)
    at(flown)
    flown.order(HoldOrder())
    flown.divert(130.0)
    assert orders(flown.resume()) == [HoldOrder()]
    assert flown.resume() == []


def test_who_had_arrived_returns_to_where_it_was() -> None:
    flown = pilot(FlightPlan((NEAR,)))
    at(flown, 0, NEAR.latitude_deg)
    flown.divert(None)
    at(flown, 100_000, 58.0005)
    assert orders(flown.resume()) == [leg(NEAR)]


A, B = TargetReport(0, 58.002, 15.0, 100.0), TargetReport(0, 58.004, 15.001, 90.0)


def guided_to(flown: Pilot, target: TargetReport, at_us: int) -> None:
    hears(flown, at_us)
    flown.on_report(target, at_us)


def hears(flown: Pilot, at_us: int) -> None:
    """A heartbeat; after silence home is told again."""
    flown.on_report(FLIES, at_us)
    flown.on_report(HomeReport(0, 58.0, 15.0, HOME_M), at_us)


def test_a_vehicle_that_a_ground_station_guides_is_sent_back_once_to_where_that_one_had_sent_it() -> None:
    flown = pilot()
    at(flown)
    guided_to(flown, A, 0)
    (command,) = flown.divert(130.0)
    told(flown, command, accepted=True)
    flown.on_report(TargetReport(0, 58.0, 15.0, 130.0), 0)
    assert orders(flown.resume()) == [GoToOrder(*A[1:])], "not to where giving way had sent it"
    assert flown.resume() == []


def test_after_giving_way_the_targets_of_the_ground_station_are_its_own_again() -> None:
    flown = pilot()
    at(flown)
    guided_to(flown, A, 0)
    flown.divert(130.0)
    assert orders(flown.resume()) == [GoToOrder(*A[1:])]
    guided_to(flown, B, 10_000_000)
    flown.on_report(TAKEN_OVER, 11_000_000)
    flown.on_report(FLIES, 12_000_000)
    assert at(flown, 12_000_000) == [], "nobody asked"
    assert flown.resume() == []
    guided_to(flown, B, 13_000_000)
    assert flown.avoidance_off == "its pilot took over", "the mode was changed in flight, whatever it was doing"
    with pytest.raises(Refused, match="its pilot took over"):
        flown.divert(130.0)
    flown.command(HoldOrder())
    assert flown.avoidance_off is None
    flown.divert(130.0)


def test_a_target_that_was_heard_before_a_gap_of_the_link_is_returned_to() -> None:
    flown = pilot()
    flown.note = (notes := []).append
    guided_to(flown, A, 0)
    hears(flown, 4_000_000)
    at(flown, 4_000_000)
    flown.divert(130.0)
    assert notes == ["its target was heard 4 s ago, and is taken to be the same still"]
    guided_to(flown, A, 4_200_000)
    assert orders(flown.resume()) == [GoToOrder(*A[1:])]


def test_a_target_that_was_given_in_a_gap_of_the_link_is_returned_to() -> None:
    flown = pilot()
    guided_to(flown, A, 0)
    hears(flown, 4_000_000)
    at(flown, 4_000_000)
    flown.divert(130.0)
    guided_to(flown, B, 4_200_000)
    assert orders(flown.resume()) == [GoToOrder(*B[1:])], "it overtakes nothing: the order came after it"


def test_a_vehicle_that_never_said_where_it_was_going_holds_and_says_so() -> None:
    flown = pilot()
    flown.note = (notes := []).append
    at(flown)
    flown.divert(130.0)
    assert flown.resume() == []
    assert notes == ["it is not known where the vehicle was going: it holds"]


def test_between_two_places_it_returns_to_the_one_it_was_sent_to_last() -> None:
    """A shuttle: each round the ground station gives the place that an order of ours gave the round before."""
    flown = pilot()
    at(flown)
    for lap in range(4):
        for to in (A, B):
            now_us = flown.now_us + 60_000_000
            guided_to(flown, to, now_us)
            at(flown, now_us)
            assert flown.others_target() == GoToOrder(*to[1:]), lap
            (command,) = flown.divert(130.0)
            told(flown, command, accepted=True)
            (back,) = flown.resume()
            assert back.order == GoToOrder(*to[1:]), lap
            told(flown, back, accepted=True)
            flown.on_report(to, now_us + 500_000)


def test_hold_then_resume_goes_on_to_where_the_order_before_had_it() -> None:
    flown = pilot()
    at(flown)
    guided_to(flown, A, 0)
    flown.command(GoToOrder(*B[1:]))
    flown.command(HoldOrder())
    flown.command(HoldOrder())
    assert orders(flown.proceed()) == [GoToOrder(*B[1:])]


def test_a_ground_station_that_sends_the_vehicle_elsewhere_meanwhile_is_not_contradicted() -> None:
    flown = pilot()
    at(flown)
    guided_to(flown, A, 0)
    (command,) = flown.divert(130.0)
    told(flown, command, accepted=True)
    flown.on_report(TargetReport(0, 58.0, 15.0, 130.0), 100_000)
    flown.on_report(A, 1_100_000)
    assert flown.diversion is not None
    assert flown.diversion.progress is OrderProgress.OVERTAKEN
    assert "another target" in flown.diversion.reason
    assert flown.resume() == []


def test_a_refused_diversion_leaves_the_vehicle_to_who_guides_it() -> None:
    flown = pilot()
    at(flown)
    guided_to(flown, A, 0)
    (command,) = flown.divert(130.0)
    told(flown, command, "failed")
    assert flown.resume() == [], "it never left"


def test_without_anything_interrupted_there_is_nothing_to_resume() -> None:
    flown = pilot()
    at(flown)
    guided_to(flown, A, 0)
    with pytest.raises(Refused, match="nothing was interrupted"):
        flown.proceed()
    flown.order(HoldOrder())
    assert orders(flown.proceed()) == [GoToOrder(*A[1:])]
    with pytest.raises(Refused, match="nothing was interrupted"):
        flown.proceed()


@RULES
def test_resume_is_refused_by_the_same_rules_and_changes_nothing(breaks: Callable[[Pilot], None], words: str) -> None:
    flown = pilot(ROUTE)
    at(flown)
    flown.order(HoldOrder())
    breaks(flown)
    stood = flown.flying
    with pytest.raises(Refused, match=words) as refused:
        flown.proceed()
    assert refused.value.code == "forbidden"
    assert flown.flying == stood
    flown.control = True
    flown.on_report(FLIES, 1)
    if breaks in {no_control, no_status, not_airborne, perhaps_airborne}:
        assert at(flown, 100_000) == [], "it stands still"


def test_what_was_interrupted_is_remembered_when_resume_is_refused() -> None:
    flown, now_us = pilot(), 0
    flown.clock = lambda: now_us
    at(flown)
    guided_to(flown, A, 0)
    flown.order(HoldOrder())
    now_us = 8_200_000
    for _ in range(2):
        with pytest.raises(Refused, match=r"no heartbeat for 8\.2 s"):
            flown.proceed()
    hears(flown, now_us)
    assert orders(flown.proceed()) == [GoToOrder(*A[1:])]


def test_resume_in_a_mode_of_the_pilot_sends_nothing_also_not_later() -> None:
    flown = pilot(ROUTE)
    at(flown)
    flown.on_report(TAKEN_OVER, 1)
    with pytest.raises(Refused, match="mode LOITER, which takes no positions"):
        flown.proceed()
    flown.on_report(FLIES, 2)
    assert not any(at(flown, at_us) for at_us in range(3, 2_000_000, 100_000)), "it was refused"
    assert orders(flown.proceed()) == [leg(NEAR)]


@pytest.mark.parametrize(
    ("plan", "latitude", "altitude", "words", "code"),
    [
        (FlightPlan((NEAR,), start_us=5_000_000), 58.0, 100.0, "the plan begins in 4.0 s", "plan-not-begun"),
        (FlightPlan((NEAR,)), NEAR.latitude_deg, 100.0, "the plan is over", "plan-over"),
        (FlightPlan((NEAR,)), None, 100.0, "position is not known", "forbidden"),
        (FlightPlan((Waypoint(58.001, 15.0, HOME_M + 5.0),)), 58.0, 100.0, "below the floor", "forbidden"),
    ],
)
def test_resume_is_refused_where_the_plan_orders_nothing(
    plan: FlightPlan, latitude: float | None, altitude: float, words: str, code: str
) -> None:
    flown = pilot(plan)
    flown.on_report(FLIES, 1_000_000)
    if latitude is not None:
        at(flown, 1_000_000, latitude, altitude)
    flown.order(HoldOrder())
    with pytest.raises(Refused, match=words) as refused:
        flown.proceed()
    assert refused.value.code == code
    assert flown.flying == "order"


def test_resume_begins_a_plan_whose_fix_is_older_than_the_link_may_be_only_with_a_new_one() -> None:
    flown, now_us = pilot(ROUTE), 4_000_000
    at(flown)
    flown.order(HoldOrder())
    hears(flown, now_us)
    with pytest.raises(Refused, match="position is not known"):
        flown.proceed()
    assert at(flown, now_us) == [], "the order stands"
    assert orders(flown.proceed()) == [leg(NEAR)]


def test_an_order_after_a_takeover_is_returned_to_after_giving_way() -> None:
    flown = pilot(ROUTE)
    at(flown)
    flown.on_report(TAKEN_OVER, 1)
    flown.on_report(FLIES, 2)
    flown.order(GoToOrder(58.0, 15.001, 90.0))
    flown.divert(130.0)
    assert orders(flown.resume()) == [GoToOrder(58.0, 15.001, 90.0)]


TAKEN_OVER = StatusReport(0, armed=True, guided=False, airborne=True, mode="LOITER")
LANDED = StatusReport(0, armed=False, guided=True, airborne=False, mode="GUIDED")


@pytest.mark.parametrize("missions", [False, True])
@pytest.mark.parametrize("mode", ["LOITER", "AUTO", "AUTO.MISSION"])
@pytest.mark.parametrize("doing", ["plan", "order", "hold", "diversion", "hover"])
def test_after_a_takeover_nothing_is_sent_until_asked(doing: str, mode: str, *, missions: bool) -> None:
    flown = pilot(ROUTE if doing == "plan" else None)
    flown.missions = missions
    taken_over = TAKEN_OVER._replace(mode=mode)
    at(flown)
    if doing == "order":
        flown.order(GoToOrder(58.0, 15.0, 90.0))
    elif doing != "plan":
        if doing != "hover":
            guided_to(flown, A, 0)
        if doing == "hold":
            flown.order(HoldOrder())
        else:
            flown.divert(130.0)
    flown.on_report(taken_over, 1)
    if flown.diversion is not None:
        assert flown.diversion.progress is OrderProgress.OVERTAKEN
        assert f"mode {mode}" in flown.diversion.reason
    assert at(flown, 1) == [], "nothing in the mode of its pilot"
    assert flown.resume() == []
    with pytest.raises(Refused, match=f"the vehicle is in mode {mode}"):
        flown.proceed()
    for status in (taken_over, FLIES):
        flown.on_report(status, 2)
        assert flown.resume() == []
        with pytest.raises(Refused, match=r"mode (LOITER|AUTO|AUTO.MISSION), which|its pilot took over"):
            flown.divert(130.0)
    assert not any(at(flown, at_us) for at_us in range(3, 2_000_000, 100_000))
    if doing == "plan":
        assert orders(flown.proceed()) == [leg(NEAR)]


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


# -- what is known ages ------------------------------------------------------------------------------------------


def test_over_a_dead_link_nothing_is_commanded() -> None:
    flown = pilot(ROUTE)
    now_us = 0
    flown.clock = lambda: now_us
    now_us = HEARD_WITHIN_US
    assert flown.refusal(HoldOrder()) is None
    now_us = 8_200_000
    with pytest.raises(Refused, match=r"no heartbeat for 8\.2 s"):
        flown.order(HoldOrder())
    with pytest.raises(Refused, match=r"no heartbeat for 8\.2 s"):
        flown.divert(None)
    assert at(flown, 8_200_000) == []


def test_after_silence_home_must_be_told_again_before_an_altitude_is_promised() -> None:
    flown = pilot()
    at(flown)
    flown.on_report(FLIES, FORGETS_US + 1)
    with pytest.raises(Refused, match="home is not known"):
        flown.order(GoToOrder(58.0, 15.0, 100.0))
    flown.on_report(PositionReport(0, "", 58.0, 15.0, 100.0, height_m=50.0), FORGETS_US + 1)
    assert orders(flown.order(GoToOrder(58.0, 15.0, 100.0)))


def test_a_home_that_leaps_in_flight_is_told_and_not_believed() -> None:
    flown, notes = pilot(), []
    flown.note = notes.append
    flown.on_report(HomeReport(0, 58.0, 15.0, 5050.0), 0)
    assert "leapt by 5000 m" in notes[0]
    assert "above the ceiling" in (flown.refusal(GoToOrder(58.0, 15.0, 5100.0)) or "")


# -- missions ----------------------------------------------------------------------------------------------------

AUTO = StatusReport(0, armed=True, guided=False, airborne=True, mode="AUTO")


def on_mission(*, missions: bool) -> Pilot:
    flown = pilot()
    flown.missions = missions
    at(flown)
    flown.on_report(AUTO, 0)
    flown.on_report(MissionReport(0, 3), 0)
    flown.on_report(A, 0)
    return flown


def test_without_leave_a_mission_is_not_interrupted() -> None:
    flown = on_mission(missions=False)
    with pytest.raises(Refused, match=r"mode AUTO, which takes no positions.*--control auto"):
        flown.divert(130.0)


def test_with_leave_a_mission_is_interrupted_to_give_way_and_resumed_at_its_item() -> None:
    flown = on_mission(missions=True)
    assert flown.refusal(flown.stop(None)) is None
    (command,) = flown.divert(130.0)
    assert command.order == InterruptOrder(58.0, 15.0, 130.0, stops=True)
    told(flown, command, accepted=True)
    flown.on_report(FLIES, 100_000)
    (again,) = flown.resume()
    assert again.order == ResumeMissionOrder()
    told(flown, again, accepted=True)
    flown.on_report(AUTO, 200_000)
    assert flown.on_report(MissionReport(0, 3), 300_000) == []
    assert flown.resume() == []


def test_a_mission_that_reports_no_target_is_resumed_once() -> None:
    flown = on_mission(missions=True)
    flown.targets.forget()
    (command,) = flown.divert(None)
    told(flown, command, accepted=True)
    flown.on_report(FLIES, 100_000)
    assert orders(flown.resume()) == [ResumeMissionOrder()]
    assert flown.resume() == [], "once"


def test_a_mission_that_begins_elsewhere_is_sent_to_its_item_once() -> None:
    flown = on_mission(missions=True)
    (command,) = flown.divert(None)
    assert command.order == InterruptOrder(58.0, 15.0, 100.0, stops=True), "to hold is to leave the mission, too"
    told(flown, command, accepted=True)
    flown.on_report(FLIES, 100_000)
    (again,) = flown.resume()
    told(flown, again, accepted=True)
    flown.on_report(AUTO, 200_000)
    assert orders(flown.on_report(MissionReport(0, 1), 300_000)) == [MissionItemOrder(3)]
    assert flown.on_report(MissionReport(0, 1), 400_000) == []


def test_a_pilot_who_begins_the_mission_again_has_it_also_where_the_interruption_was_not_acknowledged() -> None:
    flown = on_mission(missions=True)
    flown.divert(130.0)
    flown.on_report(FLIES, 100_000)
    flown.on_report(AUTO, 200_000)
    assert flown.diversion is not None
    assert flown.diversion.progress is OrderProgress.OVERTAKEN
    assert flown.resume() == []
    assert flown.avoidance_off == "its pilot took over"


def test_a_ground_station_that_begins_a_mission_when_nothing_is_ours_takes_nothing_over() -> None:
    flown = on_mission(missions=True)
    assert flown.avoidance_off is None
    assert orders(flown.divert(130.0)) == [InterruptOrder(58.0, 15.0, 130.0, stops=True)]


def test_a_plan_is_not_sent_into_a_mission() -> None:
    flown = pilot(ROUTE)
    flown.missions = True
    flown.on_report(AUTO, 0)
    assert at(flown) == []


def test_a_mission_item_is_not_set_once_the_pilot_has_the_vehicle() -> None:
    flown = on_mission(missions=True)
    (command,) = flown.divert(None)
    told(flown, command, accepted=True)
    flown.on_report(FLIES, 100_000)
    (again,) = flown.resume()
    told(flown, again, accepted=True)
    flown.on_report(AUTO, 200_000)
    flown.on_report(TAKEN_OVER, 250_000)
    assert flown.on_report(MissionReport(0, 1), 300_000) == []


def test_an_order_of_a_command_centre_interrupts_no_mission() -> None:
    with pytest.raises(Refused, match="only giving way interrupts a mission"):
        on_mission(missions=True).order(GoToOrder(58.0, 15.0, 100.0))


def test_without_control_the_pilot_watches() -> None:
    flown = pilot(ROUTE, control=False)
    assert at(flown) == []
    assert flown.resume() == []
    assert flown.flying == "watching"
