"""Autopilots whose ground station is no longer heard, by the parameters that are set over the wire."""

import struct

import pytest
from pymavlink.dialects.v20 import all as mavlink

from dyknow.navigation.vehicle import FailsafeReport
from dyknow.proxies.mavlink.parameters import VehicleParameters
from dyknow.sim_uavs.dynamics.faults import parse_fault
from dyknow.sim_uavs.dynamics.flight import Mode
from dyknow.sim_uavs.dynamics.missions import Item, MissionAction
from dyknow.sim_uavs.dynamics.quadcopter import Vector
from dyknow.sim_uavs.dynamics.settings import VehicleConfig
from dyknow.sim_uavs.dynamics.vehicles import SimulatedVehicle
from tests.sim_uavs.station import HOME, START_US, Station

AWAY = (Item(MissionAction.FLY_TO, Vector(0.0, 0.0, -30.0)), Item(MissionAction.FLY_TO, Vector(300.0, 0.0, -30.0)))
GCS = mavlink.MAV_TYPE_GCS
COMPUTER = mavlink.MAV_TYPE_ONBOARD_CONTROLLER


def flying(persona: str, height_m: float = 30.0, system: int = 255, **parameters: float) -> Station:
    """A vehicle that is on its way 200 m north, and has heard its station for three seconds."""
    station = Station(persona, airborne_m=height_m, system=system)
    for name, value in parameters.items():
        sent = struct.unpack("<f", struct.pack("<i", int(value)))[0] if is_integer(persona, name) else value
        (told,) = station.send(mavlink.MAVLink_param_set_message(1, 1, name.encode(), sent, 9))
        assert told.param_value == sent or persona == "px4"
    station.vehicle.flight.items = AWAY
    station.vehicle.flight.go_to(Vector(200.0, 0.0, -height_m))
    beating(station, 3.0)
    return station


def is_integer(persona: str, name: str) -> bool:
    return persona == "px4" and name not in {"RTL_RETURN_ALT", "COM_FAIL_ACT_T", "COM_OF_LOSS_T"}


def beating(station: Station, seconds: float, kind: int = GCS) -> None:
    for _ in range(round(seconds)):
        station.send(mavlink.MAVLink_heartbeat_message(kind, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 4, 3))
        station.run(1.0)


def mode_of(station: Station) -> Mode:
    return station.vehicle.flight.mode


def texts(station: Station) -> list[str]:
    return [message.text for message in station.of_type("STATUSTEXT")]


def test_by_default_the_order_under_way_is_carried_out() -> None:
    for persona in ("ardupilot", "px4"):
        station = flying(persona)
        station.run(60.0)
        assert mode_of(station) is Mode.GUIDED
        assert station.vehicle.flight.body.position.north == pytest.approx(200.0, abs=2.0)


def test_an_arducopter_returns_after_its_time_and_climbs_first() -> None:
    station = flying("ardupilot", FS_GCS_ENABLE=1, FS_GCS_TIMEOUT=8, RTL_ALT=6000)
    station.run(6.5)
    assert mode_of(station) is Mode.GUIDED
    station.run(1.5)
    assert mode_of(station) is Mode.RTL
    assert "GCS Failsafe" in texts(station)
    at = station.vehicle.flight.body.position
    station.run_until(lambda: station.height_m > 59.0)
    assert station.vehicle.flight.body.position.minus(at).horizontal < 15.0, "first up"
    station.run_until(lambda: not station.truth.armed)
    assert station.vehicle.flight.body.position.horizontal < 2.0


