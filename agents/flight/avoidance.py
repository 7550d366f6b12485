"""Giving way, agreed between two platforms (thesis 9.4.1: "in order to initiate an avoidance maneuver").

Either platform may propose when its warning is open and the two converge; the higher one climbs, a tie goes to the unit
whose name sorts first. Proposals that cross settle on the one of the unit that sorts first. A partner that refuses or is
silent leaves the whole manoeuvre to the other; a vehicle that does not fly its part leaves it to the partner, after it has
tried the other way. Where neither can, that is an alarm, and neither is left holding in the other's way.

The phases of an encounter are in ARCHITECTURE.md; what each of three does is in `agents.flight.levels`.

One crossing is one manoeuvre: what brakes do (overshoot, drift back) ends nothing, since both are judged by where they
wanted to go. A silent partner is taken to stand where it was last.
"""

from collections.abc import Callable
from typing import TypeAlias

from agents.flight import levels
from agents.flight.encounters import (
    CLEAR_M,
    IDLE_M,
    Divert,
    Encounter,
    EncounterPhase,
    LeaveToPartner,
    ManoeuvreRole,
    NeitherCan,
    Over,
    Propose,
    Relation,
    ResumeRoute,
    Step,
    ahead,
    aside,
    braking_m,
    climber_of,
    converge,
    flees,
    is_over,
    leaps,
    relation,
    room_m,
    room_made_m,
    run_m,
)
from agents.flight.evidence import Evidence
from agents.flight.places import Fix
from dyknow.model.errors import Refused
from federation.members.directory import unit_order

CLOSE_M = 15.0
MOST_CLIMB_M = 60.0
"""No encounter takes a vehicle farther than that from the altitude at which it began."""
PATIENCE_US = 40_000_000
UNMOVED_US, UNMOVED_M = 5_000_000, 2.0
"""A platform that holds for a partner that has not moved apart by so much after that time takes the manoeuvre itself."""
AGAIN_US = 2_500_000
KNOWN_US = 2_500_000
FOLLOW_M = 5.0
MOST_ASKED = 4
WOULD_HOLD = "would-hold"
"""The code of a refusal to climb by one that holds if the other climbs."""
CLIMBING_M_S = 0.5

CLIMB, DESCEND, HOLD, ASIDE = ManoeuvreRole
ASKED, MAKING_ROOM, PASSING, LEFT = EncounterPhase

May: TypeAlias = Callable[[float | None], str | None]
"""The rule that forbids stopping at an altitude (metres above mean sea level; None: where it is), or None."""


