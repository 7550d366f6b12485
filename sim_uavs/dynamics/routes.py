"""Routes as plain data: where to fly, how fast, whether over and over. Pure.

Offsets are metres north, east and down of a local frame; a route holds WGS-84 places, so that any vehicle can fly it.
"""

from collections.abc import Sequence
from math import cos, pi, sin
from typing import NamedTuple

from dyknow.navigation.geodesy import LocalFrame
from dyknow.sim_uavs.dynamics.quadcopter import Vector
from dyknow.sim_uavs.dynamics.settings import HomePlace


class Route(NamedTuple):
    """Places to fly to in turn; with `loop` the first follows the last."""

    waypoints: tuple[HomePlace, ...]
    speed_m_s: float = 5.0
    loop: bool = False


def through(frame: LocalFrame, points: Sequence[Vector], speed_m_s: float, *, loop: bool = False) -> Route:
    """Once along `points`; or, with `loop`, over and over."""
    return Route(tuple(HomePlace(*frame.from_ned(*point)) for point in points), speed_m_s, loop)


def hover(frame: LocalFrame, point: Vector, speed_m_s: float = 5.0) -> Route:
    """To one point, and stay."""
    return through(frame, (point,), speed_m_s)


def patrol(frame: LocalFrame, corner: Vector, north_m: float, east_m: float, speed_m_s: float) -> Route:
    """Over and over around a rectangle, clockwise from its south-western corner."""
    offsets = ((0.0, 0.0), (north_m, 0.0), (north_m, east_m), (0.0, east_m))
    corners = [corner.plus(Vector(north, east, 0.0)) for north, east in offsets]
    return through(frame, corners, speed_m_s, loop=True)


def circle(
    frame: LocalFrame, centre: Vector, radius_m: float, speed_m_s: float, *, corners: int = 12, from_rad: float = 0.0
) -> Route:
    """Over and over around a polygon on a circle, clockwise, beginning in the direction `from_rad` (0: north)."""
    angles = [from_rad + 2.0 * pi * corner / corners for corner in range(corners)]
    points = [centre.plus(Vector(radius_m * cos(angle), radius_m * sin(angle), 0.0)) for angle in angles]
    return through(frame, points, speed_m_s, loop=True)
