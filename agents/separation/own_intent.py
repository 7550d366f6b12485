"""The intent of the own vehicle, from what its autopilot says and what was ordered (ASTM F3548).

    commander, mode                        legs                                          right of way
    on the ground, or not armed            none: it is no traffic                        -
    a manoeuvre of ours                    its places, then it stands                    committed
    an order, another station's target     that place, then it stands                    by name
    the route                              its places, as far as 90 s                    by name
    a mission, its target reported         that place, then on                           by name with leave, else cannot
    RTL                                    up, home, down                                cannot
    LAND                                   down                                          cannot
    its pilot, anything else               its motion, and what it reaches               cannot

A vehicle that may not be commanded, or is without leave to give way, cannot. Federation time, WGS-84, metres above mean sea level.
"""

from typing import Final

from agents.flight.arbiter import ENDINGS, Commander
from agents.flight.heard_vehicle import InterruptedMission
from agents.flight.pilot import Pilot
from agents.flight.places import Fix
from navigation.geodesy import distance_m
from navigation.intents.intent import (
    CLIMB_M_S,
    DESCENT_M_S,
    MOST_LEGS,
    SPEED_M_S,
    Contingency,
    IntendedPlace,
    Intent,
    IntentEnding,
    IntentSource,
    RightOfWay,
)
from navigation.vehicle import (
    MISSION_MODES,
    MODES_OF,
    FailsafeReport,
    GoToOrder,
    HoldOrder,
    InterruptOrder,
    LandOrder,
    LinkLossAction,
    Order,
    ReturnHomeOrder,
    TakeOffOrder,
)

AHEAD_S: Final = 90.0
"""Legs beyond that are left out."""
RETURN_HEIGHT_M: Final = 15.0
"""How high above home a vehicle returns whose parameters are not known (ArduCopter RTL_ALT)."""
LOW_BATTERY: Final = 0.15
_LAND_MODES, _RETURN_MODES = MODES_OF[LandOrder], MODES_OF[ReturnHomeOrder]
_TAKE_OFF_MODES: Final = MODES_OF[TakeOffOrder]


