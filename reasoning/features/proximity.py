"""How close two aircraft are and will be: plain floats, metres, seconds.

Positions are (latitude, longitude) in degrees, WGS-84. Around the middle latitude the earth is taken as flat, with the
ellipsoid's radii of curvature there; on the ellipsoid this is right within 1 cm per km at middle latitudes. Vectors
point from the first aircraft to the second: north, east, down.
"""

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

_A_M: Final = 6_378_137.0
_E2: Final = 6.694_379_990_141_316e-3
_RADIANS: Final = math.pi / 180.0
_LEAST_M_DEG: Final = 110_000.0
"""No degree of latitude is shorter: 110 574 m at the equator."""
_SLOWEST: Final = 1e-12
"""Squared relative speed, m^2/s^2, below which two courses are equal."""


def offset_m(first: Sequence[float], second: Sequence[float]) -> tuple[float, float]:
    """(north, east) in metres from the first position to the second.

    north = M dlat, east = N cos(lat) dlon, with M = a (1 - e2) / w^3, N = a / w, w = sqrt(1 - e2 sin^2 lat).
    """
    lat_rad = (first[0] / 2 + second[0] / 2) * _RADIANS
    sine = math.sin(lat_rad)
    w2 = 1.0 - _E2 * sine * sine
    n_m = _A_M / math.sqrt(w2)
    dlon_deg = second[1] - first[1]
    if dlon_deg > 180.0 or dlon_deg < -180.0:
        dlon_deg = math.remainder(math.remainder(second[1], 360.0) - math.remainder(first[1], 360.0), 360.0)
    north_m = n_m * (1.0 - _E2) / w2 * ((second[0] - first[0]) * _RADIANS)
    return north_m, n_m * math.cos(lat_rad) * (dlon_deg * _RADIANS)


def are_beyond(first: Sequence[float], second: Sequence[float], radius_m: float) -> bool:
    """Whether two positions are surely farther apart than `radius_m`, and no farther than is a number of metres."""
    apart_deg = second[0] - first[0]
    if -180.0 < apart_deg < 180.0 and -720.0 < second[1] - first[1] < 720.0:
        if apart_deg * _LEAST_M_DEG > radius_m or -apart_deg * _LEAST_M_DEG > radius_m:
            return True
        north_m, east_m = offset_m(first, second)
        return north_m * north_m + east_m * east_m > radius_m * radius_m
    return False


_new = tuple.__new__  # makes a NamedTuple in half the time


class Approach(NamedTuple):
    """The closest point of two straight courses: seconds from now; metres horizontally and vertically there."""

    time_s: float
    xy_m: float
    z_m: float


def closest_approach(p_m: Sequence[float], v_m_s: Sequence[float]) -> Approach:
    """Time to, and distances at, the closest point of two straight courses.

    Minimises |p + v t| over t >= 0, hence t* = max(0, -p.v / v.v). Equal velocities give 0.

    Args:
        p_m: other minus own position: north, east, down.
        v_m_s: other minus own velocity: north, east, down.
    """
    pn, pe, pd = p_m
    vn, ve, vd = v_m_s
    speed_squared = vn * vn + ve * ve + vd * vd
    if speed_squared < _SLOWEST:
        return Approach(0.0, math.hypot(pn, pe), abs(pd))
    time_s = max(0.0, -(pn * vn + pe * ve + pd * vd) / speed_squared)
    return _new(Approach, (time_s, math.hypot(pn + vn * time_s, pe + ve * time_s), abs(pd + vd * time_s)))


def horizontal_miss_m(p_m: Sequence[float], v_m_s: Sequence[float]) -> float:
    """Horizontal distance at the horizontally closest point of two straight courses, HMD of DO-365."""
    speed_squared = v_m_s[0] * v_m_s[0] + v_m_s[1] * v_m_s[1]
    if speed_squared < _SLOWEST:
        return math.hypot(p_m[0], p_m[1])
    time_s = max(0.0, -(p_m[0] * v_m_s[0] + p_m[1] * v_m_s[1]) / speed_squared)
    return math.hypot(p_m[0] + v_m_s[0] * time_s, p_m[1] + v_m_s[1] * time_s)


def fence_margin_m(position: Sequence[float], corners: Sequence[Sequence[float]]) -> float:
    """Distance to the edge of a polygon of (latitude, longitude) corners: positive inside, negative outside."""
    points = [offset_m(position, corner) for corner in corners]
    inside, nearest_m = False, math.inf
    for (an, ae), (bn, be) in zip(points, [*points[1:], points[0]], strict=True):
        if (an > 0.0) != (bn > 0.0) and ae + (be - ae) * an / (an - bn) > 0.0:
            inside = not inside
        dn, de = bn - an, be - ae
        length_squared = dn * dn + de * de
        along = 0.0 if length_squared == 0.0 else min(1.0, max(0.0, -(an * dn + ae * de) / length_squared))
        nearest_m = min(nearest_m, math.hypot(an + along * dn, ae + along * de))
    return nearest_m if inside else -nearest_m
