"""From a meeting to a manoeuvre that those concerned agree on, and back to the own way (thesis 9.4.1).

The glue between intents, the rule of `dyknow.agents.capabilities.separation.logic`, acts to the others, and the pilot. Decisions are noted
here and reported to the delegators of the tasks that keep vehicles apart. Times are the node clock.
"""

from collections import Counter
from collections.abc import Iterable
from typing import Final

from dyknow.agents.actions import COORDINATION, Action, Offer
from dyknow.agents.capabilities.flight.errand import OrderProgress
from dyknow.agents.capabilities.flight.options import AvoidanceOptions
from dyknow.agents.capabilities.flight.pilot import Pilot
from dyknow.agents.capabilities.separation.answers import AvoidAnswers
from dyknow.agents.capabilities.separation.encounter_log import EncounterLog
from dyknow.agents.capabilities.separation.logic import SeparationLogic
from dyknow.agents.capabilities.separation.neighbourhood import Neighbourhood
from dyknow.agents.capabilities.separation.neither import NeitherAlarms
from dyknow.agents.capabilities.separation.often import PURSUES, PURSUES_US, REPORTS, REPORTS_US, Often
from dyknow.agents.capabilities.separation.reaction_times import ReactionTimes
from dyknow.agents.capabilities.separation.records import legs_text
from dyknow.agents.capabilities.separation.situation import (
    Fly,
    GoOn,
    LeaveTo,
    Neither,
    Over,
    Propose,
    Step,
    Waits,
)
from dyknow.agents.capabilities.separation.situation_view import SituationView
from dyknow.agents.monitoring.coordination import Coordination
from dyknow.agents.monitoring.monitors import UnitMonitors
from dyknow.agents.part import Part
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.federation.messages.acts import Act, Performative
from dyknow.federation.messages.contents import Avoid, Content, Reason
from dyknow.model.errors import Refused
from dyknow.reasoning import AlarmEvent

ANSWER_WITHIN_US: Final = 1_000_000
BLIND_LOOK_US: Final = 500_000
NOT_FLOWN: Final = frozenset({OrderProgress.REFUSED, OrderProgress.OVERTAKEN, OrderProgress.UNSEEN})


