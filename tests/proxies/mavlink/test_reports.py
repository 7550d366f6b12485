import math
import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dyknow.navigation.vehicle import (
    AccelerationReport,
    AttitudeReport,
    BatteryReport,
    FenceReport,
    FixReport,
    LocalPositionReport,
    MissionReport,
    PositionReport,
    StatusReport,
    TargetReport,
    VelocityReport,
    WinchReport,
)
from dyknow.proxies.mavlink.frames import WANTED, decoded, frame_at
from dyknow.proxies.mavlink.reports import VehicleReports, device_us, flight_mode, is_autopilot
from tests.proxies.vehicle import heartbeat, position
from tests.strategies import examples


def gps(
    *,
    fix: int = 3,
    alt: float = 510.0,
    eph: int = 150,
    epv: int = 200,
    h_acc: int = 0,
    v_acc: int = 0,
    vel_acc: int = 0,
):
    return mavlink.MAVLink_gps_raw_int_message(
        0, fix, 470000000, 80000000, round(alt * 1e3), eph, epv, 500, 9000, 10, 0, h_acc, v_acc, vel_acc
    )


def home(alt: float = 500.0):
    return mavlink.MAVLink_home_position_message(470000000, 80000000, round(alt * 1e3), 0, 0, 0, [1, 0, 0, 0], 0, 0, 0)


def test_a_fix_is_as_good_as_it_states_else_as_its_dilution_says() -> None:
    known = VehicleReports()
    stated = known.reports(gps(h_acc=800, v_acc=1200, vel_acc=300), 7)
    assert stated[1] == PositionReport(7, "GPS_RAW_INT", 47.0, 8.0, 510.0, 0.8, 1.2)
    assert (stated[0].east_m_s, stated[0].down_m_s, stated[0].sd_m_s) == (pytest.approx(5.0), None, 0.3)
    assert stated[0].north_m_s == pytest.approx(0.0, abs=1e-9)
    assert known.reports(gps(), 7)[1][5:7] == (3.0, 4.0)
    assert known.reports(gps(eph=65535, epv=65535), 7)[1][5:7] == (5.0, 5.0)


def test_a_flat_fix_has_no_altitude_and_no_fix_is_no_position() -> None:
    assert VehicleReports().reports(gps(fix=2), 7)[1].altitude_m is None
    assert VehicleReports().reports(gps(fix=1), 7) == (FixReport(7, False),)


def test_a_fix_that_is_lost_or_found_is_reported_once() -> None:
    known = VehicleReports()
    told = [
        [each.has_fix for each in known.reports(gps(fix=fix), at) if isinstance(each, FixReport)]
        for at, fix in enumerate((3, 3, 2, 0, 1, 5, 6, 1))
    ]
    assert told == [[True], [], [False], [], [], [True], [], [False]]


@pytest.mark.parametrize(
    ("before", "altitude", "height", "expected"),
    [
        ([], 1.25, 1.25, None),
        ([gps(alt=600)], 1.25, 1.25, None),
        ([gps(alt=5)], 1.25, 1.25, 1.25),
        ([home(0.0)], 12.0, 12.0, 12.0),
        ([home(500.0)], 12.0, 12.0, None),
        ([], 589.78, 0.04, 589.78),
        ([gps(alt=600)], 589.78, 0.04, 589.78),
    ],
)
def test_an_altitude_above_nothing_is_used_only_when_something_confirms_it(before, altitude, height, expected) -> None:
    known = VehicleReports()
    for message in before:
        known.reports(message, 1)
    found = known.reports(position(1, alt=altitude, height=height), 2)[1]
    assert found.altitude_m == expected
    assert (found.height_m is None) == (expected is None)


def test_a_reboot_makes_the_vehicle_forget_its_home() -> None:
    known = VehicleReports()
    known.reports(home(0.0), 1)
    known.on_reboot()
    assert known.reports(position(1, alt=12.0, height=12.0), 2)[1].altitude_m is None


def test_raw_acceleration_has_a_unit_only_on_ardupilot() -> None:
    raw = mavlink.MAVLink_raw_imu_message(5_000_000, 0, 0, -1000, 0, 0, 0, 0, 0, 0)
    known = VehicleReports()
    assert known.reports(raw, 1) == ()
    known.reports(heartbeat(), 1)
    assert known.reports(raw, 1) == (AccelerationReport(1, "RAW_IMU", 0.0, 0.0, pytest.approx(-9.80665)),)
    assert device_us(raw) == 5_000_000
    scaled = mavlink.MAVLink_scaled_imu_message(5000, 500, 0, 0, 0, 0, 0, 0, 0, 0)
    assert known.reports(scaled, 1)[0].x_m_s2 == pytest.approx(4.903325)
    highres = mavlink.MAVLink_highres_imu_message(5_000_000, 1, 2, 3, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0)
    assert known.reports(highres, 1)[0][2:] == (1.0, 2.0, 3.0)


