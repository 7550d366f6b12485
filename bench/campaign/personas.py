"""A vehicle of the campaign that its platform hears and commands by MAVLink bytes, as ArduCopter or PX4 do it.

What the edge of a platform does as long as the process runs is done here: its heartbeats, and the reading of lists. Without the
process the autopilot hears nothing.
"""

from collections.abc import Sequence
from typing import Final

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dyknow.navigation.geodesy import LocalFrame
from dyknow.navigation.vehicle import Report
from dyknow.proxies.mavlink.lists.vehicle_lists import VehicleLists
from dyknow.proxies.mavlink.orders import Errands
from dyknow.proxies.mavlink.reports import VehicleReports
from dyknow.proxies.mavlink.requests import Requests
from dyknow.sim_uavs.autopilot.personas import PERSONAS
from dyknow.sim_uavs.dynamics.faults import ActiveFaults
from dyknow.sim_uavs.dynamics.fences import FlightFence
from dyknow.sim_uavs.dynamics.link_loss import LinkFailsafe
from dyknow.sim_uavs.dynamics.quadcopter import Vector
from dyknow.sim_uavs.dynamics.settings import VehicleConfig
from tests.sim_uavs.wired import POLL_US, WiredVehicle

BEAT_US: Final = 1_000_000
_PLANNER, _ADDRESS = 255, ("127.0.0.1", 14550)


class PersonaVehicle(WiredVehicle):
    """See the module.

    Attributes:
        is_attended: whether the process of its platform runs.
    """

    def __init__(self, config: VehicleConfig, now_us: int, *, phase_us: int = 0) -> None:
        super().__init__(config, now_us, phase_us=phase_us)
        self.is_attended, self._beat_us = True, now_us
        self._persona = PERSONAS[config.persona]

    @property
    def _faults(self) -> ActiveFaults:
        return self.autopilot._faults

    @property
    def _failsafe(self) -> LinkFailsafe:
        return self.autopilot._failsafe

    @property
    def fence(self) -> FlightFence:
        return self.autopilot.fence

    def restart(self) -> None:
        """A new process of the platform has not heard anything yet."""
        self._known, self._errands, self._requests = VehicleReports(), Errands(), Requests()
        self.lists, self._reports, self._is_homed, self._ask_us = VehicleLists(), [], False, 0

    def on_time(self, now_us: int, stamp_us: int) -> list[Report]:
        if not self.is_attended:
            self.deadline_us = now_us + POLL_US
            self.autopilot.on_time(now_us - self._phase_us)
            return []
        if now_us >= self._beat_us:
            self._beat_us = now_us + BEAT_US
            beat = mavlink.MAVLink_heartbeat_message(
                mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, mavlink.MAV_STATE_ACTIVE, 3
            )
            self._stamp_us = stamp_us
            self._send(beat, now_us)
        return super().on_time(now_us, stamp_us)

    def upload(self, points: Sequence[Vector], frame: LocalFrame, now_us: int) -> None:
        """A planner loads a mission that flies through these places; ArduCopter's begins with its home."""
        home = [Vector(0.0, 0.0, 0.0)] if self._persona.home_is_item_0 else []
        items = [*home, *points]
        planner = mavlink.MAVLink(None, srcSystem=_PLANNER, srcComponent=190)
        system = self.autopilot.config.system_id
        messages = [mavlink.MAVLink_mission_count_message(system, 1, len(items), mavlink.MAV_MISSION_TYPE_MISSION)]
        for at, item in enumerate(items):
            latitude_deg, longitude_deg, altitude_m = frame.from_ned(*item)
            place = round(latitude_deg * 1e7), round(longitude_deg * 1e7), altitude_m
            messages.append(
                mavlink.MAVLink_mission_item_int_message(
                    system, 1, at, mavlink.MAV_FRAME_GLOBAL_INT, mavlink.MAV_CMD_NAV_WAYPOINT, 0, 1, 0, 0, 0, 0, *place
                )
            )
        for message in messages:
            self.autopilot.on_bytes(message.pack(planner), _ADDRESS, now_us - self._phase_us)
        if len(self.flight.items) != len(items):
            raise ValueError(f"a mission of {len(items)} items was not taken")