class GivingWay(Part):
    """The meetings of one platform, carried out.

    Args:
        neighbourhood: the intents of others, and of the own vehicle.
        log: keeps a record of each meeting.
        monitors: whose warnings say that this platform will do nothing about them.
        emit: takes commands to the vehicle.
        note: takes words for the log.
        on_alarm: takes the alarm that neither of two can avoid the other.
        may_avoid: whether this platform may give way at all.

    Attributes:
        refused: proposals of others that were refused, by code.
        logic: the rule, with the present meetings and the manoeuvre.
        times: how long its manoeuvres took to begin.
    """

    vital = heeds_samples = True
    offers = (Offer(COORDINATION, (Action(Avoid, "on_avoid"),)),)

    def __init__(self, ports: Ports, parts: PartRegistry) -> None:
        self._unit, self._agent, self._clock, self._pilot = ports.unit, ports.agent, ports.clock, parts[Pilot.of]
        self._contain = ports.contain
        self._neighbourhood, self._monitors = parts[Neighbourhood], parts[UnitMonitors.of]
        self._coordination = parts[Coordination]
        self._log, self._emit, self._note = parts[EncounterLog], ports.emit, ports.note
        self._may_avoid = ports.config.options[AvoidanceOptions].avoidance
        self.logic, self.refused = SeparationLogic(ports.unit), Counter[str]()
        self._view = SituationView(parts[Pilot.of], parts[Neighbourhood], self.logic, may_avoid=self._may_avoid)
        self._answers = AvoidAnswers(ports.unit, self.logic, parts[Neighbourhood], self._view)
        self._blind_us = 0
        self.times = ReactionTimes()
        self._neither = NeitherAlarms(ports.unit, ports.on_alarm, ports.note)
        self._reports, self._pursuits = Often(REPORTS, REPORTS_US), Often(PURSUES, PURSUES_US)
        self._seen: object = None
        self._ordered = -1
        ports.moved.append(self.on_moved)
        ports.annotators.append(self.annotated)

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
            self._look(now_us)
        else:
            self._end_all(now_us)
            self._end_stray(now_us, may_command=True)
        self._neighbourhood.cannot = bool(self.logic.cannot)
        self._neighbourhood.publish(now_us)

    @property
    def deadline_us(self) -> int | None:
        """While vehicles are kept apart: when the position will be too old, and then twice a second."""
        blind_us = self._view.blind_from_us if self._neighbourhood.is_watched else None
        return None if blind_us is None else max(self._clock.wall_us(blind_us), self._blind_us)

    def on_time(self, now_us: int) -> None:
        """Notify the vehicles that this one meets: its position is unknown by now."""
        blind_us = self._view.blind_from_us
        if blind_us is None or self._pilot.now_us < blind_us or now_us < self._blind_us:
            return
        self._blind_us = now_us + BLIND_LOOK_US
        if self._neighbourhood.is_watched:
            self._look(now_us)

    def _look(self, now_us: int) -> None:
        situation = self._view.situation()
        if situation is None:
            self._end_all(now_us)
            return
        met = set(self.logic.meetings)
        self._do(self._contain.call(self.logic.look, situation, otherwise=[]), now_us)
        for unit in self.logic.meetings.keys() - met:
            self._log.begin(unit, now_us)
        self._end_stray(now_us, may_command=not situation.cannot)

    def _end_all(self, now_us: int) -> None:
        """No task keeps vehicles apart now, or the vehicle is on the ground."""
        self._do(self.logic.forget(list(self.logic.meetings)), now_us)
        self.logic.manoeuvre = self._neighbourhood.manoeuvre = None

    def _end_stray(self, now_us: int, *, may_command: bool) -> None:
        """End a manoeuvre that is over but still flown: the vehicle was on the ground, or could not be commanded then."""
        if self._is_flown:
            return
        self._neighbourhood.manoeuvre = None
        diversion = self._pilot.diversion
        if may_command and diversion and diversion.command.number == self._ordered and not self.logic.meetings:
            self.logic.manoeuvre = None
            self._go_on((), now_us)

    # -- what others say ---------------------------------------------------------------------------------------

    def on_avoid(self, act: Act, content: Avoid, now_us: int) -> None:
        """`(avoid ...)`: another one proposes what it will fly, or, with `because`, leaves the meeting to us.

        Raises:
            Refused: its proposal meets our agreed manoeuvre; or we cannot avoid it, with the reason.
        """
        other = act.sender.unit
        try:
            what = self._answers.answer(other, content)
        except Refused as refused:
            self.refused[refused.code or "cannot"] += 1
            if self._reports.allows(other, now_us):
                self._tell(f"{self._unit} refuses to avoid {other}: {refused.reason}", now_us)
            raise
        if self._reports.allows(other, now_us):
            self._tell(f"{self._unit} agrees with {other}: {what}", now_us)
        self._agent.done(act, now_us)

    # -- steps -------------------------------------------------------------------------------------------------

    def _do(self, steps: Iterable[Step], now_us: int) -> None:
        for step in steps:
            match step:
                case Propose(unit, manoeuvre):
                    self._propose(
                        unit,
                        Avoid(
                            units=(self._unit, unit),
                            legs=legs_text(self._view.places(manoeuvre.places)),
                            speed_m_s=manoeuvre.speed_m_s,
                        ),
                        now_us,
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

    def _propose(self, unit: str, content: Avoid, now_us: int) -> None:
        def on_reply(reply: Act, answer: Content | None, at_us: int) -> None:
            if reply.performative in {Performative.AGREE, Performative.INFORM}:  # the result may overtake the agree
                if content.because is None:
                    self._on_agreed(unit, at_us)
            elif reply.performative in {Performative.REFUSE, Performative.NOT_UNDERSTOOD, Performative.FAILURE}:
                self._declined(unit, content, answer if isinstance(answer, Reason) else Reason(text="no reason"), at_us)

        def on_silence(why: str, at_us: int) -> None:
            if content.because is None:
                self._on_agreed(unit, at_us)
            else:
                self._declined(unit, content, Reason(text=why), at_us)

        self._agent.delegate(
            unit, content, now_us, on_reply=on_reply, on_silence=on_silence, reply_within_us=ANSWER_WITHIN_US
        )

    def _on_agreed(self, unit: str, now_us: int) -> None:
        self._do(self.logic.on_agreed(unit, self._pilot.now_us), now_us)

    def _declined(self, unit: str, content: Avoid, reason: Reason, now_us: int) -> None:
        """Take the refusal of our proposal, or of a meeting that we leave to the other."""
        if content.because is None:
            if reason.code == "not-free":
                self._tell(f"{unit} refuses: {reason.text}", now_us)
                self.logic.on_declined(unit, self._clock.federation_us(now_us))
            else:
                self._on_agreed(unit, now_us)
            return
        situation = self._view.situation()
        if situation is not None and unit in situation.neighbours:
            unseen = reason.code == "no-evidence"
            self._do(self.logic.on_left_refused(unit, reason.text, situation, is_unseen=unseen), now_us)

    def _fly(self, step: Fly, now_us: int) -> None:
        manoeuvre = self.logic.manoeuvre
        if manoeuvre is None:  # the manoeuvre before it could not be flown
            return
        places = self._view.places(manoeuvre.places)
        try:
            commands = self._pilot.divert(step.place.altitude_m, places[0][:2], manoeuvre.planned.speed_m_s)
        except Refused as refused:
            self._not_flown(refused.reason, now_us, overtaken=True)
            return
        for command in commands:
            self._ordered = command.number
            self._emit(command)
        self._neighbourhood.manoeuvre, self._neighbourhood.manoeuvre_m_s = places, manoeuvre.planned.speed_m_s
        if step.is_new:
            self.times.on_order(self._ordered, manoeuvre.seen_us, self._clock.federation_us(now_us))
            self._tell(f"{self._unit} {step.words} for {', '.join(step.units)}", now_us)
            for unit in step.units:
                self._count_pursuit(unit, now_us)

    def _count_pursuit(self, unit: str, now_us: int) -> None:
        """Report a vehicle for which we make room again and again: it may follow us on purpose, as users may judge."""
        if self._pursuits.count(unit, now_us) >= PURSUES:
            self._pursuits.forget(unit)
            self._tell(
                f"{self._unit} has made room for {unit} {PURSUES} times within a minute: it may be following", now_us
            )

    def _go_on(self, units: tuple[str, ...], now_us: int) -> None:
        self._neighbourhood.manoeuvre = None
        self._tell(f"{self._unit} flies on" + (f", free of {', '.join(units)}" if units else ""), now_us)
        for command in self._pilot.resume():
            self._emit(command)

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
            taken = self.times.on_motion(diversion.command.number, self._clock.federation_us(now_us))
            if taken:
                self._note(taken)
                self._log.note(taken, now_us)
        elif diversion.progress in NOT_FLOWN:
            self._not_flown(diversion.reason, now_us, overtaken=diversion.progress is not OrderProgress.UNSEEN)

    @property
    def _is_flown(self) -> bool:
        manoeuvre = self.logic.manoeuvre
        return manoeuvre is not None and manoeuvre.is_commanded

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
