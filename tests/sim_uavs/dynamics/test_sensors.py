import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow.sim_uavs.dynamics.quadcopter import GRAVITY_M_S2, ZERO, Body, Vector
from dyknow.sim_uavs.dynamics.sensors import (
    GpsNoise,
    ImuNoise,
    draw_bias,
    next_wander,
    read_gps,
    read_imu,
    specific_force,
)

ALOFT = Body(Vector(3.0, -4.0, -50.0), Vector(5.0, 0.0, 0.0))


def readings(seed, count=4000, dt_s=0.1, noise=None):
    rng, wander, found = np.random.default_rng(seed), ZERO, []
    noise = noise or GpsNoise(correlation_s=1.0)
    for _ in range(count):
        wander = next_wander(wander, noise, dt_s, rng)
        found.append(read_gps(ALOFT, wander, noise, rng))
    return found


def test_one_seed_gives_one_sequence_of_readings() -> None:
    assert readings(1, 50) == readings(1, 50) != readings(2, 50)


def test_position_errors_have_no_bias_and_the_stated_accuracy() -> None:
    found = readings(3)
    for axis, stated in (("north", "horizontal_sd_m"), ("east", "horizontal_sd_m"), ("down", "vertical_sd_m")):
        errors = [getattr(r.position, axis) - getattr(ALOFT.position, axis) for r in found]
        assert abs(np.mean(errors)) < 0.05
        assert np.std(errors) == pytest.approx(getattr(found[0], stated), rel=0.15)


def test_scaled_noise_scales_the_errors_and_the_accuracy_it_states() -> None:
    plain, tenfold = GpsNoise(), GpsNoise().scaled(10.0)
    one, ten = (read_gps(ALOFT, ZERO, noise, np.random.default_rng(5)) for noise in (plain, tenfold))
    assert ten.horizontal_sd_m == pytest.approx(10.0 * one.horizontal_sd_m)
    assert (ten.position.north - 3.0) == pytest.approx(10.0 * (one.position.north - 3.0))


def test_a_vehicle_at_rest_feels_gravity_upwards_only() -> None:
    assert specific_force(Body()) == pytest.approx((0.0, 0.0, -GRAVITY_M_S2))


@given(st.floats(-4, 4), st.floats(-4, 4), st.floats(-3, 3), st.floats(-3.1, 3.1))
def test_the_thrust_of_a_multicopter_is_felt_along_its_own_axis_whatever_it_does(north, east, down, yaw_rad) -> None:
    force = specific_force(Body(acceleration=Vector(north, east, down), yaw_rad=yaw_rad))
    assert force.north == pytest.approx(0.0, abs=1e-9)
    assert force.east == pytest.approx(0.0, abs=1e-9)
    assert force.down == pytest.approx(-((north**2 + east**2 + (down - GRAVITY_M_S2) ** 2) ** 0.5))


def test_imu_noise_is_white_around_one_bias() -> None:
    rng, noise = np.random.default_rng(9), ImuNoise()
    bias = draw_bias(noise, rng)
    found = [read_imu(Body(), bias, noise, rng).force.down for _ in range(3000)]
    assert np.mean(found) == pytest.approx(-GRAVITY_M_S2 + bias.down, abs=0.01)
    assert np.std(found) == pytest.approx(noise.acceleration_m_s2, rel=0.1)
