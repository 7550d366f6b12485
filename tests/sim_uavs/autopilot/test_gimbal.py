"""A camera's mount over MAVLink: ordered as real gimbals are, and reported as they report."""

from math import asin, atan2, cos, degrees, hypot, inf, nan, pi, radians, sin

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dyknow.navigation.geodesy import LocalFrame
from dyknow.navigation.vehicle import (
    Command,
    CommandResult,
    LookAtOrder,
    MountOrder,
    MountReport,
    PointMountOrder,
    Report,
)
from dyknow.proxies.mavlink.reports import VehicleReports
from dyknow.sim_uavs.dynamics.scenarios import ORIGIN
from dyknow.sim_uavs.dynamics.settings import PersonaName, VehicleConfig
from dyknow.sim_uavs.dynamics.vehicles import SimulatedVehicle
from tests.sim_uavs.wired import WiredVehicle

START_US = 1_700_000_000_000_000
HEIGHT_M = 50.0
ERROR_RAD = 0.02


def config(persona: PersonaName = "ardupilot", *, has_mount: bool = True) -> VehicleConfig:
    return VehicleConfig(3, ORIGIN, persona, heading_deg=40.0, airborne_m=HEIGHT_M, has_mount=has_mount)


def heard(vehicle: WiredVehicle | SimulatedVehicle, order: MountOrder | None, seconds: float = 4.0) -> list[Report]:
    reports: list[Report] = []
    for tick in range(int(seconds * 20)):
        now_us = START_US + tick * 50_000
        if tick == 20 and order is not None:
            reports += [report for _, report in vehicle.on_command(Command(7, order), now_us, now_us)]
        reports += vehicle.on_time(now_us, now_us)
    return reports


def last_mount(reports: list[Report]) -> MountReport:
    return next(each for each in reversed(reports) if isinstance(each, MountReport))


def answers(reports: list[Report]) -> list[CommandResult]:
    return [each for each in reports if isinstance(each, CommandResult)]


@pytest.mark.parametrize("persona", ["ardupilot", "px4"])
def test_a_mount_that_was_told_nothing_looks_down_and_is_reported_as_often_as_attitude(persona: PersonaName) -> None:
    reports = heard(WiredVehicle(config(persona), START_US), None)
    mounts = [each for each in reports if isinstance(each, MountReport)]
    assert len(mounts) >= 30
    assert mounts[-1].tilt_rad == pytest.approx(pi / 2.0, abs=ERROR_RAD)


@pytest.mark.parametrize("persona", ["ardupilot", "px4"])
@pytest.mark.parametrize("pan_deg", [-170.0, -30.0, 0.0, 75.0])
def test_angles_that_are_ordered_are_those_that_are_reported(persona: PersonaName, pan_deg: float) -> None:
    order = PointMountOrder(radians(pan_deg), radians(35.0))
    reports = heard(WiredVehicle(config(persona), START_US), order)
    assert [each.accepted for each in answers(reports)] == [True]
    assert last_mount(reports)[2:] == pytest.approx((order.pan_rad, order.tilt_rad), abs=ERROR_RAD)


def test_looking_at_a_place_it_keeps_looking_there_from_wherever_the_vehicle_is() -> None:
    frame = LocalFrame(*ORIGIN)
    order = LookAtOrder(*frame.from_ned(30.0, -20.0, 0.0))
    for vehicle in (WiredVehicle(config(), START_US), SimulatedVehicle(config(), START_US)):
        pan_rad, tilt_rad = last_mount(heard(vehicle, order))[2:]
        assert pan_rad == pytest.approx(atan2(-20.0, 30.0) - radians(40.0), abs=ERROR_RAD)
        assert tilt_rad == pytest.approx(asin(HEIGHT_M / hypot(30.0, 20.0, HEIGHT_M)), abs=ERROR_RAD)


def test_an_autopilot_older_than_the_gimbal_protocol_is_ordered_as_it_understands() -> None:
    vehicle = WiredVehicle(config("ardupilot-3.3"), START_US)
    reports = heard(vehicle, PointMountOrder(0.5, 0.6))
    assert [each.accepted for each in answers(reports)] == [True]
    mount = vehicle.autopilot.mount
    assert mount is not None
    assert mount.angles == pytest.approx((0.5, 0.6), abs=1e-4)
    place = LocalFrame(*ORIGIN).from_ned(25.0, 0.0, 0.0)
    other = WiredVehicle(config("ardupilot-3.3"), START_US)
    heard(other, LookAtOrder(*place))
    mount = other.autopilot.mount
    assert mount is not None
    assert mount.angles.tilt_rad == pytest.approx(atan2(HEIGHT_M, 25.0), abs=0.03)


