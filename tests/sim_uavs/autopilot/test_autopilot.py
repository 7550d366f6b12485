"""The rules of a MAVLink vehicle, each in both personas where it concerns both."""

import struct
from itertools import pairwise

import pytest
from pymavlink.dialects.v20 import all as mavlink

from dyknow.sim_uavs.dynamics.flight import Mode
from tests.sim_uavs.station import HOME, ME, NAN, START_US, Station, decoded

PERSONAS = pytest.mark.parametrize("persona", ["ardupilot", "px4"])
GO_TO, TAKE_OFF, ARM = (
    mavlink.MAV_CMD_DO_REPOSITION,
    mavlink.MAV_CMD_NAV_TAKEOFF,
    mavlink.MAV_CMD_COMPONENT_ARM_DISARM,
)
ABOVE_SEA, ABOVE_HOME = mavlink.MAV_FRAME_GLOBAL_INT, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT
ACCEPTED, REJECTED, DENIED, UNSUPPORTED = 0, 1, 2, 3
NORTH = (55.7250, 13.4600)
KEEP = (-1.0, 1.0, 0.0, NAN)


def hello(persona="ardupilot", **config) -> Station:
    station = Station(persona, **config)
    station.send(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3))
    return station


@PERSONAS
def test_streams_come_at_their_rates_on_the_grid(persona) -> None:
    station = hello(persona)
    station.run(10.05)
    imu = "RAW_IMU" if persona == "ardupilot" else "HIGHRES_IMU"
    expected = {"HEARTBEAT": 10, "GLOBAL_POSITION_INT": 100, "ATTITUDE": 100, "SYS_STATUS": 20, "SYSTEM_TIME": 10}
    expected |= {"GPS_RAW_INT": 20, "LOCAL_POSITION_NED": 50, "VFR_HUD": 50, "BATTERY_STATUS": 10, "HOME_POSITION": 5}
    expected |= {"EXTENDED_SYS_STATE": 20, "MISSION_CURRENT": 10, "CURRENT_MODE": 5, imu: 100}
    for name, count in expected.items():
        assert abs(len(station.of_type(name)) - count) <= 1, name
    stamps = [message.time_boot_ms for message in station.of_type("GLOBAL_POSITION_INT")]
    assert all(stamp % 100 == 0 for stamp in stamps)
    assert {b - a for a, b in pairwise(stamps)} == {100}


@PERSONAS
def test_the_heartbeat_says_what_the_vehicle_is_and_does(persona) -> None:
    station = hello(persona)
    station.run(2)
    beat = station.last("HEARTBEAT")
    assert (beat.type, beat.autopilot) == (2, 3 if persona == "ardupilot" else 12)
    assert (beat.get_srcSystem(), beat.get_srcComponent()) == (1, 1)
    assert beat.base_mode & 1
    assert not beat.base_mode & 128
    station.take_off()
    station.run(1.1)
    beat = station.last("HEARTBEAT")
    assert beat.base_mode & 128
    assert beat.custom_mode == (4 if persona == "ardupilot" else 4 << 16 | 3 << 24)
    assert station.last("EXTENDED_SYS_STATE").landed_state == mavlink.MAV_LANDED_STATE_IN_AIR


def test_a_rising_px4_is_in_its_take_off_mode() -> None:
    station = hello("px4")
    station.command(ARM, 1)
    station.command(TAKE_OFF, 0, 0, 0, NAN, NAN, NAN, NAN)
    station.run(1.5)
    assert station.last("HEARTBEAT").custom_mode == 4 << 16 | 2 << 24
    station.run(15)
    assert station.last("HEARTBEAT").custom_mode == 4 << 16 | 3 << 24
    assert station.height_m == pytest.approx(10.0, abs=0.3), "the height is its parameter MIS_TAKEOFF_ALT"