def test_attitude_and_local_position_pass_as_they_are() -> None:
    known = VehicleReports()
    assert known.reports(mavlink.MAVLink_attitude_message(5, 0.5, -0.25, 2.0, 0, 0, 0), 9) == (
        AttitudeReport(9, "ATTITUDE", 0.5, -0.25, 2.0),
    )
    local = mavlink.MAVLink_local_position_ned_message(5, 1, 2, -3, 4, 5, -6)
    assert known.reports(local, 9) == (LocalPositionReport(9, "LOCAL_POSITION_NED", 1, 2, -3, 4, 5, -6),)


def test_an_unknown_charge_is_no_report() -> None:
    unknown = mavlink.MAVLink_sys_status_message(0, 0, 0, 0, 12_000, -1, -1, 0, 0, 0, 0, 0, 0)
    assert VehicleReports().reports(unknown, 1) == ()
    no_current = mavlink.MAVLink_sys_status_message(0, 0, 0, 0, 12_000, -1, 40, 0, 0, 0, 0, 0, 0)
    assert VehicleReports().reports(no_current, 1) == (BatteryReport(1, 0.4, None),)
    second = mavlink.MAVLink_battery_status_message(1, 0, 0, 0, [0] * 10, 100, 0, 0, 30)
    assert VehicleReports().reports(second, 1) == ()


def test_whether_it_flies_comes_from_its_landed_state_or_an_ardupilots_heartbeat() -> None:
    known = VehicleReports()
    assert known.reports(heartbeat(state=3), 1)[0].airborne is False
    assert known.reports(heartbeat(state=4), 1)[0].airborne is True
    landed = mavlink.MAVLink_extended_sys_state_message(0, mavlink.MAV_LANDED_STATE_ON_GROUND)
    assert known.reports(landed, 2) == (StatusReport(2, True, True, False, "GUIDED"),)
    assert known.reports(landed, 3) == (), "told once"
    px4 = VehicleReports()
    assert px4.reports(heartbeat(autopilot=mavlink.MAV_AUTOPILOT_PX4), 1)[0].airborne is None


@pytest.mark.parametrize(
    ("autopilot", "kind", "custom", "expected"),
    [
        (3, 2, 4, ("GUIDED", True)),
        (3, 2, 6, ("RTL", False)),
        (3, 2, 99, ("99", False)),
        (3, 1, 15, ("GUIDED", True)),
        (3, 10, 15, ("GUIDED", True)),
        (3, 1, 4, ("4", False)) if 4 not in mavlink.enums["PLANE_MODE"] else (3, 1, 5, ("FLY_BY_WIRE_A", False)),
        (12, 2, 4 << 16 | 3 << 24, ("AUTO.LOITER", True)),
        (12, 2, 4 << 16 | 5 << 24, ("AUTO.RTL", False)),
        (12, 2, 6 << 16, ("OFFBOARD", True)),
        (12, 2, 3 << 16, ("POSCTL", False)),
        (0, 2, 7, ("7", False)),
    ],
)
def test_flight_modes_have_their_names_and_say_whether_positions_are_taken(autopilot, kind, custom, expected) -> None:
    assert flight_mode(autopilot, kind, custom) == expected


def test_a_target_is_told_above_the_sea_or_not_at_all() -> None:
    known = VehicleReports()

    def target(frame: int, mask: int = 0):
        numbers = (470000000, 80000000, 20.0, 0, 0, 0, 0, 0, 0, 0, 0)
        return known.reports(mavlink.MAVLink_position_target_global_int_message(5, frame, mask, *numbers), 9)

    assert target(6) == (), "above a home that is not known"
    known.reports(home(500.0), 1)
    assert target(6) == (TargetReport(9, 47.0, 8.0, 520.0),)
    assert target(0) == (TargetReport(9, 47.0, 8.0, 20.0),)
    assert target(10) == (), "above terrain"
    assert target(0, mask=1) == (), "no position in it"


def test_only_autopilots_are_vehicles() -> None:
    assert is_autopilot(heartbeat())
    assert not is_autopilot(heartbeat(autopilot=mavlink.MAV_AUTOPILOT_INVALID))
    assert not is_autopilot(mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, 8, 0, 0, 0, 3))


