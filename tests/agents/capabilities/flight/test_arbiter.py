"""Who commands a vehicle: its pilot's hands, giving way, a mission, a single order, the route; and never two."""

from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow import Sample
from dyknow.agents.capabilities.flight.arbiter import CommandClaims, Commander
from dyknow.agents.capabilities.flight.pilot import Pilot
from dyknow.agents.places import FlightLimits
from dyknow.model.errors import Refused
from dyknow.navigation.vehicle import (
    Arm,
    GoToOrder,
    HoldOrder,
    HomeReport,
    LandOrder,
    Order,
    ReturnHomeOrder,
    SetGuided,
    StatusReport,
    TakeOffOrder,
    TargetReport,
)

THERE = GoToOrder(0.0, 0.001, 70.0)
ELSEWHERE = GoToOrder(0.0, 0.002, 70.0)


def flown(*, armed: bool = True, airborne: bool = True, mode: str = "GUIDED", mission: str = "m") -> Pilot:
    pilot = Pilot(control=True, limits=FlightLimits(10.0, 120.0))
    pilot.on_report(HomeReport(0, 0.0, 0.0, 20.0), 0)
    tell(pilot, armed=armed, airborne=airborne, mode=mode)
    pilot.on_estimate(Sample(0, 0, (0.0, 0.0, 70.0, 0.0, 0.0, 0.0)))
    if mission:
        pilot.begin_mission(mission)
    return pilot


def tell(pilot: Pilot, *, armed: bool = True, airborne: bool = True, mode: str = "GUIDED") -> None:
    pilot.on_report(StatusReport(pilot.now_us, armed, mode == "GUIDED", airborne, mode), pilot.now_us)


@given(st.builds(CommandClaims, *[st.sampled_from(["", "x"])] * 5), st.sampled_from(Commander))
def test_only_the_greatest_claim_commands_and_nothing_less_may_order(claims: CommandClaims, by: Commander) -> None:
    greater = [who for who, claim in zip(list(Commander)[1:], claims, strict=True) if claim and who > by]
    if greater:
        with pytest.raises(Refused):
            claims.check(by)
    else:
        claims.check(by)


EVENTS = st.sampled_from(
    [
        "guided",
        "loiter",
        "goto",
        "hold",
        "resume",
        "mission goto",
        "mission land",
        "divert",
        "way free",
        "other station",
        "next leader",
    ]
)


@given(st.lists(EVENTS, max_size=25))
def test_a_mission_never_sends_anything_while_another_goes_before_it(events: list[str]) -> None:
    pilot, mode, hands = flown(), "GUIDED", False
    for event in events:
        sent: list[Order] = []
        with suppress(Refused):
            match event:
                case "guided" | "loiter":
                    mode = "GUIDED" if event == "guided" else "LOITER"
                    tell(pilot, mode=mode)
                    hands |= mode == "LOITER"
                case "goto" | "hold":
                    pilot.command(ELSEWHERE if event == "goto" else HoldOrder())
                    hands = True
                case "resume":
                    waited = bool(pilot.mission.waits)
                    pilot.proceed()
                    hands = hands and not waited
                case "mission goto" | "mission land" if pilot.mission.name:
                    order = THERE if event == "mission goto" else LandOrder()
                    sent = [each.order for each in pilot.order(order, Commander.MISSION)]
                case "next leader":
                    pilot.end_mission(is_over=False)
                    pilot.begin_mission("m")
                case "divert":
                    pilot.divert(90.0)
                case "way free":
                    pilot.resume()
                case "other station":
                    pilot.on_report(TargetReport(pilot.now_us, 0.01, 0.01, 70.0), pilot.now_us)
                    hands |= bool(pilot.mission.waits)
        if sent:
            assert not hands
            assert mode == "GUIDED"
            assert pilot.diversion is None
        assert (pilot.claims.commander is Commander.MISSION) <= (not hands)


def test_a_ground_station_that_commands_the_vehicle_has_the_mission_wait_until_a_user_resumes_it() -> None:
    pilot = flown()
    pilot.order(THERE, Commander.MISSION)
    pilot.take_over("ground station 255/190 has commanded the vehicle (SET_MODE)")
    assert pilot.claims.commander is Commander.HANDS
    with pytest.raises(Refused, match="ground station 255/190"):
        pilot.order(THERE, Commander.MISSION)
    pilot.proceed()
    pilot.take_over("again")
    assert pilot.mission.waits == "again"


