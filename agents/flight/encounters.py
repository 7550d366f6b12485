"""What two vehicles that meet look like to one of them: whether they converge, where it can stop, how far apart they are.

Plain geometry on fixes: metres, seconds, north-east-down. Nothing here decides; `agents.flight.avoidance` does.
"""

from dataclasses import dataclass, field
from enum import Enum
from math import hypot, sqrt
from typing import NamedTuple, TypeAlias

from agents.flight.places import Fix
from federation.members.directory import unit_order
from navigation.geodesy import LocalFrame
from navigation.vehicle import stopping_distance_m
from reasoning.features.proximity import closest_approach, offset_m

HORIZON_S = 10.0
MISS_M, MISS_Z_M = 20.0, 15.0
NEAR_M, NEAR_Z_M = 60.0, 20.0
CONVERGING_M_S = 1.0
CLEAR_M = 20.0
SOON_S = 5.0
KEEP_M = 45.0
"""How near, horizontally, a vehicle that climbs on its way comes to the other before it is above it."""
ASIDE_M = 40.0
RISING_M_S = 2.0
"""How fast a vehicle is taken to climb or sink when the place where it has done so is chosen."""
AWAY_M, NOT_YET_AWAY_M, AWAY_IN_S = 60.0, 25.0, 5.0
"""Away: so far, or that in a moment; before it has come down by 10 m."""
OPENING_US = 1_000_000
OPENING_ANYWAY_US = 15_000_000
IDLE_US, IDLE_M = 10_000_000, 30.0
"""Two that have not made for each other for so long, and are so far apart, need no more room."""
LEAP_M_S, LEAP_M = 12.0, 6.0
"""An altitude that changes faster, beyond noise, is not believed."""
FLIGHT_M_S, FLIGHT_M = 150.0, 50.0
"""A place that changes faster than a vehicle flies, beyond what a filter that starts again corrects, is not believed."""


class ManoeuvreRole(Enum):
    """What one side of a manoeuvre does."""

    CLIMB = "climb"
    DESCEND = "descend"
    HOLD = "hold"
    ASIDE = "go aside"


class EncounterPhase(Enum):
    """How far an encounter has come; see `agents.flight.avoidance`."""

    ASKED = "asked"
    MAKING_ROOM = "making room"
    PASSING = "passing"
    LEFT = "left to the partner"


@dataclass(slots=True)
class Encounter:
    """One partner, from the warning until both are on their ways again. Times are the node clock.

    Attributes:
        climber: of the two, as proposed or agreed.
        start, other: where this side was when it began, and where the partner was seen last.
        role: what this side does; None until that is agreed, and after it was left to the partner.
        alone, takes_all: the partner neither climbs nor holds for us; and has reported that.
        altitude_m: where this side goes, or, once it flies on, the bound of its route.
        place: where it stops, WGS-84 degrees.
        gap_m, level_m: how far apart vertically they were when this side began to make room, at `since_us`, and at which
            altitude the partner was.
        opening_since_us, idle_since_us: since when without a break they move apart, or do not converge; None: they do not.
        failed: what our autopilot does not fly, and why.
        lost: nothing has been heard of the partner for a while.
        awaited: a proposal of ours is not answered yet; proposed: how many of them there were.
        their_level: what the partner does for another, in its own words.
        left_because, theirs: why the partner is to take all of it, and why it cannot.
    """

    partner: str
    climber: str
    start: Fix
    other: Fix
    other_start: Fix
    asked_us: int
    phase: EncounterPhase = EncounterPhase.ASKED
    role: ManoeuvreRole | None = None
    alone: bool = False
    takes_all: bool = False
    altitude_m: float | None = None
    place: tuple[float, float] | None = None
    since_us: int = 0
    gap_m: float = 0.0
    level_m: float = 0.0
    opening_since_us: int | None = None
    idle_since_us: int | None = None
    failed: dict[ManoeuvreRole, str] = field(default_factory=dict)
    lost: bool = False
    awaited: bool = False
    proposed: int = 0
    their_level: ManoeuvreRole | None = None
    left_because: str = ""
    theirs: str = ""

    @property
    def keeps(self) -> bool:
        """Whether it keeps the vehicle from its route."""
        return self.phase is EncounterPhase.MAKING_ROOM

    @property
    def is_above(self) -> bool:
        """Whether this side is to stay above the partner."""
        if self.role in {ManoeuvreRole.CLIMB, ManoeuvreRole.DESCEND}:
            return self.role is ManoeuvreRole.CLIMB
        return self.start.altitude_m > self.other.altitude_m


class Relation(NamedTuple):
    """The partner relative to us: metres and metres per second, north-east-down."""

    p_m: tuple[float, float, float]
    v_m_s: tuple[float, float, float]

    @property
    def away_m(self) -> float:
        return hypot(self.p_m[0], self.p_m[1])

    @property
    def apart_m(self) -> float:
        """Vertically."""
        return abs(self.p_m[2])

    @property
    def opening_m_s(self) -> float:
        """How fast the horizontal distance grows; 0 at no distance."""
        away_m = self.away_m
        return 0.0 if away_m == 0.0 else (self.p_m[0] * self.v_m_s[0] + self.p_m[1] * self.v_m_s[1]) / away_m