@pytest.mark.parametrize(
    ("persona", "action", "height"),
    [("ardupilot", "FS_GCS_ENABLE", "RTL_ALT"), ("px4", "NAV_DLL_ACT", "RTL_RETURN_ALT")],
)
def test_a_vehicle_above_its_return_height_never_sinks_to_it(persona: str, action: str, height: str) -> None:
    station = flying(
        persona, 70.0, **{action: 1 if persona == "ardupilot" else 2, height: 2000 if persona == "ardupilot" else 20}
    )
    station.run(5.2)
    assert mode_of(station) is Mode.RTL
    lowest_m = 70.0
    while station.vehicle.flight.body.position.horizontal > 2.0:
        station.run(0.5)
        lowest_m = min(lowest_m, station.height_m)
    assert lowest_m > 68.5


def test_a_return_ends_at_the_final_height_where_one_is_set() -> None:
    station = flying("ardupilot", FS_GCS_ENABLE=1, RTL_ALT_FINAL=1000)
    station.run(120.0)
    assert mode_of(station) is Mode.RTL
    assert station.truth.armed
    assert station.height_m == pytest.approx(10.0, abs=1.0)
    assert station.vehicle.flight.body.position.horizontal < 2.0


@pytest.mark.parametrize(
    ("action", "mode"), [(1, Mode.RTL), (3, Mode.RTL), (4, Mode.LAND), (5, Mode.LAND), (7, Mode.LAND)]
)
def test_an_arducopter_returns_or_lands_by_its_parameter(action: int, mode: Mode) -> None:
    station = flying("ardupilot", FS_GCS_ENABLE=action)
    station.run(6.0)
    assert mode_of(station) is mode


@pytest.mark.parametrize(("action", "options", "mode"), [(1, 0, Mode.RTL), (1, 2, Mode.AUTO), (2, 0, Mode.AUTO)])
def test_a_mission_of_an_arducopter_continues_where_its_options_say_so(action: int, options: int, mode: Mode) -> None:
    station = flying("ardupilot", FS_GCS_ENABLE=action, FS_OPTIONS=options)
    station.vehicle.flight.set_mode(Mode.AUTO)
    station.run(6.0)
    assert mode_of(station) is mode


def test_a_pilot_keeps_an_arducopter_where_its_options_say_so() -> None:
    for options, mode in ((0, Mode.RTL), (16, Mode.LOITER)):
        station = flying("ardupilot", FS_GCS_ENABLE=1, FS_OPTIONS=options)
        station.vehicle.flight.set_mode(Mode.LOITER)
        station.run(6.0)
        assert mode_of(station) is mode


def test_an_arducopter_waits_for_one_station_only_and_for_none_it_never_heard() -> None:
    other = flying("ardupilot", system=254, FS_GCS_ENABLE=1)
    other.run(20.0)
    assert mode_of(other) is Mode.GUIDED, "the heartbeats of 254 were never waited for"
    ours = flying("ardupilot", system=254, FS_GCS_ENABLE=1, SYSID_MYGCS=254)
    ours.run(6.0)
    assert mode_of(ours) is Mode.RTL


def test_an_arducopter_that_hears_its_station_again_says_so_and_returns_all_the_same() -> None:
    station = flying("ardupilot", FS_GCS_ENABLE=1)
    station.run(6.0)
    beating(station, 2.0)
    assert "GCS Failsafe Cleared" in texts(station)
    assert mode_of(station) is Mode.RTL


@pytest.mark.parametrize(("action", "mode"), [(1, Mode.GUIDED), (2, Mode.RTL), (3, Mode.LAND)])
def test_a_px4_waits_in_hold_before_it_acts(action: int, mode: Mode) -> None:
    station = flying("px4", NAV_DLL_ACT=action, COM_DL_LOSS_T=6, COM_FAIL_ACT_T=5.0)
    station.vehicle.flight.set_mode(Mode.AUTO)
    station.run(4.5)
    assert mode_of(station) is Mode.AUTO
    station.run(2.0)
    assert mode_of(station) is Mode.GUIDED
    assert "Connection to ground station lost" in texts(station)
    station.run(5.5)
    assert mode_of(station) is mode