def test_positions_are_where_the_vehicle_is_within_its_noise() -> None:
    station = hello()
    station.take_off(30.0)
    station.run(5)
    told, truth = station.last("GLOBAL_POSITION_INT"), station.truth.place
    assert told.lat / 1e7 == pytest.approx(truth.latitude_deg, abs=2e-5)
    assert told.lon / 1e7 == pytest.approx(truth.longitude_deg, abs=3e-5)
    assert told.alt / 1e3 == pytest.approx(truth.altitude_m, abs=2.0)
    assert told.relative_alt == pytest.approx(told.alt - HOME.altitude_m * 1e3, abs=1)
    raw = station.last("GPS_RAW_INT")
    assert raw.fix_type == 3
    assert raw.lat == pytest.approx(told.lat, abs=300)
    assert station.last("LOCAL_POSITION_NED").z == pytest.approx(-30.0, abs=2.0)
    assert station.last("RAW_IMU").zacc == pytest.approx(-1000, abs=60)


def test_time_since_boot_and_utc_name_the_same_instants() -> None:
    station = hello()
    station.run(3)
    for told in station.of_type("SYSTEM_TIME"):
        assert told.time_unix_usec - told.time_boot_ms * 1000 == START_US - START_US % 1_000_000


@PERSONAS
def test_every_command_gets_one_final_acknowledgement_addressed_to_who_asked(persona) -> None:
    station = hello(persona, system=42, component=191)
    for command in (ARM, TAKE_OFF, mavlink.MAV_CMD_NAV_LAND, mavlink.MAV_CMD_DO_SET_MODE, 511, 512, 31000, 65535):
        station.command(command)  # asserts one acknowledgement to (42, 191)
        station.command_int(command, ABOVE_SEA, (0, 0, 0, 0), 0, 0, 0.0)
    assert station.command(31000) == UNSUPPORTED
    assert not [m for m in station.run(5) if m.get_type() == "COMMAND_ACK"]


@PERSONAS
def test_a_requested_message_follows_its_acknowledgement(persona) -> None:
    station = hello(persona)
    for number, name in (
        (148, "AUTOPILOT_VERSION"),
        (242, "HOME_POSITION"),
        (436, "CURRENT_MODE"),
        (49, "GPS_GLOBAL_ORIGIN"),
    ):
        message = mavlink.MAVLink_command_long_message(1, 1, 512, 0, number, 0, 0, 0, 0, 0, 0)
        assert [m.get_type() for m in station.send(message)] == ["COMMAND_ACK", name]
    assert station.command(512, 397) == UNSUPPORTED, "component metadata: refused, not ignored"
    assert station.command(512, NAN) == UNSUPPORTED


@PERSONAS
def test_modes_are_listed_all_or_one_by_one(persona) -> None:
    station = hello(persona)
    station.command(512, 435, 0)
    modes = station.of_type("AVAILABLE_MODES")
    assert [mode.mode_index for mode in modes] == list(range(1, modes[0].number_modes + 1))
    assert {"ardupilot": ("GUIDED", 4), "px4": ("Hold", 4 << 16 | 3 << 24)}[persona] in {
        (mode.mode_name, mode.custom_mode) for mode in modes
    }
    station.heard.clear()
    station.command(512, 435, 2)
    assert [mode.mode_index for mode in station.of_type("AVAILABLE_MODES")] == [2]


@PERSONAS
def test_capabilities_promise_what_is_answered(persona) -> None:
    station = hello(persona)
    station.command(512, 148)
    has = station.last("AUTOPILOT_VERSION").capabilities
    bytewise = mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE
    assert has & mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_INT
    assert bool(has & bytewise) == (persona == "px4")
    assert has & mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_FENCE
    for absent in ("MISSION_RALLY", "FTP"):
        assert not has & getattr(mavlink, f"MAV_PROTOCOL_CAPABILITY_{absent}")


def test_ardupilot_takes_off_in_guided_only_to_the_height_it_is_told() -> None:
    station = hello("ardupilot")
    assert station.command(ARM, 1) == ACCEPTED
    assert station.command(TAKE_OFF, 0, 0, 0, 0, 0, 0, 12) == REJECTED
    station.run(0.2)
    assert "guided" in station.last("STATUSTEXT").text
    assert station.set_mode("GUIDED") == ACCEPTED
    assert station.command(TAKE_OFF, 0, 0, 0, 0, 0, 0, 12) == ACCEPTED
    station.run(15)
    assert station.height_m == pytest.approx(12.0, abs=0.3)


