"""The vehicle of a platform: what it reports becomes streams, what is ordered becomes commands. Faults of simulated ones."""

from collections.abc import Callable, Iterable
from typing import Final

from agents.actions import Action, Offer, Role
from agents.effects import Effect, InjectFault, Reported
from agents.exchange.local_instance import LocalInstance
from agents.flight.errand import Errand
from agents.flight.giving_way import GivingWay
from agents.flight.pilot import Pilot
from agents.flight.vehicle_streams import VehicleStreams
from agents.interface import InterfaceAgent
from agents.part import Followed, Part
from agents.tasks.requests import FLIGHT as FLIGHT_REQUESTS
from dyknow import US_PER_S, Sample, earlier
from federation.members.clock import FederationClock
from federation.members.offers import Service
from federation.messages.acts import Act, Performative
from federation.messages.contents import Done, Fault, Goto, Hold, Land, Reason, Resume, ReturnHome
from federation.messages.descriptions import ConditionEntry, LabelEntry
from navigation.vehicle import (
    Command,
    GoToOrder,
    HoldOrder,
    LandOrder,
    LinkReport,
    Order,
    ReturnHomeOrder,
    StationReport,
    StatusReport,
)

FLIGHT: Final = Service("flight", "pilot")
FAULTS: Final = Service("fault-injection", "simulator")


class FlightAgent(Part):
    """One vehicle: its pilot and its streams.

    Args:
        streams: made of its reports.
        giving_way: looks at where the vehicle is after each estimate.
        local: the part whose deadline samples may move.
        emit: takes commands to the vehicle.
        note: takes what is heard of the vehicle, or why it is not heard.
        offer: called when its condition changes.
        may_avoid: whether this platform may give way at all.
    """

    offers = (
        Offer(
            FLIGHT,
            FLIGHT_REQUESTS,
        ),
    )
    takes = {Reported: "on_reported"}  # noqa: RUF012  (a declaration, like the class's methods)

    def __init__(
        self,
        agent: InterfaceAgent,
        clock: FederationClock,
        pilot: Pilot,
        streams: VehicleStreams,
        giving_way: GivingWay,
        local: LocalInstance,
        emit: Callable[[Command], None],
        note: Callable[[str], None],
        offer: Callable[[int], None],
        may_avoid: bool,
    ) -> None:
        self._agent, self._clock, self.pilot, self.streams, self._emit = agent, clock, pilot, streams, emit
        self._on_moved, self._note, self._offer = giving_way.on_moved, note, offer
        self._may_avoid = may_avoid
        self._link: ConditionEntry | None = None
        self._avoidance: ConditionEntry | None = None
        self._followed: Followed = (self, local)
        self._awaited: tuple[Act, Errand] | None = None

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
        """Another station that commands is the pilot's own hands."""
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
        return None if due_us is None else self._clock.wall_us(due_us)

    def on_time(self, now_us: int) -> None:
        federation_us = self._clock.federation_us(now_us)
        self.pilot.on_time(federation_us)
        self._on_estimates(self.streams.on_time(federation_us), now_us)
        self._tell(now_us)

    # -- orders: done when the vehicle has taken them over; how far it has come, its position shows ---------------

    def on_goto(self, act: Act, content: Goto, now_us: int) -> None:
        """`(goto ...)`; raises Refused, naming the rule, as all orders do."""
        self._order(act, GoToOrder(content.latitude_deg, content.longitude_deg, content.altitude_m), now_us)

    def on_hold(self, act: Act, _content: Hold, now_us: int) -> None:
        """`(hold)`"""
        self._order(act, HoldOrder(), now_us)

    def on_land(self, act: Act, _content: Land, now_us: int) -> None:
        """`(land)`"""
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

    def _order(self, act: Act, order: Order, now_us: int) -> None:
        self._await(act, self.pilot.order(order), now_us)

    def _await(self, act: Act, commands: Iterable[Command], now_us: int) -> None:
        """Agree, send, and inform when the vehicle has taken the order over; a newer order ends the wait for an older."""
        self.supersede(now_us)
        self._fly(commands)
        self._agent.answer(act, Performative.AGREE, None, now_us)
        if self.pilot.errand is not None:
            self._awaited = act, self.pilot.errand

    def supersede(self, now_us: int) -> None:
        """A newer order is sent: end the wait for the one before."""
        if self._awaited is not None:
            self._fail(self._awaited[0], "overtaken by a newer order", now_us)
        self._awaited = None

    def _tell(self, now_us: int) -> bool:
        """Inform of the order that is awaited if its outcome is known; whether it was."""
        if self._awaited is None:
            return False
        act, errand = self._awaited
        if errand.has_failed:
            self._fail(act, errand.reason, now_us)
        elif errand.is_taken:
            self._agent.answer(act, Performative.INFORM, Done(text=errand.words), now_us)
        else:
            return False
        self._awaited = None
        return True

    def _fail(self, act: Act, reason: str, now_us: int) -> None:
        self._agent.answer(act, Performative.FAILURE, Reason(text=reason), now_us)


class Faults(Part):
    """Fault injection into a simulated vehicle."""

    offers = (Offer(FAULTS, (Action(Fault, "on_fault", role=Role.COMMAND_CENTRE),)),)

    def __init__(self, agent: InterfaceAgent, clock: FederationClock, emit: Callable[[Effect], None]) -> None:
        self._agent, self._clock, self._emit = agent, clock, emit

    def on_fault(self, act: Act, content: Fault, now_us: int) -> None:
        """`(fault kind: ...)`: for a while, or until it is taken back."""
        until_us = None
        if content.duration_s is not None:
            until_us = self._clock.federation_us(now_us) + round(content.duration_s * US_PER_S)
        self._emit(InjectFault(content.kind, content.value, until_us))
        self._agent.done(act, now_us)
