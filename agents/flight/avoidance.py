"""Giving way, agreed between two platforms (thesis 9.4.1: "in order to initiate an avoidance maneuver").

Either platform may propose when its warning opens; the higher one climbs, a tie goes to the unit whose name sorts
first. Proposals that cross settle on the one of the unit that sorts first. A partner that refuses or is silent leaves
the whole manoeuvre to the other.

What was agreed is carried to its end, however the warning flickers while both brake: both hold until they are apart
vertically, then fly on, the climber above until the other is away; no one waits for ever.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from math import hypot
from typing import NamedTuple, TypeAlias

from agents.flight.places import Fix
from dyknow.model.errors import Refused
from federation.members.directory import unit_order
from navigation.geodesy import distance_m

SEPARATION_M = 25.0
CLEAR_M = 20.0
AWAY_M = 60.0
DIVERGING_M_S = 1.0
DIVERGING_US = 3_000_000
PATIENCE_US = 20_000_000
AGAIN_US = 2_500_000
KNOWN_US = 2_500_000
FOLLOW_M = 5.0
CLIMBING_M_S = 0.5

May: TypeAlias = Callable[[float | None], str | None]
"""The rule that forbids stopping at an altitude (metres above mean sea level; None: where it is), or None."""


class ManoeuvreRole(Enum):
    """What one side of a manoeuvre does."""

    CLIMB = "climb"
    DESCEND = "descend"
    HOLD = "hold"


class Propose(NamedTuple):
    """Ask `partner` to agree that `climber` climbs while the other holds."""

    partner: str
    climber: str
    climb_m: float


class Divert(NamedTuple):
    """Stop, at this altitude (metres above mean sea level) or where it is."""

    altitude_m: float | None


class ResumeRoute(NamedTuple):
    """Fly on; not below `raised_to_m` nor above `lowered_to_m` while these are given."""

    raised_to_m: float | None = None
    lowered_to_m: float | None = None


Step: TypeAlias = Propose | Divert | ResumeRoute


@dataclass(slots=True)
class Encounter:
    """One partner, from the warning until both are on their ways again. Times are the node clock.

    Attributes:
        role: what this side does; None until that is agreed.
        awaited: whether a proposal of ours is not answered yet.
        clear_since_us, diverging_since_us: since when without a break, or None.
        lifted: this side flies on, above (or below) the other.
    """

    partner: str
    climber: str
    asked_us: int
    role: ManoeuvreRole | None = None
    altitude_m: float | None = None
    awaited: bool = False
    clear_since_us: int | None = None
    diverging_since_us: int | None = None
    lifted: bool = False

    @property
    def keeps(self) -> bool:
        """Whether it keeps the vehicle from its route."""
        return self.role is not None and not self.lifted


def climber_of(unit: str, own: Fix, partner: str, other: Fix) -> str:
    """The higher one climbs; within a metre, the unit that sorts first."""
    if abs(own.altitude_m - other.altitude_m) > 1.0:
        return unit if own.altitude_m > other.altitude_m else partner
    return min(unit, partner, key=unit_order)


class Avoidance:
    """The encounters of one platform.

    Every step returns what to do now. `may` is called before anything is promised or done.
    """

    def __init__(self, unit: str) -> None:
        self.unit = unit
        self.encounters: dict[str, Encounter] = {}
        self._order: Divert | ResumeRoute = ResumeRoute()

    # -- agreeing ----------------------------------------------------------------------------------------------

    def on_warning(self, partner: str, own: Fix, other: Fix, may: May, now_us: int) -> list[Step]:
        """A warning about `partner` opened here."""
        known = self.encounters.get(partner)
        if known is not None:
            known.clear_since_us, known.lifted = None, False
            return self._settled()
        known = self.encounters[partner] = Encounter(partner, self.unit, now_us)
        return [self._propose(known, own, other, may, now_us)]

    def _propose(self, known: Encounter, own: Fix, other: Fix, may: May, now_us: int) -> Propose:
        known.climber = climber_of(self.unit, own, known.partner, other)
        if known.climber == self.unit and may(_above(own, other)) is not None:
            known.climber = known.partner
        known.awaited, known.asked_us = True, now_us
        above, below = (own, other) if known.climber == self.unit else (other, own)
        return Propose(known.partner, known.climber, max(0.0, below.altitude_m + SEPARATION_M - above.altitude_m))

    def on_proposal(
        self, partner: str, climber: str, own: Fix, other: Fix, may: May, now_us: int
    ) -> tuple[Refused | None, list[Step]]:
        """`partner` proposes that `climber` climbs. Returns why that is refused, or None, and what to do."""
        known = self.encounters.get(partner)
        crossed = known is not None and known.awaited and known.climber != climber
        if crossed and unit_order(self.unit) < unit_order(partner):
            return Refused("superseded by the proposal of ours that crossed this one", "superseded"), []
        role = ManoeuvreRole.CLIMB if climber == self.unit else ManoeuvreRole.HOLD
        reason = may(_above(own, other) if role is ManoeuvreRole.CLIMB else None)
        if reason is not None:
            return Refused(reason), []
        if known is None:
            known = self.encounters[partner] = Encounter(partner, climber, now_us, clear_since_us=now_us)
        known.climber = climber
        return None, self._take(known, role, own, other)

    def on_agreed(self, partner: str, own: Fix, other: Fix, may: May) -> list[Step]:
        """`partner` accepted our proposal."""
        known = self.encounters.get(partner)
        if known is None or not known.awaited:
            return []
        known.awaited = False
        if known.role is not None:
            return []
        if known.climber != self.unit:
            return self._take(known, ManoeuvreRole.HOLD, own, other)
        return self._alone(known, own, other, may, ManoeuvreRole.CLIMB, ManoeuvreRole.DESCEND)

    def awaits(self, partner: str) -> bool:
        """Whether `partner` has not answered our proposal yet."""
        known = self.encounters.get(partner)
        return known is not None and known.awaited

    def on_superseded(self, partner: str) -> None:
        """`partner` has made a proposal of its own, which goes first: it is under way, or made again."""
        known = self.encounters.get(partner)
        if known is not None:
            known.awaited = False

    def on_declined(self, partner: str, own: Fix, other: Fix, may: May) -> list[Step]:
        """`partner` refused, or was silent: the whole manoeuvre is ours, unless it has proposed one meanwhile."""
        known = self.encounters.get(partner)
        if known is None or not known.awaited:
            return []
        known.awaited = False
        if known.role is not None:
            return []
        if own.altitude_m < other.altitude_m - FOLLOW_M:
            return self._alone(known, own, other, may, ManoeuvreRole.DESCEND, ManoeuvreRole.CLIMB)
        return self._alone(known, own, other, may, ManoeuvreRole.CLIMB, ManoeuvreRole.DESCEND)

    def _alone(self, known: Encounter, own: Fix, other: Fix, may: May, *roles: ManoeuvreRole) -> list[Step]:
        """The first of the roles that the rules allow; else hold."""
        for role in roles:
            if may(_above(own, other) if role is ManoeuvreRole.CLIMB else _below(own, other)) is None:
                return self._take(known, role, own, other)
        return self._take(known, ManoeuvreRole.HOLD, own, other)

    def _take(self, known: Encounter, role: ManoeuvreRole, own: Fix, other: Fix) -> list[Step]:
        known.role = role
        if role is ManoeuvreRole.CLIMB:
            known.altitude_m = _above(own, other)
        else:
            known.altitude_m = _below(own, other) if role is ManoeuvreRole.DESCEND else None
        return self._settled()

    # -- carrying out, and ending ------------------------------------------------------------------------------

    def on_moved(self, partner: str, own: Fix, other: Fix | None, may: May, now_us: int, *, warned: bool) -> list[Step]:
        """Positions have changed. `warned`: the warning about `partner` is open here."""
        known = self.encounters.get(partner)
        if known is None:
            return []
        if warned:
            known.clear_since_us, known.lifted = None, False
        elif known.clear_since_us is None:
            known.clear_since_us = now_us
        if other is None or own.valid_us - other.valid_us > KNOWN_US:
            return [] if warned else self._end(known)
        if known.role is None:
            return self._not_agreed(known, own, other, may, now_us, warned=warned)
        self._follow(known, own, other, may)
        away_m = distance_m(own.latitude_deg, own.longitude_deg, other.latitude_deg, other.longitude_deg)
        if opening_m_s(own, other) < DIVERGING_M_S:
            known.diverging_since_us = None
        elif known.diverging_since_us is None:
            known.diverging_since_us = now_us
        if not warned:
            self._see_whether_over(known, away_m, abs(own.altitude_m - other.altitude_m), now_us)
        return self._settled()

    def _not_agreed(self, known: Encounter, own: Fix, other: Fix, may: May, now_us: int, *, warned: bool) -> list[Step]:
        if known.awaited:
            return []
        if not warned:
            return self._end(known)
        return [self._propose(known, own, other, may, now_us)] if now_us >= known.asked_us + AGAIN_US else []

    def _see_whether_over(self, known: Encounter, away_m: float, apart_m: float, now_us: int) -> None:
        diverging_us = 0 if known.diverging_since_us is None else now_us - known.diverging_since_us
        patient = known.clear_since_us is not None and now_us < known.clear_since_us + PATIENCE_US
        is_away = away_m >= AWAY_M and diverging_us >= DIVERGING_US
        if is_away or (known.role is ManoeuvreRole.HOLD and apart_m >= CLEAR_M):
            del self.encounters[known.partner]
        elif apart_m >= CLEAR_M:
            known.lifted = True
        elif not patient and not known.lifted:
            del self.encounters[known.partner]

    def _follow(self, known: Encounter, own: Fix, other: Fix, may: May) -> None:
        """Stay clear of a partner that rises or sinks itself; of two that climb, one stops."""
        if known.role is ManoeuvreRole.CLIMB and known.altitude_m is not None:
            rises = other.down_m_s < -CLIMBING_M_S and abs(own.altitude_m - other.altitude_m) < CLEAR_M
            wanted_m = other.altitude_m + SEPARATION_M
            if rises and climber_of(self.unit, own, known.partner, other) != self.unit:
                known.role, known.altitude_m = ManoeuvreRole.HOLD, None
            elif wanted_m > known.altitude_m + FOLLOW_M and may(wanted_m) is None:
                known.altitude_m = wanted_m
        elif known.role is ManoeuvreRole.DESCEND and known.altitude_m is not None:
            wanted_m = other.altitude_m - SEPARATION_M
            if wanted_m < known.altitude_m - FOLLOW_M and may(wanted_m) is None:
                known.altitude_m = wanted_m

    def on_gone(self, partner: str) -> list[Step]:
        """`partner` left the federation: nothing more is known of it, fly on."""
        known = self.encounters.get(partner)
        return [] if known is None else self._end(known)

    def forget_order(self) -> None:
        """What was to be done was not done: it is to be ordered again when something changes."""
        self._order = ResumeRoute()

    def _end(self, known: Encounter) -> list[Step]:
        del self.encounters[known.partner]
        return self._settled()

    def _settled(self) -> list[Step]:
        """What all encounters together want of the vehicle, if that is something else than before."""
        keeping = [e for e in self.encounters.values() if e.keeps]
        free = [e for e in self.encounters.values() if e.lifted]
        order: Divert | ResumeRoute
        if keeping:
            climb_m, descend_m = _highest(keeping), _lowest(keeping)
            order = Divert(descend_m if climb_m is None else climb_m)
        else:
            order = ResumeRoute(_highest(free), _lowest(free))
        if order == self._order:
            return []
        self._order = order
        return [order]


def opening_m_s(own: Fix, other: Fix) -> float:
    """How fast the horizontal distance grows; 0 at no distance."""
    north_m = distance_m(own.latitude_deg, own.longitude_deg, other.latitude_deg, own.longitude_deg)
    east_m = distance_m(own.latitude_deg, own.longitude_deg, own.latitude_deg, other.longitude_deg)
    north_m = north_m if other.latitude_deg >= own.latitude_deg else -north_m
    east_m = east_m if other.longitude_deg >= own.longitude_deg else -east_m
    away_m = hypot(north_m, east_m)
    if away_m == 0.0:
        return 0.0
    return (north_m * (other.north_m_s - own.north_m_s) + east_m * (other.east_m_s - own.east_m_s)) / away_m


def _above(own: Fix, other: Fix) -> float:
    return max(own.altitude_m, other.altitude_m + SEPARATION_M)


def _below(own: Fix, other: Fix) -> float:
    return min(own.altitude_m, other.altitude_m - SEPARATION_M)


def _highest(encounters: list[Encounter]) -> float | None:
    climbs = [e.altitude_m for e in encounters if e.role is ManoeuvreRole.CLIMB and e.altitude_m is not None]
    return max(climbs, default=None)


def _lowest(encounters: list[Encounter]) -> float | None:
    descents = [e.altitude_m for e in encounters if e.role is ManoeuvreRole.DESCEND and e.altitude_m is not None]
    return min(descents, default=None)
