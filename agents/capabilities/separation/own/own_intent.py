"""The intent of the own vehicle, from its autopilot's reports and its orders (ASTM F3548).

    commander, mode                        legs                                          right of way
    on the ground, or not armed            none: it is no traffic                        -
    a manoeuvre of ours                    its places, then it stands                    committed
    an order, another station's target     that place, then it stands                    by name
    the route                              its places, as far as 90 s                    by name
    a mission, its items read              its places from the present item on, its end  by name with leave, else cannot
    a mission, its target reported         that place                                    by name with leave, else cannot
    RTL                                    up, home, down                                by name with leave, else cannot
    LAND, a take-off                       down, up                                      landing with leave, else cannot
    its pilot, anything else               its motion, and the places it reaches         cannot

A vehicle that may not be commanded now (control, link, mode, its pilot), or whose platform may not give way, cannot; a
low battery puts it before all that can, also on a manoeuvre. Federation time, WGS-84, metres above mean sea level.
"""

from collections.abc import Sequence
from math import hypot
from typing import Final, NamedTuple

from dyknow.agents.capabilities.flight.arbiter import ENDINGS, Commander, unready
from dyknow.agents.capabilities.flight.errand import OrderProgress
from dyknow.agents.capabilities.flight.heard_vehicle import InterruptedMission
from dyknow.agents.capabilities.flight.pilot import Pilot
from dyknow.agents.capabilities.separation.own.flown_speeds import FlownSpeeds
from dyknow.agents.capabilities.separation.records import MOST_DELAY_S, MOST_SPEED_M_S
from dyknow.agents.places import Fix, FlightPlan
from dyknow.navigation.geodesy import distance_m
from dyknow.navigation.intents.intent import (
    MOST_LEGS,
    SPEED_M_S,
    Contingency,
    IntendedPlace,
    Intent,
    IntentEnding,
    IntentSource,
    RightOfWay,
)
from dyknow.navigation.mission_plans import MissionItem, MissionStep
from dyknow.navigation.vehicle import (
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
"""The fraction of its charge from which on a vehicle goes first."""
MOST_AWAITED: Final = 8
"""How many legs of the way that it may fly as well an intent has while it is unknown which one it flies."""
_LAND_MODES, _RETURN_MODES = MODES_OF[LandOrder], MODES_OF[ReturnHomeOrder]
_TAKE_OFF_MODES: Final = MODES_OF[TakeOffOrder]
_BACKTRACKS, _STREAMED = "SMART_RTL", "OFFBOARD"
_STANDS_M_S: Final = 1.0
_CONTINUED: Final = frozenset({MissionStep.FLY_TO, MissionStep.TAKE_OFF})
_SAME_M, _SAME_UP_M = 10.0, 5.0
"""Greatest distance of the reported target from its mission item; beyond, the items have changed."""


class _Way(NamedTuple):
    source: IntentSource
    legs: tuple[IntendedPlace, ...] = ()
    ending: IntentEnding = IntentEnding.HOVER


class OwnIntent:
    """See the module.

    Args:
        may_avoid: whether this platform may give way at all.
    """

    def __init__(self, pilot: Pilot, *, may_avoid: bool) -> None:
        self._pilot, self._may_avoid = pilot, may_avoid
        self._speeds = FlownSpeeds()

    def now(self, manoeuvre: tuple[IntendedPlace, ...] | None, speed_m_s: float | None = None) -> Intent | None:
        """The intent; None: where the vehicle is is not known.

        `manoeuvre`: its places, None: it flies none; `speed_m_s`: how fast, None: as by itself.
        """
        pilot, fix = self._pilot, self._pilot.fix
        if fix is None:
            return None
        status = pilot.status
        if status is None or not status.armed or status.airborne is False:
            self._speeds.forget()
            return self._made(fix, IntentSource.GROUND, RightOfWay.CANNOT, (), IntentEnding.HOVER)
        self._speeds.watch(fix)
        return self.without_others(fix) if manoeuvre is None else self._manoeuvring(fix, manoeuvre, speed_m_s)

    def _manoeuvring(self, fix: Fix, manoeuvre: tuple[IntendedPlace, ...], speed_m_s: float | None) -> Intent:
        """The manoeuvre. Until the vehicle shows that it flies it, it may fly its own way: that is its contingency."""
        own, diversion = self.without_others(fix), self._pilot.diversion
        progress = OrderProgress.FLOWN if diversion is None else diversion.progress
        if progress is OrderProgress.UNSEEN:
            return own._replace(contingency=Contingency(0.0, manoeuvre[:MOST_AWAITED], IntentEnding.HOVER))
        rank = min(self._rank(IntentSource.MANOEUVRE), RightOfWay.COMMITTED)
        found = self._made(fix, IntentSource.MANOEUVRE, rank, manoeuvre, IntentEnding.HOVER)
        found = found if speed_m_s is None else found._replace(speed_m_s=speed_m_s)
        if progress is OrderProgress.FLOWN:
            return found
        return found._replace(contingency=Contingency(0.0, own.legs[:MOST_AWAITED], own.ending))

    def without_others(self, fix: Fix) -> Intent:
        """Its intent if there were no others."""
        source, legs, ending = self._way(fix)
        return self._made(fix, source, self._rank(source), legs, ending)

    def _rank(self, source: IntentSource) -> RightOfWay:
        pilot = self._pilot
        silent_us = pilot.now_us - pilot.heard_us
        is_commanded = unready(pilot.status, silent_us, control=pilot.control) is None and pilot.avoidance_off is None
        if not (self._may_avoid and is_commanded):
            return RightOfWay.CANNOT
        if pilot.battery is not None and pilot.battery.fraction <= LOW_BATTERY:
            return RightOfWay.URGENT
        lands = source in {IntentSource.LANDING, IntentSource.TAKE_OFF}
        return RightOfWay.LANDING if lands else RightOfWay.NAMED

    def _way(self, fix: Fix) -> _Way:
        pilot, status = self._pilot, self._pilot.status
        mode = "" if status is None else status.mode
        if mode in _LAND_MODES:
            return self._landing(fix)
        if mode in _RETURN_MODES:
            return self._return(fix)
        target = pilot.targets.reported if pilot.targets.tells(pilot.now_us) else None
        towards = None if target is None else IntendedPlace(*target[1:4])
        if mode in MISSION_MODES:
            return self._mission(fix, pilot.item, towards) or _Way(IntentSource.MISSION, (), IntentEnding.OPEN)
        if mode in _TAKE_OFF_MODES:
            source = IntentSource.TAKE_OFF
            return _Way(source, (), IntentEnding.OPEN) if towards is None else _Way(source, (towards,))
        if pilot.diversion is not None and pilot.kept_aside is not None:
            return self._aside(fix, pilot.kept_aside)
        commander = pilot.claims._replace(avoidance="").commander if pilot.control else Commander.NONE
        if commander is Commander.HANDS or (status is not None and not status.guided):
            return _Way(IntentSource.PILOT, (), IntentEnding.OPEN)
        ours = self._ours(fix, commander) if pilot.control else None
        if ours is not None:
            return ours
        if towards is not None and pilot.diversion is None:
            return _Way(IntentSource.STATION, (towards,))
        back = None if pilot.targets.is_ours or pilot.diversion is not None else pilot.others_target()
        if back is not None:
            return _Way(IntentSource.STATION, (IntendedPlace(*back[:3]),))
        stands = hypot(fix.speed_m_s, fix.down_m_s) < _STANDS_M_S
        return _Way(IntentSource.HOVER, (), IntentEnding.HOVER if stands else IntentEnding.OPEN)

    def _ours(self, fix: Fix, commander: Commander) -> _Way | None:
        """The way that this platform has ordered; None: there is none."""
        pilot = self._pilot
        if commander is Commander.ROUTE and pilot.plan is not None:
            legs = _route(pilot.plan, pilot.leg, fix)
            return _Way(IntentSource.ROUTE, legs) if legs else None
        if pilot.standing is not None:
            return self._ordered(fix, pilot.standing, IntentSource.ORDER)
        if commander is not Commander.NONE or pilot.plan is None or not pilot.keeps_plan:
            return None
        if pilot.diversion is None:
            return _Way(IntentSource.HOVER)
        return _Way(IntentSource.ROUTE, (IntendedPlace(*pilot.plan.waypoints[-1]),))

    def _ordered(self, fix: Fix, order: Order, source: IntentSource) -> _Way | None:
        """The way of an order; None: it is one that has none."""
        match order:
            case LandOrder():
                return self._landing(fix)
            case ReturnHomeOrder():
                return self._return(fix)
            case GoToOrder() | InterruptOrder():
                return _Way(source, (IntendedPlace(*order[:3]),))
            case HoldOrder():
                return _Way(IntentSource.HOVER)
        return None

    def _aside(self, fix: Fix, aside: Order | InterruptedMission) -> _Way:
        """The way that it interrupted to make room, and will resume."""
        if isinstance(aside, InterruptedMission):
            towards = None if aside.towards is None else IntendedPlace(*aside.towards[:3])
            return self._mission(fix, aside.item, towards) or _Way(IntentSource.MISSION)
        is_ours = isinstance(aside, ENDINGS) or aside == self._pilot.standing
        source = IntentSource.ORDER if is_ours else IntentSource.STATION
        return self._ordered(fix, aside, source) or _Way(source)

    def _mission(self, fix: Fix, item: int | None, towards: IntendedPlace | None) -> _Way | None:
        """Its mission from that item on; to its target alone where the items are others by now. None: neither is known."""
        ahead = [] if item is None else [each for each in self._pilot.loaded if each.item >= item]
        legs, ending = self._mission_legs(fix, ahead)
        is_flown = bool(legs) and (towards is None or _leads_to(ahead[0], towards))
        if is_flown:
            return _Way(IntentSource.MISSION, legs, ending)
        return None if towards is None else _Way(IntentSource.MISSION, (towards,))

    def _mission_legs(self, fix: Fix, ahead: Sequence[MissionItem]) -> tuple[tuple[IntendedPlace, ...], IntentEnding]:
        """The places of its items as far as `AHEAD_S`, up to an unknown item, and the ending after the last one."""
        legs: list[IntendedPlace] = []
        at, left_m = _place(fix), AHEAD_S * max(self._speeds.level_m_s(self._pilot.cruise), SPEED_M_S)
        ending = IntentEnding.HOVER
        for each in ahead:
            more, ending = self._item_legs(at, each)
            legs += more
            for to in more:
                left_m -= distance_m(at.latitude_deg, at.longitude_deg, to.latitude_deg, to.longitude_deg)
                at = to
            if each.step not in _CONTINUED or left_m < 0.0 or len(legs) >= MOST_LEGS:
                break
        return tuple(legs[:MOST_LEGS]), ending if len(legs) <= MOST_LEGS else IntentEnding.HOVER

    def _item_legs(self, at: IntendedPlace, item: MissionItem) -> tuple[tuple[IntendedPlace, ...], IntentEnding]:
        """The places of one item that begins at `at`, and the ending if it is the last one."""
        to = at
        if item.latitude_deg is not None and item.longitude_deg is not None:
            to = to._replace(latitude_deg=item.latitude_deg, longitude_deg=item.longitude_deg)
        if item.altitude_m is not None:
            to = to._replace(altitude_m=item.altitude_m)
        match item.step:
            case MissionStep.RETURN:
                return self._return_legs(at)
            case MissionStep.LAND:
                return ((self._below(to),) if to == at else (to, self._below(to))), IntentEnding.LAND
            case MissionStep.UNKNOWN:
                return (), IntentEnding.HOVER
        return (to,), IntentEnding.HOVER

    def _landing(self, fix: Fix) -> _Way:
        return _Way(IntentSource.LANDING, (self._below(_place(fix)),), IntentEnding.LAND)

    def _return(self, fix: Fix) -> _Way:
        """Straight home; not known where that is, or where it flies back the way that it came."""
        status = self._pilot.status
        if self._pilot.bounds.home is None or (status is not None and status.mode == _BACKTRACKS):
            return _Way(IntentSource.RETURN, (), IntentEnding.OPEN)
        return _Way(IntentSource.RETURN, *self._return_legs(_place(fix)))

    def _below(self, here: IntendedPlace) -> IntendedPlace:
        """The ground below: that of home, as far as is known."""
        home_m = self._pilot.bounds.home_altitude_m
        ground_m = here.altitude_m - 200.0 if home_m is None else min(home_m, here.altitude_m)
        return here._replace(altitude_m=ground_m)

    def _return_legs(self, here: IntendedPlace) -> tuple[tuple[IntendedPlace, ...], IntentEnding]:
        """Up to the height at which it returns, home, and down, or to the height at which it stays."""
        home, failsafe = self._pilot.bounds.home, self._pilot.failsafe
        if home is None:
            return (), IntentEnding.OPEN
        height_m = RETURN_HEIGHT_M if failsafe is None or failsafe.return_height_m is None else failsafe.return_height_m
        level_m = max(here.altitude_m, home.altitude_m + height_m)
        over = IntendedPlace(home.latitude_deg, home.longitude_deg, level_m)
        final_m = 0.0 if failsafe is None or failsafe.final_height_m is None else failsafe.final_height_m
        ending = IntentEnding.HOVER if final_m > 0.0 else IntentEnding.LAND
        down = over._replace(altitude_m=home.altitude_m + final_m)
        away_m = distance_m(here.latitude_deg, here.longitude_deg, home.latitude_deg, home.longitude_deg)
        if away_m < 3.0:
            return (down,), ending
        climb = () if level_m - here.altitude_m < 1.0 else (here._replace(altitude_m=level_m),)
        return (*climb, over, down), ending

    def _on_lost_link(self, failsafe: FailsafeReport, source: IntentSource) -> LinkLossAction | None:
        status = self._pilot.status
        if source is IntentSource.MISSION:
            return failsafe.in_mission
        return failsafe.in_offboard if status is not None and status.mode == _STREAMED else failsafe.action

    def _contingency(
        self, here: IntendedPlace, source: IntentSource, legs: tuple[IntendedPlace, ...], speed_m_s: float
    ) -> Contingency | None:
        """Its autopilot's way on a lost link, from its place by then; None: it flies its legs to their end."""
        failsafe = self._pilot.failsafe
        if source in {IntentSource.LANDING, IntentSource.RETURN, IntentSource.GROUND}:
            return None
        action = None if failsafe is None else self._on_lost_link(failsafe, source)
        if failsafe is None or action is None or action is LinkLossAction.CARRY_ON:
            several = len(legs) > 1 and source in {IntentSource.ROUTE, IntentSource.MANOEUVRE}
            return Contingency(0.0, legs[:1], IntentEnding.HOVER) if several else None
        delay_s = min(max(0.0, failsafe.delay_s or 0.0), MOST_DELAY_S)
        there = _flown(here, legs, delay_s * speed_m_s)
        match action:
            case LinkLossAction.RETURN:
                return Contingency(delay_s, *self._return_legs(there))
            case LinkLossAction.LAND | LinkLossAction.TERMINATE:
                return Contingency(delay_s, (self._below(there),), IntentEnding.LAND)
        return Contingency(delay_s, (), IntentEnding.HOVER)

    def _made(
        self, fix: Fix, source: IntentSource, rank: RightOfWay, legs: tuple[IntendedPlace, ...], ending: IntentEnding
    ) -> Intent:
        here = _place(fix)
        plan, order, speeds, cruise = self._pilot.plan, self._pilot.standing, self._speeds, self._pilot.cruise
        if source is IntentSource.ROUTE and plan is not None:
            speed = plan.speed_m_s
        elif isinstance(order, GoToOrder) and order.speed_m_s:
            speed = order.speed_m_s
        else:
            speed = speeds.level_m_s(cruise)
        contingency = self._contingency(here, source, legs, fix.speed_m_s)
        return Intent(
            fix.valid_us, *here, fix.north_m_s, fix.east_m_s, fix.down_m_s, source, rank, legs, ending,
            max(0.5, min(MOST_SPEED_M_S, speed)), min(MOST_SPEED_M_S, speeds.climb_m_s(cruise)),
            min(MOST_SPEED_M_S, speeds.descent_m_s(cruise)), contingency=contingency,
        )  # fmt: skip


def _place(fix: Fix) -> IntendedPlace:
    return IntendedPlace(fix.latitude_deg, fix.longitude_deg, fix.altitude_m)


def _flown(here: IntendedPlace, legs: Sequence[IntendedPlace], left_m: float) -> IntendedPlace:
    """Where it is on its legs `left_m` metres farther on; at their end it stands."""
    at = here
    for to in legs:
        leg_m = distance_m(at.latitude_deg, at.longitude_deg, to.latitude_deg, to.longitude_deg)
        if leg_m > left_m:
            share = left_m / leg_m
            east_deg = (to.longitude_deg - at.longitude_deg + 180.0) % 360.0 - 180.0
            return IntendedPlace(
                at.latitude_deg + share * (to.latitude_deg - at.latitude_deg),
                (at.longitude_deg + share * east_deg + 180.0) % 360.0 - 180.0,
                at.altitude_m + share * (to.altitude_m - at.altitude_m),
            )
        at, left_m = to, left_m - leg_m
    return at


def _leads_to(item: MissionItem, towards: IntendedPlace) -> bool:
    """Whether a vehicle that flies the item has that target."""
    if item.step in {MissionStep.LAND, MissionStep.RETURN}:
        return True
    if item.altitude_m is None or abs(item.altitude_m - towards.altitude_m) > _SAME_UP_M:
        return False
    if item.latitude_deg is None or item.longitude_deg is None:
        return True
    return distance_m(item.latitude_deg, item.longitude_deg, *towards[:2]) <= _SAME_M


def _route(plan: FlightPlan, leg: int, fix: Fix) -> tuple[IntendedPlace, ...]:
    """Its places from that leg on, over and over if it is flown so, as far as `AHEAD_S`; none before it begins."""
    if fix.valid_us < plan.start_us:
        return ()
    places = plan.waypoints[leg:]
    while plan.loop and len(plan.waypoints) > 1 and len(places) < MOST_LEGS:
        places += plan.waypoints
    legs: list[IntendedPlace] = []
    left_m, before = AHEAD_S * max(plan.speed_m_s, 1.0), (fix.latitude_deg, fix.longitude_deg)
    for place in places[:MOST_LEGS]:
        legs.append(IntendedPlace(*place))
        left_m -= distance_m(*before, place.latitude_deg, place.longitude_deg)
        before = place.latitude_deg, place.longitude_deg
        if left_m < 0.0:
            break
    return tuple(legs)