class OwnIntent:
    """See the module.

    Args:
        may_avoid: whether this platform may give way at all.

    Attributes:
        battery: the fraction that is left, where it is known.
    """

    def __init__(self, pilot: Pilot, *, may_avoid: bool) -> None:
        self._pilot, self._may_avoid = pilot, may_avoid
        self.battery: float | None = None
        self._fastest_m_s, self._climb_m_s, self._descent_m_s = 0.0, 0.0, 0.0

    def now(self, manoeuvre: tuple[IntendedPlace, ...] | None) -> Intent | None:
        """The intent; None: where the vehicle is is not known. `manoeuvre`: what it flies to keep apart, None: nothing."""
        pilot, fix = self._pilot, self._pilot.fix
        if fix is None:
            return None
        status = pilot.status
        if status is None or not status.armed or status.airborne is False:
            self._fastest_m_s = self._climb_m_s = self._descent_m_s = 0.0
            return self._made(fix, IntentSource.GROUND, RightOfWay.CANNOT, (), IntentEnding.HOVER)
        self._watch(fix)
        if manoeuvre is not None:
            return self._made(fix, IntentSource.MANOEUVRE, RightOfWay.COMMITTED, manoeuvre, IntentEnding.HOVER)
        return self.without_others(fix)

    def without_others(self, fix: Fix) -> Intent:
        """What it would fly if there were no others."""
        source, legs, ending = self._way(fix)
        return self._made(fix, source, self._rank(), legs, ending)

    def _rank(self) -> RightOfWay:
        pilot = self._pilot
        if not (self._may_avoid and pilot.control) or pilot.avoidance_off is not None:
            return RightOfWay.CANNOT
        if self.battery is not None and self.battery <= LOW_BATTERY:
            return RightOfWay.URGENT
        return RightOfWay.NAMED

    def _watch(self, fix: Fix) -> None:
        """Learn how fast it flies; what was seen is forgotten slowly."""
        self._fastest_m_s = max(fix.speed_m_s, 0.998 * self._fastest_m_s)
        self._climb_m_s = max(-fix.down_m_s, 0.998 * self._climb_m_s)
        self._descent_m_s = max(fix.down_m_s, 0.998 * self._descent_m_s)

    def _way(self, fix: Fix) -> tuple[IntentSource, tuple[IntendedPlace, ...], IntentEnding]:
        pilot, status = self._pilot, self._pilot.status
        mode = "" if status is None else status.mode
        here = IntendedPlace(fix.latitude_deg, fix.longitude_deg, fix.altitude_m)
        if mode in _LAND_MODES:
            return IntentSource.LANDING, (self._below(here),), IntentEnding.LAND
        if mode in _RETURN_MODES:
            return IntentSource.RETURN, self._return_legs(here, None), IntentEnding.LAND
        target = pilot.targets.told if pilot.targets.tells(pilot.now_us) else None
        towards = None if target is None else IntendedPlace(*target[1:4])
        if mode in MISSION_MODES or mode in _TAKE_OFF_MODES:
            if towards is None:
                return IntentSource.MISSION, (), IntentEnding.OPEN
            return IntentSource.MISSION, (towards,), IntentEnding.HOVER
        if pilot.diversion is not None and pilot.kept_aside is not None:
            return self._aside(pilot.kept_aside)
        claims = pilot.claims._replace(avoidance="")
        commander = claims.commander if pilot.control else Commander.NONE
        if commander is Commander.HANDS or (status is not None and not status.guided):
            return IntentSource.PILOT, (), IntentEnding.OPEN
        order = pilot.standing if pilot.control else None
        if commander is Commander.ROUTE and pilot.plan is not None:
            legs = self._route(fix)
            if legs:
                return IntentSource.ROUTE, legs, IntentEnding.HOVER
        if isinstance(order, GoToOrder | InterruptOrder) and commander is not Commander.NONE:
            return IntentSource.ORDER, (IntendedPlace(*order[:3]),), IntentEnding.HOVER
        if isinstance(order, HoldOrder):
            return IntentSource.HOVER, (), IntentEnding.HOVER
        if (
            commander is not Commander.NONE
            and pilot.plan is not None
            and pilot.leg >= len(pilot.plan.waypoints)
            and pilot.keeps_plan
        ):
            return IntentSource.HOVER, (), IntentEnding.HOVER
        if towards is not None and pilot.diversion is None:
            return IntentSource.STATION, (towards,), IntentEnding.HOVER
        back = pilot.others_target()
        if back is not None:
            return IntentSource.STATION, (IntendedPlace(*back[:3]),), IntentEnding.HOVER
        return IntentSource.HOVER, (), IntentEnding.HOVER if fix.speed_m_s < 1.0 else IntentEnding.OPEN

    def _aside(self, aside: Order | InterruptedMission) -> tuple[IntentSource, tuple[IntendedPlace, ...], IntentEnding]:
        """What it did before it made room, and will do again."""
        source = IntentSource.MISSION if isinstance(aside, InterruptedMission) else IntentSource.ORDER
        order = aside.towards if isinstance(aside, InterruptedMission) else aside
        fix = self._pilot.fix
        if isinstance(order, ENDINGS) and fix is not None:
            here = IntendedPlace(fix.latitude_deg, fix.longitude_deg, fix.altitude_m)
            if isinstance(order, LandOrder):
                return IntentSource.LANDING, (self._below(here),), IntentEnding.LAND
            return IntentSource.RETURN, self._return_legs(here, None), IntentEnding.LAND
        if isinstance(order, GoToOrder | InterruptOrder):
            return source, (IntendedPlace(*order[:3]),), IntentEnding.HOVER
        return source, (), IntentEnding.HOVER

    def _route(self, fix: Fix) -> tuple[IntendedPlace, ...]:
        plan = self._pilot.plan
        if plan is None or fix.valid_us < plan.start_us:
            return ()
        places = plan.waypoints[self._pilot.leg :]
        if plan.loop:
            places += plan.waypoints[: self._pilot.leg]
        legs: list[IntendedPlace] = []
        left_m, before = AHEAD_S * max(plan.speed_m_s, 1.0), (fix.latitude_deg, fix.longitude_deg)
        for place in places[:MOST_LEGS]:
            legs.append(IntendedPlace(*place))
            left_m -= distance_m(*before, place.latitude_deg, place.longitude_deg)
            before = place.latitude_deg, place.longitude_deg
            if left_m < 0.0:
                break
        return tuple(legs)

    def _below(self, here: IntendedPlace) -> IntendedPlace:
        """The ground below: that of home, as far as is known."""
        home_m = self._pilot.bounds.home_altitude_m
        ground_m = here.altitude_m - 200.0 if home_m is None else min(home_m, here.altitude_m)
        return here._replace(altitude_m=ground_m)

    def _return_legs(self, here: IntendedPlace, failsafe: FailsafeReport | None) -> tuple[IntendedPlace, ...]:
        """Up to the height at which it returns, home, and down."""
        home, failsafe = self._pilot.bounds.home, failsafe or self._pilot.failsafe
        if home is None:
            return (here,)
        height_m = RETURN_HEIGHT_M if failsafe is None or failsafe.return_height_m is None else failsafe.return_height_m
        level_m = max(here.altitude_m, home.altitude_m + height_m)
        over = IntendedPlace(home.latitude_deg, home.longitude_deg, level_m)
        final_m = 0.0 if failsafe is None or failsafe.final_height_m is None else failsafe.final_height_m
        down = over._replace(altitude_m=home.altitude_m + final_m)
        away_m = distance_m(here.latitude_deg, here.longitude_deg, home.latitude_deg, home.longitude_deg)
        if away_m < 3.0:
            return (down,)
        climb = () if level_m - here.altitude_m < 1.0 else (here._replace(altitude_m=level_m),)
        return (*climb, over, down)

    def _contingency(
        self, here: IntendedPlace, source: IntentSource, legs: tuple[IntendedPlace, ...]
    ) -> Contingency | None:
        """What its autopilot does on a lost link; None: it flies its legs to their end."""
        failsafe = self._pilot.failsafe
        action: LinkLossAction | None = None
        if failsafe is not None:
            action = failsafe.in_mission if source is IntentSource.MISSION else failsafe.action
        if source in {IntentSource.LANDING, IntentSource.RETURN, IntentSource.GROUND}:
            return None
        if action is None or action is LinkLossAction.CARRY_ON:
            several = len(legs) > 1 and source in {IntentSource.ROUTE, IntentSource.MANOEUVRE}
            return Contingency(0.0, legs[:1], IntentEnding.HOVER) if several else None
        delay_s = 0.0 if failsafe is None or failsafe.delay_s is None else failsafe.delay_s
        match action:
            case LinkLossAction.RETURN:
                return Contingency(delay_s, self._return_legs(here, failsafe), IntentEnding.LAND)
            case LinkLossAction.LAND | LinkLossAction.TERMINATE:
                return Contingency(delay_s, (self._below(here),), IntentEnding.LAND)
        return Contingency(delay_s, (), IntentEnding.HOVER)

    def _made(
        self, fix: Fix, source: IntentSource, rank: RightOfWay, legs: tuple[IntendedPlace, ...], ending: IntentEnding
    ) -> Intent:
        here = IntendedPlace(fix.latitude_deg, fix.longitude_deg, fix.altitude_m)
        plan, order, speed = self._pilot.plan, self._pilot.standing, SPEED_M_S
        if source is IntentSource.ROUTE and plan is not None:
            speed = plan.speed_m_s
        elif isinstance(order, GoToOrder) and order.speed_m_s:
            speed = order.speed_m_s
        elif self._fastest_m_s > 1.0:
            speed = self._fastest_m_s
        contingency = self._contingency(here, source, legs)
        return Intent(
            fix.valid_us, *here, fix.north_m_s, fix.east_m_s, fix.down_m_s, source, rank, legs, ending,
            max(0.5, min(60.0, speed)), max(CLIMB_M_S, min(20.0, self._climb_m_s)),
            max(DESCENT_M_S, min(20.0, self._descent_m_s)), contingency=contingency,
        )  # fmt: skip
