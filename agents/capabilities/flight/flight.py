"""The vehicle of a platform: its reports become streams, orders become commands. Faults of simulated ones."""

from collections.abc import Iterable
from typing import Final

from dyknow import US_PER_S, Sample, earlier
from dyknow.agents.actions import QUERIED, Action, Offer, Role
from dyknow.agents.capabilities.flight.arbiter import Commander, in_words
from dyknow.agents.capabilities.flight.arrival import Arrival
from dyknow.agents.capabilities.flight.below import occupied_below
from dyknow.agents.capabilities.flight.errand import Errand
from dyknow.agents.capabilities.flight.options import AvoidanceOptions
from dyknow.agents.capabilities.flight.pilot import Pilot
from dyknow.agents.capabilities.flight.requests import FLIGHT as FLIGHT_REQUESTS
from dyknow.agents.capabilities.flight.vehicle_streams import VehicleStreams
from dyknow.agents.effects import InjectFault, Reported
from dyknow.agents.exchange.gateway import Gateway
from dyknow.agents.exchange.local_instance import LocalInstance
from dyknow.agents.part import Followed, Part
from dyknow.agents.places import Waypoint, fences_of, place_text
from dyknow.agents.ports import PartRegistry, Ports
from dyknow.federation.members.offers import Service
from dyknow.federation.messages.acts import Act, Performative
from dyknow.federation.messages.contents import Done, Fault, FlightOutlook, Goto, Hold, Land, Reason, Resume, ReturnHome
from dyknow.federation.messages.contents.flight import MOST_PLACES
from dyknow.federation.messages.descriptions import ConditionEntry, LabelEntry
from dyknow.navigation.vehicle import (
    Command,
    GoToOrder,
    HoldOrder,
    InterruptOrder,
    LandOrder,
    LinkReport,
    Order,
    ReturnHomeOrder,
    StationReport,
    StatusReport,
)

FLIGHT: Final = Service("flight", "pilot")
FAULTS: Final = Service("fault-injection", "simulator")
FOLLOWS: Final = "follows "
"""How the condition of a vehicle begins that flies after an object."""


