from math import cos, pi

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dyknow.sim_uavs.dynamics.guidance import Speeds, approach_speed, velocity_to
from dyknow.sim_uavs.dynamics.quadcopter import GRAVITY_M_S2, ZERO, AirframeLimits, Body, Vector, Wind, step, wrapped

LIMITS = AirframeLimits()
DT_S = 0.02
ALOFT = Body(Vector(0.0, 0.0, -1000.0))
speeds = st.floats(-60.0, 60.0)
vectors = st.builds(Vector, speeds, speeds, speeds)
inside = st.builds(Vector, st.floats(-10.0, 10.0), st.floats(-10.0, 10.0), st.floats(-5.0, 3.0))


def flown(body, demand, seconds, wind=ZERO, yaw_rad=0.0, motors=True):
    for _ in range(round(seconds / DT_S)):
        body = step(body, demand, yaw_rad, wind, DT_S, LIMITS, motors=motors)
    return body


@given(inside, st.lists(st.tuples(vectors, vectors), min_size=1, max_size=20), st.sampled_from([0.005, 0.02, 0.1]))
def test_no_demand_and_no_wind_exceeds_the_limits(velocity, pushes, dt_s) -> None:
    body = ALOFT._replace(velocity=velocity)
    for demand, wind in pushes:
        body = step(body, demand, 1.0, wind, dt_s, LIMITS, motors=True)
        assert body.velocity.horizontal <= LIMITS.speed_m_s + 1e-9
        assert -LIMITS.climb_m_s - 1e-9 <= body.velocity.down <= LIMITS.descent_m_s + 1e-9
        assert body.acceleration.horizontal <= LIMITS.acceleration_m_s2 + 1e-6
        assert abs(body.acceleration.down) <= LIMITS.vertical_acceleration_m_s2 + 1e-6
        assert abs(body.yaw_rate_rad_s) <= LIMITS.yaw_rate_rad_s + 1e-9


@given(st.lists(st.tuples(vectors, st.booleans()), min_size=1, max_size=30))
def test_the_battery_never_gains_and_the_ground_is_never_entered(demands) -> None:
    body = Body(Vector(0.0, 0.0, -0.5), charge=0.001)
    for demand, motors in demands:
        after = step(body, demand, 0.0, ZERO, 0.1, LIMITS, motors=motors)
        assert 0.0 <= after.charge < body.charge or after.charge == body.charge == 0.0
        assert after.position.down <= 0.0
        body = after


def test_flying_fast_or_upwards_costs_more_than_hovering() -> None:
    hover, fast, up = (flown(ALOFT, demand, 10.0).charge for demand in (ZERO, Vector(15, 0, 0), Vector(0, 0, -5)))
    assert fast < hover
    assert up < hover
    assert 20 * 60 < (1.0 / (1.0 - hover)) * 10.0 < 30 * 60, "a hover lasts about 25 minutes"


@given(inside)
def test_it_settles_on_the_demanded_velocity_in_still_air(velocity) -> None:
    settled = flown(ALOFT._replace(velocity=velocity), Vector(5.0, -3.0, -1.0), 12.0)
    assert settled.velocity.is_close_to(Vector(5.0, -3.0, -1.0), 0.01)


def test_a_wind_within_its_power_is_compensated_and_a_storm_is_not() -> None:
    assert flown(ALOFT, ZERO, 20.0, wind=Vector(10.0, 0.0, 0.0)).velocity.horizontal < 0.01
    assert flown(ALOFT, ZERO, 20.0, wind=Vector(60.0, 0.0, 0.0)).velocity.north > 5.0


def test_without_motors_it_falls_and_stays_where_it_fell() -> None:
    falling = flown(Body(Vector(0.0, 0.0, -50.0)), Vector(0, 0, -5), 1.0, motors=False)
    assert falling.velocity.down == pytest.approx(GRAVITY_M_S2, rel=0.1)
    fallen = flown(falling, Vector(0, 0, -5), 10.0, motors=False)
    assert fallen.on_ground
    assert fallen.velocity == ZERO


def test_accelerating_north_while_facing_north_puts_the_nose_down_and_facing_west_the_right_side() -> None:
    north = step(ALOFT, Vector(10.0, 0.0, 0.0), 0.0, ZERO, DT_S, LIMITS, motors=True)
    assert north.pitch_rad < -0.1
    assert abs(north.roll_rad) < 1e-9
    facing_west = step(
        ALOFT._replace(yaw_rad=-pi / 2), Vector(10.0, 0.0, 0.0), -pi / 2, ZERO, DT_S, LIMITS, motors=True
    )
    assert facing_west.roll_rad > 0.1
    assert abs(facing_west.pitch_rad) < 1e-9


@given(st.floats(-1e3, 1e3))
def test_wrapped_angles_are_the_same_angle(angle) -> None:
    assert -pi <= wrapped(angle) < pi
    assert cos(wrapped(angle) - angle) == pytest.approx(1.0)


def test_it_turns_the_short_way() -> None:
    turned = step(ALOFT._replace(yaw_rad=3.0), ZERO, -3.0, ZERO, DT_S, LIMITS, motors=True)
    assert turned.yaw_rate_rad_s > 0, "through pi, not back through zero"


def test_gusts_come_from_the_seed_and_have_the_stated_spread() -> None:
    def gusts(seed):
        rng, gust, found = np.random.default_rng(seed), ZERO, []
        wind = Wind(gust_sd_m_s=2.0, correlation_s=0.5)
        for _ in range(8000):
            gust = wind.next_gust(gust, 0.1, rng)
            found.append(gust.north)
        return found

    assert gusts(7) == gusts(7) != gusts(8)
    assert np.std(gusts(7)) == pytest.approx(2.0, rel=0.1)


@settings(max_examples=10, deadline=None)
@given(
    st.floats(-300, 300),
    st.floats(-300, 300),
    st.floats(-100, 100),
    inside,
    st.floats(-6, 6),
    st.floats(1.0, 14.0),
)
def test_guidance_arrives_and_stays_whatever_the_start_and_a_moderate_wind(north, east, down, velocity, wind, cruise):
    target = ALOFT.position.plus(Vector(north, east, down))
    body, last = ALOFT._replace(velocity=velocity), []
    for tick in range(round((40 + 500 / cruise) / DT_S)):
        demand = velocity_to(body.position, target, Speeds(cruise, 3.0, 2.0), LIMITS)
        assert demand.horizontal <= cruise + 1e-9
        body = step(body, demand, 0.0, Vector(wind, 0.0, 0.0), DT_S, LIMITS, motors=True)
        if tick * DT_S > 30 + 500 / cruise:
            last.append(body.position)
    assert all(position.is_close_to(target, 0.5) for position in last)


@given(st.floats(0, 1e4), st.floats(0.1, 10.0))
def test_the_approach_speed_can_be_braked_away_within_the_distance(distance, braking) -> None:
    assert approach_speed(distance, braking) <= (2 * braking * distance) ** 0.5 + 1e-6
