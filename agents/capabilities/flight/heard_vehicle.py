"""State of a vehicle as heard by its platform, and the orders that this state allows. Times are federation time."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from dyknow.agents.capabilities.flight import arbiter
from dyknow.agents.capabilities.flight.targets import Targets
from dyknow.agents.places import Bounds, Fix, FlightLimits, FlightPlan
from dyknow.model.errors import Refused
from dyknow.navigation import vehicle
from dyknow.navigation.cruise import CruiseReport
from dyknow.navigation.mission_plans import MissionItem

FORBIDDEN: Final = "forbidden"
"""The code of a refusal by a rule."""


class InterruptedMission(NamedTuple):
    """A mission of the autopilot's that was interrupted: its item, and where it was flying to, if the vehicle reports that."""

    item: int | None
    towards: vehicle.GoToOrder | None


@dataclass(slots=True)
class HeardVehicle:
    """One vehicle's state, as it reports it.

    Attributes:
        control: the person's consent to command the vehicle at all; without it the pilot only watches.
        missions: the person's consent to interrupt a mission (AUTO) in order to give way.
        clock: federation time now; None: the time of the last event.
        note: takes words for users.
        winch: the last report of its winch.
        handled: the answer to the last order to its winch or gripper; None: there is none yet.
        failsafe: its autopilot's action when its link is lost; None: not reported.
        cruise: how fast its autopilot flies to places by itself.
        battery: the remaining charge; None: not reported.
        loaded: the items of its mission; empty: it has none, or they are not known.
        heard_us: when it last reported its state.
        targets: where it flies to, and by whose word.
    """

    control: bool = False
    plan: FlightPlan | None = None
    limits: FlightLimits = field(default_factory=FlightLimits)
    missions: bool = False
    clock: Callable[[], int] | None = None
    note: Callable[[str], None] = lambda _text: None
    status: vehicle.StatusReport | None = None
    fix: Fix | None = None
    bounds: Bounds = field(default_factory=Bounds)
    failsafe: vehicle.FailsafeReport | None = None
    cruise: CruiseReport = field(default_factory=lambda: CruiseReport(0))
    battery: vehicle.BatteryReport | None = None
    loaded: tuple[MissionItem, ...] = ()
    _now_us: int = 0
    heard_us: int = 0
    targets: Targets = field(default_factory=Targets)
    winch: vehicle.WinchReport | None = None
    handled: vehicle.CommandResult | None = None
    _number: int = 0
    _handling: int = -1
    _is_ground_noted: bool = False

    @property
    def now_us(self) -> int:
        return self._now_us if self.clock is None else max(self._now_us, self.clock())

    def refusal(self, order: vehicle.Order, *, in_person: bool = False, start: Fix | None = None) -> str | None:
        """The rule that forbids `order` now, in words, or None.

        Args:
            order: the order that the vehicle would carry out.
            in_person: a user asks for it, not a rule or a mission.
            start: where it would be then; None: where it is.
        """
        silent_us = self.now_us - self.heard_us
        if isinstance(order, arbiter.GROUND):
            return arbiter.grounded(order, self.status, silent_us, control=self.control)
        return (
            arbiter.unready(self.status, silent_us, control=self.control)
            or arbiter.unguided(order, self.status, missions=self.missions, in_person=in_person)
            or self._outside(order, self.fix if start is None else start)
        )

    def _outside(self, order: vehicle.Order, start: Fix | None) -> str | None:
        refusal, unknown = self.bounds.outside(order, self.limits, start), self.bounds.unknown_ground
        if unknown is not None and not self._is_ground_noted:
            self._is_ground_noted = True
            place = f"{unknown[0]:.5f},{unknown[1]:.5f}"
            self.note(f"the elevation of {place} is not known: the floor is above home alone where it is not")
        return refusal

    @property
    def may_interrupt(self) -> bool:
        """Whether the vehicle flies a mission, returns or lands, and may be interrupted in that."""
        return self.missions and self.status is not None and self.status.mode in vehicle.INTERRUPTIBLE_MODES

    def check(self, order: vehicle.Order, *, in_person: bool = False) -> None:
        """Raise Refused if a rule forbids `order`; see `refusal`."""
        reason = self.refusal(order, in_person=in_person)
        if reason is not None:
            raise Refused(reason, FORBIDDEN)

    def numbered(self, order: vehicle.Order) -> vehicle.Command:
        """The order as the next command."""
        self._number += 1
        return vehicle.Command(self._number, order)

    def handle(self, order: vehicle.GripOrder | vehicle.LineOrder | vehicle.PointMountOrder) -> vehicle.Command:
        """An order to winch, gripper or mount, which moves the vehicle nowhere; `handled` is its answer. Raises Refused."""
        self.check(order)
        self.handled, command = None, self.numbered(order)
        self._handling = command.number
        return command

    def _on_bounding(
        self, report: vehicle.PositionReport | vehicle.FenceReport | vehicle.FailsafeReport | CruiseReport
    ) -> None:
        """Take a report that bounds the flight: a height, a fence, a failsafe or a cruise speed."""
        match report:
            case vehicle.PositionReport(altitude_m=float() as altitude_m, height_m=float() as height_m):
                self.bounds.on_height(altitude_m, height_m)
            case vehicle.FenceReport():
                self.bounds.fence = report
            case vehicle.FailsafeReport():
                self.failsafe = report
            case CruiseReport():
                self.cruise = report

    def _on_handled(self, report: vehicle.WinchReport | vehicle.CommandResult) -> None:
        if isinstance(report, vehicle.WinchReport):
            self.winch = report
        elif report.number == self._handling:
            self.handled = report

    def others_target(self) -> vehicle.GoToOrder | None:
        """Where a ground station, or the mission, has sent the vehicle, as it reported last, also before a gap of the link."""
        return self.targets.way_back()

    def stop(self, altitude_m: float | None, place: tuple[float, float] | None = None) -> vehicle.Order:
        """The order to stop there, see `divert`; in a mission it is one that leaves it."""
        fix, interrupts = self.fix, self.may_interrupt
        if fix is None or (altitude_m is None and place is None and not interrupts):
            return vehicle.HoldOrder()
        latitude_deg, longitude_deg = place or (fix.latitude_deg, fix.longitude_deg)
        there = latitude_deg, longitude_deg, fix.altitude_m if altitude_m is None else altitude_m
        stops = place is None
        return vehicle.InterruptOrder(*there, stops) if interrupts else vehicle.GoToOrder(*there, stops=stops)
