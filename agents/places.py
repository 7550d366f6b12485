"""Where a vehicle is, where it is to fly, and between which bounds: values of the pilot and of avoidance."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import ceil, hypot, isfinite
from typing import NamedTuple

from dyknow.federation.messages.contents import Fence
from dyknow.federation.messages.contents.flight import MOST_FENCES, MOST_PLACES
from dyknow.navigation.fences import FENCE_MARGIN_M, FenceArea, fence_refusal
from dyknow.navigation.geodesy import distance_m
from dyknow.navigation.terrain.clearance import AerialPlace, judge_way
from dyknow.navigation.terrain.elevation import Elevation
from dyknow.navigation.vehicle import FenceReport, GoToOrder, HoldOrder, HomeReport, InterruptOrder, Order
from dyknow.reasoning import Profile

LEAP_M = 50.0


class Fix(NamedTuple):
    """Where something is and how it moves: WGS-84 degrees, metres above mean sea level, metres per second (NED)."""

    valid_us: int
    latitude_deg: float
    longitude_deg: float
    altitude_m: float
    north_m_s: float = 0.0
    east_m_s: float = 0.0
    down_m_s: float = 0.0

    @property
    def speed_m_s(self) -> float:
        """Over ground."""
        return hypot(self.north_m_s, self.east_m_s)


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

    def next_leg(self, leg: int, fix: Fix) -> tuple[int, Order | None]:
        """The leg after `fix` while on `leg`, and its order; None: the plan is over."""
        if leg >= len(self.waypoints):
            return leg, None
        there, last = self.waypoints[leg], leg + 1 == len(self.waypoints) and not self.loop
        up_m = there.altitude_m - fix.altitude_m if last else 0.0
        if distance_m(fix.latitude_deg, fix.longitude_deg, *there[:2], up_m) <= self.arrival_m:
            leg += 1
            if self.loop:
                leg %= len(self.waypoints)
            if leg >= len(self.waypoints):
                return leg, HoldOrder()
            there = self.waypoints[leg]
        return leg, GoToOrder(*there, self.speed_m_s)


@dataclass(frozen=True, slots=True)
class FlightLimits:
    """Metres above home between which this platform may send its vehicle, how far from home, and the ground below."""

    floor_m: float = 10.0
    ceiling_m: float = 120.0
    range_m: float = 1000.0
    elevation: Elevation | None = None


class Bounds:
    """Home and the autopilot's own fence, as far as they are known, and the check of places against them.

    The vehicle reports home; its altitude alone also follows from an altitude and a height above home.

    Attributes:
        unknown_ground: the first place that was to be flown to or over whose elevation is not known, in degrees.
    """

    def __init__(self) -> None:
        self.home: HomeReport | None = None
        self.fence: FenceReport | None = None
        self.unknown_ground: tuple[float, float] | None = None
        self._last_home: HomeReport | None = None
        self._home_altitude_m: float | None = None

    def on_home(self, home: HomeReport, *, flying: bool) -> str | None:
        """Take a home over, or say why not: in flight it does not leap."""
        if not all(map(isfinite, home[1:])):
            return "home: expected finite degrees and metres"
        known = self._last_home
        if flying and known is not None:
            level_m = distance_m(known.latitude_deg, known.longitude_deg, home.latitude_deg, home.longitude_deg)
            leap_m = max(level_m, abs(known.altitude_m - home.altitude_m))
            if leap_m > LEAP_M:
                self.home = known
                return f"home leapt by {leap_m:.0f} m in flight; floor, ceiling and range stay at the old one"
        self.home = self._last_home = home
        return None

    def on_height(self, altitude_m: float, height_m: float) -> None:
        """An altitude above the sea and the height above home at one place."""
        if isfinite(altitude_m) and isfinite(height_m):
            self._home_altitude_m = altitude_m - height_m

    def forget(self) -> None:
        """The vehicle was silent: its home has to be reported again."""
        self.home = self._home_altitude_m = None

    @property
    def home_altitude_m(self) -> float | None:
        return self._home_altitude_m if self.home is None else self.home.altitude_m

    def within(self, altitude_m: float, limits: FlightLimits) -> float:
        """The altitude, or the nearest between floor and ceiling, where home is known."""
        home_m = self.home_altitude_m
        if home_m is None:
            return altitude_m
        return min(max(altitude_m, home_m + limits.floor_m), home_m + limits.ceiling_m)

    def outside(self, order: Order, limits: FlightLimits, fix: Fix | None) -> str | None:
        """The bound that `order` breaks, in words, or None."""
        if not isinstance(order, GoToOrder | InterruptOrder):
            return None
        if not all(map(isfinite, (order.latitude_deg, order.longitude_deg, order.altitude_m))):
            return "the place is not a number"
        return (
            self._too_low_or_high(order.altitude_m, limits)
            or self._too_far(order, limits, fix)
            or self._fenced_off(order, fix)
            or self._near_ground(order, limits, fix)
        )

    def _near_ground(self, order: GoToOrder | InterruptOrder, limits: FlightLimits, fix: Fix | None) -> str | None:
        """The ground that the place, or the straight way there, comes too near, as far as its elevation is known."""
        if limits.elevation is None:
            return None
        start = None if fix is None else AerialPlace(fix.latitude_deg, fix.longitude_deg, fix.altitude_m)
        end = AerialPlace(order.latitude_deg, order.longitude_deg, order.altitude_m)
        judged = judge_way(limits.elevation, start, end, limits.floor_m, 0.0 if fix is None else fix.speed_m_s)
        self.unknown_ground = self.unknown_ground or judged.unknown
        return judged.refusal

    def _fenced_off(self, order: GoToOrder | InterruptOrder, fix: Fix | None) -> str | None:
        """The polygon or circle of the autopilot's fence that forbids the place, or the straight way there."""
        if self.fence is None or not self.fence.areas:
            return None
        here = None if fix is None else (fix.latitude_deg, fix.longitude_deg)
        there = order.latitude_deg, order.longitude_deg
        return fence_refusal(self.fence.areas, here, there, union=self.fence.is_union)

    def _too_low_or_high(self, altitude_m: float, limits: FlightLimits) -> str | None:
        home_m = self.home_altitude_m
        if home_m is None:
            return "the vehicle's home is not known, so neither floor nor ceiling is"
        height_m = altitude_m - home_m
        if height_m < limits.floor_m - 0.01:
            return f"{height_m:.1f} m above home is below the floor of {limits.floor_m:.0f} m"
        if height_m > limits.ceiling_m + 0.01:
            return f"{height_m:.1f} m above home is above the ceiling of {limits.ceiling_m:.0f} m"
        fence = self.fence
        if fence is None:
            return None
        if fence.highest_m is not None and height_m > fence.highest_m - FENCE_MARGIN_M + 0.01:
            return f"{height_m:.1f} m above home is not {FENCE_MARGIN_M:.0f} m below the autopilot's fence of {fence.highest_m:.0f} m"
        if fence.lowest_m is not None and height_m < fence.lowest_m + FENCE_MARGIN_M - 0.01:
            return f"{height_m:.1f} m above home is not {FENCE_MARGIN_M:.0f} m above the autopilot's fence of {fence.lowest_m:.0f} m"
        return None

    def _too_far(self, order: GoToOrder | InterruptOrder, limits: FlightLimits, fix: Fix | None) -> str | None:
        """The way back counts: a vehicle that is outside already may stop, or come nearer."""
        centre, name = (self.home, "home") if self.home is not None else (fix, "where it is")
        if centre is None:
            return "neither home nor the vehicle's place is known, so its range is not"
        there_m = distance_m(centre.latitude_deg, centre.longitude_deg, order.latitude_deg, order.longitude_deg)
        here_m = 0.0
        if fix is not None:
            here_m = distance_m(centre.latitude_deg, centre.longitude_deg, fix.latitude_deg, fix.longitude_deg)
        if there_m > max(limits.range_m, here_m) + 0.01:
            return f"{there_m:.0f} m from {name} is beyond the range of {limits.range_m:.0f} m"
        radius_m = None if self.fence is None or self.home is None else self.fence.radius_m
        if radius_m is not None and there_m > max(radius_m - FENCE_MARGIN_M, here_m) + 0.01:
            return f"{there_m:.0f} m from home is not {FENCE_MARGIN_M:.0f} m inside the autopilot's fence of {radius_m:.0f} m"
        return None


