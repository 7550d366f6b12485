"""Where a simulated vehicle really is, whatever its sensors say."""

from typing import NamedTuple

from dyknow.sim_uavs.autopilot.autopilot import Autopilot
from dyknow.sim_uavs.autopilot.server import AutopilotServer
from dyknow.sim_uavs.dynamics.flight import Mode
from dyknow.sim_uavs.dynamics.settings import HomePlace


class TrueMotion(NamedTuple):
    """Degrees, metres above sea, m/s, charge 0..1."""

    place: HomePlace
    north_m_s: float
    east_m_s: float
    down_m_s: float
    armed: bool
    airborne: bool
    mode: Mode
    charge: float


def true_motion(vehicle: Autopilot) -> TrueMotion:
    flight = vehicle.flight
    place = HomePlace(*vehicle._frame.from_ned(*flight.body.position))
    return TrueMotion(place, *flight.body.velocity, flight.armed, flight.airborne, flight.mode, flight.body.charge)


def true_motion_of(server: AutopilotServer) -> TrueMotion:
    with server._lock:
        return true_motion(server._autopilot)
