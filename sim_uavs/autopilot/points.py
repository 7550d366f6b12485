"""MAVLink's ways to name a point, turned into the vehicle's local frame."""

from math import isfinite

from pymavlink.dialects.v20 import all as mavlink

from dyknow.navigation.geodesy import LocalFrame
from dyknow.sim_uavs.dynamics.quadcopter import Vector

_ABOVE_SEA = frozenset({mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT})
_ABOVE_HOME = frozenset(
    {
        mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT,
        mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
        mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT,
        mavlink.MAV_FRAME_GLOBAL_TERRAIN_ALT_INT,
    }
)
FRAMES = _ABOVE_SEA | _ABOVE_HOME
_HIGHEST_M = 100_000.0


def local_point(frame: LocalFrame, kind: int, latitude_deg: float, longitude_deg: float, up_m: float) -> Vector | None:
    """Metres from home of a point in MAV_FRAME `kind`: the frame says from where `up_m` counts (the ground is flat).

    None when the frame is another kind, or a number is no coordinate.
    """
    numbers = (latitude_deg, longitude_deg, up_m)
    if kind not in FRAMES or not all(map(isfinite, numbers)):
        return None
    if abs(latitude_deg) > 90.0 or abs(longitude_deg) > 180.0 or abs(up_m) > _HIGHEST_M:
        return None
    altitude_m = up_m if kind in _ABOVE_SEA else frame.altitude_m + up_m
    return Vector(*frame.to_ned(latitude_deg, longitude_deg, altitude_m))
