"""The lists of one vehicle, read one after the other: its fence, then its mission."""

from collections.abc import Iterator
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from dyknow.navigation.mission_plans import MissionPlanReport
from dyknow.navigation.vehicle import Report
from dyknow.proxies.mavlink.lists.fence_list import FenceList
from dyknow.proxies.mavlink.lists.item_list import ItemList
from dyknow.proxies.mavlink.lists.mission_list import MissionPlanList
from dyknow.proxies.mavlink.reports import VehicleReports
from dyknow.proxies.mavlink.ways import Target

_HOME_ALTITUDE_M = 0.5
"""A home that is reported to be so much higher or lower is where it was."""


class VehicleLists:
    """The lists of one vehicle, read by the mission protocol."""

    def __init__(self) -> None:
        self.fence, self.mission = FenceList(), MissionPlanList()
        self._home_m: float | None = None

    def restart(self) -> None:
        """The vehicle is met, or met again."""
        for each in self._all:
            each.restart()

    @property
    def _all(self) -> tuple[ItemList, ItemList]:
        return self.fence, self.mission

    def on_message(self, message: Any, known: VehicleReports, valid_us: int) -> Iterator[Report]:
        """Take a message of the vehicle into its lists; `known`: its earlier reports."""
        if self.fence.on_message(message):
            yield known.fence(self.fence.areas, valid_us)
        if message.get_type() == "MISSION_CURRENT":
            self.mission.on_total(message.total)
        home_m = known.home_altitude_m
        if home_m is not None and (self._home_m is None or abs(home_m - self._home_m) > _HOME_ALTITUDE_M):
            self._home_m = home_m
        has_home = known.autopilot == mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
        changed = self.mission.on_home(self._home_m, has_home=has_home)
        if self.mission.on_message(message) or changed:
            yield MissionPlanReport(valid_us, self.mission.steps)

    def due(self, target: Target, now_us: int) -> list[Any]:
        """The messages to send now; a list is not begun while another one is read."""
        busy = next((each for each in self._all if each.is_busy), None)
        for each in self._all if busy is None else (busy,):
            messages = each.due(target, now_us)
            if messages:
                return messages
        return []

    def take_problems(self) -> list[str]:
        """The problems of the lists, each sentence once."""
        return [problem for each in self._all for problem in each.take_problems()]