def test_a_mission_that_a_px4_only_held_continues_when_a_station_is_heard_again() -> None:
    station = flying("px4", NAV_DLL_ACT=1)
    station.vehicle.flight.set_mode(Mode.AUTO)
    station.run(12.0)
    stood = station.vehicle.flight.body
    assert stood.velocity.horizontal < 0.5
    beating(station, 2.0)
    assert mode_of(station) is Mode.AUTO


def test_a_px4_in_hold_flies_on_to_its_place_although_it_is_to_hold() -> None:
    station = flying("px4", NAV_DLL_ACT=1)
    station.run(60.0)
    assert station.vehicle.flight.body.position.north == pytest.approx(200.0, abs=2.0)


def test_a_px4_hears_any_ground_station_and_no_other_system() -> None:
    station = flying("px4", system=77, NAV_DLL_ACT=2)
    beating(station, 8.0)
    assert mode_of(station) is Mode.GUIDED
    beating(station, 8.0, COMPUTER)
    assert mode_of(station) is Mode.RTL


def test_a_px4_that_terminates_falls() -> None:
    station = flying("px4", NAV_DLL_ACT=5)
    station.run(15.0)
    assert not station.truth.armed
    assert station.height_m < 0.5


@pytest.mark.parametrize(("action", "mode"), [(0, Mode.LAND), (3, Mode.RTL), (4, Mode.LAND), (5, Mode.GUIDED)])
def test_targets_that_are_streamed_and_end_are_a_lost_link_of_their_own(action: int, mode: Mode) -> None:
    station = flying("px4", COM_OBL_RC_ACT=action, NAV_DLL_ACT=0)
    assert station.set_mode("OFFBOARD") == 0
    target = mavlink.MAVLink_set_position_target_local_ned_message(
        0, 1, 1, mavlink.MAV_FRAME_LOCAL_NED, 0b0000_1101_1111_1000, 200.0, 0.0, -30.0, *[0.0] * 8
    )
    for _ in range(20):
        station.send(target)
        station.run(0.2)
    assert mode_of(station) is Mode.OFFBOARD
    station.run(1.2)
    assert mode_of(station) is mode


def test_a_vehicle_on_the_ground_stays_there() -> None:
    station = flying("ardupilot", 0.0, FS_GCS_ENABLE=1)
    station.vehicle.flight.arm()
    station.run(5.0)
    assert not station.truth.armed
    assert station.height_m < 0.1


@pytest.mark.parametrize("persona", ["ardupilot", "px4"])
@pytest.mark.parametrize("action", range(8))
def test_what_a_vehicle_without_bytes_reports_is_what_its_parameters_say(persona: str, action: int) -> None:
    station = Station(persona, airborne_m=30.0)
    settings = station.vehicle.flight.settings
    settings.link_loss_action, settings.offboard_loss_action = float(action), float(action)
    if persona == "px4" and action in {4, 7}:
        pytest.skip("there is no such value")
    autopilot, read = (12 if persona == "px4" else 3), VehicleParameters()
    for message in station.send(mavlink.MAVLink_param_request_list_message(1, 1)):
        if message.get_type() == "PARAM_VALUE":
            read.on_value(autopilot, message)
    simulated = SimulatedVehicle(VehicleConfig(1, HOME, persona, airborne_m=30.0, settings=settings), START_US)
    (told,) = [report for report in simulated.on_time(START_US + 100_000, 7) if isinstance(report, FailsafeReport)]
    assert told == read.failsafe(autopilot, 7)


def test_a_vehicle_without_bytes_returns_when_it_hears_nothing() -> None:
    config = VehicleConfig(1, HOME, "px4", airborne_m=30.0)
    config.settings.link_loss_action = 2.0
    simulated = SimulatedVehicle(config, START_US)
    for step in range(1, 120):
        if step == 30:
            simulated.inject(parse_fault("silence"), START_US + step * 100_000)
        simulated.on_time(START_US + step * 100_000, 0)
        assert simulated.flight.mode is (Mode.RTL if step >= 79 else Mode.GUIDED), step