class Avoidance:
    """The encounters of one platform.

    Every step returns what to do now. `may` is called before anything is promised or done.
    """

    def __init__(self, unit: str) -> None:
        self.unit = unit
        self.encounters: dict[str, Encounter] = {}
        self._order: Divert | ResumeRoute = ResumeRoute()
        self._evidence = Evidence()

    # -- agreeing ----------------------------------------------------------------------------------------------

    def on_warned(self, partner: str, own: Fix, other: Fix, may: May, now_us: int) -> list[Step]:
        """A warning about `partner` is open here: if the two converge, and no encounter is under way, begin one."""
        if partner in self.encounters or not converge(own, other):
            return []
        known = self.encounters[partner] = Encounter(partner, self.unit, own, other, other, now_us)
        reason = may(None)
        return self._leave(known, reason) if reason is not None else [self._propose(known, own, other, may, now_us)]

    def _propose(self, known: Encounter, own: Fix, other: Fix, may: May, now_us: int) -> Propose:
        climber = levels.proposed_mover(self.unit, known, own, other, levels.level_among(self.encounters, known))
        if climber == self.unit and not isinstance(self._way(known, own, other, may), ManoeuvreRole):
            climber = known.partner
        return self._ask(known, climber, own, other, now_us)

    def _way(self, known: Encounter, own: Fix, other: Fix, may: May) -> ManoeuvreRole | str:
        """How this side makes room vertically, or why it does not."""
        level = levels.level_among(self.encounters, known)
        chosen = levels.ways(level, known.their_level, other.altitude_m - own.altitude_m)
        refusals = [self._refusal(known, role, own, other, may, turns=level is CLIMB) for role in chosen]
        return next(
            (role for role, refused in zip(chosen, refusals, strict=True) if refused is None), refusals[0] or ""
        )

    def _ask(self, known: Encounter, climber: str, own: Fix, other: Fix, now_us: int) -> Propose:
        known.climber, known.awaited, known.asked_us = climber, True, now_us
        known.proposed += 1
        upper, lower = (own, other) if known.climber == self.unit else (other, own)
        climb_m = max(0.0, lower.altitude_m + levels.SEPARATION_M - upper.altitude_m)
        return Propose(known.partner, known.climber, climb_m, levels.level_among(self.encounters, known))

    def on_proposal(
        self,
        partner: str,
        climber: str,
        own: Fix,
        other: Fix,
        may: May,
        now_us: int,
        *,
        warned: bool,
        because: str | None = None,
        level: ManoeuvreRole | None = None,
    ) -> tuple[Refused | None, list[Step]]:
        """`partner` proposes that `climber` climbs, or does nothing itself, `because`. `warned`: we are about it, too.
        `level`: what the partner does for another.
        Returns why that is refused, or None, and what to do.
        """
        known = self.encounters.get(partner)
        refused = self._evidence.refusal(partner, own, other, now_us, warned=warned or known is not None)
        if refused is not None:
            return refused, []
        if because is not None:
            self._evidence.spend(partner, now_us, warned=warned or known is not None)
            known = known or self._met(partner, self.unit, own, other, now_us)
            return self._take_whole(known, because, own, other, may, now_us)
        crossed = known is not None and self.awaits(partner) and known.climber != climber
        if crossed and unit_order(self.unit) < unit_order(partner):
            return Refused("superseded by the proposal of ours that crossed this one", "superseded"), []
        if known is not None and known.phase is LEFT:
            return Refused(known.left_because, "cannot"), []
        if known is not None and known.role is not None:
            return None, []  # what is under way is carried to its end
        is_new, known = known is None, known or self._met(partner, climber, own, other, now_us)
        known.their_level, mine = level, levels.level_among(self.encounters, known)
        role = self._way(known, own, other, may) if climber == self.unit else HOLD
        reason = role if isinstance(role, str) else self._refusal(known, role, own, other, may, turns=True)
        code = WOULD_HOLD if climber == self.unit and self._refusal(known, HOLD, own, other, may) is None else ""
        if levels.mover(self.unit, mine, partner, level) not in {None, climber}:
            reason, code = (
                f"it does something else for another: {mine.value if mine else 'nothing'}",
                levels.code_of(mine),
            )
        if reason is not None or isinstance(role, str):
            if not known.awaited:
                del self.encounters[partner]
            return Refused(reason or "", code), []
        known.climber = climber
        self._evidence.spend(partner, now_us, warned=warned or not is_new)
        return None, self._take(known, role, own, other, now_us)

    def _met(self, partner: str, climber: str, own: Fix, other: Fix, now_us: int) -> Encounter:
        found = self.encounters[partner] = Encounter(partner, climber, own, other, other, now_us)
        return found

    def _take_whole(
        self, known: Encounter, because: str, own: Fix, other: Fix, may: May, now_us: int
    ) -> tuple[Refused | None, list[Step]]:
        """The partner cannot avoid us: all of it is ours."""
        known.alone = known.takes_all = True
        if known.phase is PASSING or known.role is ASIDE:
            return None, []
        moves, fails = known.role in {CLIMB, DESCEND}, known.role in known.failed
        if moves and not fails:
            known.place = ahead(own, braking_m(own))  # it does not hold: stop before it
            return None, self._settled()
        steps = [] if known.phase is LEFT or moves else self._alone(known, own, other, may, now_us)
        if known.left_because:
            rest = [step for step in steps if not isinstance(step, LeaveToPartner)]
            both = NeitherCan(known.partner, (known.left_because, because))
            return Refused(known.left_because, "cannot"), [*rest, both]
        return None, steps

    def on_agreed(self, partner: str, own: Fix, other: Fix, may: May, now_us: int) -> list[Step]:
        """`partner` accepted our proposal."""
        if not self.awaits(partner):
            return []
        known = self.encounters[partner]
        known.awaited = False
        level, theirs = levels.level_among(self.encounters, known), known.climber == partner
        both = level is CLIMB and theirs and known.their_level is None  # by now both climb, each for another
        known.their_level = CLIMB if both else known.their_level
        role = self._way(known, own, other, may) if both or not theirs else HOLD
        role = HOLD if both and role is not DESCEND else role
        if isinstance(role, str) or self._refusal(known, role, own, other, may, turns=True) is not None:
            return self._alone(known, own, other, may, now_us)
        return self._take(known, role, own, other, now_us)

    def awaits(self, partner: str) -> bool:
        """Whether `partner` has not answered our proposal yet."""
        known = self.encounters.get(partner)
        return known is not None and known.awaited and known.phase is ASKED

    def on_superseded(self, partner: str) -> None:
        """`partner` has made a proposal of its own, which goes first: it is under way, or made again."""
        known = self.encounters.get(partner)
        if known is not None:
            known.awaited = False

    def on_counter(self, partner: str, code: str, own: Fix, other: Fix, may: May, now_us: int) -> list[Step]:
        """`partner` would take part otherwise: not climb but hold, or do what it does for another. Propose that."""
        if not self.awaits(partner):
            return []
        known = self.encounters[partner]
        known.their_level = levels.level_of(code)
        if known.proposed >= MOST_ASKED or (code == WOULD_HOLD and isinstance(self._way(known, own, other, may), str)):
            return self.on_declined(partner, own, other, may, now_us)
        if levels.is_of_level(code):
            return [self._propose(known, own, other, may, now_us)]
        return [self._ask(known, self.unit, own, other, now_us)]

    def on_declined(self, partner: str, own: Fix, other: Fix, may: May, now_us: int) -> list[Step]:
        """`partner` refused, or was silent: the whole manoeuvre is ours, unless it has proposed one meanwhile."""
        if not self.awaits(partner):
            return []
        known = self.encounters[partner]
        known.awaited = False
        return self._alone(known, own, other, may, now_us)

    def on_grounded(self, partner: str) -> list[Step]:
        """`partner` says that it is on the ground or disarmed: it is no traffic."""
        known = self.encounters.get(partner)
        return [] if known is None else self._end(known)

    def _alone(self, known: Encounter, own: Fix, other: Fix, may: May, now_us: int) -> list[Step]:
        """The first way that is allowed and that our autopilot has not refused; else it is left to the partner."""
        known.alone = True
        down_first = own.altitude_m < other.altitude_m - FOLLOW_M or levels.level_among(self.encounters, known) is HOLD
        down_first |= known.lost and known.climber == known.partner
        reason = ""
        for role in (DESCEND, CLIMB, ASIDE) if down_first else (CLIMB, DESCEND, ASIDE):
            refused = self._refusal(known, role, own, other, may)
            if refused is None:
                return self._take(known, role, own, other, now_us)
            reason = reason or refused
        return self._leave(known, reason)

    def _refusal(
        self, known: Encounter, role: ManoeuvreRole, own: Fix, other: Fix, may: May, *, turns: bool = False
    ) -> str | None:
        """Why this side does not take that role, or None; `turns`: it may do the opposite of what it does for others."""
        if role in known.failed:
            return known.failed[role]
        if role in {HOLD, ASIDE}:
            return may(None)
        against = DESCEND if role is CLIMB else CLIMB
        if not turns and any(each.role is against for each in self.encounters.values() if each is not known):
            return f"it would {role.value} while it does the opposite for another"
        altitude_m = room_m(role, own, other, levels.SEPARATION_M)
        if abs(altitude_m - known.start.altitude_m) > MOST_CLIMB_M:
            return f"{altitude_m:.0f} m is more than {MOST_CLIMB_M:.0f} m from its own altitude"
        return may(altitude_m)

    def _take(self, known: Encounter, role: ManoeuvreRole, own: Fix, other: Fix, now_us: int) -> list[Step]:
        if role is DESCEND:
            levels.turn(self.encounters, known)
        known.role, known.phase, known.since_us, known.proposed = role, MAKING_ROOM, now_us, 0
        known.gap_m, known.level_m = abs(own.altitude_m - other.altitude_m), other.altitude_m
        known.altitude_m = room_m(role, own, other, levels.SEPARATION_M) if role in {CLIMB, DESCEND} else None
        if role is ASIDE:
            known.place = aside(own, other)
        else:
            run = braking_m(own)
            if role is not HOLD and not known.alone:
                run = run_m(own, other, abs((known.altitude_m or own.altitude_m) - own.altitude_m))
            known.place = ahead(own, run)
        if role is HOLD and flees(own, other):
            known.phase, known.altitude_m = PASSING, own.altitude_m
        return self._settled()

    # -- what is not flown -------------------------------------------------------------------------------------

    def on_not_flown(
        self, reason: str, own: Fix, may: May, now_us: int, *, refused: bool, overtaken: bool
    ) -> list[Step]:
        """Our autopilot does not fly the diversion: it refused, another's target took its place, or nothing moves.

        What was refused is tried the other way. What another overwrote would be overwritten again, and what is not
        seen may still come: the partner takes the manoeuvre, and this side commands nothing further.
        """
        steps: list[Step] = []
        for known in [each for each in self.encounters.values() if each.keeps]:
            role = known.role or HOLD
            known.failed |= dict.fromkeys(ManoeuvreRole, reason) if overtaken else {role: reason}
            if overtaken or not refused:
                steps += self._leave(known, reason, keeping=not overtaken)
            elif role is HOLD:
                steps += self._leave(known, reason)
            else:
                steps += self._alone(known, own, known.other, may, now_us)
        if overtaken:
            self._order = ResumeRoute()  # it is not ours to resume: whoever overtook it flies it now
        return [step for step in steps if not (overtaken and isinstance(step, ResumeRoute))]

    def on_flown(self) -> None:
        """Our autopilot flies what it was not seen to fly: the partner need not take it."""
        for known in self.encounters.values():
            if known.keeps and known.role is not None and known.failed.pop(known.role, ""):
                known.left_because = ""

    def _leave(self, known: Encounter, reason: str, *, keeping: bool = False) -> list[Step]:
        """The partner is to take the whole manoeuvre; `keeping`: what was ordered stays so, in case it comes."""
        told, known.left_because = bool(known.left_because), known.left_because or reason
        neither = [NeitherCan(known.partner, (reason, known.theirs))] if known.theirs else []
        if not keeping:
            known.phase, known.role = LEFT, None
        return [*neither, *([] if told else [LeaveToPartner(known.partner, reason)]), *self._settled()]

    def on_left_refused(self, partner: str, reason: str, own: Fix, other: Fix, may: May, now_us: int) -> list[Step]:
        """`partner` cannot take the manoeuvre that we left to it: go aside if that is possible, else tell."""
        known = self.encounters.get(partner)
        if known is None or not known.left_because:
            return []
        known.theirs = reason or "no reason"
        if known.phase is LEFT and self._refusal(known, ASIDE, own, other, may) is None:
            return self._take(known, ASIDE, own, other, now_us)
        return [NeitherCan(partner, (known.left_because, reason))]

    # -- carrying out, and ending ------------------------------------------------------------------------------

    def on_moved(self, partner: str, own: Fix, other: Fix | None, may: May, now_us: int, *, warned: bool) -> list[Step]:
        """Positions have changed. `warned`: the warning about `partner` is open here."""
        known = self.encounters.get(partner)
        if other is not None and own.valid_us - other.valid_us > KNOWN_US:
            other = None
        if known is None:
            return self.on_warned(partner, own, other, may, now_us) if warned and other is not None else []
        if other is None or leaps(known.other, other):
            other = known.other._replace(north_m_s=0.0, east_m_s=0.0, down_m_s=0.0)
            known.lost = True
        else:
            known.other, known.lost = other, False
        if known.phase is ASKED:
            return self._while_asked(known, own, other, may, now_us)
        seen = relation(own, other)
        if is_over(known, seen, own, other, now_us):
            return self._end(known)
        if known.phase is MAKING_ROOM:
            return self._make_room(known, seen, own, other, may, now_us)
        if known.phase is PASSING and room_made_m(known, seen, own, other) < CLOSE_M and converge(own, other):
            if known.role is not HOLD or not flees(own, other):
                return self._take(known, known.role or HOLD, own, other, now_us)
            if seen.away_m < IDLE_M:
                return self._alone(known, own, other, may, now_us)
        return self._settled()

    def _while_asked(self, known: Encounter, own: Fix, other: Fix, may: May, now_us: int) -> list[Step]:
        if known.awaited or now_us < known.asked_us + AGAIN_US:
            return []
        return [self._propose(known, own, other, may, now_us)] if converge(own, other) else self._end(known)

    def _make_room(self, known: Encounter, seen: Relation, own: Fix, other: Fix, may: May, now_us: int) -> list[Step]:
        since_us = now_us - known.since_us
        if known.role is ASIDE:
            return self._end(known) if since_us >= PATIENCE_US else self._settled()
        if known.role is HOLD:
            moved = abs(other.altitude_m - known.level_m) >= UNMOVED_M or seen.apart_m >= known.gap_m + UNMOVED_M
            unmoved = since_us >= UNMOVED_US and not moved
            if (known.lost or unmoved) and seen.apart_m < CLEAR_M:
                return self._alone(known, own, other, may, now_us)
        self._follow(known, own, other, may, now_us)
        if room_made_m(known, seen, own, other) >= CLEAR_M:
            known.phase, known.place, known.idle_since_us = PASSING, None, None
            if known.role is HOLD:
                known.altitude_m = own.altitude_m
        elif since_us >= PATIENCE_US:
            return self._end(known)
        return self._settled()

    def _follow(self, known: Encounter, own: Fix, other: Fix, may: May, now_us: int) -> None:
        """Stay clear of a partner that rises or sinks itself; of two that climb, one stops."""
        if known.role not in {CLIMB, DESCEND} or known.altitude_m is None:
            return
        rises = other.down_m_s < -CLIMBING_M_S and abs(own.altitude_m - other.altitude_m) < CLEAR_M
        if (
            known.role is CLIMB
            and rises
            and not known.takes_all
            and climber_of(self.unit, own, known.partner, other) != self.unit
        ):
            self._take(known, HOLD, own, other, now_us)
            self._order = ResumeRoute()
            return
        wanted_m = room_m(known.role, other, other, levels.SEPARATION_M)
        farther_m = wanted_m - known.altitude_m if known.role is CLIMB else known.altitude_m - wanted_m
        if farther_m > FOLLOW_M and self._refusal(known, known.role, other, other, may) is None:
            known.altitude_m = wanted_m

    def on_gone(self, partner: str) -> None:
        """`partner` left the federation: it is taken to be where it was last."""
        known = self.encounters.get(partner)
        if known is not None:
            known.lost = True

    def _end(self, known: Encounter) -> list[Step]:
        del self.encounters[known.partner]
        return [*self._settled(), Over(known.partner)]

    def _settled(self) -> list[Step]:
        """What all encounters together want of the vehicle, if that is something else than before."""
        order = levels.together(self.encounters.values())
        if order == self._order:
            return []
        self._order = order
        return [order]