class FlightAgent(Part):
    """One vehicle: its pilot and its streams.

    Args:
        streams: made of its reports.
        local: the part whose deadline samples may move.
        on_moved: called after each estimate of where the vehicle is.
        emit: takes commands to the vehicle.
        note: takes what is heard of the vehicle, or why it is not heard.
        offer: called when its condition changes.
        may_avoid: whether this platform may give way at all.
        profiles: of monitors, which may have fences.
        camera_frame: the origin of the metres of objects, with cameras.
        conditions: the conditions that all parts report.
        contain: lets the pilot fly on when giving way raises.
        gateway: where other units are, as far as this platform's streams know.
        directory: the other members.
    """

    vital = True
    offers = (
        Offer(
            FLIGHT,
            (*FLIGHT_REQUESTS, Action(FlightOutlook, "on_outlook", QUERIED, Role.OBSERVER)),
        ),
    )
    takes = {Reported: "on_reported"}  # noqa: RUF012  (a declaration, like the class's methods)

    def __init__(self, ports: Ports, parts: PartRegistry) -> None:
        self._contain, self._gateway, self._directory = ports.contain, parts[Gateway.of], ports.directory
        self._profiles, self._frame, self._conditions = ports.config.profiles, ports.camera_frame, ports.conditions
        self._agent, self._clock, self.pilot = ports.agent, ports.clock, parts[Pilot.of]
        self.streams, self._emit = parts[VehicleStreams.of], ports.emit
        self._on_moved, self._note, self._offer = ports.on_moved, ports.note, ports.offer
        self._may_avoid = ports.config.options[AvoidanceOptions].avoidance
        self._link: ConditionEntry | None = None
        self._avoidance: ConditionEntry | None = None
        self._followed: Followed = (self, parts[LocalInstance])
        self._awaited: tuple[Act, Errand] | None = None
        self._arriving: tuple[Act, Arrival] | None = None

    def labels(self) -> Iterable[LabelEntry]:
        return self.streams.entries()

    def conditions(self) -> Iterable[ConditionEntry]:
        return tuple(condition for condition in (self._link, self._avoidance) if condition is not None)

    def on_reported(self, event: Reported, now_us: int) -> Followed:
        """The vehicle's word counts when it is taken, not when it was posted: timers may have passed since."""
        federation_us = self._clock.federation_us(now_us)
        if isinstance(event.report, LinkReport):
            self._on_link(event.report, now_us)
            return None
        if isinstance(event.report, StationReport):
            self._on_station(event.report)
            return None if self._tell(now_us) else self._followed
        self._fly(self.pilot.on_report(event.report, federation_us))
        self._on_estimates(self.streams.on_report(event.report, federation_us), now_us)
        changed = isinstance(event.report, StatusReport) and self._on_status(now_us)
        return None if self._tell(now_us) or changed else self._followed

    def _on_link(self, report: LinkReport, now_us: int) -> None:
        self._note(report.text)
        self._link = None if report.ok else ConditionEntry(text=report.text[:200], since_us=now_us)
        self._offer(now_us)

    def _on_station(self, report: StationReport) -> None:
        """A station that changes the mode, or flies by remote control, is the pilot's own hands; any other command is not."""
        if not report.commands:
            self._note(report.text)
        elif self.pilot.control:
            self.pilot.take_over(report.text)

    def _on_status(self, now_us: int) -> bool:
        """Show why the vehicle would not give way; whether that changed."""
        reason = self.pilot.avoidance_off if self._may_avoid else None
        text, before = f"avoidance off: {reason}", self._avoidance
        if (before and before.text) == (reason and text):
            return False
        self._avoidance = None if reason is None else ConditionEntry(text=text, since_us=now_us)
        self._note("avoidance on" if reason is None else text)
        self._offer(now_us)
        return True

    def _fly(self, commands: Iterable[Command]) -> None:
        for command in commands:
            self._emit(command)

    def _on_estimates(self, estimates: Iterable[Sample], now_us: int) -> None:
        for sample in estimates:
            self._fly(self.pilot.on_estimate(sample))
            self._on_moved(now_us)

    @property
    def deadline_us(self) -> int | None:
        due_us = earlier(self.streams.deadline_us, self.pilot.deadline_us)
        if self._awaited is not None:
            due_us = earlier(due_us, self._awaited[1].words_due_us)
        if self._arriving is not None:
            due_us = earlier(due_us, self._arriving[1].deadline_us)
        return None if due_us is None else self._clock.wall_us(due_us)

    def on_time(self, now_us: int) -> Followed:
        federation_us = self._clock.federation_us(now_us)
        self.pilot.on_time(federation_us)
        self._on_estimates(self.streams.on_time(federation_us), now_us)
        return None if self._tell(now_us) else self._followed

    # -- what is ahead -----------------------------------------------------------------------------------------

    def on_outlook(self, act: Act, _content: FlightOutlook, now_us: int) -> None:
        """`(flight-outlook)`: the places ahead, and what bounds them."""
        pilot, frame = self.pilot, self._frame
        ahead = _ahead(pilot)
        followed = (each.text for each in self._conditions() if each.text.startswith(FOLLOWS))
        outlook = FlightOutlook(
            commander=pilot.claims.commander.name.lower(),
            doing=next(followed, _doing(pilot))[:400],
            ahead=tuple(place_text(*each[:2]) for each in ahead[:MOST_PLACES]),
            again=pilot.claims.commander is Commander.ROUTE and pilot.plan is not None and pilot.plan.loop,
            altitude_m=ahead[0][2] if ahead else None,
            fences=fences_of(pilot.bounds, pilot.limits, self._profiles),
            origin=None if frame is None else place_text(frame.latitude_deg, frame.longitude_deg),
        )
        self._agent.answer(act, Performative.INFORM, outlook, now_us)

    # -- orders: done when the vehicle has taken them over; how far it has come, its position shows ---------------

    def on_goto(self, act: Act, content: Goto, now_us: int) -> None:
        """`(goto ...)`; raises Refused, naming the rule, as all orders do."""
        order = GoToOrder(content.latitude_deg, content.longitude_deg, content.altitude_m)
        self._order(act, order, now_us)
        if content.until is not None and self._awaited is not None:
            self._arriving = act, Arrival(order, self._awaited[1])

    def on_hold(self, act: Act, _content: Hold, now_us: int) -> None:
        """`(hold)`"""
        self._order(act, HoldOrder(), now_us)

    def on_land(self, act: Act, _content: Land, now_us: int) -> None:
        """`(land)`; refused while another member's vehicle is in the air below."""
        self._check_below(now_us)
        self._order(act, LandOrder(), now_us)

    def on_return_home(self, act: Act, _content: ReturnHome, now_us: int) -> None:
        """`(return-home)`"""
        self._order(act, ReturnHomeOrder(), now_us)

    def on_resume(self, act: Act, _content: Resume, now_us: int) -> None:
        """`(resume)`: a mission that waits continues; else the plan is flown again, or once to where it was sent before."""
        waits = self.pilot.mission.waits
        commands = self.pilot.proceed()
        if waits:
            self._agent.done(act, now_us, f"mission {self.pilot.mission.name} continues, which waited: {waits}")
        else:
            self._await(act, commands, now_us)

    def _check_below(self, now_us: int) -> None:
        """Raise Refused if another vehicle is in the air below."""
        pilot = self.pilot
        if pilot.fix is not None:
            units = [entry.unit for entry in self._directory.entries(gone=True)]
            at_us, home_m = self._clock.federation_us(now_us), pilot.bounds.home_altitude_m
            refusal = occupied_below(self._gateway, units, pilot.fix, home_m, at_us)
            if refusal is not None:
                raise refusal

    def _order(self, act: Act, order: Order, now_us: int) -> None:
        self._await(act, self.pilot.command(order), now_us)

    def _await(self, act: Act, commands: Iterable[Command], now_us: int) -> None:
        """Agree, send, and inform when the vehicle has taken the order over; a newer order ends the wait for an older."""
        self.supersede(now_us)
        self._fly(commands)
        self._agent.answer(act, Performative.AGREE, None, now_us)
        if self.pilot.errand is not None:
            self._awaited = act, self.pilot.errand

    def supersede(self, now_us: int) -> None:
        """A newer order is sent: end the wait for the one before."""
        waiting = self._awaited or self._arriving
        if waiting is not None:
            self._fail(waiting[0], "overtaken by a newer order", now_us)
        self._awaited = self._arriving = None

    def _tell(self, now_us: int) -> bool:
        """Inform of the order that is awaited if its outcome is known; whether it was."""
        if self._awaited is None:
            return self._tell_arrival(now_us)
        act, errand = self._awaited
        words_us = errand.words_due_us
        if words_us is not None and self.pilot.now_us < words_us:
            return False
        if errand.has_failed:
            self._fail(act, errand.reason, now_us)
            self._arriving = None
        elif errand.is_taken and self._arriving is not None:
            self._awaited = None
            return self._tell_arrival(now_us)
        elif errand.is_taken:
            self._agent.answer(act, Performative.INFORM, Done(text=errand.words), now_us)
        else:
            return False
        self._awaited = None
        return True

    def _tell_arrival(self, now_us: int) -> bool:
        """Inform of the arrival that is awaited, or of the reason why it does not come; whether that is known."""
        if self._arriving is None:
            return False
        act, arrival = self._arriving
        arrival.look(self.pilot)
        if not arrival.words:
            return False
        if arrival.has_failed:
            self._fail(act, arrival.words, now_us)
        else:
            self._agent.answer(act, Performative.INFORM, Done(text=arrival.words), now_us)
        self._arriving = None
        return True

    def _fail(self, act: Act, reason: str, now_us: int) -> None:
        self._agent.answer(act, Performative.FAILURE, Reason(text=reason), now_us)


