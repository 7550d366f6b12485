"""Which one yields, and when: one rule for everybody, for two vehicles or ten, in every mode. Federation time; no I/O.

Two meet when their tubes lose the minima within `LOOK_S`. Of two the later in the total order of right of way yields
(`dyknow.navigation.intents.intent.RightOfWay`, then the name). For each vehicle that we meet:

    state      it is entered when                                            then
    EXPECTED   the other is later, and can                                   it yields; its manoeuvre is free of us: over
    MINE       we are later; or the other cannot, has left it to us, or      we plan a way that is free of all others and of
               has not shown anything for 2 s                                their contingencies, propose it, fly it
    LEFT       we cannot: our mode, our limits, a refusal, nothing is free   the other is notified, and is to take it
    NEITHER    we cannot, and the other cannot either, or has refused it     the alarm, with the seconds that are left

and of our own manoeuvre:

    PROPOSED   to those that we meet, for half a second at most; the way    all agree, or are silent: FLOWN; one refuses: again;
               before it is flown meanwhile                                 the reason is gone: the way before it
    FLOWN      it is commanded, place by place                               refused, overtaken, unseen: we cannot, for 5 s, and
                                                                             are taken to fly our own way
               our own way has been free of all others for half a second,    over: we fly on
               and for a second for each earlier one near that makes room
"""

from collections.abc import Iterable, Mapping
from typing import Final

import numpy as np

from dyknow.agents.capabilities.separation.situation import (
    Fly,
    GoOn,
    LeaveTo,
    Manoeuvre,
    ManoeuvreState,
    MeetingState,
    Neither,
    Over,
    PairMeeting,
    Propose,
    Situation,
    Step,
    Waits,
)
from dyknow.federation.members.directory import unit_order
from dyknow.navigation.intents.candidates import PlannedManoeuvre, Yielding, plan, way_is_free
from dyknow.navigation.intents.intent import IntentEnding, IntentSource, RightOfWay
from dyknow.navigation.intents.meeting import MINIMA, clearance, closeness, first_meetings
from dyknow.navigation.intents.path import FlatMotion, Tube, fly

LOOK_S: Final = 12.0
"""Meetings farther ahead are not acted on: until then much may change."""
STEPS: Final = 81
PATIENCE_US: Final = 2_000_000
ASKS_US, URGENT_S = 500_000, 6.0
AGAIN_US: Final = 1_000_000
OVER_US: Final = 1_500_000
LEAST_US, FREE_US = 1_500_000, 500_000
TURN_US, NEAR_M = 1_000_000, 100.0
"""Delay of a vehicle's flying on after each one before it, which has published its way by then."""
CANNOT_US: Final = 5_000_000
MOST_REFUSALS: Final = 2
WAITS_US, ROUND_US, AFTER_US = 4_000_000, 2_000_000, 1_000_000
"""How long a vehicle stands where it has made room before it looks for a way round, the pause between such looks, and
the delay for each vehicle in its way that goes before by name."""
OFTEN, OFTEN_US, MOST_COUNTED = 3, 120_000_000, 64
"""A vehicle that makes room for another one so often does not get on: that is reported."""
NOTHING_FREE: Final = "no way is free of all others within its limits"