def test_px4_takes_off_to_a_height_above_sea_when_it_is_told_one() -> None:
    station = hello("px4")
    station.command(ARM, 1)
    assert station.command(TAKE_OFF, 0, 0, 0, NAN, NAN, NAN, HOME.altitude_m + 17.0) == ACCEPTED
    station.run(15)
    assert station.height_m == pytest.approx(17.0, abs=0.3)


@PERSONAS
@pytest.mark.parametrize("frame", [0, 5])
def test_a_point_above_sea_and_one_above_home_are_told_by_the_frame(persona, frame) -> None:
    station = hello(persona)
    station.take_off()
    x, y = round(NORTH[0] * 1e7), round(NORTH[1] * 1e7)
    assert station.command_int(GO_TO, frame, KEEP, x, y, HOME.altitude_m + 30.0) == ACCEPTED
    station.run(30)
    assert station.truth.place == pytest.approx((*NORTH, HOME.altitude_m + 30.0), abs=0.2)
    for relative in (3, 6, 10, 11):
        assert station.command_int(GO_TO, relative, KEEP, x, y, 35.0 + relative) == ACCEPTED
        station.run(12)
        assert station.height_m == pytest.approx(35.0 + relative, abs=0.3)


@PERSONAS
def test_degrees_are_floats_in_a_long_command_and_integers_in_the_other(persona) -> None:
    station = hello(persona)
    station.take_off()
    assert station.command(GO_TO, *KEEP, *NORTH, HOME.altitude_m + 20.0) == ACCEPTED
    station.run(25)
    assert station.truth.place.latitude_deg == pytest.approx(NORTH[0], abs=1e-5)


def test_a_point_is_refused_outside_guided_unless_the_change_of_mode_is_asked_for() -> None:
    station = hello()
    station.take_off()
    station.set_mode("LOITER")
    x, y = round(NORTH[0] * 1e7), round(NORTH[1] * 1e7)
    assert station.command_int(GO_TO, ABOVE_HOME, (-1, 0, 0, NAN), x, y, 20.0) == DENIED
    assert station.command_int(GO_TO, ABOVE_HOME, (-1, 1, 0, NAN), x, y, 20.0) == ACCEPTED
    assert station.truth.mode is Mode.GUIDED


@PERSONAS
def test_impossible_points_are_denied(persona) -> None:
    station = hello(persona)
    station.take_off()
    for x, y, z in (
        (910_000_000, 0, 20.0),
        (0, 0, 20.0),
        (557_250_000, 134_600_000, NAN),
        (557_250_000, 134_600_000, -5.0),
    ):
        assert station.command_int(GO_TO, ABOVE_HOME, KEEP, x, y, z) == DENIED
    assert station.command_int(GO_TO, 8, KEEP, 557_250_000, 134_600_000, 20.0) == DENIED, "a body frame is no place"
    assert station.command(GO_TO, *KEEP, float("inf"), 0.0, 20.0) == DENIED


@PERSONAS
def test_speeds_are_obeyed(persona) -> None:
    station = hello(persona)
    station.take_off()
    assert station.command(mavlink.MAV_CMD_DO_CHANGE_SPEED, 1, 4.0, -1) == ACCEPTED
    station.command_int(GO_TO, ABOVE_HOME, KEEP, round(NORTH[0] * 1e7), round(NORTH[1] * 1e7), 20.0)
    station.run(8)
    assert station.truth.north_m_s == pytest.approx(4.0, abs=0.1)
    assert station.command(mavlink.MAV_CMD_DO_CHANGE_SPEED, 1, -4.0, -1) == DENIED


