"""GPS and IMU as the autopilot sees them: truth plus seeded noise. Pure: the generator is an argument.

Frames as in dynamics.py; the IMU speaks in the body frame (forward, right, down).
"""

from math import cos, exp, sin, sqrt
from typing import NamedTuple

from numpy.random import Generator

from dyknow.sim_uavs.dynamics.quadcopter import GRAVITY_M_S2, ZERO, Body, Vector


class GpsNoise(NamedTuple):
    """Standard deviations: a slowly wandering error of the position (m), white noise on top (m) and on velocity (m/s).

    The defaults are those of a receiver whose fixes an autopilot has already filtered.
    """

    wander_m: float = 0.2
    white_m: float = 0.08
    vertical_factor: float = 1.4
    velocity_m_s: float = 0.05
    correlation_s: float = 60.0

    def scaled(self, factor: float) -> "GpsNoise":
        return self._replace(
            wander_m=self.wander_m * factor, white_m=self.white_m * factor, velocity_m_s=self.velocity_m_s * factor
        )


class ImuNoise(NamedTuple):
    """Standard deviations: acceleration m/s^2, rates rad/s, attitude rad; biases are drawn once per vehicle."""

    acceleration_m_s2: float = 0.08
    acceleration_bias_m_s2: float = 0.03
    rate_rad_s: float = 0.005
    attitude_rad: float = 0.004


class GpsReading(NamedTuple):
    """Position m and velocity m/s in the local frame, with the accuracy the receiver states (standard deviations, m)."""

    position: Vector
    velocity: Vector
    horizontal_sd_m: float
    vertical_sd_m: float
    satellites: int


class ImuReading(NamedTuple):
    """Specific force m/s^2 and rates rad/s in the body frame; roll, pitch, yaw rad relative to NED."""

    force: Vector
    rates: Vector
    roll_rad: float
    pitch_rad: float
    yaw_rad: float


def next_wander(wander: Vector, noise: GpsNoise, dt_s: float, rng: Generator) -> Vector:
    """The slow part of the GPS error: first-order Gauss-Markov, of standard deviation `wander_m`."""
    keep = exp(-dt_s / noise.correlation_s)
    fresh = noise.wander_m * sqrt(1.0 - keep * keep)
    north, east, down = (float(x) for x in rng.standard_normal(3))
    return Vector(
        keep * wander.north + fresh * north,
        keep * wander.east + fresh * east,
        keep * wander.down + fresh * noise.vertical_factor * down,
    )


def read_gps(body: Body, wander: Vector, noise: GpsNoise, rng: Generator) -> GpsReading:
    white = [float(x) for x in rng.standard_normal(6)]
    horizontal = sqrt(noise.wander_m**2 + noise.white_m**2)
    jitter = Vector(
        noise.white_m * white[0], noise.white_m * white[1], noise.white_m * noise.vertical_factor * white[2]
    )
    return GpsReading(
        body.position.plus(wander).plus(jitter),
        body.velocity.plus(Vector(*white[3:]), noise.velocity_m_s),
        horizontal,
        horizontal * noise.vertical_factor,
        14,
    )


def draw_bias(noise: ImuNoise, rng: Generator) -> Vector:
    """The constant error of one vehicle's accelerometers, m/s^2."""
    return ZERO.plus(Vector(*(float(x) for x in rng.standard_normal(3))), noise.acceleration_bias_m_s2)


def read_imu(body: Body, bias: Vector, noise: ImuNoise, rng: Generator) -> ImuReading:
    white = [float(x) for x in rng.standard_normal(9)]
    force = specific_force(body).plus(bias).plus(Vector(*white[:3]), noise.acceleration_m_s2)
    rates = Vector(0.0, 0.0, body.yaw_rate_rad_s).plus(Vector(*white[3:6]), noise.rate_rad_s)
    roll, pitch, yaw = (
        angle + noise.attitude_rad * error
        for angle, error in zip((body.roll_rad, body.pitch_rad, body.yaw_rad), white[6:], strict=True)
    )
    return ImuReading(force, rates, roll, pitch, yaw)


def specific_force(body: Body) -> Vector:
    """The reading of an accelerometer: acceleration less gravity, turned from NED into the body frame (m/s^2)."""
    north, east, down = body.acceleration.minus(Vector(0.0, 0.0, GRAVITY_M_S2))
    forward = north * cos(body.yaw_rad) + east * sin(body.yaw_rad)
    right = east * cos(body.yaw_rad) - north * sin(body.yaw_rad)
    pitched = down * cos(body.pitch_rad) + forward * sin(body.pitch_rad)
    return Vector(
        forward * cos(body.pitch_rad) - down * sin(body.pitch_rad),
        right * cos(body.roll_rad) + pitched * sin(body.roll_rad),
        pitched * cos(body.roll_rad) - right * sin(body.roll_rad),
    )
