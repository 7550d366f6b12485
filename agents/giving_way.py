"""From a warning to a manoeuvre that both platforms agreed on, and back to the route (thesis 9.4.1).

The glue between alarms, the rules of `agents.avoidance`, acts to the partner, and the pilot. Times are the node clock.
"""

from collections.abc import Iterable

from agents.avoidance import Avoidance, Divert, Propose, Resume, Step
from agents.context import Context
from agents.pilot import Fix
from dyknow.errors import Refused
from federation.acts import Act, Performative
from federation.contents import Avoid, Content, Done, Reason
from navigation.geodesy import distance_m
from reasoning import AlarmEvent

ANSWER_WITHIN_US = 1_000_000


class GivingWay:
    """The encounters of one platform, carried out.

    `log` keeps what was decided, for people: who climbs, who refused and why.
    """

    def __init__(self, context: Context) -> None:
        self._c = context
        self._avoidance = Avoidance(context.unit)
        self._alarm_of: dict[str, str] = {}
        self.log: list[str] = []

    # -- warnings ----------------------------------------------------------------------------------------------

    def on_alarm(self, event: AlarmEvent, now_us: int) -> None:
        """A warning about another platform opened or closed here."""
        if len(event.units) != 2:
            return
        partner = event.units[1]
        if event.event == "closed":
            self._do(self._avoidance.on_clear(partner, now_us), now_us)
            return
        own, other = self._c.pilot.fix, self._c.fix_of(partner)
        if own is None or other is None:
            return
        if not self._c.pilot.control:
            return
        self._alarm_of[partner] = event.id
        self._do(self._avoidance.on_warning(partner, own, other, now_us), now_us)

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
        accepted, steps = self._avoidance.on_proposal(partner, content.climber, own, other, now_us)
        if not accepted:
            raise Refused("superseded by the proposal of ours that crossed this one")
        self._alarm_of[partner] = content.alarm
        refusal = self._perform(steps)
        if refusal is not None:
            self._avoidance.encounters.pop(partner, None)
            raise Refused(refusal)
        self._c.desk.answer(act, Performative.AGREE, None, now_us)
        self._c.desk.answer(act, Performative.INFORM, Done(), now_us)

    def on_gone(self, partner: str, now_us: int) -> None:
        self._do(self._avoidance.on_gone(partner), now_us)

    def on_moved(self, now_us: int) -> None:
        """Positions have changed: see whose wait is over."""
        for partner in list(self._avoidance.encounters):
            own, other = self._c.pilot.fix, self._c.fix_of(partner)
            if own is not None and other is not None:
                away_m = distance_m(own.latitude_deg, own.longitude_deg, other.latitude_deg, other.longitude_deg)
                self._do(self._avoidance.on_range(partner, away_m, now_us), now_us)

    @property
    def encounters(self) -> tuple[str, ...]:
        return tuple(self._avoidance.encounters)

    # -- steps -------------------------------------------------------------------------------------------------

    def _do(self, steps: Iterable[Step], now_us: int) -> None:
        for step in steps:
            if isinstance(step, Propose):
                self._propose(step, now_us)
            else:
                refusal = self._perform([step])
                if refusal is not None:
                    self._note(f"{self._c.unit} does not move: {refusal}")

    def _perform(self, steps: Iterable[Step]) -> str | None:
        """Fly the steps; the rule that forbids one, if any does."""
        try:
            for step in steps:
                if isinstance(step, Divert):
                    what = "holds" if step.altitude_m is None else f"goes to {step.altitude_m:.1f} m"
                    self._c.fly(self._c.pilot.divert(step.altitude_m))
                    self._note(f"{self._c.unit} {what} for {step.partner}")
                elif isinstance(step, Resume):
                    self._c.fly(self._c.pilot.resume(step.raised_to_m))
                    self._note(f"{self._c.unit} flies on, clear of {step.partner}")
        except Refused as refused:
            return refused.reason
        return None

    def _propose(self, step: Propose, now_us: int) -> None:
        partner = step.partner

        def on_reply(reply: Act, said: Content | None, at_us: int) -> None:
            own, other = self._c.pilot.fix, self._c.fix_of(partner)
            if own is None or other is None:
                return
            if reply.performative is Performative.AGREE:
                self._note(f"{partner} agrees that {step.climber} climbs")
                self._do(self._avoidance.on_agreed(partner, own, other), at_us)
            elif reply.performative in {Performative.REFUSE, Performative.NOT_UNDERSTOOD, Performative.FAILURE}:
                reason = said.text if isinstance(said, Reason) else "no reason given"
                if not reason.startswith("superseded"):
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

    def _alone(self, partner: str, reason: str, now_us: int) -> None:
        """The partner cannot or does not answer: the whole manoeuvre is ours."""
        own, other, home = self._c.pilot.fix, self._c.fix_of(partner), self._c.pilot.home
        if own is None or other is None:
            return
        lowest_m = (home.altitude_m if home is not None else own.altitude_m) + self._c.pilot.limits.floor_m
        self._note(f"{partner} leaves the manoeuvre to {self._c.unit}: {reason}")
        self._do(self._avoidance.on_declined(partner, own, other, lowest_m), now_us)

    def _note(self, text: str) -> None:
        self.log.append(text)
        del self.log[:-100]


__all__ = ["Fix", "GivingWay"]
