"""From a warning to a manoeuvre that both platforms agreed on, and back to the route (thesis 9.4.1).

The glue between alarms, the rules of `agents.flight.avoidance`, acts to the partner, and the pilot. Times are the node clock.
"""

from collections.abc import Callable, Iterable

from agents.actions import COORDINATION, Action, Offer
from agents.exchange.gateway import Gateway
from agents.flight.avoidance import Avoidance, Divert, Propose, Step
from agents.flight.pilot import Pilot
from agents.flight.places import Fix
from agents.interface import InterfaceAgent
from agents.monitoring.coordination import Coordination
from agents.monitoring.monitors import UnitMonitors
from agents.part import Part, PeerChange
from dyknow import NO_VALUE
from dyknow.model.errors import Refused, UnknownLabel, ValueNotAvailable
from federation.members.liveness import PlatformGone
from federation.messages.acts import Act, Performative
from federation.messages.contents import Avoid, Content, Reason
from navigation.vehicle import Command, GoToOrder, HoldOrder
from reasoning import AlarmEvent

ANSWER_WITHIN_US = 1_000_000


class GivingWay(Part):
    """The encounters of one platform, carried out.

    Args:
        gateway: where other units are, as far as this platform's streams know.
        monitors: whose alarms are about.
        coordination: whether a task wants platforms to give way when a monitor raises an alarm.
        emit: takes commands to the vehicle.
        may_avoid: whether this platform may give way at all.

    Attributes:
        log: what was decided, for users: which one climbs, which one refused and why.
    """

    offers = (Offer(COORDINATION, (Action(Avoid, "on_avoid"),)),)

    def __init__(
        self,
        unit: str,
        agent: InterfaceAgent,
        pilot: Pilot,
        gateway: Gateway,
        monitors: UnitMonitors,
        coordination: Coordination,
        emit: Callable[[Command], None],
        *,
        may_avoid: bool,
    ) -> None:
        self._unit, self._agent, self._pilot, self._gateway, self._emit = unit, agent, pilot, gateway, emit
        self._monitors, self._coordination, self._may_avoid = monitors, coordination, may_avoid
        self._avoidance = Avoidance(unit)
        self._alarm_of: dict[str, str] = {}
        self.log: list[str] = []

    @property
    def encounters(self) -> tuple[str, ...]:
        """The units this platform is avoiding, or about to."""
        return tuple(self._avoidance.encounters)

    # -- what happens ------------------------------------------------------------------------------------------

    def on_alarm(self, event: AlarmEvent, now_us: int) -> None:
        """A warning about another platform opened or closed here; that it closed is seen when positions change."""
        if not self._starts(event.monitor) or len(event.units) != 2 or event.event == "closed":
            return
        partner = event.units[1]
        own, other = self._pilot.fix, fix_of(self._gateway, partner)
        if own is None or other is None:
            return
        reason = self._may(None)
        if reason is not None:
            self._note(f"{self._unit} does not move for {partner}: {reason}")
            return
        self._alarm_of[partner] = event.id
        self._do(self._avoidance.on_warning(partner, own, other, self._may, now_us), now_us)

    def _starts(self, monitor: str) -> bool:
        """Whether an alarm of `monitor` starts a manoeuvre."""
        named = self._monitors.named.get(monitor)
        starts = named is not None and named.plan.profile.starts_avoidance
        return starts and self._may_avoid and self._coordination.avoids(monitor)

    def on_avoid(self, act: Act, content: Avoid, now_us: int) -> None:
        """`(avoid ...)`: the partner proposes which one climbs.

        Raises:
            Refused: the rule that keeps this platform from taking part, or a proposal of ours that goes first.
        """
        partner = act.sender.unit
        own, other = self._pilot.fix, fix_of(self._gateway, partner)
        if own is None:
            raise Refused("this platform does not know where it is")
        if content.climber not in {self._unit, partner} or set(content.units) != {self._unit, partner}:
            raise Refused("the manoeuvre is not between the two of us")
        if not self._may_avoid:
            raise Refused("this platform was told not to give way")
        if other is None:
            raise Refused(f"this platform does not know where {partner} is")
        reason, steps = self._avoidance.on_proposal(partner, content.climber, own, other, self._may, now_us)
        if reason is not None:
            raise reason
        self._alarm_of[partner] = content.alarm
        self._note(f"{self._unit} agrees with {partner} that {content.climber} climbs")
        self._do(steps, now_us)
        self._agent.done(act, now_us)

    def on_moved(self, now_us: int) -> None:
        """Positions have changed: carry on with what was agreed, or end it."""
        own = self._pilot.fix
        if own is None:
            return
        for partner in self.encounters:
            other, warned = fix_of(self._gateway, partner), self._is_warned(partner)
            self._do(self._avoidance.on_moved(partner, own, other, self._may, now_us, warned=warned), now_us)

    def on_peer(self, change: PeerChange, now_us: int) -> None:
        """A partner is gone: its encounter is over."""
        if isinstance(change, PlatformGone):
            self._do(self._avoidance.on_gone(change.unit), now_us)

    def _is_warned(self, partner: str) -> bool:
        return any(
            named.plan.profile.starts_avoidance
            and partner in named.instances
            and named.instances[partner].monitor.alarm_id
            for named in self._monitors.named.values()
        )

    # -- steps -------------------------------------------------------------------------------------------------

    def _may(self, altitude_m: float | None) -> str | None:
        """The rule that forbids stopping at that altitude, or at all."""
        fix = self._pilot.fix
        if altitude_m is None or fix is None:
            return self._pilot.refusal(HoldOrder())
        return self._pilot.refusal(GoToOrder(fix.latitude_deg, fix.longitude_deg, altitude_m))

    def _do(self, steps: Iterable[Step], now_us: int) -> None:
        for step in steps:
            if isinstance(step, Propose):
                self._propose(step, now_us)
                continue
            try:
                if isinstance(step, Divert):
                    commands = self._pilot.divert(step.altitude_m)
                    what = "holds" if step.altitude_m is None else f"goes to {step.altitude_m:.1f} m"
                else:
                    commands = self._pilot.resume(step.raised_to_m, step.lowered_to_m)
                    what = "flies on"
                for command in commands:
                    self._emit(command)
                self._note(f"{self._unit} {what}")
            except Refused as refused:
                self._avoidance.forget_order()
                self._note(f"{self._unit} does not move: {refused.reason}")

    def _propose(self, step: Propose, now_us: int) -> None:
        partner = step.partner

        def on_reply(reply: Act, said: Content | None, at_us: int) -> None:
            if reply.performative in {Performative.AGREE, Performative.INFORM}:  # the result may overtake the agree
                self._agreed(partner, step.climber, at_us)
            elif reply.performative in {Performative.REFUSE, Performative.NOT_UNDERSTOOD, Performative.FAILURE}:
                reason = said if isinstance(said, Reason) else Reason(text="no reason given")
                if reason.code == "superseded":
                    self._avoidance.on_superseded(partner)
                else:
                    self._alone(partner, reason.text, at_us)

        def on_silence(why: str, at_us: int) -> None:
            self._alone(partner, why, at_us)

        self._agent.delegate(
            partner,
            Avoid(
                alarm=self._alarm_of.get(partner, ""),
                climber=step.climber,
                climb_m=step.climb_m,
                units=(self._unit, partner),
            ),
            now_us,
            on_reply=on_reply,
            on_silence=on_silence,
            reply_within_us=ANSWER_WITHIN_US,
        )

    def _agreed(self, partner: str, climber: str, now_us: int) -> None:
        own, other = self._pilot.fix, fix_of(self._gateway, partner)
        if own is not None and other is not None and self._avoidance.awaits(partner):
            self._note(f"{partner} agrees that {climber} climbs")
            self._do(self._avoidance.on_agreed(partner, own, other, self._may), now_us)

    def _alone(self, partner: str, reason: str, now_us: int) -> None:
        """The partner cannot or does not answer: the whole manoeuvre is ours."""
        own, other = self._pilot.fix, fix_of(self._gateway, partner)
        if own is not None and other is not None and self._avoidance.awaits(partner):
            self._note(f"{partner} leaves the manoeuvre to {self._unit}: {reason}")
            self._do(self._avoidance.on_declined(partner, own, other, self._may), now_us)

    def _note(self, text: str) -> None:
        self.log.append(text)
        del self.log[:-100]


def fix_of(gateway: Gateway, unit: str) -> Fix | None:
    """Position and, where it is known, velocity of a unit; None where there is no position."""
    try:
        position = gateway.latest("heli-position", unit)
        altitude = gateway.latest("heli-altitude", unit)
    except (ValueNotAvailable, UnknownLabel):
        return None
    if NO_VALUE in (position.value, altitude.value):
        return None
    return Fix(position.valid_us, *position.value, *altitude.value, *_velocity(gateway, unit))


def _velocity(gateway: Gateway, unit: str) -> tuple[float, ...]:
    """North, east, down in m/s, or nothing where it is not known."""
    try:
        value = gateway.latest("heli-velocity", unit).value
    except (ValueNotAvailable, UnknownLabel):
        return ()
    return () if value is NO_VALUE else tuple(value)
