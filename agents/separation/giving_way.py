"""From a meeting to a manoeuvre that those concerned agree on, and back to the own way (thesis 9.4.1).

The glue between intents, the rule of `agents.separation.logic`, acts to the others, and the pilot. Whatever is decided is noted
here and reported to the delegators of the tasks that keep vehicles apart. Times are the node clock.
"""

from collections import Counter
from collections.abc import Callable, Iterable
from typing import Final

from agents.actions import COORDINATION, Action, Offer
from agents.containment import Containment
from agents.flight.errand import OrderProgress
from agents.flight.pilot import Pilot
from agents.flight.places import Fix
from agents.interface import InterfaceAgent
from agents.monitoring.coordination import Coordination
from agents.monitoring.monitors import UnitMonitors
from agents.part import Part
from agents.separation.encounter_log import EncounterLog
from agents.separation.logic import STEPS, SeparationLogic
from agents.separation.neighbourhood import Neighbourhood
from agents.separation.neighbours import Traffic3D, tube_of
from agents.separation.neither import NeitherAlarms
from agents.separation.often import PURSUES, PURSUES_US, REPORTS, REPORTS_US, Often
from agents.separation.records import legs_of, legs_text
from agents.separation.situation import (
    Fly,
    GoOn,
    LeaveTo,
    Neither,
    Over,
    Propose,
    Situation,
    Step,
    Waits,
)
from dyknow.model.errors import Refused
from federation.members.clock import FederationClock
from federation.messages.acts import Act, Performative
from federation.messages.contents import Avoid, Content, Reason
from navigation.intents.intent import IntendedPlace, Intent, IntentEnding, IntentSource, RightOfWay
from navigation.intents.meeting import MINIMA, clearance, closeness
from navigation.intents.path import FlatOrigin, FlatPlace, flat_legs, motion_of, performance_of
from navigation.vehicle import Command
from reasoning import AlarmEvent

ANSWER_WITHIN_US: Final = 1_000_000
NOT_FLOWN: Final = frozenset({OrderProgress.REFUSED, OrderProgress.OVERTAKEN, OrderProgress.UNSEEN})
SOON_S: Final = 20.0
"""A meeting that another leaves to us has to be so near, by our own data."""
_FAR_M: Final = 5_000.0
_OLD_US: Final = 2_000_000


