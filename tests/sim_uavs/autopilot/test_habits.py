"""Habits of real autopilots that an order has to reckon with, done by the simulated ones: on bytes, without a platform."""

import pytest
from pymavlink.dialects.v20 import all as mavlink

from dyknow.sim_uavs.dynamics.flight import Mode
from dyknow.sim_uavs.dynamics.quadcopter import Vector
from tests.sim_uavs.station import HOME, NAN, Station

BOTH = pytest.mark.parametrize("persona", ["ardupilot", "px4"])
INT = mavlink.MAV_FRAME_GLOBAL_INT


def under_way(persona: str) -> Station:
    """A vehicle that has been sent 200 m north, 30 m up, and is on its way."""
    station = Station(persona, airborne_m=30.0)
    place = round((HOME.latitude_deg + 200.0 / 111_194.9) * 1e7), round(HOME.longitude_deg * 1e7)
    command = mavlink.MAV_CMD_DO_REPOSITION
    assert station.command_int(command, INT, (-1.0, 1.0, 0.0, NAN), *place, HOME.altitude_m + 30.0) == 0
    station.run_until(lambda: station.vehicle.flight.body.position.north > 30.0)
    return station


def test_a_px4_that_holds_already_keeps_its_place_when_it_is_told_to_hold() -> None:
    station = under_way("px4")
    assert station.set_mode("GUIDED") == 0
    station.run(40.0)
    assert station.vehicle.flight.body.position.north == pytest.approx(200.0, abs=2.0)


def test_a_px4_stops_at_a_place_that_is_none() -> None:
    station = under_way("px4")
    assert station.command(mavlink.MAV_CMD_DO_REPOSITION, -1.0, 1.0, 0.0, NAN, NAN, NAN, NAN) == 0
    station.run(12.0)
    assert station.vehicle.flight.body.position.north < 60.0


@BOTH
def test_a_change_to_another_mode_and_back_forgets_the_place(persona: str) -> None:
    station = under_way(persona)
    station.set_mode("LOITER")
    station.run(6.0)
    stood_m = station.vehicle.flight.body.position.north
    station.set_mode("GUIDED")
    station.run(10.0)
    assert station.vehicle.flight.body.position.north == pytest.approx(stood_m, abs=1.0)


def test_a_px4_rises_in_a_mode_of_its_own_and_holds_afterwards() -> None:
    station = Station("px4")
    station.take_off(20.0)
    modes = [message.custom_mode for message in station.of_type("HEARTBEAT")]
    station.run(3.0)
    assert 4 << 16 | 2 << 24 in modes
    assert station.last("HEARTBEAT").custom_mode == 4 << 16 | 3 << 24
    assert station.truth.mode is Mode.GUIDED


@pytest.mark.parametrize(("persona", "count"), [("ardupilot", 1), ("px4", 2)])
def test_a_change_of_mode_is_acknowledged_once_or_twice(persona: str, count: int) -> None:
    station = Station(persona, airborne_m=30.0)
    numbers = (4, 5) if persona == "px4" else (6, 0)
    message = mavlink.MAVLink_command_long_message(1, 1, mavlink.MAV_CMD_DO_SET_MODE, 0, 1, *numbers, 0, 0, 0, 0)
    acknowledged = [each for each in station.send(message) if each.get_type() == "COMMAND_ACK"]
    assert len(acknowledged) == count
    assert station.truth.mode is Mode.RTL


@BOTH
def test_a_refusal_is_given_in_words_as_well(persona: str) -> None:
    station = Station(persona, airborne_m=30.0)
    settings = station.vehicle.flight.settings
    settings.fence_on, settings.fence_highest_m = 1.0, 60.0
    place = round(HOME.latitude_deg * 1e7), round(HOME.longitude_deg * 1e7)
    result = station.command_int(
        mavlink.MAV_CMD_DO_REPOSITION, INT, (-1.0, 1.0, 0.0, NAN), *place, HOME.altitude_m + 90.0
    )
    assert result == (0 if persona == "px4" else mavlink.MAV_RESULT_FAILED)
    station.run(0.2)
    words = "Reposition is outside geofence" if persona == "px4" else "Refused: outside the fence"
    assert station.last("STATUSTEXT").text == words
    assert station.last("STATUSTEXT").severity <= mavlink.MAV_SEVERITY_WARNING


def test_a_px4_sends_some_messages_at_a_rate_of_its_own() -> None:
    for persona, result in (("px4", mavlink.MAV_RESULT_FAILED), ("ardupilot", 0)):
        station = Station(persona)
        interval = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAVLINK_MSG_ID_MISSION_CURRENT, 200_000
        assert station.command(*interval) == result


def test_a_clock_that_runs_slow_says_less_time_than_has_passed() -> None:
    station = Station("px4", airborne_m=30.0)
    station.run(1.0)
    before_ms = station.last("GLOBAL_POSITION_INT").time_boot_ms
    station.inject("clock-drift=-8000")
    station.run(100.0)
    assert station.last("GLOBAL_POSITION_INT").time_boot_ms - before_ms == pytest.approx(99_200, abs=110)


def test_a_clock_that_stands_still_is_behind_from_then_on() -> None:
    station = Station("ardupilot", airborne_m=30.0)
    station.run(1.0)
    before_ms = station.last("GLOBAL_POSITION_INT").time_boot_ms
    station.inject("clock-stop", 0.5)
    station.run(0.4)
    assert station.last("GLOBAL_POSITION_INT").time_boot_ms - before_ms <= 100
    station.run(1.6)
    assert station.last("GLOBAL_POSITION_INT").time_boot_ms - before_ms == pytest.approx(1_500, abs=110)
    station.inject("clock-stop", 1.0)
    station.run(3.0)
    assert station.last("GLOBAL_POSITION_INT").time_boot_ms - before_ms == pytest.approx(3_500, abs=110)


def test_a_copter_returns_at_the_height_of_its_parameter_or_at_its_own_if_that_is_more() -> None:
    for start_m, highest_m in ((30.0, 45.0), (60.0, 60.0)):
        station = Station("ardupilot", airborne_m=start_m)
        station.vehicle.flight.settings.return_m = 45.0
        station.vehicle.flight.go_to(Vector(100.0, 0.0, -start_m))
        station.run(20.0)
        assert station.command(mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH) == 0
        heights_m = []
        while station.vehicle.flight.body.position.north > 20.0:
            station.run(0.5)
            heights_m.append(station.height_m)
        assert max(heights_m) == pytest.approx(highest_m, abs=1.0)
