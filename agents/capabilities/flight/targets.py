"""Where a vehicle says it is flying to, and by whose word. Times are federation time.

A target is ours while an order of ours that is under way has it, and stays ours until another one is reported; any other
target is another station's, or that of the vehicle's own mission. Another station's target is remembered while ours
are flown, and over gaps of the link: it is the way back. It is forgotten when the vehicle changes its mode by itself.
"""

from dataclasses import dataclass

from dyknow.agents.capabilities.flight.arbiter import HEARD_WITHIN_US
from dyknow.agents.capabilities.flight.errand import Errand, is_at
from dyknow.agents.places import Fix
from dyknow.navigation.geodesy import distance_m
from dyknow.navigation.vehicle import GoToOrder, TargetReport, stopping_distance_m

_THERE_M = 5.0


@dataclass(slots=True)
class Targets:
    """The targets that one vehicle has reported.

    Attributes:
        reported_us: when the newest was reported last.
        is_ours: whether an order of ours gave it.
        others: the newest that another station gave, and when it was reported last (`others_us`).
    """

    reported: TargetReport | None = None
    reported_us: int = -HEARD_WITHIN_US
    is_ours: bool = False
    others: TargetReport | None = None
    others_us: int = 0

    def on_target(self, target: TargetReport, now_us: int, errand: Errand | None) -> bool:
        """Take a target; whether another station has given a new one since the last. `errand`: the order under way."""
        before, self.reported, self.reported_us = self.reported, target, now_us
        is_same = before is not None and is_at(before, target)
        if errand is not None and not errand.is_over and errand.is_ours(target):
            self.is_ours = True
            return False
        self.is_ours = self.is_ours and is_same
        if self.is_ours:
            return False
        self.others, self.others_us = target, now_us
        return before is not None and not is_same

    def forget(self) -> None:
        """The vehicle's mode has changed: it no longer flies to its target."""
        self.reported = self.others = None
        self.is_ours = False

    def tells(self, now_us: int) -> bool:
        """Whether the vehicle has reported a target lately."""
        return now_us - self.reported_us <= HEARD_WITHIN_US

    def way_back(self) -> GoToOrder | None:
        """Where another station, or the mission, has sent the vehicle."""
        to = self.others
        return None if to is None else GoToOrder(to.latitude_deg, to.longitude_deg, to.altitude_m)

    def age_us(self, now_us: int) -> int:
        """For how long no target at all has been heard, while the way back is remembered."""
        return max(0, now_us - self.reported_us)

    def is_sent_away(self, fix: Fix) -> bool:
        """Whether another station has the vehicle fly elsewhere than where it is."""
        to = self.reported
        if to is None or self.is_ours:
            return False
        up_m = to.altitude_m - fix.altitude_m
        away_m = distance_m(fix.latitude_deg, fix.longitude_deg, to.latitude_deg, to.longitude_deg, up_m)
        return away_m > _THERE_M + stopping_distance_m(fix.speed_m_s)
