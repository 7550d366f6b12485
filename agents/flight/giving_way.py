"""From a warning to a manoeuvre that both platforms agreed on, and back to the route (thesis 9.4.1).

The glue between alarms, the rules of `agents.flight.avoidance`, acts to the partner, and the pilot. Whatever is decided is
noted here and reported to the delegator of the task. Times are the node clock.
"""

from collections.abc import Callable, Iterable

from agents.actions import COORDINATION, Action, Offer
from agents.containment import Containment
from agents.exchange.gateway import Gateway
from agents.flight.avoidance import WOULD_HOLD, Avoidance
from agents.flight.encounters import (
    Divert,
    LeaveToPartner,
    ManoeuvreRole,
    NeitherCan,
    Over,
    Propose,
    ResumeRoute,
    Step,
    stands,
)
from agents.flight.errand import OrderProgress
from agents.flight.evidence import fix_of, leap_of
from agents.flight.levels import is_of_level, level_of
from agents.flight.pilot import Pilot
from agents.flight.places import Fix
from agents.interface import InterfaceAgent
from agents.monitoring.coordination import Coordination
from agents.monitoring.monitors import UnitMonitors
from agents.part import Part, PeerChange
from dyknow.model.errors import Refused
from federation.members.clock import FederationClock
from federation.members.liveness import PlatformGone
from federation.messages.acts import Act, Performative
from federation.messages.contents import Avoid, Content, Reason
from navigation.vehicle import Command
from reasoning import NEITHER_CAN_AVOID, AlarmEvent

ANSWER_WITHIN_US = 1_000_000
GROUNDED_US = 10_000_000
"""So long a partner on the ground is no traffic; then the next proposal finds out again."""
NOT_FLOWN = frozenset({OrderProgress.REFUSED, OrderProgress.OVERTAKEN, OrderProgress.UNSEEN})


