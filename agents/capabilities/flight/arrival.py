"""Arrival of a vehicle at the target of an order, or why it will not arrive; a user may wait for it.

It has arrived when its position is within the bounds in which a target counts as that of the order. Giving way on
the way, and a gap of the link, are waited for; the end of the order ends the wait.
"""

from dataclasses import dataclass
from typing import Final

from dyknow import US_PER_S
from dyknow.agents.capabilities.flight.arbiter import HEARD_WITHIN_US, Commander
from dyknow.agents.capabilities.flight.errand import LEVEL_M, UPRIGHT_M, Errand, OrderProgress
from dyknow.agents.capabilities.flight.pilot import Pilot
from dyknow.navigation.geodesy import distance_m
from dyknow.navigation.vehicle import GoToOrder

UNSEEN_US: Final = 10 * US_PER_S
"""How long a vehicle that does not fly its order may take to do so again."""
UNHEARD_US: Final = 30 * US_PER_S


@dataclass(slots=True)
class Arrival:
    """One wait, for the vehicle to be at the place of `order`.

    Attributes:
        words: how it ended; empty: it has not.
        has_failed: whether it ended without the vehicle there.
    """

    order: GoToOrder
    errand: Errand
    words: str = ""
    has_failed: bool = False
    _lost_us: int | None = None
    _due_us: int | None = None

    @property
    def deadline_us(self) -> int | None:
        """When time alone ends it."""
        return self._due_us

    def look(self, pilot: Pilot) -> None:
        """Judge the vehicle's position and activity."""
        if pilot.standing != self.order:
            self._fail(self._overtaken_by(pilot))
            return
        if pilot.claims.commander is Commander.AVOIDANCE:
            self._lost_us = self._due_us = None
            return
        if pilot.errand is not None and pilot.errand.order == self.order:
            self.errand = pilot.errand
        away_m, up_m = self._distances(pilot)
        if away_m <= LEVEL_M and abs(up_m) <= UPRIGHT_M and self.errand.is_taken:
            self.words = (
                f"arrived: {away_m:.1f} m from the place, {abs(up_m):.1f} m {'below' if up_m > 0 else 'above'} it"
            )
        elif pilot.now_us - pilot.heard_us >= UNHEARD_US:
            self._fail(f"no heartbeat for {UNHEARD_US / 1e6:.0f} s: it is not known whether the vehicle arrives")
        else:
            self._wait_for(pilot)

    def _wait_for(self, pilot: Pilot) -> None:
        """Give a vehicle that does not fly its order time to do so again."""
        self._due_us = pilot.heard_us + UNHEARD_US
        is_heard = pilot.now_us - pilot.heard_us <= HEARD_WITHIN_US
        if self.errand.progress is not OrderProgress.UNSEEN or not is_heard:
            self._lost_us = None
            return
        self._lost_us = pilot.now_us if self._lost_us is None else self._lost_us
        if pilot.now_us - self._lost_us >= UNSEEN_US:
            self._fail(self.errand.reason)
        else:
            self._due_us = min(self._due_us, self._lost_us + UNSEEN_US)

    def _overtaken_by(self, pilot: Pilot) -> str:
        """The reason why the order is no longer flown."""
        return self.errand.reason or pilot.claims.hands or pilot.mission.waits or "the vehicle was sent elsewhere"

    def _distances(self, pilot: Pilot) -> tuple[float, float]:
        """How far off the place is horizontally, and how far above the vehicle, metres."""
        fix, order = pilot.fix, self.order
        if fix is None:
            return float("inf"), 0.0
        away_m = distance_m(fix.latitude_deg, fix.longitude_deg, order.latitude_deg, order.longitude_deg)
        return away_m, order.altitude_m - fix.altitude_m

    def _fail(self, why: str) -> None:
        self.words, self.has_failed = f"it does not arrive: {why}", True
