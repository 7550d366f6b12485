"""Of three in one place each takes a level of its own: one climbs, one stays, one descends; none climbs twice as high.

A platform that gives way to one makes room for the next as well, as it has begun: the one that climbs stays above all, the
one that stays below a climber descends. Only if there is no room below does it climb above the one that climbs.
"""

from collections.abc import Collection, Mapping

from agents.flight.encounters import Divert, Encounter, EncounterPhase, ManoeuvreRole, ResumeRoute, climber_of, room_m
from agents.flight.places import Fix
from federation.members.directory import unit_order

CLIMB, DESCEND, HOLD, ASIDE = ManoeuvreRole
_RANK = {None: 0, ASIDE: 0, HOLD: 1, CLIMB: 2, DESCEND: 2}
_CODE = "level-"
SEPARATION_M = 22.0
"""How far apart vertically one goes: where the warning ends (20 m), and what altimeters and autopilots may be off."""
LOWER_M = 2.0
"""One that is so much lower has less far to go down than up; copters climb faster than they sink."""


def mover(unit: str, level: ManoeuvreRole | None, partner: str, their_level: ManoeuvreRole | None) -> str | None:
    """Which of the two makes room vertically, by what each does for others; None: either may."""
    mine, theirs = _RANK[level], _RANK[their_level]
    if mine != theirs:
        return unit if mine > theirs else partner
    if mine < _RANK[CLIMB]:
        return None
    if level is not their_level:
        return unit if level is CLIMB else partner
    return max(unit, partner, key=unit_order)


def proposed_mover(unit: str, known: Encounter, own: Fix, other: Fix, level: ManoeuvreRole | None) -> str:
    """Which of the two has to make room: the bound one, else the higher one, or, of two that hold, the lower one."""
    bound = mover(unit, level, known.partner, known.their_level)
    if bound is None:
        return climber_of(unit, own, known.partner, other)
    if level is HOLD and known.proposed == 0:  # whether the partner holds for another as well, its answer says
        return climber_of(unit, other, known.partner, own)
    return bound


def ways(
    level: ManoeuvreRole | None, their_level: ManoeuvreRole | None, lower_m: float = 0.0
) -> tuple[ManoeuvreRole, ...]:
    """How one that is to make room does so, the best first; `lower_m`: how much lower than the other it is."""
    if level is None or level is ASIDE:
        return (DESCEND, CLIMB) if lower_m >= LOWER_M else (CLIMB,)
    if level is CLIMB:
        return (DESCEND, CLIMB) if their_level is CLIMB else (CLIMB,)
    return (DESCEND, CLIMB)


def code_of(level: ManoeuvreRole | None) -> str:
    """The code of a refusal by one at that level: it makes the room, or the other does."""
    return _CODE + ("" if level is None else level.value)


def level_of(code: str) -> ManoeuvreRole | None:
    """What a code, or the word in a proposal, says of the other's level; None: none."""
    word = code.removeprefix(_CODE)
    return next((role for role in (CLIMB, DESCEND, HOLD) if role.value == word), None)


def is_of_level(code: str) -> bool:
    return code.startswith(_CODE)


def level_among(encounters: Mapping[str, Encounter], known: Encounter) -> ManoeuvreRole | None:
    """What this side does in other encounters than `known`."""
    roles = {each.role for each in encounters.values() if each is not known}
    return next((role for role in (CLIMB, DESCEND, HOLD) if role in roles), None)


def turn(encounters: Mapping[str, Encounter], known: Encounter) -> None:
    """Descend in the other encounters as well: one vehicle cannot climb for one partner and descend for another."""
    for each in encounters.values():
        if each is not known and each.role is CLIMB and each.keeps:
            each.role, each.altitude_m = DESCEND, room_m(DESCEND, each.start, each.other, SEPARATION_M)


def together(encounters: Collection[Encounter]) -> Divert | ResumeRoute:
    """What all encounters together want of the vehicle: the highest climb, else the lowest descent; else to fly on."""
    keeping = [each for each in encounters if each.keeps]
    if not keeping:
        passing = [each for each in encounters if each.phase is EncounterPhase.PASSING]
        raised = [each.altitude_m for each in passing if each.is_above and each.altitude_m is not None]
        lowered = [each.altitude_m for each in passing if not each.is_above and each.altitude_m is not None]
        return ResumeRoute(max(raised, default=None), min(lowered, default=None))
    climbs = [each.altitude_m for each in keeping if each.role is CLIMB and each.altitude_m is not None]
    descents = [each.altitude_m for each in keeping if each.role is DESCEND and each.altitude_m is not None]
    places = [each for each in keeping if each.place is not None]
    first = min(places, key=lambda each: each.since_us, default=None)
    return Divert(max(climbs, default=min(descents, default=None)), None if first is None else first.place)