class GivingWay(Part):
    """The encounters of one platform, carried out.

    Args:
        gateway: where other units are, as far as this platform's streams know.
        monitors: whose alarms are about.
        coordination: whether a task wants platforms to give way when a monitor raises an alarm.
        emit: takes commands to the vehicle.
        note: takes words for the log.
        on_alarm: takes the alarm that neither of two can avoid the other.
        may_avoid: whether this platform may give way at all.

    Attributes:
        refused: proposals of partners that were refused, by code.
    """

    vital = True
    offers = (Offer(COORDINATION, (Action(Avoid, "on_avoid"),)),)

    def __init__(
        self,
        unit: str,
        agent: InterfaceAgent,
        clock: FederationClock,
        pilot: Pilot,
        gateway: Gateway,
        monitors: UnitMonitors,
        coordination: Coordination,
        emit: Callable[[Command], None],
        note: Callable[[str], None],
        on_alarm: Callable[[AlarmEvent], None],
        contain: Containment,
        *,
        may_avoid: bool,
    ) -> None:
        self._contain = contain
        self._unit, self._agent, self._clock, self._pilot, self._gateway = unit, agent, clock, pilot, gateway
        self._monitors, self._coordination, self._may_avoid = monitors, coordination, may_avoid
        self._emit, self._note, self._raise = emit, note, on_alarm
        self._avoidance = Avoidance(unit)
        self._alarm_of: dict[str, str] = {}
        self._warned: dict[str, set[str]] = {}
        self._neither: dict[str, AlarmEvent] = {}
        self._grounded_until_us: dict[str, int] = {}
        self._put_off: set[str] = set()
        self._seen: object = None
        self.refused: dict[str, int] = {}

    @property
    def encounters(self) -> tuple[str, ...]:
        """The units this platform is avoiding, or about to."""
        return tuple(self._avoidance.encounters)

    def annotated(self, event: AlarmEvent) -> AlarmEvent:
        """A warning says as well that this platform will do nothing about it."""
        reason = self._pilot.avoidance_off if self._may_avoid else None
        if event.event != "opened" or reason is None or not self._is_warning(event.monitor):
            return event
        return event._replace(values={**event.values, f"avoidance[{self._unit}]": f"off: {reason}"})

    # -- what happens ------------------------------------------------------------------------------------------

    def on_alarm(self, event: AlarmEvent, now_us: int) -> None:
        """A warning about another platform opened, closed or ended here."""
        if len(event.units) != 2 or not self._is_warning(event.monitor):
            return
        partner = event.units[1]
        if event.event != "opened":
            warned = self._warned.get(partner, set())
            warned.discard(event.monitor)
            if not warned:
                self._put_off.discard(partner)
            return
        self._warned.setdefault(partner, set()).add(event.monitor)
        self._alarm_of[partner] = event.id
        own = self._pilot.fix
        if own is not None:
            self._look(partner, own, now_us)

    def _is_warning(self, monitor: str) -> bool:
        named = self._monitors.named.get(monitor)
        return named is not None and named.plan.profile.starts_avoidance

    def _is_warned(self, partner: str) -> bool:
        """Whether a warning about that platform is open that a task wants to be acted on."""
        return any(map(self._coordination.avoids, self._warned.get(partner, ())))

    def on_moved(self, now_us: int) -> None:
        """Positions have changed: begin what has become necessary, carry on with what was agreed, or end it."""
        own = self._pilot.fix
        if own is None:
            return
        self._follow_diversion(now_us)
        for partner in tuple(dict.fromkeys((*self.encounters, *self._warned))):
            self._contain.call(self._look, partner, own, now_us, otherwise=None)

    def _look(self, partner: str, own: Fix, now_us: int) -> None:
        warned = self._is_warned(partner)
        if partner not in self._avoidance.encounters and not (warned and self._begins(partner, now_us)):
            return
        other = fix_of(self._gateway, partner)
        self._do(self._avoidance.on_moved(partner, own, other, self._may, now_us, warned=warned), now_us)

    def _begins(self, partner: str, now_us: int) -> bool:
        """Whether an encounter with that platform is any of ours."""
        return (
            self._may_avoid
            and self._pilot.control
            and not self._stands
            and not self._is_grounded(partner, now_us)
            and not self._is_put_off(partner, now_us)
        )

    def _is_put_off(self, partner: str, now_us: int) -> bool:
        """Whether that platform has leapt, reported once while a warning about it is open."""
        leap = self._leap(partner, now_us)
        if leap is not None and partner not in self._put_off:
            self._put_off.add(partner)
            self._tell(f"{self._unit} puts off avoiding {partner}: {leap}", now_us)
        return leap is not None

    def _is_grounded(self, partner: str, now_us: int) -> bool:
        """Whether that platform has reported it of its vehicle, which does not move."""
        other = fix_of(self._gateway, partner)
        return now_us < self._grounded_until_us.get(partner, 0) and other is not None and stands(other)

    @property
    def _stands(self) -> bool:
        """Whether the vehicle says that it is on the ground, or not armed: it is no traffic."""
        status = self._pilot.status
        return status is not None and not (status.armed and status.airborne is not False)

    def _leap(self, partner: str, now_us: int) -> str | None:
        return leap_of(self._gateway, partner, self._clock.federation_us(now_us))

    def on_peer(self, change: PeerChange, now_us: int) -> None:  # noqa: ARG002
        """A partner is gone: it is where it was last, as far as is known."""
        if isinstance(change, PlatformGone):
            self._avoidance.on_gone(change.unit)

    # -- what the partner says ---------------------------------------------------------------------------------

    def on_avoid(self, act: Act, content: Avoid, now_us: int) -> None:
        """`(avoid ...)`: the partner proposes which one climbs, or, with `because`, leaves all of it to us.

        Raises:
            Refused: the rule that keeps this platform from taking part, or a proposal of ours that goes first.
        """
        partner = act.sender.unit
        try:
            steps = self._answer(partner, content, now_us)
        except Refused as refused:
            code = refused.code or "cannot"
            self.refused[code] = self.refused.get(code, 0) + 1
            if code != "superseded":
                self._tell(f"{self._unit} refuses to avoid {partner}: {refused.reason}", now_us)
            raise
        self._alarm_of[partner] = content.alarm
        what = (
            f"leaves all of it to {self._unit}: {content.because}"
            if content.because
            else f"{content.climber} makes room"
        )
        self._tell(f"{self._unit} agrees with {partner}: {what}", now_us)
        self._do(steps, now_us)
        self._agent.done(act, now_us)

    def _answer(self, partner: str, content: Avoid, now_us: int) -> list[Step]:
        own, other = self._pilot.fix, fix_of(self._gateway, partner)
        if own is None:
            raise Refused("this platform does not know where it is", "no-position")
        if content.climber not in {self._unit, partner} or set(content.units) != {self._unit, partner}:
            raise Refused("the manoeuvre is not between the two of us", "not-a-participant")
        if not self._may_avoid:
            raise Refused("this platform was told not to give way", "exempt")
        if other is None:
            raise Refused(f"this platform does not know where {partner} is", "no-position")
        if self._stands:
            raise Refused("the vehicle is on the ground or not armed", "grounded")
        leap = self._leap(partner, now_us)
        if leap is not None:
            raise Refused(leap, "implausible")
        refused, steps = self._avoidance.on_proposal(
            partner, content.climber, own, other, self._may, now_us,
            warned=self._is_warned(partner), because=content.because, level=level_of(content.level or ""),
        )  # fmt: skip
        if refused is not None:
            self._do(steps, now_us)
            raise refused
        return steps

    def _propose(self, partner: str, content: Avoid, now_us: int) -> None:
        def on_reply(reply: Act, said: Content | None, at_us: int) -> None:
            if reply.performative in {Performative.AGREE, Performative.INFORM}:  # the result may overtake the agree
                self._agreed(partner, content, at_us)
            elif reply.performative in {Performative.REFUSE, Performative.NOT_UNDERSTOOD, Performative.FAILURE}:
                self._declined(partner, content, said if isinstance(said, Reason) else Reason(text="no reason"), at_us)

        def on_silence(why: str, at_us: int) -> None:
            self._declined(partner, content, Reason(text=why), at_us)

        self._agent.delegate(
            partner, content, now_us, on_reply=on_reply, on_silence=on_silence, reply_within_us=ANSWER_WITHIN_US
        )

    def _agreed(self, partner: str, content: Avoid, now_us: int) -> None:
        own, other = self._pilot.fix, fix_of(self._gateway, partner)
        if content.because is None and own is not None and other is not None and self._avoidance.awaits(partner):
            self._tell(f"{partner} agrees that {content.climber} makes room", now_us)
            self._do(self._avoidance.on_agreed(partner, own, other, self._may, now_us), now_us)

    def _declined(self, partner: str, content: Avoid, reason: Reason, now_us: int) -> None:
        """The partner cannot or does not answer: the whole manoeuvre is ours; or it cannot take what we left to it."""
        own, other = self._pilot.fix, fix_of(self._gateway, partner)
        if reason.code == "superseded":
            self._avoidance.on_superseded(partner)
        elif reason.code == "grounded" and other is not None and stands(other):
            self._grounded_until_us[partner] = now_us + GROUNDED_US
            self._tell(f"{partner} is on the ground: no traffic", now_us)
            self._do(self._avoidance.on_grounded(partner), now_us)
        elif own is None or other is None:
            return
        elif content.because is not None:
            self._do(self._avoidance.on_left_refused(partner, reason.text, own, other, self._may, now_us), now_us)
        elif (reason.code == WOULD_HOLD or is_of_level(reason.code or "")) and self._avoidance.awaits(partner):
            self._tell(f"{partner} takes part otherwise: {reason.text}", now_us)
            self._do(self._avoidance.on_counter(partner, reason.code or "", own, other, self._may, now_us), now_us)
        elif self._avoidance.awaits(partner):
            self._tell(f"{partner} leaves the manoeuvre to {self._unit}: {reason.text}", now_us)
            self._do(self._avoidance.on_declined(partner, own, other, self._may, now_us), now_us)

    # -- steps -------------------------------------------------------------------------------------------------

    def _may(self, altitude_m: float | None) -> str | None:
        """The rule that forbids stopping at that altitude, or at all."""
        return self._pilot.avoidance_off or self._pilot.refusal(self._pilot.stop(altitude_m))

    def _do(self, steps: Iterable[Step], now_us: int) -> None:
        for step in steps:
            match step:
                case Propose(partner, climber, climb_m, level):
                    self._propose(partner, self._avoid(partner, climber, climb_m, level=level), now_us)
                case LeaveToPartner(partner, reason):
                    self._tell(f"{self._unit} does not avoid {partner}, which is to do all of it: {reason}", now_us)
                    self._propose(partner, self._avoid(partner, partner, 0.0, reason), now_us)
                case NeitherCan():
                    self._on_neither(step, now_us)
                case Over(partner):
                    self._close_neither(partner, now_us)
                case Divert() | ResumeRoute():
                    self._fly(step, now_us)

    def _avoid(
        self, partner: str, climber: str, climb_m: float, because: str | None = None, level: ManoeuvreRole | None = None
    ) -> Avoid:
        units, alarm = (self._unit, partner), self._alarm_of.get(partner, "")
        return Avoid(
            alarm=alarm,
            climber=climber,
            climb_m=min(climb_m, 1000.0),
            units=units,
            because=because,
            level=level and level.value,
        )

    def _fly(self, step: Divert | ResumeRoute, now_us: int) -> None:
        try:
            if isinstance(step, Divert):
                commands = self._pilot.divert(step.altitude_m, step.place)
                what = "holds" if step.altitude_m is None else f"goes to {step.altitude_m:.1f} m"
            else:
                commands = self._pilot.resume(step.raised_to_m, step.lowered_to_m)
                what = "flies on" if step == ResumeRoute() else "flies on, apart in height"
        except Refused as refused:
            self._not_flown(refused.reason, now_us, refused=False, overtaken=True)
            return
        for command in commands:
            self._emit(command)
        self._tell(f"{self._unit} {what}", now_us)

    def _follow_diversion(self, now_us: int) -> None:
        """See whether the vehicle flies its manoeuvre, once for each change of that."""
        diversion = self._pilot.diversion
        seen = None if diversion is None else (diversion.command.number, diversion.progress)
        if seen == self._seen:
            return
        self._seen = seen
        if diversion is not None and diversion.progress is OrderProgress.FLOWN:
            self._avoidance.on_flown()
        if diversion is None or diversion.progress not in NOT_FLOWN:
            return
        progress = diversion.progress
        self._not_flown(
            diversion.reason,
            now_us,
            refused=progress is OrderProgress.REFUSED,
            overtaken=progress is OrderProgress.OVERTAKEN,
        )

    def _not_flown(self, reason: str, now_us: int, *, refused: bool, overtaken: bool) -> None:
        own = self._pilot.fix
        if own is not None:
            self._tell(f"{self._unit} does not fly its manoeuvre: {reason}", now_us)
            steps = self._avoidance.on_not_flown(reason, own, self._may, now_us, refused=refused, overtaken=overtaken)
            self._do(steps, now_us)

    # -- telling -----------------------------------------------------------------------------------------------

    def _tell(self, text: str, now_us: int) -> None:
        """To the log, and to the delegators of tasks."""
        self._note(text)
        self._coordination.report(text, now_us)

    def _on_neither(self, step: NeitherCan, now_us: int) -> None:
        """Neither of the two avoids the other: an alarm of its own."""
        if step.partner in self._neither:
            return
        valid_us = self._clock.federation_us(now_us)
        reasons = dict(zip((self._unit, step.partner), step.reasons, strict=True))
        event = AlarmEvent(
            f"{NEITHER_CAN_AVOID} {self._unit} {step.partner} {valid_us}", "opened", NEITHER_CAN_AVOID,
            (self._unit, step.partner), valid_us, valid_us, {f"reason[{unit}]": why for unit, why in reasons.items()},
        )  # fmt: skip
        self._neither[step.partner] = event
        self._note(
            f"neither {self._unit} nor {step.partner} can avoid the other: {'; '.join(filter(None, step.reasons))}"
        )
        self._raise(event)

    def _close_neither(self, partner: str, now_us: int) -> None:
        event = self._neither.pop(partner, None)
        if event is not None:
            self._raise(event._replace(event="closed", detected_us=self._clock.federation_us(now_us)))