@pytest.mark.parametrize("order", [PointMountOrder(nan, 0.3), PointMountOrder(0.1, inf), LookAtOrder(200.0, 13.0, 0.0)])
def test_what_is_no_angle_and_no_place_is_refused_and_moves_nothing(order: MountOrder) -> None:
    reports = heard(WiredVehicle(config(), START_US), order)
    assert [each.accepted for each in answers(reports)] == [False]
    assert last_mount(reports).tilt_rad == pytest.approx(pi / 2.0, abs=ERROR_RAD)


def test_a_vehicle_without_a_mount_refuses_and_reports_none() -> None:
    reports = heard(WiredVehicle(config(has_mount=False), START_US), PointMountOrder(0.0, 1.0), 8.0)
    assert [(each.accepted, each.reason) for each in answers(reports)] == [(False, "unsupported")]
    assert not any(isinstance(each, MountReport) for each in reports)


def status(yaw_rad: float, pitch_rad: float, flags: int) -> mavlink.MAVLink_message:
    y, p = yaw_rad / 2.0, pitch_rad / 2.0
    q = [cos(p) * cos(y), -sin(p) * sin(y), sin(p) * cos(y), cos(p) * sin(y)]
    return mavlink.MAVLink_gimbal_device_attitude_status_message(0, 0, 0, flags, q, nan, nan, nan, 0)


def test_a_yaw_from_north_needs_the_heading_and_is_reported_from_it() -> None:
    known = VehicleReports()
    locked = status(radians(100.0), radians(-60.0), mavlink.GIMBAL_DEVICE_FLAGS_YAW_LOCK)
    assert known.reports(locked, 5) == ()
    known.reports(mavlink.MAVLink_attitude_message(0, 0.1, 0.2, radians(170.0), 0.0, 0.0, 0.0), 5)
    for flags in (mavlink.GIMBAL_DEVICE_FLAGS_YAW_LOCK, mavlink.GIMBAL_DEVICE_FLAGS_YAW_IN_EARTH_FRAME):
        (report,) = known.reports(status(radians(100.0), radians(-60.0), flags), 5)
        assert isinstance(report, MountReport)
        assert report[2:] == pytest.approx((radians(-70.0), radians(60.0)))
    (report,) = known.reports(status(radians(100.0), radians(-60.0), 0), 5)
    assert isinstance(report, MountReport)
    assert report.pan_rad == pytest.approx(radians(100.0))


@pytest.mark.parametrize("pitch_deg", [-89.9, -90.0, -90.1, -95.0, -20.0, 0.0, 25.0])
@pytest.mark.parametrize("yaw_deg", [-179.0, -90.0, 0.0, 35.0, 150.0])
def test_also_straight_down_the_angles_are_those_of_the_gimbal_and_do_not_turn_over(
    pitch_deg: float, yaw_deg: float
) -> None:
    (report,) = VehicleReports().reports(status(radians(yaw_deg), radians(pitch_deg), 0), 5)
    assert isinstance(report, MountReport)
    assert report[2:] == pytest.approx((radians(yaw_deg), radians(-pitch_deg)), abs=1e-6)


@pytest.mark.parametrize("quaternion", [[nan] * 4, [0.0] * 4, [inf, 0.0, 0.0, 0.0], [3e38, 3e38, 0.0, 0.0]])
def test_what_is_no_attitude_of_a_gimbal_is_no_report(quaternion: list[float]) -> None:
    message = mavlink.MAVLink_gimbal_device_attitude_status_message(0, 0, 0, 0, quaternion, nan, nan, nan, 0)
    assert VehicleReports().reports(message, 5) == ()


def test_older_autopilots_report_angles_in_degrees() -> None:
    known = VehicleReports()
    (report,) = known.reports(mavlink.MAVLink_mount_orientation_message(0, 1.0, -80.0, 350.0), 5)
    assert isinstance(report, MountReport)
    assert [degrees(each) for each in report[2:]] == pytest.approx([-10.0, 80.0])
    for pitch, yaw in ((nan, 0.0), (0.0, inf), (400.0, 0.0)):
        assert known.reports(mavlink.MAVLink_mount_orientation_message(0, 0.0, pitch, yaw), 5) == ()
