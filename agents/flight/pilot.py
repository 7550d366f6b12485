"""The pilot: flies the platform's plan and carries out orders, within the rules for commanding aircraft.

A platform commands its vehicle only when it was given control, and only while the vehicle is armed, airborne and in
a guided mode; never below `floor_m` above home nor above `ceiling_m`. Every refusal names the rule that made it.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

from dyknow import Sample
from dyknow.model.errors import Refused
from navigation import vehicle
from navigation.geodesy import distance_m

RETRY_US = 2_000_000


class Fix(NamedTuple):
    """Where something is and how it moves: WGS-84 degrees, metres above mean sea level, metres per second (NED)."""

    valid_us: int
    latitude_deg: float
    longitude_deg: float
    altitude_m: float
    north_m_s: float = 0.0
    east_m_s: float = 0.0
    down_m_s: float = 0.0


class Waypoint(NamedTuple):
    latitude_deg: float
    longitude_deg: float
    altitude_m: float


@dataclass(frozen=True, slots=True)
class FlightPlan:
    """A route to fly once from `start_us` (federation time), or over and over."""

    waypoints: tuple[Waypoint, ...]
    speed_m_s: float = 5.0
    start_us: int = 0
    loop: bool = False
    arrival_m: float = 3.0


@dataclass(frozen=True, slots=True)
class FlightLimits:
    """Metres above home between which this platform may send its vehicle."""

    floor_m: float = 10.0
    ceiling_m: float = 120.0


@dataclass(slots=True)
class Pilot:
    """One vehicle's commands. Times are federation time.

    `control` is the person's consent to command the vehicle at all; without it the pilot only watches.
    """

    control: bool = False
    plan: FlightPlan | None = None
    limits: FlightLimits = field(default_factory=FlightLimits)
    status: vehicle.StatusReport | None = None
    home: vehicle.HomeReport | None = None
    fix: Fix | None = None
    _target: vehicle.TargetReport | None = None
    _leg: int = 0
    _diversion: vehicle.Order | None = None
    _raised_to_m: float | None = None
    _lowered_to_m: float | None = None
    _goal: vehicle.Order | None = None
    _standing: vehicle.Order | None = None
    _number: int = 0
    _again_us: int | None = None

    def on_report(self, report: vehicle.Report, now_us: int) -> list[vehicle.Command]:
        """Take what the vehicle says of itself; a command it denied is tried again after `RETRY_US`."""
        if isinstance(report, vehicle.StatusReport):
            self.status = report
            self._mind_takeover(report)
        elif isinstance(report, vehicle.HomeReport):
            self.home = report
        elif isinstance(report, vehicle.TargetReport) and self._diversion is None:
            self._target = report
        elif isinstance(report, vehicle.CommandResult) and report.number == self._number and not report.accepted:
            self._again_us = now_us + RETRY_US
        return []

    def _mind_takeover(self, status: vehicle.StatusReport) -> None:
        """An order from before a manual takeover is repeated once the vehicle is given back, in one flight."""
        if not status.armed:
            self._goal = self._standing
        elif not status.guided and not isinstance(self._standing, vehicle.LandOrder | vehicle.ReturnHomeOrder):
            self._goal = None

    def on_estimate(self, sample: Sample) -> list[vehicle.Command]:
        """Take a fused estimate (see `navigation.PositionFilter`) and fly on."""
        latitude, longitude, altitude, north, east, down = sample.value[:6]
        self.fix = Fix(sample.valid_us, latitude, longitude, altitude, north, east, down)
        return list(self._fly(sample.valid_us))

    def _fly(self, now_us: int) -> Iterator[vehicle.Command]:
        if self._again_us is not None and now_us >= self._again_us:
            self._goal, self._again_us = None, None
        if self._diversion is not None:
            wanted: vehicle.Order | None = self._diversion
        elif self.plan is None or self._standing is not None or now_us < self.plan.start_us:
            wanted = self._standing
        else:
            wanted = self._next_leg(self.plan)
        if wanted is None or wanted == self._goal or self.refusal(wanted) is not None:
            return
        self._goal = wanted
        yield self._command(wanted)

    def _next_leg(self, plan: FlightPlan) -> vehicle.Order | None:
        fix = self.fix
        if fix is None or self._leg >= len(plan.waypoints):
            return None
        there = plan.waypoints[self._leg]
        away_m = distance_m(fix.latitude_deg, fix.longitude_deg, there.latitude_deg, there.longitude_deg)
        if away_m <= plan.arrival_m:
            self._leg += 1
            if plan.loop:
                self._leg %= len(plan.waypoints)
            if self._leg >= len(plan.waypoints):
                return vehicle.HoldOrder()
            there = plan.waypoints[self._leg]
        altitude_m = there.altitude_m if self._raised_to_m is None else max(there.altitude_m, self._raised_to_m)
        if self._lowered_to_m is not None:
            altitude_m = min(altitude_m, self._lowered_to_m)
        return vehicle.GoToOrder(there.latitude_deg, there.longitude_deg, altitude_m, plan.speed_m_s)

    def _command(self, order: vehicle.Order) -> vehicle.Command:
        self._number += 1
        return vehicle.Command(self._number, order)

    def refusal(self, order: vehicle.Order) -> str | None:
        """The rule that forbids `order` now, in words, or None."""
        if not self.control:
            return "this platform was not given control of its vehicle (join with --control)"
        status = self.status
        if status is None:
            return "the vehicle has not said in what state it is"
        if not status.armed:
            return "the vehicle is not armed"
        if not status.airborne:
            return "the vehicle is not airborne"
        if not status.guided:
            return f"the vehicle is in mode {status.mode}, which takes no positions; a guided mode is needed"
        if isinstance(order, vehicle.GoToOrder):
            return self._outside(order.altitude_m)
        return None

    def _outside(self, altitude_m: float) -> str | None:
        if self.home is None:
            return "the vehicle's home is not known, so neither floor nor ceiling is"
        height_m = altitude_m - self.home.altitude_m
        if height_m < self.limits.floor_m - 0.01:
            return f"{height_m:.1f} m above home is below the floor of {self.limits.floor_m:.0f} m"
        if height_m > self.limits.ceiling_m + 0.01:
            return f"{height_m:.1f} m above home is above the ceiling of {self.limits.ceiling_m:.0f} m"
        return None

    def order(self, order: vehicle.Order) -> list[vehicle.Command]:
        """Carry out an order: it replaces the plan until `resume`.

        Raises:
            Refused: naming the rule.
        """
        reason = self.refusal(order)
        if reason is None and self._diversion is not None and isinstance(order, vehicle.GoToOrder | vehicle.HoldOrder):
            reason = "the vehicle is giving way to another; ask again when it flies on"
        if reason is not None:
            raise Refused(reason)
        self._diversion = None
        self._standing = self._goal = order
        return [self._command(order)]

    def divert(self, altitude_m: float | None) -> list[vehicle.Command]:
        """Leave the plan to avoid another vehicle: stop here, at `altitude_m` above mean sea level, or where it is.

        Raises:
            Refused: naming the rule.
        """
        fix = self.fix
        if altitude_m is None or fix is None:
            order: vehicle.Order = vehicle.HoldOrder()
        else:
            order = vehicle.GoToOrder(fix.latitude_deg, fix.longitude_deg, altitude_m)
        reason = self.refusal(order)
        if reason is not None:
            raise Refused(reason)
        self._diversion = self._goal = order
        return [self._command(order)]

    def resume(self, raised_to_m: float | None = None, lowered_to_m: float | None = None) -> list[vehicle.Command]:
        """Fly on as before the diversion or the order, not below the one or above the other while they are given."""
        was_diverted, self._diversion, self._goal = self._diversion is not None, None, None
        self._raised_to_m, self._lowered_to_m = raised_to_m, lowered_to_m
        if not was_diverted:
            self._standing = None
        elif self.plan is not None:
            self._leg = min(self._leg, len(self.plan.waypoints) - 1)  # who had arrived returns to where it was
        if self.plan is None and self._standing is None and self._target is not None:
            there = self._target
            self._standing = vehicle.GoToOrder(there.latitude_deg, there.longitude_deg, there.altitude_m)
        return [] if self.fix is None else list(self._fly(self.fix.valid_us))

    @property
    def flying(self) -> str:
        """What the vehicle is doing for us, in a word: `watching`, `diverted`, `order`, `plan` or `holding`."""
        if not self.control:
            return "watching"
        if self._diversion is not None:
            return "diverted"
        if isinstance(
            self._standing, vehicle.HoldOrder | vehicle.LandOrder | vehicle.ReturnHomeOrder | vehicle.GoToOrder
        ):
            return "order"
        if self.plan is not None and self._leg < len(self.plan.waypoints):
            return "plan"
        return "holding"
