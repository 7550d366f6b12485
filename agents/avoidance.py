"""Who gives way, agreed between two platforms (thesis 9.4.1: "in order to initiate an avoidance maneuver").

Either platform may propose when its warning opens; the higher one climbs, a tie goes to the unit whose name sorts
first. Proposals that cross settle on the one of the unit that sorts first. A partner that refuses or is silent for
a second leaves the whole manoeuvre to the other. Then both hold; when the warning closes the lower one flies on,
the climber waits above until the other is away, and resumes its route.
"""

from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple, TypeAlias

from agents.pilot import Fix
from federation.directory import unit_order

SEPARATION_M = 25.0
AWAY_M = 60.0
PATIENCE_US = 20_000_000


class Role(Enum):
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

    partner: str
    altitude_m: float | None


class Resume(NamedTuple):
    """Fly on, not below this altitude while it is given."""

    partner: str
    raised_to_m: float | None


Step: TypeAlias = Propose | Divert | Resume


@dataclass(slots=True)
class Encounter:
    """One partner, from the warning until both are on their ways again."""

    partner: str
    climber: str
    since_us: int
    role: Role | None = None
    altitude_m: float | None = None
    clear_since_us: int | None = None
    lifted: bool = False


def climber_of(unit: str, own: Fix, partner: str, other: Fix) -> str:
    """The higher one climbs; within a metre, the unit that sorts first."""
    if abs(own.altitude_m - other.altitude_m) > 1.0:
        return unit if own.altitude_m > other.altitude_m else partner
    return min(unit, partner, key=unit_order)


class Avoidance:
    """The encounters of one platform. Times are federation time.

    `commandable` is asked before anything is proposed: a platform that may not command its vehicle leaves the
    manoeuvre to its partner.
    """

    def __init__(self, unit: str) -> None:
        self.unit = unit
        self.encounters: dict[str, Encounter] = {}

    def on_warning(self, partner: str, own: Fix, other: Fix, now_us: int) -> list[Step]:
        """A warning about `partner` opened here."""
        known = self.encounters.get(partner)
        if known is not None:
            known.clear_since_us, known.lifted = None, False
            return self._again(known, own, other)
        climber = climber_of(self.unit, own, partner, other)
        self.encounters[partner] = Encounter(partner, climber, now_us)
        above, below = (own, other) if climber == self.unit else (other, own)
        climb_m = max(0.0, below.altitude_m + SEPARATION_M - above.altitude_m)
        return [Propose(partner, climber, climb_m)]

    def _again(self, known: Encounter, own: Fix, other: Fix) -> list[Step]:
        if known.role is None:
            return []
        return self._take(known, known.role, own, other)

    def on_proposal(self, partner: str, climber: str, own: Fix, other: Fix, now_us: int) -> tuple[bool, list[Step]]:
        """`partner` proposes that `climber` climbs. Returns whether it is accepted, and what to do."""
        known = self.encounters.get(partner)
        waiting = known is not None and known.role is None
        if waiting and known is not None and known.climber != climber and unit_order(self.unit) < unit_order(partner):
            return False, []
        if known is None:
            known = self.encounters[partner] = Encounter(partner, climber, now_us)
        known.climber = climber
        role = Role.CLIMB if climber == self.unit else Role.HOLD
        return True, self._take(known, role, own, other)

    def on_agreed(self, partner: str, own: Fix, other: Fix) -> list[Step]:
        """`partner` accepted our proposal."""
        known = self.encounters.get(partner)
        if known is None or known.role is not None:
            return []
        return self._take(known, Role.CLIMB if known.climber == self.unit else Role.HOLD, own, other)

    def on_declined(self, partner: str, own: Fix, other: Fix, lowest_m: float) -> list[Step]:
        """`partner` refused, or was silent: the whole manoeuvre is ours."""
        known = self.encounters.get(partner)
        if known is None or (known.role is not None and known.role is not Role.HOLD):
            return []
        below = own.altitude_m < other.altitude_m - 5.0 and other.altitude_m - SEPARATION_M >= lowest_m
        return self._take(known, Role.DESCEND if below else Role.CLIMB, own, other)

    def _take(self, known: Encounter, role: Role, own: Fix, other: Fix) -> list[Step]:
        """Adopt `role`. The climb is counted from the higher of the two, so that both bounds of the warning clear."""
        known.role = role
        if role is Role.HOLD:
            altitude_m = None
        elif role is Role.CLIMB:
            altitude_m = max(own.altitude_m, other.altitude_m + SEPARATION_M, known.altitude_m or own.altitude_m)
        else:
            altitude_m = min(own.altitude_m, other.altitude_m - SEPARATION_M)
        known.altitude_m = altitude_m
        return [Divert(known.partner, altitude_m)]

    def on_clear(self, partner: str, now_us: int) -> list[Step]:
        """The warning about `partner` closed here: the lower one goes first."""
        known = self.encounters.get(partner)
        if known is None:
            return []
        if known.role in {None, Role.HOLD}:
            del self.encounters[partner]
            return [] if self._busy() else [Resume(partner, self._raised())]
        known.clear_since_us = now_us
        return []

    def on_range(self, partner: str, distance_m: float, now_us: int) -> list[Step]:
        """How far away, horizontally, `partner` is now. Ends the climber's wait."""
        known = self.encounters.get(partner)
        if known is None or known.clear_since_us is None:
            return []
        if distance_m >= AWAY_M:
            del self.encounters[partner]
            return [] if self._busy() else [Resume(partner, self._raised())]
        if not known.lifted and now_us >= known.clear_since_us + PATIENCE_US:
            known.lifted = True
            return [] if self._busy() else [Resume(partner, self._raised())]
        return []

    def on_gone(self, partner: str) -> list[Step]:
        """`partner` left the federation: nothing more is known of it, fly on."""
        known = self.encounters.pop(partner, None)
        if known is None or known.role is None or self._busy():
            return []
        return [Resume(partner, self._raised())]

    def _busy(self) -> bool:
        """Whether some encounter still keeps the vehicle where it is."""
        return any(e.role is not None and not e.lifted for e in self.encounters.values())

    def _raised(self) -> float | None:
        return max((e.altitude_m for e in self.encounters.values() if e.altitude_m is not None), default=None)