def test_a_change_of_mode_in_the_middle_has_the_mission_wait_until_a_user_resumes_it() -> None:
    pilot = flown()
    pilot.order(THERE, Commander.MISSION)
    tell(pilot, mode="LOITER")
    assert pilot.mission.waits == "the vehicle was taken over: mode LOITER"
    tell(pilot)
    with pytest.raises(Refused, match="LOITER") as refused:
        pilot.order(THERE, Commander.MISSION)
    assert refused.value.code == "hands"
    assert pilot.proceed() == []
    assert [each.order for each in pilot.order(THERE, Commander.MISSION)] == [THERE]


def test_a_mission_does_not_resume_in_a_mode_that_its_pilot_chose() -> None:
    pilot = flown()
    tell(pilot, mode="LOITER")
    with pytest.raises(Refused, match="guided mode"):
        pilot.proceed()
    assert pilot.mission.waits


@pytest.mark.parametrize("order", [ELSEWHERE, HoldOrder(), LandOrder(), ReturnHomeOrder()])
def test_a_users_order_takes_the_vehicle_from_a_mission_until_it_is_resumed(order: Order) -> None:
    pilot = flown()
    pilot.order(THERE, Commander.MISSION)
    assert [each.order for each in pilot.command(order)] == [order]
    for _ in range(3):  # its leader leaves, and leads it again
        with pytest.raises(Refused) as refused:
            pilot.order(THERE, Commander.MISSION)
        assert refused.value.code == "hands"
        pilot.end_mission(is_over=False)
        assert pilot.standing == order
        pilot.begin_mission("m")
        assert pilot.mission.waits.startswith("a user ordered")
    assert pilot.proceed() == []
    assert [each.order for each in pilot.order(THERE, Commander.MISSION)] == [THERE]


def test_a_mission_that_waits_does_so_though_its_leader_ended_it_and_began_it_again() -> None:
    pilot = flown()
    pilot.command(HoldOrder())
    pilot.end_mission()
    pilot.begin_mission("m")
    assert pilot.mission.waits.startswith("a user ordered")
    pilot.end_mission()
    assert pilot.proceed() == []
    pilot.begin_mission("m")
    assert not pilot.mission.waits


def test_a_mission_that_is_permitted_anew_waits_for_nothing() -> None:
    pilot = flown()
    pilot.command(HoldOrder())
    pilot.end_mission(is_over=False)
    pilot.awaited.expect("m")
    pilot.begin_mission("m")
    assert not pilot.mission.waits


def test_following_takes_no_vehicle_from_a_mission() -> None:
    pilot = flown()
    for order in (ELSEWHERE, HoldOrder()):
        with pytest.raises(Refused, match="dyknow mission abort") as refused:
            pilot.order(order)
        assert refused.value.code == "mission"


def test_giving_way_goes_before_a_mission_which_flies_on_afterwards() -> None:
    pilot = flown()
    command = pilot.order(THERE, Commander.MISSION)[0]
    pilot.divert(90.0)
    with pytest.raises(Refused) as refused:
        pilot.order(ELSEWHERE, Commander.MISSION)
    assert refused.value.code == "giving-way"
    pilot.resume()
    assert pilot.flying == "mission"
    assert pilot.standing == command.order


def test_it_takes_off_only_from_a_vehicle_that_stands_disarmed() -> None:
    pilot = flown(armed=False, airborne=False, mode="STABILIZE")
    assert [each.order for each in pilot.prepare(SetGuided())] == [SetGuided()]
    tell(pilot, armed=False, airborne=False)
    assert pilot.prepare(Arm())
    tell(pilot, airborne=False)
    assert pilot.prepare(TakeOffOrder(20.0))
    armed = flown(airborne=False, mission="")
    tell(armed, airborne=False, mode="STABILIZE")
    with pytest.raises(Refused, match="STABILIZE"):
        armed.begin_mission("m")
    with pytest.raises(Refused, match="its pilot chose"):
        armed.prepare(SetGuided())


def test_a_vehicle_that_its_pilot_flies_is_not_given_to_a_mission() -> None:
    with pytest.raises(Refused, match="LOITER"):
        flown(mode="LOITER")
