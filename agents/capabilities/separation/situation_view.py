"""The `Situation` that the rule decides on: one platform's own vehicle and all others at a moment. Federation time.

A vehicle whose position has not been known for a while is taken to fly on as its intent had it: the vehicles that it
meets are notified that it does not avoid them.
"""

from collections.abc import Iterable, Sequence
from functools import partial
from typing import Final

from dyknow.agents.capabilities.flight.pilot import Pilot
from dyknow.agents.capabilities.separation.logic import STEPS, SeparationLogic
from dyknow.agents.capabilities.separation.neighbourhood import Neighbourhood
from dyknow.agents.capabilities.separation.neighbours import Traffic3D
from dyknow.agents.capabilities.separation.situation import Situation
from dyknow.agents.places import Fix
from dyknow.navigation.intents.intent import IntendedPlace, IntentEnding, RightOfWay
from dyknow.navigation.intents.path import (
    STEP_S,
    FlatMotion,
    FlatOrigin,
    FlatPlace,
    Performance,
    flat_legs,
    fly,
    motion_of,
    performance_of,
)

OLD_US: Final = 2_000_000
"""Age beyond which a position no longer counts as the vehicle's."""
MOST_FLOWN_ON_S: Final = 60.0
LEAST_STATED_M_S: Final = 2.0
_FAR_M: Final = 5_000.0


class SituationView:
    """See the module.

    Args:
        neighbourhood: the intents of others, and of the own vehicle.
        logic: the rule, whose manoeuvre is flown.
        may_avoid: whether this platform may give way at all.

    Attributes:
        origin: the origin of metres; None: there was no situation yet.
    """

    def __init__(self, pilot: Pilot, neighbourhood: Neighbourhood, logic: SeparationLogic, *, may_avoid: bool) -> None:
        self._pilot, self._neighbourhood, self._logic, self._may_avoid = pilot, neighbourhood, logic, may_avoid
        self.origin: FlatOrigin | None = None

    @property
    def blind_from_us(self) -> int | None:
        """When the position will be too old, unless another one comes; None: never, the vehicle is not in the air."""
        fix, status = self._pilot.fix, self._pilot.status
        flies = status is not None and status.armed and status.airborne is not False
        return fix.valid_us + OLD_US + 1 if flies and fix is not None else None

    def situation(self) -> Situation | None:
        """The present situation; None: the vehicle is on the ground, or its position was never known."""
        pilot, around = self._pilot, self._neighbourhood
        fix, own = pilot.fix, around.own.now(None)
        if fix is None or own is None or not own.is_airborne:
            return None
        origin = self._origin_at(fix)
        cannot = "" if own.rank is not RightOfWay.CANNOT else self._cannot_words
        now_us, motion, legs = fix.valid_us, motion_of(own, origin), tuple(flat_legs(own.legs, origin))
        performance = performance_of(own)
        is_blind = pilot.now_us - now_us > OLD_US
        if is_blind:
            age_s = (pilot.now_us - now_us) / 1e6
            cannot = f"its position has not been known for {age_s:.0f} s"
            motion = _flown_on(motion, legs, own.ending, performance, min(age_s, MOST_FLOWN_ON_S))
            now_us = pilot.now_us
        traffic = around.others.near(origin, fix, max(own.speed_m_s, fix.speed_m_s), now_us, STEPS)
        return Situation(
            now_us, own.rank, cannot, motion, legs, own.ending, performance, around.others.by_unit, traffic,
            partial(may_fly_to, pilot, origin), is_blind, _slower(pilot.stated_m_s),
        )  # fmt: skip

    def traffic_now(self, now: Situation) -> Traffic3D:
        """The tubes of all others, once more: one of them has just reported."""
        fix, origin = self._pilot.fix, self.origin
        if fix is None or origin is None:
            return now.traffic
        speed = max(now.performance.speed_m_s, fix.speed_m_s)
        return self._neighbourhood.others.near(origin, fix, speed, now.now_us, STEPS)

    def places(self, places: Iterable[FlatPlace]) -> tuple[IntendedPlace, ...]:
        """The places in degrees; empty while there is no origin."""
        origin = self.origin
        if origin is None:
            return ()
        return tuple(IntendedPlace(*origin.degrees(each.north_m, each.east_m), each.altitude_m) for each in places)

    @property
    def _cannot_words(self) -> str:
        off = self._pilot.avoidance_off or "it may not command its vehicle"
        return off if self._may_avoid else "this platform has no leave to give way"

    def _origin_at(self, fix: Fix) -> FlatOrigin:
        """The origin of metres near `fix`; it moves only between manoeuvres."""
        origin = self.origin
        if origin is not None and self._logic.manoeuvre is None:
            north_m, east_m = origin.metres(fix.latitude_deg, fix.longitude_deg)
            origin = origin if abs(north_m) + abs(east_m) < _FAR_M else None
        if origin is None:
            origin = self.origin = FlatOrigin.at(fix.latitude_deg, fix.longitude_deg)
        return origin


def _slower(stated_m_s: float | None) -> float | None:
    """Half of the speed that is ordered again afterwards; None: none is, or it is slow already."""
    return None if stated_m_s is None or stated_m_s < LEAST_STATED_M_S else stated_m_s / 2.0


def _flown_on(
    motion: FlatMotion, legs: Sequence[FlatPlace], ending: IntentEnding, performance: Performance, seconds: float
) -> FlatMotion:
    """Where a vehicle is, and how it moves, after that time on its way."""
    at = max(1, round(seconds / STEP_S))
    tube = fly(motion, legs, ending, performance, at + 1)
    here, before = tube[:, at], tube[:, at - 1]
    north_m_s, east_m_s = ((here[:2] - before[:2]) / STEP_S).tolist()
    up_m_s = float(here[2] + here[3] - before[2] - before[3]) / 2.0 / STEP_S
    return FlatMotion(float(here[0]), float(here[1]), float(here[2] + here[3]) / 2.0, north_m_s, east_m_s, up_m_s)


def may_fly_to(pilot: Pilot, origin: FlatOrigin, place: FlatPlace, before: FlatPlace | None = None) -> bool:
    """Whether it may be sent to a place, straight from the one before it; None: from where it is."""
    order = pilot.stop(place.altitude_m, origin.degrees(place.north_m, place.east_m))
    if before is None or pilot.fix is None:
        return pilot.refusal(order) is None
    latitude_deg, longitude_deg = origin.degrees(before.north_m, before.east_m)
    start = pilot.fix._replace(
        latitude_deg=latitude_deg,
        longitude_deg=longitude_deg,
        altitude_m=before.altitude_m,
        north_m_s=0.0,
        east_m_s=0.0,
    )
    return pilot.refusal(order, start=start) is None