def relation(own: Fix, other: Fix) -> Relation:
    north_m, east_m = offset_m((own.latitude_deg, own.longitude_deg), (other.latitude_deg, other.longitude_deg))
    return Relation(
        (north_m, east_m, own.altitude_m - other.altitude_m),
        (other.north_m_s - own.north_m_s, other.east_m_s - own.east_m_s, other.down_m_s - own.down_m_s),
    )


def stands(fix: Fix) -> bool:
    """Whether it moves no more than a vehicle on the ground seems to."""
    return fix.speed_m_s < CONVERGING_M_S and abs(fix.down_m_s) < CONVERGING_M_S


def with_course_of(fix: Fix, course: Fix) -> Fix:
    """There, moving horizontally as then: where it wants to go, whatever its brakes do."""
    return fix._replace(north_m_s=course.north_m_s, east_m_s=course.east_m_s, down_m_s=0.0)


def converge(own: Fix, other: Fix, slack: float = 0.0) -> bool:
    """Whether the two are about to meet: near and closing, or too close within the horizon.

    `slack` widens every threshold by that part: what one platform sees the other is believed to see.
    """
    seen, wider = relation(own, other), 1.0 + slack
    closest = closest_approach(seen.p_m, seen.v_m_s)
    closing = -seen.opening_m_s >= CONVERGING_M_S * (1.0 - slack)
    if seen.away_m < NEAR_M * wider and seen.apart_m < NEAR_Z_M * wider and closing:
        return True
    moves = hypot(*seen.v_m_s) >= CONVERGING_M_S * (1.0 - slack)
    soon = 0.0 < closest.time_s <= HORIZON_S * wider
    return moves and soon and closest.xy_m < MISS_M * wider and closest.z_m < MISS_Z_M * wider


def climber_of(unit: str, own: Fix, partner: str, other: Fix) -> str:
    """The higher one climbs; within a metre, the unit that sorts first."""
    if abs(own.altitude_m - other.altitude_m) > 1.0:
        return unit if own.altitude_m > other.altitude_m else partner
    return min(unit, partner, key=unit_order)


def leaps(before: Fix, after: Fix) -> bool:
    """Whether no aircraft can have changed its altitude, or its place, so fast."""
    seconds = max(0.0, (after.valid_us - before.valid_us) / 1e6)
    far_m = hypot(*offset_m((before.latitude_deg, before.longitude_deg), (after.latitude_deg, after.longitude_deg)))
    climbs = abs(after.altitude_m - before.altitude_m) > LEAP_M + LEAP_M_S * seconds
    return climbs or far_m > FLIGHT_M + FLIGHT_M_S * seconds


def room_made_m(known: Encounter, seen: Relation, own: Fix, other: Fix) -> float:
    """How far apart vertically they are; for one that holds as far as they will be, as they move, when they are near."""
    up_m, up_m_s = seen.p_m[2], seen.v_m_s[2]
    apart_m_s = up_m_s if up_m >= 0.0 else -up_m_s
    if known.role is not ManoeuvreRole.HOLD or apart_m_s < CONVERGING_M_S:
        return seen.apart_m
    closing_m_s = -relation(with_course_of(own, known.start), with_course_of(other, known.other_start)).opening_m_s
    keep_m = MISS_M + max(braking_m(own), braking_m(known.start))  # so that it can stop still
    near_s = max(0.0, (seen.away_m - keep_m) / max(closing_m_s, CONVERGING_M_S))
    return seen.apart_m + apart_m_s * (min(near_s, SOON_S) + start_s(own, known.start))


def start_s(own: Fix, course: Fix) -> float:
    """How much later it arrives, since it has to gain the speed of its course first: as much as braking takes."""
    speed_m_s = course.speed_m_s
    return max(0.0, braking_m(course) - braking_m(own)) / max(speed_m_s, CONVERGING_M_S)


def is_over(known: Encounter, seen: Relation, own: Fix, other: Fix, now_us: int) -> bool:
    """Away from each other, as they fly and as they want to; or for long neither makes for the other."""
    opening = seen.opening_m_s >= CONVERGING_M_S
    known.opening_since_us = (known.opening_since_us or now_us) if opening else None
    closing = converge(own, other) if known.phase is EncounterPhase.LEFT else seen.opening_m_s <= -CONVERGING_M_S
    known.idle_since_us = None if closing else known.idle_since_us or now_us
    if not known.keeps and known.idle_since_us is not None and now_us >= known.idle_since_us + IDLE_US:
        return known.phase is EncounterPhase.LEFT or known.lost or seen.away_m >= IDLE_M
    soon_m = seen.away_m + AWAY_IN_S * seen.opening_m_s
    if known.opening_since_us is None or seen.away_m < NOT_YET_AWAY_M or soon_m < AWAY_M:
        return False
    wants = relation(with_course_of(own, known.start), with_course_of(other, known.other_start))
    wanted = wants.opening_m_s >= CONVERGING_M_S
    return now_us >= known.opening_since_us + (OPENING_US if wanted else OPENING_ANYWAY_US)


