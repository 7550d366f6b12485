"""A quadcopter as a point mass with a heading: pure, stepped by `dt_s`.

Frame: north, east, down in metres from the take-off point, on flat ground at `down_m` = 0 (above it is negative).
With the motors on the acceleration never exceeds `Limits`, nor does the speed, whatever is demanded and however
the wind blows; too strong a wind carries the vehicle off its demand instead. Without motors it falls.
"""

from math import atan2, copysign, cos, exp, hypot, pi, sin, sqrt
from typing import NamedTuple

from numpy.random import Generator

GRAVITY_M_S2 = 9.80665
_IDLE_W = 8.0  # avionics, motors off
_new = tuple.__new__  # makes a NamedTuple in half the time; a step makes a dozen vectors


class Vector(NamedTuple):
    """North, east, down."""

    north: float
    east: float
    down: float

    def plus(self, other: "Vector", factor: float = 1.0) -> "Vector":
        (north, east, down), (to_north, to_east, to_down) = self, other
        return _new(Vector, (north + factor * to_north, east + factor * to_east, down + factor * to_down))

    def minus(self, other: "Vector") -> "Vector":
        (north, east, down), (from_north, from_east, from_down) = self, other
        return _new(Vector, (north - from_north, east - from_east, down - from_down))

    @property
    def horizontal(self) -> float:
        return hypot(self.north, self.east)

    def is_close_to(self, other: "Vector", within: float) -> bool:
        return sqrt(sum((a - b) ** 2 for a, b in zip(self, other, strict=True))) <= within


ZERO = Vector(0.0, 0.0, 0.0)


class AirframeLimits(NamedTuple):
    """The limits of the airframe: a 2 kg quadcopter that hovers for about 25 minutes.

    `response_s` is how fast its attitude loop turns an error of velocity into acceleration.
    """

    speed_m_s: float = 15.0
    climb_m_s: float = 5.0
    descent_m_s: float = 3.0
    acceleration_m_s2: float = 4.0
    vertical_acceleration_m_s2: float = 3.0
    yaw_rate_rad_s: float = 1.5
    drag_per_s: float = 0.15
    response_s: float = 0.3
    mass_kg: float = 2.0
    hover_w: float = 190.0
    capacity_wh: float = 80.0


def laden(limits: AirframeLimits, load_kg: float) -> AirframeLimits:
    """The limits of the airframe with a load on its line: the same thrust and power move more."""
    share = limits.mass_kg / (limits.mass_kg + load_kg)
    return limits._replace(
        climb_m_s=limits.climb_m_s * share,
        acceleration_m_s2=limits.acceleration_m_s2 * share,
        vertical_acceleration_m_s2=limits.vertical_acceleration_m_s2 * share,
        mass_kg=limits.mass_kg + load_kg,
        hover_w=limits.hover_w / share**1.5,
    )


class Wind(NamedTuple):
    """A steady wind (the direction it blows to, m/s) with gusts of standard deviation `gust_sd_m_s`."""

    north_m_s: float = 0.0
    east_m_s: float = 0.0
    gust_sd_m_s: float = 0.0
    correlation_s: float = 3.0

    def next_gust(self, gust: Vector, dt_s: float, rng: Generator) -> Vector:
        """A first-order Gauss-Markov process with the stated standard deviation and correlation time."""
        if self.gust_sd_m_s == 0.0:
            return ZERO
        keep = exp(-dt_s / self.correlation_s)
        fresh = self.gust_sd_m_s * sqrt(1.0 - keep * keep)
        north, east = rng.standard_normal(2)
        return Vector(keep * gust.north + fresh * float(north), keep * gust.east + fresh * float(east), 0.0)

    def with_gust(self, gust: Vector) -> Vector:
        return Vector(self.north_m_s + gust.north, self.east_m_s + gust.east, gust.down)


class Body(NamedTuple):
    """Position m, velocity m/s, acceleration m/s^2 (of the last step), heading rad in [-pi, pi), charge 0..1."""

    position: Vector = ZERO
    velocity: Vector = ZERO
    acceleration: Vector = ZERO
    yaw_rad: float = 0.0
    yaw_rate_rad_s: float = 0.0
    charge: float = 1.0
    power_w: float = 0.0

    @property
    def on_ground(self) -> bool:
        return self.position.down >= 0.0

    @property
    def height_m(self) -> float:
        return -self.position.down

    @property
    def pitch_rad(self) -> float:
        """Nose up is positive: accelerating forwards needs the nose down."""
        return -atan2(self._forward_m_s2, GRAVITY_M_S2 - self.acceleration.down)

    @property
    def roll_rad(self) -> float:
        """Right side down is positive."""
        right = self.acceleration.east * cos(self.yaw_rad) - self.acceleration.north * sin(self.yaw_rad)
        return atan2(right, hypot(GRAVITY_M_S2 - self.acceleration.down, self._forward_m_s2))

    @property
    def _forward_m_s2(self) -> float:
        return self.acceleration.north * cos(self.yaw_rad) + self.acceleration.east * sin(self.yaw_rad)