class GivingWay(Part):
    """The meetings of one platform, carried out.

    Args:
        neighbourhood: what others will do, and what it says of its own vehicle.
        log: keeps a record of each meeting.
        monitors: whose warnings say that this platform will do nothing about them.
        emit: takes commands to the vehicle.
        note: takes words for the log.
        on_alarm: takes the alarm that neither of two can avoid the other.
        may_avoid: whether this platform may give way at all.

    Attributes:
        refused: proposals of others that were refused, by code.
        logic: the rule, with the present meetings and the manoeuvre.
    """

    vital = True
    offers = (Offer(COORDINATION, (Action(Avoid, "on_avoid"),)),)

    def __init__(
        self,
        unit: str,
        agent: InterfaceAgent,
        clock: FederationClock,
        pilot: Pilot,
        neighbourhood: Neighbourhood,
        log: EncounterLog,
        monitors: UnitMonitors,
        coordination: Coordination,
        emit: Callable[[Command], None],
        note: Callable[[str], None],
        on_alarm: Callable[[AlarmEvent], None],
        contain: Containment,
        *,
        may_avoid: bool,
    ) -> None:
        self._unit, self._agent, self._clock, self._pilot, self._contain = unit, agent, clock, pilot, contain
        self._neighbourhood, self._monitors, self._coordination = neighbourhood, monitors, coordination
        self._log, self._emit, self._note, self._may_avoid = log, emit, note, may_avoid
        self.logic, self.refused = SeparationLogic(unit), Counter[str]()
        self._origin: FlatOrigin | None = None
        self._neither = NeitherAlarms(unit, on_alarm, note)
        self._reports, self._pursuits = Often(REPORTS, REPORTS_US), Often(PURSUES, PURSUES_US)
        self._seen: object = None
        self._ordered = -1

    @property
    def encounters(self) -> tuple[str, ...]:
        """The units that this platform meets."""
        return tuple(self.logic.meetings)

    def annotated(self, event: AlarmEvent) -> AlarmEvent:
        """A warning says as well that this platform will do nothing about it."""
        reason = self._pilot.avoidance_off if self._may_avoid else None
        named = self._monitors.named.get(event.monitor)
        if event.event != "opened" or reason is None or named is None or not named.plan.profile.starts_avoidance:
            return event
        return event._replace(values={**event.values, f"avoidance[{self._unit}]": f"off: {reason}"})

    # -- what happens ------------------------------------------------------------------------------------------

    def on_moved(self, now_us: int) -> None:
        """The vehicle's position has changed: say what it will do, and look whether that meets others."""
        fix = self._pilot.fix
        if fix is None:
            return
        self._follow_diversion(now_us)
        if self._neighbourhood.is_watched:
            situation = self._situation(fix)
            if situation is None:
                self._end_all(now_us)
            else:
                met = set(self.logic.meetings)
                self._do(self._contain.call(self.logic.look, situation, otherwise=[]), now_us)
                for unit in self.logic.meetings.keys() - met:
                    self._log.begin(unit, now_us)
                self._end_stray(now_us, may_command=not situation.cannot)
        else:
            self._end_all(now_us)
            self._end_stray(now_us, may_command=True)
        self._neighbourhood.publish(now_us)

    def _end_all(self, now_us: int) -> None:
        """No task keeps vehicles apart now, or the vehicle is on the ground."""
        self._do(self.logic.forget(list(self.logic.meetings)), now_us)
        self.logic.manoeuvre = self._neighbourhood.manoeuvre = None

    def _end_stray(self, now_us: int, *, may_command: bool) -> None:
        """What the vehicle still flies of a manoeuvre that is over: it was on the ground or could not be commanded then."""
        if self._is_flown:
            return
        self._neighbourhood.manoeuvre = None
        diversion = self._pilot.diversion
        if may_command and diversion and diversion.command.number == self._ordered and not self.logic.meetings:
            self.logic.manoeuvre = None
            self._go_on((), now_us)

    def _situation(self, fix: Fix) -> Situation | None:
        """What is known now; None: the vehicle is on the ground."""
        pilot, around = self._pilot, self._neighbourhood
        own = around.own.now(None)
        if own is None or not own.is_airborne:
            return None
        origin = self._origin_at(fix)
        federation_us = max(fix.valid_us, pilot.now_us)
        cannot = "" if own.rank is not RightOfWay.CANNOT else self._cannot_words
        if not cannot and federation_us - fix.valid_us > _OLD_US:
            cannot = "its position is not known"
        traffic = around.others.near(origin, fix, max(own.speed_m_s, fix.speed_m_s), fix.valid_us, STEPS)
        return Situation(
            fix.valid_us, own.rank, cannot, motion_of(own, origin), tuple(flat_legs(own.legs, origin)), own.ending,
            performance_of(own), around.others.by_unit, traffic, self._allowed(origin),
        )  # fmt: skip

    @property
    def _cannot_words(self) -> str:
        off = self._pilot.avoidance_off or "it may not command its vehicle"
        return off if self._may_avoid else "this platform has no leave to give way"

    def _origin_at(self, fix: Fix) -> FlatOrigin:
        """What metres count from; it moves only between manoeuvres."""
        origin = self._origin
        if origin is not None and self.logic.manoeuvre is None:
            north_m, east_m = origin.metres(fix.latitude_deg, fix.longitude_deg)
            origin = origin if abs(north_m) + abs(east_m) < _FAR_M else None
        if origin is None:
            origin = self._origin = FlatOrigin.at(fix.latitude_deg, fix.longitude_deg)
        return origin

    def _allowed(self, origin: FlatOrigin) -> Callable[[FlatPlace], bool]:
        pilot = self._pilot

        def allowed(place: FlatPlace) -> bool:
            where = origin.degrees(place.north_m, place.east_m)
            return pilot.refusal(pilot.stop(place.altitude_m, where)) is None

        return allowed

    # -- what others say ---------------------------------------------------------------------------------------

    def on_avoid(self, act: Act, content: Avoid, now_us: int) -> None:
        """`(avoid ...)`: another one proposes what it will fly, or, with `because`, leaves the meeting to us.

        Raises:
            Refused: what it proposes meets what we have agreed to; or we cannot avoid it, with the reason.
        """
        other = act.sender.unit
        try:
            what = self._answer(other, content)
        except Refused as refused:
            self.refused[refused.code or "cannot"] += 1
            if self._reports.allows(other, now_us):
                self._tell(f"{self._unit} refuses to avoid {other}: {refused.reason}", now_us)
            raise
        if self._reports.allows(other, now_us):
            self._tell(f"{self._unit} agrees with {other}: {what}", now_us)
        self._agent.done(act, now_us)

    def _answer(self, other: str, content: Avoid) -> str:
        fix = self._pilot.fix
        if set(content.units) != {self._unit, other}:
            raise Refused("the manoeuvre is not between the two of us", "not-a-participant")
        if fix is None:
            raise Refused("this platform does not know where it is", "no-position")
        legs = legs_of(content.legs)
        if legs is None:
            raise Refused("legs are no places; write latitude,longitude,altitude;...", "no-places")
        own = self._neighbourhood.own.now(None)
        if own is None or not own.is_airborne:
            raise Refused("the vehicle is on the ground or not armed", "grounded")
        known = self._neighbourhood.others.by_unit.get(other)
        if known is None:
            raise Refused(f"this platform does not know where {other} is", "no-position")
        if known.leapt_us is not None:
            raise Refused(f"the position of {other} has leapt", "implausible")
        if not self._neighbourhood.is_watched:
            raise Refused("no task here keeps vehicles apart", "unwatched")
        situation = self._situation(fix)
        if situation is None:
            raise Refused("the vehicle is on the ground or not armed", "grounded")
        if content.because is not None:
            return self._take(other, content.because, legs, situation)
        return self._hear(other, legs, situation)

    def _take(self, other: str, because: str, legs: tuple[IntendedPlace, ...], now: Situation) -> str:
        """It leaves the meeting to us, if there is one on the way that it flies on."""
        known = self._neighbourhood.others.by_unit[other]
        if known.said:
            known.intent = known.intent._replace(rank=RightOfWay.CANNOT, legs=legs)
        now = now._replace(traffic=self._traffic(now))
        if not self.logic.meets(now, other) <= SOON_S:
            raise Refused(f"nothing here shows that {other} comes near", "no-evidence")
        known.cannot, known.cannot_us = because, now.now_us
        reason = self.logic.on_left(other, now)
        if reason is not None:
            raise Refused(reason, "cannot")
        return f"leaves all of it to {self._unit}: {because}"

    def _traffic(self, now: Situation) -> Traffic3D:
        """The tubes of all others, once more: one of them has just reported."""
        fix, origin = self._pilot.fix, self._origin
        if fix is None or origin is None:
            return now.traffic
        speed = max(now.performance.speed_m_s, fix.speed_m_s)
        return self._neighbourhood.others.near(origin, fix, speed, now.now_us, STEPS)

    def _hear(self, other: str, legs: tuple[IntendedPlace, ...], now: Situation) -> str:
        """What it will fly: refused where it meets the manoeuvre that we fly, or a way of ours that cannot be changed."""
        known = self._neighbourhood.others.by_unit[other]
        proposed = known.intent._replace(
            source=IntentSource.MANOEUVRE,
            rank=RightOfWay.COMMITTED,
            legs=legs,
            ending=IntentEnding.HOVER,
            contingency=None,
        )
        if self._is_met(proposed, now):
            raise Refused(f"it meets what {self._unit} flies", "not-free")
        if known.said:  # its positions stand for one that publishes no intent, or one that they contradict
            known.intent = proposed
        return f"{other} makes room"

    def _is_met(self, proposed: Intent, now: Situation) -> bool:
        origin = self._origin
        if origin is None:
            return False
        tube = tube_of(proposed, origin, now.now_us, STEPS)
        own = self.logic.flown(now)
        return clearance(closeness(own, tube[None], MINIMA)) < 1.0

    # -- steps -------------------------------------------------------------------------------------------------

    def _do(self, steps: Iterable[Step], now_us: int) -> None:
        for step in steps:
            match step:
                case Propose(unit, manoeuvre):
                    self._propose(
                        unit, Avoid(units=(self._unit, unit), legs=legs_text(self._places(manoeuvre.places))), now_us
                    )
                case LeaveTo(unit, reason):
                    self._tell(f"{self._unit} does not avoid {unit}, which is to do all of it: {reason}", now_us)
                    own = self._neighbourhood.own.now(None)
                    legs = "" if own is None else legs_text(own.legs)
                    self._propose(unit, Avoid(units=(self._unit, unit), because=reason, legs=legs), now_us)
                case Fly():
                    self._fly(step, now_us)
                case GoOn(units):
                    self._go_on(units, now_us)
                case Waits(units):
                    self._tell(f"{self._unit} waits: {', '.join(units) or 'another'} is where it is to fly", now_us)
                case Neither():
                    self._neither.open(step, self._pilot.now_us)
                case Over(unit):
                    self._log.end(unit, now_us)
                    self._neither.close(unit, self._clock.federation_us(now_us))

    def _places(self, places: Iterable[FlatPlace]) -> tuple[IntendedPlace, ...]:
        origin = self._origin
        if origin is None:  # nothing was planned yet
            return ()
        return tuple(IntendedPlace(*origin.degrees(each.north_m, each.east_m), each.altitude_m) for each in places)

    def _propose(self, unit: str, content: Avoid, now_us: int) -> None:
        def on_reply(reply: Act, said: Content | None, at_us: int) -> None:
            if reply.performative in {Performative.AGREE, Performative.INFORM}:  # the result may overtake the agree
                if content.because is None:
                    self.logic.on_agreed(unit)
            elif reply.performative in {Performative.REFUSE, Performative.NOT_UNDERSTOOD, Performative.FAILURE}:
                self._declined(unit, content, said if isinstance(said, Reason) else Reason(text="no reason"), at_us)

        def on_silence(why: str, at_us: int) -> None:
            if content.because is None:
                self.logic.on_agreed(unit)
            else:
                self._declined(unit, content, Reason(text=why), at_us)

        self._agent.delegate(
            unit, content, now_us, on_reply=on_reply, on_silence=on_silence, reply_within_us=ANSWER_WITHIN_US
        )

    def _declined(self, unit: str, content: Avoid, reason: Reason, now_us: int) -> None:
        """It refuses our proposal, or what we leave to it."""
        if content.because is None:
            if reason.code == "not-free":
                self._tell(f"{unit} refuses: {reason.text}", now_us)
                self.logic.on_declined(unit, self._clock.federation_us(now_us))
            else:
                self.logic.on_agreed(unit)
            return
        fix = self._pilot.fix
        situation = None if fix is None else self._situation(fix)
        if situation is not None and unit in situation.neighbours:
            unseen = reason.code == "no-evidence"
            self._do(self.logic.on_left_refused(unit, reason.text, situation, is_unseen=unseen), now_us)

    def _fly(self, step: Fly, now_us: int) -> None:
        manoeuvre = self.logic.manoeuvre
        if manoeuvre is None:  # what was flown before it could not be
            return
        places = self._places(manoeuvre.places)
        try:
            commands = self._pilot.divert(step.place.altitude_m, places[0][:2])
        except Refused as refused:
            self._not_flown(refused.reason, now_us, overtaken=True)
            return
        for command in commands:
            self._ordered = command.number
            self._emit(command)
        self._neighbourhood.manoeuvre = places
        if step.is_new:
            self._tell(f"{self._unit} {step.words} for {', '.join(step.units)}", now_us)
            for unit in step.units:
                self._count_pursuit(unit, now_us)

    def _count_pursuit(self, unit: str, now_us: int) -> None:
        """One for which we make room again and again may do that on purpose: users are to judge it."""
        if self._pursuits.count(unit, now_us) >= PURSUES:
            self._pursuits.forget(unit)
            self._tell(
                f"{self._unit} has made room for {unit} {PURSUES} times within a minute: it may be following", now_us
            )

    def _go_on(self, units: tuple[str, ...], now_us: int) -> None:
        self._neighbourhood.manoeuvre = None
        for command in self._pilot.resume():
            self._emit(command)
        self._tell(f"{self._unit} flies on" + (f", free of {', '.join(units)}" if units else ""), now_us)

    def _follow_diversion(self, now_us: int) -> None:
        """See whether the vehicle flies its manoeuvre, once for each change of that."""
        diversion = self._pilot.diversion
        if diversion is None and self._is_flown:  # a user, or the pilot, has taken the vehicle out of it
            self.logic.manoeuvre = self._neighbourhood.manoeuvre = None
        seen = None if diversion is None else (diversion.command.number, diversion.progress)
        if seen == self._seen:
            return
        self._seen = seen
        if diversion is None:
            return
        if diversion.progress is OrderProgress.FLOWN:
            self.logic.on_flown()
        elif diversion.progress in NOT_FLOWN:
            self._not_flown(diversion.reason, now_us, overtaken=diversion.progress is not OrderProgress.UNSEEN)

    @property
    def _is_flown(self) -> bool:
        manoeuvre = self.logic.manoeuvre
        return manoeuvre is not None and manoeuvre.flown is not None

    def _not_flown(self, reason: str, now_us: int, *, overtaken: bool) -> None:
        self._tell(f"{self._unit} does not fly its manoeuvre: {reason}", now_us)
        self._do(self.logic.on_not_flown(reason, self._pilot.now_us, overtaken=overtaken), now_us)
        if overtaken:
            self._neighbourhood.manoeuvre = None
            for command in self._pilot.resume():
                self._emit(command)

    # -- telling -----------------------------------------------------------------------------------------------

    def _tell(self, text: str, now_us: int) -> None:
        """To the log, and to the delegators of tasks."""
        self._note(text)
        self._log.note(text, now_us)
        self._coordination.report(text, now_us)
