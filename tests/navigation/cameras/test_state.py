"""Where a camera is at the time of an image, from fused positions, attitudes and angles of the mount."""

import numpy as np
import pytest

from dyknow.navigation.cameras.pinhole import PanTilt
from dyknow.navigation.cameras.state import LONGEST_US, CameraStateEstimator
from dyknow.navigation.fusion import Estimate
from dyknow.navigation.geodesy import LocalFrame
from dyknow.navigation.vehicle import AttitudeReport

FRAME = LocalFrame(58.4, 15.6, 0.0)


def estimator(arm_m: np.ndarray | None = None) -> CameraStateEstimator:
    """A vehicle that flies north at 10 m/s at 50 m, turns right by 0.2 rad/s past south, and pans by 0.1 rad/s."""
    made = CameraStateEstimator(FRAME, arm_m)
    for step in range(11):
        at_us = step * 100_000
        place = FRAME.from_ned(step * 1.0, 0.0, -50.0)
        made.on_estimate(at_us, Estimate(*place, 10.0, 0.0, 0.0, 0.09, 0.16, 0.25, 0.01, 0.01, 0.04))
        yaw = 3.1 + 0.02 * step
        made.on_attitude(AttitudeReport(at_us, "imu", 0.0, 0.1, yaw if yaw < np.pi else yaw - 2 * np.pi))
        made.on_mount(at_us, PanTilt(0.01 * step, 0.7))
    return made


def test_between_reports_the_pose_is_between_them_also_past_south() -> None:
    state = estimator().at(240_000)
    assert state is not None
    assert state.pose.position_m == pytest.approx([2.4, 0.0, -50.0], abs=1e-3)
    assert state.pose.attitude.yaw_rad % (2 * np.pi) == pytest.approx(3.148)
    assert state.pose.mount == pytest.approx((0.024, 0.7))


def test_the_position_s_errors_are_those_that_were_fused_and_grow_with_the_time_from_it() -> None:
    known, later = (estimator().at(at_us) for at_us in (500_000, 1_200_000))
    assert known is not None
    assert later is not None
    assert (known.errors.level_m, known.errors.vertical_m) == pytest.approx((0.4, 0.5))
    assert later.errors.level_m == pytest.approx((0.16 + 0.04 * 0.01) ** 0.5)
    assert later.pose.position_m == pytest.approx([12.0, 0.0, -50.0], abs=1e-3)


def test_without_a_recent_report_of_each_there_is_no_state() -> None:
    assert estimator().at(1_000_000 + LONGEST_US) is not None
    assert estimator().at(1_000_001 + LONGEST_US) is None
    assert estimator().at(-LONGEST_US - 1) is None
    assert CameraStateEstimator(FRAME).at(0) is None


def test_the_camera_sits_at_the_end_of_its_arm() -> None:
    state = estimator(np.array([0.5, 0.0, 0.2])).at(0)
    assert state is not None
    forward, down = 0.5 * np.cos(0.1) + 0.2 * np.sin(0.1), 0.2 * np.cos(0.1) - 0.5 * np.sin(0.1)
    assert state.pose.position_m[2] == pytest.approx(-50.0 + down, abs=1e-4)
    assert np.hypot(*state.pose.position_m[:2]) == pytest.approx(forward, abs=1e-3)


def test_reports_that_come_late_are_left_out() -> None:
    made = estimator()
    made.on_mount(500_000, PanTilt(9.0, 9.0))
    state = made.at(500_000)
    assert state is not None
    assert state.pose.mount == pytest.approx((0.05, 0.7))