def _ahead(pilot: Pilot) -> list[Waypoint]:
    """The places that the vehicle flies to, the next one first, for its commander."""
    commander, plan = pilot.claims.commander, pilot.plan
    if commander is Commander.ROUTE and plan is not None:
        return [*plan.waypoints[pilot.leg :], *(plan.waypoints[: pilot.leg] if plan.loop else ())]
    order: Order | None = pilot.standing
    if commander is Commander.AVOIDANCE and pilot.diversion is not None:
        order = pilot.diversion.order
    elif not isinstance(order, GoToOrder):
        order = pilot.others_target() if order is None else None
    if not isinstance(order, GoToOrder | InterruptOrder):
        return []
    return [Waypoint(order.latitude_deg, order.longitude_deg, order.altitude_m)]


def _doing(pilot: Pilot) -> str:
    """The vehicle's activity, in words."""
    claims, plan, standing = pilot.claims, pilot.plan, pilot.standing
    match claims.commander:
        case Commander.ROUTE if plan is not None:
            return f"flies its route, place {pilot.leg + 1} of {len(plan.waypoints)}"
        case Commander.ORDER if standing is not None:
            return in_words(standing)
        case Commander.MISSION:
            return f"mission {claims.mission}{'' if standing is None else f': {in_words(standing)}'}"
        case Commander.AVOIDANCE if pilot.diversion is not None:
            return f"gives way: {in_words(pilot.diversion.order)}"
        case Commander.HANDS:
            return claims.hands
    return "" if pilot.others_target() is None else "flies where others sent it"


class Faults(Part):
    """Fault injection into a simulated vehicle."""

    offers = (Offer(FAULTS, (Action(Fault, "on_fault", role=Role.COMMAND_CENTRE),)),)

    def __init__(self, ports: Ports, _parts: PartRegistry) -> None:
        self._agent, self._clock, self._emit = ports.agent, ports.clock, ports.emit

    def on_fault(self, act: Act, content: Fault, now_us: int) -> None:
        """`(fault kind: ...)`: for a while, or until it is taken back."""
        until_us = None
        if content.duration_s is not None:
            until_us = self._clock.federation_us(now_us) + round(content.duration_s * US_PER_S)
        self._emit(InjectFault(content.kind, content.value, until_us))
        self._agent.done(act, now_us)