def place_text(latitude_deg: float, longitude_deg: float) -> str:
    """A place as acts write it."""
    return f"{latitude_deg:.7f} {longitude_deg:.7f}"


def _shown(area: FenceArea) -> Fence:
    """A polygon or circle as acts write it; of more corners than an act holds every second, third, ... one."""
    every = ceil(len(area.corners) / MOST_PLACES) or 1
    return Fence(
        name=f"autopilot: {area}",
        centre=None if area.centre is None else place_text(*area.centre),
        radius_m=None if area.centre is None else area.radius_m,
        corners=tuple(place_text(*corner) for corner in area.corners[::every]),
    )


def fences_of(bounds: Bounds, limits: FlightLimits, profiles: Mapping[str, Profile]) -> tuple[Fence, ...]:
    """The fences of a vehicle: this platform's limits, the autopilot's own fence, and those of the monitor profiles."""
    home, own = bounds.home, bounds.fence
    centre = None if home is None else place_text(home.latitude_deg, home.longitude_deg)
    found = [
        Fence(
            name="limits", centre=centre, radius_m=limits.range_m, lowest_m=limits.floor_m, highest_m=limits.ceiling_m
        )
    ]
    if own is not None:
        found.append(
            Fence(
                name="autopilot", centre=centre, radius_m=own.radius_m, lowest_m=own.lowest_m, highest_m=own.highest_m
            )
        )
        found += map(_shown, own.areas)
    for name, profile in profiles.items():
        if profile.fence:
            corners = tuple(place_text(*corner) for corner in profile.fence[:MOST_PLACES])
            found.append(Fence(name=name, corners=corners))
    return tuple(found[:MOST_FENCES])