@given(st.sampled_from(sorted(WANTED)), st.binary(min_size=0, max_size=80))
@settings(max_examples=examples(300), deadline=None)
def test_any_payload_of_a_wanted_type_is_mapped_or_refused_without_raising(message_id, payload) -> None:
    """A sender with a right checksum may still say anything."""
    head = bytes((0xFD, len(payload), 0, 0, 0, 1, 1)) + message_id.to_bytes(3, "little")
    extra = mavlink.mavlink_map[message_id].crc_extra
    crc = mavlink.x25crc(head[1:] + payload + bytes((extra,))).crc
    frame = frame_at(head + payload + crc.to_bytes(2, "little"), 0)
    message = decoded(mavlink.MAVLink(None), frame)
    known = VehicleReports()
    known.reports(heartbeat(), 1)
    if message is not None:
        for report in known.reports(message, 5):
            assert report.valid_us == 5
            if isinstance(report, VelocityReport) and report.source == "GLOBAL_POSITION_INT":
                assert math.isfinite(report.north_m_s)


@pytest.mark.parametrize(("state", "flies"), [(3, False), (4, True), (5, True), (6, True)])
def test_an_ardupilot_in_a_failsafe_flies(state: int, flies: bool) -> None:
    (status,) = VehicleReports().reports(heartbeat(state=state), 1)
    assert status.airborne is flies
    (status,) = VehicleReports().reports(heartbeat(state=state, armed=False), 1)
    assert status.airborne is False


def fence(autopilot: int, *parameters: tuple[str, float, int]) -> FenceReport:
    known = VehicleReports()
    known.reports(heartbeat(autopilot=autopilot), 1)
    found: tuple = ()
    for name, value, kind in parameters:
        found = known.reports(mavlink.MAVLink_param_value_message(name.encode(), value, kind, 9, 0), 1) or found
    return found[0]


REAL, INT8, INT32 = 9, 2, 6


@pytest.mark.parametrize(
    ("enabled", "kinds", "bounds"),
    [(1, 1, (None, 40.0, None)), (1, 3, (None, 40.0, 300.0)), (1, 8, (5.0, None, None)), (0, 7, (None, None, None))],
)
def test_an_ardupilots_fence_is_read_from_its_parameters(enabled: int, kinds: int, bounds: tuple) -> None:
    told = fence(
        mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA,
        ("FENCE_ALT_MAX", 40.0, REAL),
        ("FENCE_ALT_MIN", 5.0, REAL),
        ("FENCE_RADIUS", 300.0, REAL),
        ("FENCE_TYPE", float(kinds), INT8),
        ("FENCE_ENABLE", float(enabled), INT8),
        ("ANGLE_MAX", 3000.0, REAL),
    )
    assert told[1:4] == bounds


def test_a_px4s_fence_is_read_from_its_parameters() -> None:
    on = struct.unpack("<f", struct.pack("<i", 2))[0]
    far, high = ("GF_MAX_HOR_DIST", 300.0, REAL), ("GF_MAX_VER_DIST", 0.0, REAL)
    assert fence(mavlink.MAV_AUTOPILOT_PX4, far, high, ("GF_ACTION", on, INT32))[1:4] == (None, None, 300.0)
    assert fence(mavlink.MAV_AUTOPILOT_PX4, far, high, ("GF_ACTION", 0.0, INT32))[1:4] == (None, None, None)


def test_which_parameters_are_still_to_be_told_is_known() -> None:
    known = VehicleReports()
    assert known.untold_parameters == ()
    known.reports(heartbeat(), 1)
    assert "FENCE_ENABLE" in known.untold_parameters
    known.reports(mavlink.MAVLink_param_value_message(b"FENCE_ENABLE", 0.0, INT8, 9, 0), 1)
    assert "FENCE_ENABLE" not in known.untold_parameters


def test_the_item_of_the_mission_is_reported() -> None:
    (told,) = VehicleReports().reports(mavlink.MAVLink_mission_current_message(4), 1)
    assert told == MissionReport(1, 4)


def test_a_winch_without_a_scale_says_nothing_of_its_load() -> None:
    known = VehicleReports()
    nan = math.nan
    (told,) = known.reports(mavlink.MAVLink_winch_status_message(7, 2.5, -0.5, nan, nan, nan, 32767, 1), 9)
    assert told == WinchReport(9, 2.5, -0.5, None, is_healthy=True, is_moving=False)
    (scaled,) = known.reports(mavlink.MAVLink_winch_status_message(7, 2.5, 0.5, 1.25, 24.0, 1.0, 30, 4), 10)
    assert scaled == WinchReport(10, 2.5, 0.5, 1.25, is_healthy=False, is_moving=True)
    known.on_reboot()
    assert known.winch is None