def step(
    body: Body, demand: Vector, yaw_rad: float, wind: Vector, dt_s: float, limits: AirframeLimits, *, motors: bool
) -> Body:
    """Fly for `dt_s` towards the demanded velocity (m/s over ground) and heading.

    Semi-implicit Euler; a = clip((demand - v) / response - drag) + drag * (wind - v), clipped again, so that the wind
    is compensated as far as thrust allows.
    """
    if not motors and body.on_ground:
        charge, power_w = _drained(body.charge, ZERO, ZERO, dt_s, limits, motors)
        return Body(body.position, ZERO, ZERO, body.yaw_rad, 0.0, charge, power_w)
    velocity = _next_velocity(body.velocity, demand, wind, dt_s, limits, motors)
    position = body.position.plus(velocity, dt_s)
    if position.down >= 0.0:
        position, velocity = Vector(position.north, position.east, 0.0), ZERO
    turn = _turn(wrapped(yaw_rad - body.yaw_rad), limits.yaw_rate_rad_s * dt_s) if motors else 0.0
    north, east, down = velocity.minus(body.velocity)
    charge, power_w = _drained(body.charge, velocity, velocity.minus(wind), dt_s, limits, motors)
    acceleration = _new(Vector, (north / dt_s, east / dt_s, down / dt_s))
    return Body(position, velocity, acceleration, wrapped(body.yaw_rad + turn), turn / dt_s, charge, power_w)


def _next_velocity(
    velocity: Vector, demand: Vector, wind: Vector, dt_s: float, limits: AirframeLimits, motors: bool
) -> Vector:
    (north, east, down), (wind_north, wind_east, wind_down) = velocity, wind
    speeds = limits.speed_m_s, limits.climb_m_s, limits.descent_m_s
    accelerations = limits.acceleration_m_s2, limits.vertical_acceleration_m_s2, limits.vertical_acceleration_m_s2
    drag_per_s, response_s = limits.drag_per_s, max(limits.response_s, dt_s)
    drag_north, drag_east = drag_per_s * (wind_north - north), drag_per_s * (wind_east - east)
    drag_down = drag_per_s * (wind_down - down)
    if motors:
        to_north, to_east, to_down = _within(*demand, *speeds)
        thrust = (
            (to_north - north) / response_s - drag_north,
            (to_east - east) / response_s - drag_east,
            (to_down - down) / response_s - drag_down,
        )
        more_north, more_east, more_down = _within(*thrust, *accelerations)
        more_north, more_east, more_down = _within(
            more_north + drag_north, more_east + drag_east, more_down + drag_down, *accelerations
        )
        next_velocity = north + dt_s * more_north, east + dt_s * more_east, down + dt_s * more_down
        return _new(Vector, _within(*next_velocity, *speeds))
    falling = drag_down + GRAVITY_M_S2
    return _new(Vector, (north + dt_s * drag_north, east + dt_s * drag_east, down + dt_s * falling))


def _within(
    north: float, east: float, down: float, most_horizontal: float, most_up: float, most_down: float
) -> tuple[float, float, float]:
    """A velocity or acceleration, shortened to the airframe's limits horizontally, upwards and downwards."""
    length = hypot(north, east)
    if length > most_horizontal:
        scale = most_horizontal / length
        north, east = north * scale, east * scale
    return north, east, most_down if down > most_down else max(down, -most_up)


def _drained(
    charge: float, velocity: Vector, airspeed: Vector, dt_s: float, limits: AirframeLimits, motors: bool
) -> tuple[float, float]:
    """The charge that is left, and the power in W: hovering, plus a third of it at full speed through the air, plus
    what lifting the mass takes.
    """
    power_w = _IDLE_W
    if motors:
        fast = airspeed.horizontal / limits.speed_m_s
        lift_w = limits.mass_kg * GRAVITY_M_S2 * max(0.0, -velocity.down)
        power_w += limits.hover_w * (1.0 + fast * fast / 3.0) + lift_w
    used = power_w * dt_s / 3600.0 / limits.capacity_wh
    return max(0.0, charge - used), power_w


def _turn(error_rad: float, most_rad: float) -> float:
    return copysign(min(abs(error_rad), most_rad), error_rad)


def wrapped(angle_rad: float) -> float:
    """The same angle in [-pi, pi)."""
    return (angle_rad + pi) % (2.0 * pi) - pi
