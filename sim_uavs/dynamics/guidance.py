"""From where the vehicle is and should be to the velocity it asks of its airframe: pure."""

from math import atan2, sqrt
from typing import NamedTuple

from dyknow.sim_uavs.dynamics.quadcopter import AirframeLimits, Vector

_GAIN_PER_S = 0.9  # near the target the speed is the distance times this
_BRAKING = 0.6  # of the acceleration limit, so that stopping leaves a reserve against wind
_FACE_FROM_M = 3.0  # nearer than this a vehicle keeps its heading


class Speeds(NamedTuple):
    """How fast to fly, m/s: over ground, up, down."""

    cruise_m_s: float
    climb_m_s: float
    descent_m_s: float


def velocity_to(position: Vector, target: Vector, speeds: Speeds, limits: AirframeLimits) -> Vector:
    """The velocity that reaches `target` and stops there, horizontally and vertically on its own."""
    offset = target.minus(position)
    distance = offset.horizontal
    fast = min(speeds.cruise_m_s, approach_speed(distance, _BRAKING * limits.acceleration_m_s2))
    scale = fast / distance if distance > 0 else 0.0
    vertical = approach_speed(abs(offset.down), _BRAKING * limits.vertical_acceleration_m_s2)
    down = min(vertical, speeds.descent_m_s) if offset.down > 0 else -min(vertical, speeds.climb_m_s)
    return Vector(offset.north * scale, offset.east * scale, down)


def approach_speed(distance_m: float, braking_m_s2: float) -> float:
    """The highest speed from which `braking_m_s2` still stops within the distance, linear near the end (m/s)."""
    linear_m = braking_m_s2 / _GAIN_PER_S**2
    if distance_m <= linear_m:
        return _GAIN_PER_S * distance_m
    return sqrt(2.0 * braking_m_s2 * (distance_m - linear_m / 2.0))


def heading_to(position: Vector, target: Vector, otherwise_rad: float) -> float:
    """The heading that looks at `target`, or the present one when it is near (rad)."""
    offset = target.minus(position)
    return atan2(offset.east, offset.north) if offset.horizontal > _FACE_FROM_M else otherwise_rad
