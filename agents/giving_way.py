"""From a warning to a manoeuvre that both platforms agreed on, and back to the route (thesis 9.4.1).

The glue between alarms, the rules of `agents.avoidance`, acts to the partner, and the pilot. Times are the node clock.
"""

from collections.abc import Iterable

from agents.avoidance import Avoidance, Divert, Propose, Step
from agents.context import Context
from dyknow.errors import Refused
from federation.acts import Act, Performative
from federation.contents import Avoid, Content, Done, Reason
from navigation.vehicle import GoTo, Hold
from reasoning import AlarmEvent

ANSWER_WITHIN_US = 1_000_000
WARNING = "-warn"
"""What the names of monitors end in whose alarms start avoidance."""


class GivingWay:
    """The encounters of one platform, carried out.

    `log` keeps what was decided, for people: who climbs, who refused and why.
    """

    def __init__(self, context: Context) -> None:
        self._c = context
        self._avoidance = Avoidance(context.unit)
        self._alarm_of: dict[str, str] = {}
        self.log: list[str] = []

    @property
    def encounters(self) -> tuple[str, ...]:
        """The units this platform is avoiding, or about to."""
        return tuple(self._avoidance.encounters)

    # -- what happens ------------------------------------------------------------------------------------------

    def on_alarm(self, event: AlarmEvent, now_us: int) -> None:
        """A warning about another platform opened or closed here; that it closed is seen when positions change."""
        if len(event.units) != 2 or event.event == "closed":
            return
        partner = event.units[1]
        own, other = self._c.pilot.fix, self._c.fix_of(partner)
        if own is None or other is None:
            return
        reason = self._may(None)
        if reason is not None:
            self._note(f"{self._c.unit} does not move for {partner}: {reason}")
            return
        self._alarm_of[partner] = event.id
        self._do(self._avoidance.on_warning(partner, own, other, self._may, now_us), now_us)

    def on_avoid(self, act: Act, content: Avoid, now_us: int) -> None:
        """`(avoid ...)`: the partner proposes who climbs.

        Raises:
            Refused: the rule that keeps this platform from taking part, or a proposal of ours that goes first.
        """
        partner = act.sender.unit
        own, other = self._c.pilot.fix, self._c.fix_of(partner)
        if own is None:
            raise Refused("this platform does not know where it is")
        if content.climber not in {self._c.unit, partner} or set(content.units) != {self._c.unit, partner}:
            raise Refused("the manoeuvre is not between the two of us")
        if not self._c.avoidance:
            raise Refused("this platform was told not to give way")
        if other is None:
            raise Refused(f"this platform does not know where {partner} is")
        reason, steps = self._avoidance.on_proposal(partner, content.climber, own, other, self._may, now_us)
        if reason is not None:
            raise Refused(reason)
        self._alarm_of[partner] = content.alarm
        self._note(f"{self._c.unit} agrees with {partner} that {content.climber} climbs")
        self._do(steps, now_us)
        self._c.desk.answer(act, Performative.AGREE, None, now_us)
        self._c.desk.answer(act, Performative.INFORM, Done(), now_us)

    def on_moved(self, now_us: int) -> None:
        """Positions have changed: carry on with what was agreed, or end it."""
        own = self._c.pilot.fix
        if own is None:
            return
        for partner in self.encounters:
            other, warned = self._c.fix_of(partner), self._is_warned(partner)
            self._do(self._avoidance.on_moved(partner, own, other, self._may, now_us, warned=warned), now_us)

    def on_gone(self, partner: str, now_us: int) -> None:
        """The partner left the federation."""
        self._do(self._avoidance.on_gone(partner), now_us)

    def _is_warned(self, partner: str) -> bool:
        return any(
            name.endswith(WARNING) and partner in named.instances and named.instances[partner].monitor.alarm_id
            for name, named in self._c.gateway.monitors.named.items()
        )

    # -- steps -------------------------------------------------------------------------------------------------

    def _may(self, altitude_m: float | None) -> str | None:
        """The rule that forbids stopping at that altitude, or at all."""
        fix = self._c.pilot.fix
        if altitude_m is None or fix is None:
            return self._c.pilot.refusal(Hold())
        return self._c.pilot.refusal(GoTo(fix.latitude_deg, fix.longitude_deg, altitude_m))

    def _do(self, steps: Iterable[Step], now_us: int) -> None:
        for step in steps:
            if isinstance(step, Propose):
                self._propose(step, now_us)
                continue
            try:
                if isinstance(step, Divert):
                    self._c.fly(self._c.pilot.divert(step.altitude_m))
                    what = "holds" if step.altitude_m is None else f"goes to {step.altitude_m:.1f} m"
                else:
                    self._c.fly(self._c.pilot.resume(step.raised_to_m, step.lowered_to_m))
                    what = "flies on"
                self._note(f"{self._c.unit} {what}")
            except Refused as refused:
                self._avoidance.forget_order()
                self._note(f"{self._c.unit} does not move: {refused.reason}")

    def _propose(self, step: Propose, now_us: int) -> None:
        partner = step.partner

        def on_reply(reply: Act, said: Content | None, at_us: int) -> None:
            if reply.performative in {Performative.AGREE, Performative.INFORM}:  # the result may overtake the agree
                self._agreed(partner, step.climber, at_us)
            elif reply.performative in {Performative.REFUSE, Performative.NOT_UNDERSTOOD, Performative.FAILURE}:
                reason = said.text if isinstance(said, Reason) else "no reason given"
                if reason.startswith("superseded"):
                    self._avoidance.on_superseded(partner)
                else:
                    self._alone(partner, reason, at_us)

        def on_silence(why: str, at_us: int) -> None:
            self._alone(partner, why, at_us)

        self._c.desk.delegate(
            partner,
            Avoid(
                alarm=self._alarm_of.get(partner, ""),
                climber=step.climber,
                climb_m=step.climb_m,
                units=(self._c.unit, partner),
            ),
            now_us,
            on_reply=on_reply,
            on_silence=on_silence,
            reply_within_us=ANSWER_WITHIN_US,
        )

    def _agreed(self, partner: str, climber: str, now_us: int) -> None:
        own, other = self._c.pilot.fix, self._c.fix_of(partner)
        if own is not None and other is not None and self._avoidance.awaits(partner):
            self._note(f"{partner} agrees that {climber} climbs")
            self._do(self._avoidance.on_agreed(partner, own, other, self._may), now_us)

    def _alone(self, partner: str, reason: str, now_us: int) -> None:
        """The partner cannot or does not answer: the whole manoeuvre is ours."""
        own, other = self._c.pilot.fix, self._c.fix_of(partner)
        if own is not None and other is not None and self._avoidance.awaits(partner):
            self._note(f"{partner} leaves the manoeuvre to {self._c.unit}: {reason}")
            self._do(self._avoidance.on_declined(partner, own, other, self._may), now_us)

    def _note(self, text: str) -> None:
        self.log.append(text)
        del self.log[:-100]
