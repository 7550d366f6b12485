"""Two vehicles head-on, as they met in the loop with real autopilots: what went wrong there, flown by the personas that learnt it."""

from typing import Any

import pytest

from dyknow.navigation.intents.meeting import MINIMA
from dyknow.reasoning import NEITHER_CAN_AVOID
from dyknow.sim_uavs.dynamics.flight import Mode
from dyknow.sim_uavs.dynamics.quadcopter import AirframeLimits, Vector
from dyknow.sim_uavs.dynamics.settings import PersonaName, VehicleSettings
from tests.sim_uavs.world.meetings import Flown, Meeting, Trouble
from tests.sim_uavs.worlds import alarms, separations_m

APART_M = 10.0
SPEED_M_S = 5.0
UP_M = 50.0
PERSONAS = pytest.mark.parametrize(
    "persona", ["ardupilot", pytest.param("ardupilot-3.3", marks=pytest.mark.full), "px4"]
)


def head_on(
    persona: PersonaName = "ardupilot", ways: tuple[str, str] = ("station", "station"), *troubles: Trouble, **one: Any
) -> Meeting:
    """0 flies north, 3 m above 1, which comes towards it and is to yield; `troubles` and the fields of `Flown` in `one` are of 1."""
    found = []
    for sign, way in zip((1.0, -1.0), ways, strict=True):
        start, end = (
            Vector(-65.0 * sign, 0.0, -UP_M - 1.5 - 1.5 * sign),
            Vector(80.0 * sign, 0.0, -UP_M - 1.5 - 1.5 * sign),
        )
        settings = VehicleSettings(cruise_m_s=SPEED_M_S)
        found.append(Flown(persona, way, start, end, SPEED_M_S, AirframeLimits(acceleration_m_s2=2.5), settings, ()))
    found[1] = found[1]._replace(troubles=troubles, **one)
    meeting = Meeting(1, found)
    meeting.run()
    return meeting


def least_m(meeting: Meeting) -> float:
    return min(metres for _, metres in separations_m(meeting.world, "0", "1"))


def neither_s(meeting: Meeting) -> float | None:
    """When it was told first that neither can avoid, after setting out."""
    told = [alarm.detected_us for alarm in alarms(meeting.task, NEITHER_CAN_AVOID)]
    return meeting.seconds(min(told)) if told else None


def met_s(meeting: Meeting) -> float:
    at_us, _ = min(separations_m(meeting.world, "0", "1"), key=lambda each: each[1])
    return meeting.seconds(at_us)


def notes(meeting: Meeting, unit: str) -> str:
    return "\n".join(meeting.world.nodes[unit].notes)


def height_m(meeting: Meeting, number: int) -> float:
    """The greatest height at which it has flown."""
    home_m = meeting.vehicles[number].autopilot.config.home.altitude_m
    return max(state.altitude_m for state in meeting.world.nodes[str(number)].truth) - home_m


@PERSONAS
def test_two_that_a_ground_station_has_sent_once_pass_apart_in_one_manoeuvre_each(persona: PersonaName) -> None:
    meeting = head_on(persona)
    assert least_m(meeting) > APART_M
    assert notes(meeting, "1").count(" for 0") == 1, "no stop and go"
    assert notes(meeting, "1").count("1 flies on, free of 0") == 1
    assert "0 agrees with 1: 1 makes room" in notes(meeting, "0")


@PERSONAS
def test_who_makes_room_does_so_until_the_other_is_away_wherever_it_was_sent(persona: PersonaName) -> None:
    """To a side or upright: one of both minima is kept all the time."""
    meeting = head_on(persona)
    truth = [meeting.world.nodes[unit].truth for unit in "01"]
    metres = dict(separations_m(meeting.world, "0", "1"))
    near = [abs(a.altitude_m - b.altitude_m) for a, b in zip(*truth, strict=True) if metres[a.at_us] < MINIMA.level_m]
    assert all(apart_m > APART_M for apart_m in near)
    assert least_m(meeting) > APART_M