class SeparationLogic:
    """The rule, for one vehicle. Steps are to be carried out in their order.

    Attributes:
        meetings: by unit.
        manoeuvre: the manoeuvre by which it keeps apart; None: it flies its own way.
        cannot: why its manoeuvres are not flown at the moment.
    """

    def __init__(self, unit: str) -> None:
        self.unit = unit
        self.meetings: dict[str, PairMeeting] = {}
        self.manoeuvre: Manoeuvre | None = None
        self.cannot = ""
        self._cannot_until_us = 0
        self._planned_us = -AGAIN_US
        self._refusals = 0
        self._often: dict[str, tuple[int, int]] = {}

    # -- looking -----------------------------------------------------------------------------------------------

    def look(self, now: Situation) -> list[Step]:
        """Positions, intents or time have changed."""
        if self.cannot and now.now_us >= self._cannot_until_us:
            self.cannot = ""
        steps = self._follow(now)
        soon = self._soon(now, self.flown(now))
        steps += self._meet(now, soon)
        because = now.cannot or self.cannot
        mine = {unit for unit in soon if self.meetings[unit].state is MeetingState.MINE}
        if because:
            steps += [step for unit in soon for step in self._leave(now, unit, because)]
            if now.cannot and not now.is_blind:
                self.manoeuvre = None
            return steps
        if mine:
            steps += self._yield(now, mine)
        elif self.manoeuvre is not None:
            steps += self._return(now, self.manoeuvre)
        return steps

    def flown(self, now: Situation) -> Tube:
        """The tube of its present way, from now on."""
        manoeuvre = None if self.manoeuvre is None else self.manoeuvre.flown
        if manoeuvre is not None:
            speed_m_s = manoeuvre.planned.speed_m_s or now.performance.speed_m_s
            performance = now.performance._replace(speed_m_s=speed_m_s)
            return fly(now.motion, manoeuvre.places, IntentEnding.HOVER, performance, STEPS)
        return fly(now.motion, now.legs, now.ending, now.performance, STEPS)

    def _soon(self, now: Situation, tube: Tube, within_s: float = LOOK_S) -> dict[str, float]:
        """Seconds until it meets each unit on that way; contingencies count for silent units."""
        traffic, found = now.traffic, dict[str, float]()
        if not traffic.units:
            return found
        seconds = first_meetings(closeness(tube, traffic.tubes, MINIMA))
        for at in np.flatnonzero(seconds <= within_s):
            unit = traffic.units[at]
            if traffic.counts[at]:
                found[unit] = min(found.get(unit, np.inf), float(seconds[at]))
        return found

    def meets(self, now: Situation, unit: str) -> float:
        """In how many seconds it meets that unit on its present way; infinite: not at all."""
        return self._soon(now, self.flown(now), np.inf).get(unit, np.inf)

    def _meet(self, now: Situation, soon: Mapping[str, float]) -> list[Step]:
        steps: list[Step] = []
        busy = self.manoeuvre.units if self.manoeuvre is not None else set[str]()
        for unit, meeting in list(self.meetings.items()):
            if unit not in soon and unit not in busy and now.now_us - meeting.seen_us > OVER_US:
                del self.meetings[unit]
                steps.append(Over(unit))
        for unit, seconds in soon.items():
            meeting = self.meetings.get(unit) or PairMeeting(now.now_us, seconds)
            self.meetings[unit] = meeting
            if now.now_us - meeting.seen_us > OVER_US:
                meeting.since_us = now.now_us
            meeting.seconds, meeting.seen_us = seconds, now.now_us
            meeting.state = MeetingState.MINE if self._is_ours(now, unit, meeting) else MeetingState.EXPECTED
        return steps

    def _is_ours(self, now: Situation, unit: str, meeting: PairMeeting) -> bool:
        other = now.neighbours[unit]
        theirs = other.rank(now.now_us)
        if theirs is RightOfWay.CANNOT or meeting.is_left:
            return True
        own, manoeuvre = now.rank, self.manoeuvre
        if manoeuvre is not None and manoeuvre.flown is not None:
            own = min(own, RightOfWay.COMMITTED)
        if (own, unit_order(self.unit)) > (theirs, unit_order(unit)):
            return True
        return now.now_us - meeting.since_us >= PATIENCE_US

    # -- yielding ----------------------------------------------------------------------------------------------

    def _yield(self, now: Situation, mine: set[str]) -> list[Step]:
        manoeuvre = self.manoeuvre
        if manoeuvre is not None and manoeuvre.state is ManoeuvreState.PROPOSED:
            return self._commit(now, manoeuvre)
        if now.now_us < self._planned_us + AGAIN_US:
            return []
        self._planned_us = now.now_us
        found = plan(self._yielding(now, everything=True))
        seconds = min(self.meetings[unit].seconds for unit in mine)
        if found is None or found.minima is None:
            steps = [step for unit in sorted(mine) for step in self._leave(now, unit, NOTHING_FREE)]
            if found is None or not self._is_better(now, found):
                return steps
            return [*steps, *self._begin(now.now_us, Manoeuvre(found, mine, now.now_us, seen_us=now.now_us))]
        made = Manoeuvre(found, mine | (manoeuvre.units if manoeuvre else set()), now.now_us, seen_us=now.now_us)
        asked = [
            unit
            for unit in sorted(mine)
            if now.neighbours[unit].has_intent and not now.neighbours[unit].is_silent(now.now_us)
        ]
        made.awaited = set(asked)
        proposed: list[Step] = [Propose(unit, found) for unit in asked]
        if not asked or seconds <= URGENT_S or self._refusals >= MOST_REFUSALS:
            return [*proposed, *self._begin(now.now_us, made)]
        made.before = manoeuvre
        self.manoeuvre = made
        return proposed

    def _yielding(self, now: Situation, *, everything: bool) -> Yielding:
        """`everything`: contingencies of those that are heard, too."""
        traffic = now.traffic
        tubes = traffic.tubes
        if not everything and traffic.units:
            tubes = tubes[np.array(traffic.counts)]
        return Yielding(now.motion, now.legs, now.ending, now.performance, tubes, now.allowed, now.slow_m_s)

    def _is_better(self, now: Situation, found: PlannedManoeuvre) -> bool:
        """Whether it keeps farther away than the present way."""
        steps = found.tube.shape[1]
        others = now.traffic.tubes[:, :, :steps]
        present = clearance(closeness(self.flown(now)[:, :steps], others, MINIMA))
        return clearance(closeness(found.tube, others, MINIMA)) > present + 0.05

    def _commit(self, now: Situation, manoeuvre: Manoeuvre) -> list[Step]:
        """Fly what was proposed once all have agreed, or have been silent for long enough."""
        seconds = min((self.meetings[unit].seconds for unit in manoeuvre.units if unit in self.meetings), default=0.0)
        if manoeuvre.awaited and now.now_us < manoeuvre.since_us + ASKS_US and seconds > URGENT_S:
            return []
        return self._begin(now.now_us, manoeuvre)

    def _begin(self, now_us: int, manoeuvre: Manoeuvre) -> list[Step]:
        manoeuvre.state, manoeuvre.since_us, self.manoeuvre = ManoeuvreState.FLOWN, now_us, manoeuvre
        self._refusals, manoeuvre.before = 0, None
        again = tuple(sorted(unit for unit in manoeuvre.units if self._count(unit, now_us) == OFTEN))
        waits: list[Step] = [Waits(again)] if again else []
        return [*waits, Fly(manoeuvre.places[0], True, manoeuvre.planned.words, tuple(sorted(manoeuvre.units)))]

    def _count(self, unit: str, now_us: int) -> int:
        """How many manoeuvres there were for it, with no more than two minutes between two of them."""
        count, last_us = self._often.get(unit, (0, 0))
        found = count + 1 if count and now_us - last_us <= OFTEN_US else 1
        self._often.pop(unit, None)
        self._often[unit] = found, now_us
        while len(self._often) > MOST_COUNTED:
            del self._often[next(iter(self._often))]
        return found

    def _follow(self, now: Situation) -> list[Step]:
        """Command the next place when the vehicle is at one."""
        manoeuvre = self.manoeuvre
        if manoeuvre is None or manoeuvre.state is not ManoeuvreState.FLOWN or len(manoeuvre.places) < 2:
            return []
        motion, to = now.motion, manoeuvre.places[0]
        away_m = float(np.hypot(to.north_m - motion.north_m, to.east_m - motion.east_m))
        speed = float(np.hypot(motion.north_m_s, motion.east_m_s))
        if away_m > 4.0 + 0.25 * speed**2 or abs(to.altitude_m - motion.altitude_m) > 2.0:
            return []
        manoeuvre.at += 1
        return [Fly(manoeuvre.places[0], False, manoeuvre.planned.words, tuple(sorted(manoeuvre.units)))]

    def _return(self, now: Situation, manoeuvre: Manoeuvre) -> list[Step]:
        """Fly on as soon as the own way has been free for a moment."""
        if manoeuvre.state is ManoeuvreState.PROPOSED:  # the reason is gone before it was flown
            self.manoeuvre = manoeuvre.before
            return []
        if now.now_us < manoeuvre.since_us + LEAST_US:
            return []
        if not way_is_free(self._yielding(now, everything=False)):
            manoeuvre.free_since_us = None
            return self._go_round(now, manoeuvre)
        if manoeuvre.free_since_us is None:
            manoeuvre.free_since_us = now.now_us
        if now.now_us < manoeuvre.free_since_us + FREE_US + self._earlier_ones(now) * TURN_US:
            return []
        return self._end(manoeuvre)

    def _earlier_ones(self, now: Situation) -> int:
        """How many near it make room, too, and fly on first: two whose ways became free at once do not meet again."""
        earlier = set[str]()
        for unit, tube in zip(now.traffic.units, now.traffic.tubes, strict=True):
            away_m = np.hypot(tube[0, 0] - now.motion.north_m, tube[1, 0] - now.motion.east_m)
            if away_m < NEAR_M and now.neighbours[unit].intent.source is IntentSource.MANOEUVRE:
                earlier.add(unit)
        return sum(unit_order(unit) < unit_order(self.unit) for unit in earlier)

    def _go_round(self, now: Situation, manoeuvre: Manoeuvre) -> list[Step]:
        """Plan a way round the vehicles in its way, once it has stood for a while because of them."""
        due_us = max(manoeuvre.since_us + WAITS_US, self._planned_us + ROUND_US)
        if now.now_us < due_us or not _stands(now.motion):
            return []
        before = sum(unit_order(unit) < unit_order(self.unit) for unit in self._in_the_way(now))
        if now.now_us < due_us + before * AFTER_US:  # two that stand for each other do not set out at once
            return []
        self._planned_us = now.now_us
        found = plan(self._yielding(now, everything=True))
        if found is None or found.minima is None or not found.returns:
            is_news, manoeuvre.waits = not manoeuvre.waits, True
            return [Waits(self._in_the_way(now))] if is_news else []
        if found.is_here(now.motion):  # to stand on is the cheapest
            return []
        units = set(self._in_the_way(now)) or set(manoeuvre.units)
        return self._begin(now.now_us, Manoeuvre(found, units, now.now_us, seen_us=now.now_us))

    def _in_the_way(self, now: Situation) -> tuple[str, ...]:
        """The units that its own way meets within `STEPS`, sorted."""
        way = fly(now.motion, now.legs, now.ending, now.performance, STEPS)
        return tuple(sorted(self._soon(now, way, np.inf)))

    def _end(self, manoeuvre: Manoeuvre) -> list[Step]:
        self.manoeuvre = None
        return [GoOn(tuple(sorted(manoeuvre.units)))]

    # -- meetings that it cannot avoid -------------------------------------------------------------------------

    def _leave(self, now: Situation, unit: str, reason: str) -> list[Step]:
        """We do not avoid it: it is notified, once; where it cannot either, that is an alarm."""
        meeting, other = self.meetings[unit], now.neighbours[unit]
        theirs = meeting.refused or other.cannot
        if not theirs and other.rank(now.now_us) is RightOfWay.CANNOT:
            theirs = (
                "it is silent"
                if other.is_silent(now.now_us)
                else f"it cannot be commanded: {other.intent.source.value}"
            )
        if theirs:
            meeting.state = MeetingState.NEITHER
            return [Neither(unit, meeting.seconds, (reason, theirs))]
        meeting.state = MeetingState.LEFT
        if meeting.told_us is not None and not (meeting.is_unseen and now.now_us >= meeting.told_us + AGAIN_US):
            return []
        meeting.told_us, meeting.is_unseen = now.now_us, False
        return [LeaveTo(unit, reason)]

    def on_not_flown(self, reason: str, now_us: int, *, overtaken: bool) -> list[Step]:
        """Our autopilot does not fly the manoeuvre: it refused, another's target took its place, or nothing moves."""
        manoeuvre = self.manoeuvre
        if manoeuvre is None:
            return []
        self.cannot, self._cannot_until_us = reason, now_us + CANNOT_US
        if overtaken:
            self.manoeuvre = None
        else:
            manoeuvre.is_unseen = True
        return []

    def on_flown(self) -> None:
        """Our autopilot flies what it was not seen to fly."""
        self.cannot = ""
        if self.manoeuvre is not None:
            self.manoeuvre.is_unseen = False

    # -- what others say ---------------------------------------------------------------------------------------

    def avoids(self, unit: str) -> bool:
        """Whether it flies a manoeuvre for that unit, which is seen or awaited to be flown."""
        manoeuvre = None if self.manoeuvre is None else self.manoeuvre.flown
        return manoeuvre is not None and unit in manoeuvre.units and not self.cannot

    def on_agreed(self, unit: str, now_us: int) -> list[Step]:
        """Note that a unit agrees to our manoeuvre, or does not answer; it is flown once all have."""
        manoeuvre = self.manoeuvre
        if manoeuvre is None or manoeuvre.state is not ManoeuvreState.PROPOSED:
            return []
        manoeuvre.awaited.discard(unit)
        return [] if manoeuvre.awaited else self._begin(now_us, manoeuvre)

    def on_declined(self, unit: str, now_us: int) -> None:
        """Drop our manoeuvre, which a unit has refused; the next is planned with that unit's newest intent."""
        manoeuvre = self.manoeuvre
        if manoeuvre is not None and manoeuvre.state is ManoeuvreState.PROPOSED and unit in manoeuvre.awaited:
            self._refusals += 1
            self.manoeuvre, self._planned_us = manoeuvre.before, now_us - AGAIN_US // 2

    def on_left(self, unit: str, now: Situation) -> str | None:
        """Take a meeting that a unit leaves to us; returns why we cannot, or None."""
        seconds = self.meets(now, unit)
        meeting = self.meetings.get(unit)
        if meeting is None:
            meeting = self.meetings[unit] = PairMeeting(now.now_us, seconds, seen_us=now.now_us)
        because = now.cannot or self.cannot
        if not because and not meeting.is_left and plan(self._yielding(now, everything=True)) is None:
            because = NOTHING_FREE
        if because:
            return because
        meeting.is_left, meeting.state = True, MeetingState.MINE
        return None

    def on_left_refused(self, unit: str, reason: str, now: Situation, *, is_unseen: bool = False) -> list[Step]:
        """Take a unit's refusal of a meeting left to it; `is_unseen`: it does not see it yet, and is notified again."""
        meeting = self.meetings.get(unit)
        if meeting is None or meeting.told_us is None:
            return []
        if is_unseen and meeting.seconds > URGENT_S:
            meeting.is_unseen = True
            return []
        meeting.refused = reason or "no reason"
        return self._leave(now, unit, now.cannot or self.cannot or NOTHING_FREE)

    def forget(self, units: Iterable[str]) -> list[Step]:
        """End the meetings with these units: no task keeps vehicles apart now."""
        steps: list[Step] = [Over(unit) for unit in units if self.meetings.pop(unit, None) is not None]
        return steps


def _stands(motion: FlatMotion) -> bool:
    return float(np.hypot(motion.north_m_s, motion.east_m_s)) < 0.5 and abs(motion.up_m_s) < 0.3