def test_an_older_station_flies_it_with_a_mission_item_that_is_no_mission() -> None:
    station = hello()
    station.take_off()
    x, y = round(NORTH[0] * 1e7), round(NORTH[1] * 1e7)
    item = mavlink.MAVLink_mission_item_int_message(1, 1, 0, 6, 16, 2, 0, 0, 0, 0, 0, x, y, 25.0, 0)
    assert [m.type for m in station.send(item) if m.get_type() == "MISSION_ACK"] == [0]
    station.run(25)
    assert station.truth.place == pytest.approx((*NORTH, HOME.altitude_m + 25.0), abs=0.2)


@PERSONAS
def test_set_position_targets_are_flown_by_position_and_by_velocity(persona) -> None:
    station = hello(persona)
    station.take_off()
    only_position, only_velocity = 0b110111111000, 0b110111000111
    there = [round(NORTH[0] * 1e7), round(NORTH[1] * 1e7), 22.0]
    station.send(mavlink.MAVLink_set_position_target_global_int_message(0, 1, 1, 6, only_position, *there, *[0.0] * 8))
    station.run(25)
    assert station.truth.place == pytest.approx((*NORTH, HOME.altitude_m + 22.0), abs=0.2)
    station.send(
        mavlink.MAVLink_set_position_target_local_ned_message(0, 1, 1, 1, only_position, 0.0, 30.0, -25.0, *[0.0] * 8)
    )
    station.run(30)
    assert station.last("LOCAL_POSITION_NED").y == pytest.approx(30.0, abs=1.5)
    station.send(
        mavlink.MAVLink_set_position_target_local_ned_message(
            0, 1, 1, 1, only_velocity, 0, 0, 0, 0.0, -3.0, 0.0, *[0.0] * 5
        )
    )
    station.run(2.5)
    assert station.truth.east_m_s == pytest.approx(-3.0, abs=0.2)


@PERSONAS
def test_a_guided_vehicle_says_where_it_is_going(persona) -> None:
    station = hello(persona)
    station.take_off()
    station.command_int(GO_TO, ABOVE_SEA, KEEP, round(NORTH[0] * 1e7), round(NORTH[1] * 1e7), 55.0)
    station.run(1)
    target = station.last("POSITION_TARGET_GLOBAL_INT")
    assert (target.lat_int, target.lon_int) == pytest.approx((NORTH[0] * 1e7, NORTH[1] * 1e7), abs=2)
    assert target.alt == pytest.approx(55.0, abs=0.01)
    station.command(mavlink.MAV_CMD_NAV_LAND)
    station.heard.clear()
    station.run(2)
    assert not station.of_type("POSITION_TARGET_GLOBAL_INT")


@PERSONAS
def test_it_lands_where_it_is_and_returns_where_it_came_from(persona) -> None:
    station = hello(persona)
    station.take_off()
    station.command_int(GO_TO, ABOVE_HOME, KEEP, round(NORTH[0] * 1e7), round(NORTH[1] * 1e7), 20.0)
    station.run(25)
    assert station.command(mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH) == ACCEPTED
    station.run_until(lambda: not station.truth.armed)
    assert station.truth.place == pytest.approx(HOME, abs=1e-3)
    station.run(1.1)
    assert station.last("EXTENDED_SYS_STATE").landed_state == mavlink.MAV_LANDED_STATE_ON_GROUND
    station.take_off()
    assert station.command(mavlink.MAV_CMD_NAV_LAND) == ACCEPTED
    station.run_until(lambda: not station.truth.armed)


def test_the_old_message_that_sets_a_mode_is_acknowledged_too() -> None:
    station = hello()
    (ack,) = [m for m in station.send(mavlink.MAVLink_set_mode_message(1, 1, 4)) if m.get_type() == "COMMAND_ACK"]
    assert (ack.command, ack.result) == (11, 0)
    assert station.truth.mode is Mode.GUIDED
    (ack,) = [m for m in station.send(mavlink.MAVLink_set_mode_message(1, 1, 77)) if m.get_type() == "COMMAND_ACK"]
    assert ack.result == DENIED