@PERSONAS
@pytest.mark.parametrize("result", [2, 4])
def test_where_the_autopilot_of_who_yields_refuses_every_order_the_other_flies_all_of_it(
    persona: PersonaName, result: int
) -> None:
    meeting = head_on(persona, ("station", "station"), Trouble(f"refuse={result}", 0.0))
    assert least_m(meeting) > APART_M
    assert "agrees with 1: leaves all of it to 0" in notes(meeting, "0")


@PERSONAS
def test_a_fence_below_the_climb_is_seen_or_met_and_they_pass_apart(persona: PersonaName) -> None:
    fenced = VehicleSettings(cruise_m_s=SPEED_M_S, fence_on=1.0, fence_kinds=1.0, fence_highest_m=UP_M + 10.0)
    meeting = head_on(persona, settings=fenced)
    assert least_m(meeting) > APART_M
    assert height_m(meeting, 1) < UP_M + 10.0


@PERSONAS
def test_where_a_ground_station_streams_its_target_to_one_the_other_flies_all_of_it(persona: PersonaName) -> None:
    meeting = head_on(persona, ("station", "streaming"))
    assert least_m(meeting) > APART_M


@PERSONAS
@pytest.mark.parametrize("way", ["streaming", "mission"])
def test_where_neither_can_avoid_it_is_told_three_seconds_before(persona: PersonaName, way: str) -> None:
    """An autopilot that reports no target shows only in its motion that another station has sent it on: that is later."""
    meeting = head_on(persona, (way, way))
    told_s = neither_s(meeting)
    assert told_s is not None
    assert told_s <= met_s(meeting) - (1.0 if (persona, way) == ("ardupilot-3.3", "streaming") else 3.0)
    if way == "mission":
        assert all(not vehicle.sent for vehicle in meeting.vehicles)
        for unit in "01":
            assert "avoidance off: mode AUTO" in notes(meeting, unit).replace("AUTO.MISSION", "AUTO")


@PERSONAS
def test_one_on_its_mission_is_avoided_by_the_other_alone(persona: PersonaName) -> None:
    meeting = head_on(persona, ("station", "mission"))
    assert least_m(meeting) > APART_M
    assert not meeting.vehicles[1].sent


@PERSONAS
def test_missions_that_may_be_interrupted_are_and_are_flown_on(persona: PersonaName) -> None:
    meeting = head_on(persona, ("mission, may be interrupted", "mission, may be interrupted"))
    assert least_m(meeting) > APART_M
    meeting.world.run_for(10.0)
    for vehicle in meeting.vehicles:
        assert vehicle.flight.mode is Mode.AUTO


@PERSONAS
@pytest.mark.parametrize("at_s", [5.0, *(pytest.param(at_s, marks=pytest.mark.full) for at_s in (8.0, 12.0))])
def test_a_pilot_who_takes_over_in_the_middle_keeps_the_vehicle(persona: PersonaName, at_s: float) -> None:
    meeting = head_on(persona, ("station", "station"), Trouble("takeover", at_s, 5.0))
    assert least_m(meeting) > APART_M
    late = [order for order in meeting.vehicles[1].sent if meeting.seconds(order.at_us) > at_s + 1.2]
    assert late == [], "nothing is sent until asked"


@PERSONAS
@pytest.mark.parametrize("at_s", [5.0, pytest.param(9.0, marks=pytest.mark.full)])
def test_an_autopilot_that_ends_in_the_middle_is_kept_away_from(persona: PersonaName, at_s: float) -> None:
    meeting = head_on(persona, ("station", "station"), Trouble("killed", at_s))
    assert least_m(meeting) > APART_M
    late = [order for order in meeting.vehicles[1].sent if meeting.seconds(order.at_us) > at_s + 4.5]
    assert late == [], "nothing is commanded over a dead link"


@PERSONAS
def test_with_a_third_of_the_acknowledgements_lost_they_pass_apart(persona: PersonaName) -> None:
    assert least_m(head_on(persona, ("station", "station"), Trouble("ack-loss=30", 0.0))) > APART_M