# -- where to stop ---------------------------------------------------------------------------------------------------


def braking_m(fix: Fix) -> float:
    """How far it flies on until it stands. A nearer point would be overshot, and flown back to."""
    return stopping_distance_m(fix.speed_m_s)


def ahead(fix: Fix, metres: float, right_m: float = 0.0) -> tuple[float, float] | None:
    """The place so far along its course and to the right of it, WGS-84 degrees; None: it hardly moves, and stays."""
    speed_m_s = fix.speed_m_s
    if speed_m_s < CONVERGING_M_S:
        return None
    north, east = fix.north_m_s / speed_m_s, fix.east_m_s / speed_m_s
    frame = LocalFrame(fix.latitude_deg, fix.longitude_deg, fix.altitude_m)
    latitude_deg, longitude_deg, _ = frame.from_ned(
        north * metres - east * right_m, east * metres + north * right_m, 0.0
    )
    return latitude_deg, longitude_deg


def flees(own: Fix, other: Fix) -> bool:
    """Whether `own` flies away from `other`, which comes from behind: to stop would be in its way."""
    seen, speed_m_s = relation(own, other), own.speed_m_s
    towards_m_s = (seen.p_m[0] * own.north_m_s + seen.p_m[1] * own.east_m_s) / max(seen.away_m, 1e-9)
    return speed_m_s >= CONVERGING_M_S and towards_m_s <= -0.5 * speed_m_s


def run_m(own: Fix, other: Fix, climb_m: float) -> float:
    """How far to fly on while climbing: never nearer than `KEEP_M` to a partner that brakes and holds, or flies ahead."""
    speed_m_s = own.speed_m_s
    least_m = braking_m(own)
    if speed_m_s < CONVERGING_M_S:
        return 0.0
    wanted_m = speed_m_s * climb_m / RISING_M_S
    stop = ahead(other, other.speed_m_s * climb_m / RISING_M_S if flees(other, own) else braking_m(other))
    held = other if stop is None else other._replace(latitude_deg=stop[0], longitude_deg=stop[1])
    p_north_m, p_east_m, _ = relation(own, held).p_m
    north, east = own.north_m_s / speed_m_s, own.east_m_s / speed_m_s
    along_m, across_m = p_north_m * north + p_east_m * east, abs(p_east_m * north - p_north_m * east)
    if along_m <= 0.0 or across_m >= KEEP_M:
        return max(least_m, wanted_m)
    return max(least_m, min(wanted_m, along_m - sqrt(KEEP_M * KEEP_M - across_m * across_m)))


def aside(own: Fix, other: Fix) -> tuple[float, float] | None:
    """A place next to the course of the partner, on the side where we are; None: neither moves, or it is there."""
    seen = relation(own, other)
    speed_m_s = other.speed_m_s
    if speed_m_s < CONVERGING_M_S:
        return ahead(own, braking_m(own), ASIDE_M)
    north, east = other.north_m_s / speed_m_s, other.east_m_s / speed_m_s
    right_m = -(seen.p_m[1] * north - seen.p_m[0] * east)
    side = -1.0 if right_m < 0.0 else 1.0
    step_m = max(0.0, ASIDE_M - abs(right_m)) * side
    frame = LocalFrame(own.latitude_deg, own.longitude_deg, own.altitude_m)
    latitude_deg, longitude_deg, _ = frame.from_ned(-east * step_m, north * step_m, 0.0)
    return latitude_deg, longitude_deg


def room_m(role: ManoeuvreRole, own: Fix, other: Fix, separation_m: float) -> float:
    """The altitude at which one that climbs, or descends, is so far apart from the other."""
    if role is ManoeuvreRole.CLIMB:
        return max(own.altitude_m, other.altitude_m + separation_m)
    return min(own.altitude_m, other.altitude_m - separation_m)


# -- what avoidance asks for: proposals to the partner, a diversion, the way back, an alarm ---------------------------


class Propose(NamedTuple):
    """Ask `partner` to agree that `climber` climbs while the other holds; `level`: what this side does for another."""

    partner: str
    climber: str
    climb_m: float
    level: ManoeuvreRole | None = None


class LeaveToPartner(NamedTuple):
    """Ask `partner` to take the whole manoeuvre, since we cannot, and why."""

    partner: str
    reason: str


class Divert(NamedTuple):
    """Stop, at this altitude (metres above mean sea level) or the present one; at that place, or here."""

    altitude_m: float | None
    place: tuple[float, float] | None = None


class ResumeRoute(NamedTuple):
    """Fly on; not below `raised_to_m` nor above `lowered_to_m` while these are given."""

    raised_to_m: float | None = None
    lowered_to_m: float | None = None


class NeitherCan(NamedTuple):
    """Neither of the two avoids the other, and why (ours, theirs)."""

    partner: str
    reasons: tuple[str, str]


class Over(NamedTuple):
    """The encounter with `partner` is over."""

    partner: str


Step: TypeAlias = Propose | LeaveToPartner | Divert | ResumeRoute | NeitherCan | Over
