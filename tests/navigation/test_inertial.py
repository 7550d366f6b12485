import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow.navigation.inertial import GRAVITY_M_S2, InertialInput, turned
from dyknow.navigation.vehicle import AccelerationReport, AttitudeReport

ANGLES = st.floats(-math.pi, math.pi)


def attitude(roll: float = 0.0, pitch: float = 0.0, yaw: float = 0.0, at_us: int = 0) -> AttitudeReport:
    return AttitudeReport(at_us, "A", roll, pitch, yaw)


@pytest.mark.parametrize(
    ("angles", "force", "expected"),
    [
        ((0, 0, 0), (1, 2, -GRAVITY_M_S2), (1, 2, 0)),
        ((0, 0, math.pi / 2), (1, 0, -GRAVITY_M_S2), (0, 1, 0)),
        ((0, math.pi / 2, 0), (GRAVITY_M_S2, 0, 0), (0, 0, 0)),
        ((math.pi / 2, 0, 0), (0, -GRAVITY_M_S2, 0), (0, 0, 0)),
        ((0, 0, 0), (0, 0, 0), (0, 0, GRAVITY_M_S2)),
    ],
)
def test_specific_force_becomes_acceleration_over_ground(angles, force, expected) -> None:
    assert turned(attitude(*angles), force) == pytest.approx(expected, abs=1e-9)


@given(ANGLES, ANGLES, ANGLES, st.tuples(*[st.floats(-50, 50)] * 3))
def test_turning_keeps_lengths(roll, pitch, yaw, force) -> None:
    north, east, down = turned(attitude(roll, pitch, yaw), force)
    assert math.hypot(north, east, down - GRAVITY_M_S2) == pytest.approx(math.hypot(*force), abs=1e-9)


def fed(period_us: int, count: int = 20) -> InertialInput:
    unit = InertialInput()
    for k in range(count):
        unit.on_attitude(attitude(at_us=k * period_us))
        unit.on_acceleration(AccelerationReport(k * period_us, "A", float(k), 0.0, -GRAVITY_M_S2))
    return unit


def test_the_mean_is_over_the_samples_inside() -> None:
    assert fed(50_000).mean(500_000, 700_000) == pytest.approx((12.5, 0, 0))


def test_a_sensor_too_slow_to_have_a_mean_counts_as_none() -> None:
    assert fed(370_000).mean(370_000, 740_000) is None
    assert fed(50_000).mean(5_000_000, 5_100_000) is None, "and so does one that fell silent"
    assert InertialInput().mean(0, 1) is None


def test_without_a_fresh_attitude_there_is_no_acceleration() -> None:
    unit = InertialInput()
    unit.on_attitude(attitude(at_us=0))
    for k in range(10):
        unit.on_acceleration(AccelerationReport(1_000_000 + k * 20_000, "A", 1.0, 0.0, -9.8))
    assert unit.mean(1_000_000, 1_200_000) is None


def test_a_second_sensor_does_not_mix_in_and_nonsense_is_dropped() -> None:
    unit = fed(50_000)
    unit.on_acceleration(AccelerationReport(960_000, "B", 100.0, 0.0, -9.8))
    unit.on_acceleration(AccelerationReport(970_000, "A", math.nan, 0.0, -9.8))
    unit.on_acceleration(AccelerationReport(980_000, "A", 1e9, 0.0, -9.8))
    assert unit.mean(900_000, 1_000_000) == pytest.approx((19.0, 0, 0))