def test_commands_for_others_are_not_ours() -> None:
    station = hello()
    for system, component in ((2, 1), (1, 154)):
        assert not station.send(mavlink.MAVLink_command_long_message(system, component, ARM, 0, 1, 0, 0, 0, 0, 0, 0))
    own = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
    data = mavlink.MAVLink_command_long_message(1, 1, ARM, 0, 1, 0, 0, 0, 0, 0, 0).pack(own)
    assert not station.vehicle.on_bytes(data, ME, station.now_us), "an echo of a vehicle's own system"
    assert not station.truth.armed


def test_time_pings_and_files_are_answered() -> None:
    station = hello()
    station.run(1.5)
    (answer,) = station.send(mavlink.MAVLink_timesync_message(0, 123_456))
    assert (answer.get_type(), answer.ts1) == ("TIMESYNC", 123_456)
    assert answer.tc1 > 0
    assert not station.send(mavlink.MAVLink_timesync_message(5, 123_456)), "an answer is not answered"
    (answer,) = station.send(mavlink.MAVLink_ping_message(99, 7, 0, 0))
    assert (answer.time_usec, answer.seq, answer.target_system) == (99, 7, 255)
    assert not station.send(mavlink.MAVLink_ping_message(99, 7, 1, 1))
    payload = list(struct.pack("<HBB", 65535, 3, 4)) + [0] * 247
    (answer,) = station.send(mavlink.MAVLink_file_transfer_protocol_message(0, 1, 1, payload))
    seq, session, opcode, size, asked = struct.unpack_from("<HBBBB", bytes(answer.payload))
    assert (seq, session, opcode, size, asked) == (0, 3, 129, 1, 4)


def test_rates_are_each_peers_own() -> None:
    station = hello()
    other = Station(vehicle=station.vehicle, peer=("127.0.0.1", 14551), system=254)
    other.now_us = station.now_us
    other.send(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3))
    assert station.command(511, 33, 1_000_000) == ACCEPTED
    assert station.command(511, 30, -1) == ACCEPTED
    assert station.command(511, 33, 1000) == DENIED, "nothing is faster than the 100 ms tick"
    assert station.command(511, 9999, 1_000_000) == UNSUPPORTED
    station.heard.clear()
    ours, theirs = [], []
    for _ in range(100):
        station.now_us += 100_000
        for peer, data in station.vehicle.on_time(station.now_us):
            (ours if peer == ME else theirs).append(decoded(data))
    assert [len([m for m in heard if m.get_msgId() == 33]) for heard in (ours, theirs)] == [10, 100]
    assert not [m for m in ours if m.get_msgId() == 30]
    for heard in (ours, theirs):
        assert {(b - a) % 256 for a, b in pairwise(m.get_seq() for m in heard)} == {1}, "no gap in any peer's sequence"
    station.command(510, 33)
    assert station.last("MESSAGE_INTERVAL").interval_us == 1_000_000


def test_given_peers_are_told_unasked_and_learned_ones_are_forgotten_when_silent() -> None:
    given, learned = ("127.0.0.1", 14540), ("127.0.0.1", 5555)
    station = hello(peers=(given,), peer=learned)
    station.now_us += 100_000
    assert {peer for peer, _ in station.vehicle.on_time(station.now_us)} == {given, learned}
    station.now_us += 31_000_000
    assert {peer for peer, _ in station.vehicle.on_time(station.now_us)} == {given}


def test_a_pause_is_not_made_up_for_with_old_telemetry() -> None:
    station = hello()
    station.run(1)
    station.now_us += 8_000_000
    sent = station.vehicle.on_time(station.now_us)
    assert len(sent) < 20
    assert station.vehicle.deadline_us > station.now_us


def test_one_seed_gives_the_same_bytes_and_another_does_not() -> None:
    def recorded(seed):
        station = Station(seed=seed, peers=(ME,))
        return [sent for _ in range(30) if (sent := _tick(station))]

    def _tick(station):
        station.now_us += 100_000
        return station.vehicle.on_time(station.now_us)

    assert recorded(1) == recorded(1) != recorded(2)
