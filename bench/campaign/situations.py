"""What one run of the campaign flies: pure data. Metres north, east and down of the origin of all scenarios; seconds after setting out."""

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

from dyknow.agents.places import FlightLimits
from dyknow.navigation.fences import FenceArea
from dyknow.sim_uavs.dynamics.quadcopter import AirframeLimits, Vector, Wind
from dyknow.sim_uavs.dynamics.settings import PersonaName, VehicleSettings

APART_M, APART_Z_M = 75.0, 21.0
"""Vehicles set out, and end, so far apart: horizontally or vertically."""

PLAN, GOTO, STATION, STREAMED = "plan", "goto", "station", "streamed"
AUTO, AUTO_LEAVE, RTL, RTL_LEAVE, LAND, LAND_LEAVE = "AUTO", "AUTO, leave", "RTL", "RTL, leave", "LAND", "LAND, leave"
HOVER = "hover"
WITH_LEAVE = frozenset({AUTO_LEAVE, RTL_LEAVE, LAND_LEAVE})
"""Ways in which the platform may interrupt what the autopilot flies by itself."""
ENDS_ON_GROUND = frozenset({RTL, RTL_LEAVE, LAND, LAND_LEAVE})


class Way(NamedTuple):
    """From where to where a vehicle flies, through which places, and by which order it does (`kind`); speed over ground in m/s.

    `by_user`: a user orders it to return or land through its platform; otherwise a ground station does.
    """

    kind: str
    places: tuple[Vector, ...]
    speed_m_s: float
    by_user: bool = False

    @property
    def start(self) -> Vector:
        return self.places[0]

    @property
    def end(self) -> Vector:
        """The last place; of those that land the place on the ground."""
        last = self.places[-1]
        return last._replace(down=0.0) if self.kind in ENDS_ON_GROUND else last

    @property
    def highest_m(self) -> float:
        return max(-place.down for place in self.places)


class DrawnVehicle(NamedTuple):
    """One vehicle: its way, what it can do, and what bounds it.

    Attributes:
        clock: by how much its platform's clock is wrong: us, ppm.
        persona: the autopilot whose habits it has.
        fence: the areas that its autopilot keeps to, or stays out of.
        is_hemmed: whether they may leave it no room on either side.
    """

    way: Way
    limits: AirframeLimits
    settings: VehicleSettings
    flight_limits: FlightLimits
    clock: tuple[int, float] = (0, 0.0)
    persona: PersonaName = "ardupilot"
    fence: tuple[FenceArea, ...] = ()
    is_hemmed: bool = False

    @property
    def failsafe(self) -> str:
        """What it does on a lost link, by the name and the value of its parameter; empty: nothing."""
        name = "NAV_DLL_ACT" if self.persona == "px4" else "FS_GCS_ENABLE"
        return f"{name} {self.settings.link_loss_action:.0f}" if self.settings.link_loss_action else ""

    def __str__(self) -> str:
        found = f"{self.way.kind} at {self.way.speed_m_s:.1f} m/s"
        return f"{found} ({self.failsafe} after {self.settings.link_loss_s:.0f} s)" if self.failsafe else found


class Trouble(NamedTuple):
    """Something that goes wrong.

    Attributes:
        kind: what, in words; the table counts by it.
        unit: the vehicle, or platform, that suffers.
        at_s, for_s: when it begins, and how long it lasts; None: for good.
        other: the other end of a link; None: all others.
        fault: of the simulated vehicle, if it is one.
        clock: by how much the clock of the platform is wrong from then on: us, ppm. A clock that is behind has stood still.
    """

    kind: str
    unit: int
    at_s: float
    for_s: float | None
    other: int | None = None
    fault: str = ""
    clock: tuple[int, float] = (0, 0.0)

    def __str__(self) -> str:
        lasts = "for good" if self.for_s is None else f"for {self.for_s:.0f} s"
        ends = "" if self.other is None else f"-{self.other}"
        wrong = f"{self.clock[0] / 1e6:+.2f} s {self.clock[1]:+.0f} ppm" if any(self.clock) else self.fault
        return f"{self.kind} {wrong}".strip() + f" of {self.unit}{ends} at {self.at_s:.0f} s {lasts}"


class Situation(NamedTuple):
    """All that happens in one run. `is_wired`: its vehicles are heard and commanded by MAVLink bytes."""

    seed: int
    geometry: str
    vehicles: tuple[DrawnVehicle, ...]
    troubles: tuple[Trouble, ...]
    wind: Wind
    is_wired: bool = False

    @property
    def causes(self) -> tuple[str, ...]:
        """The lines of the table in which this run counts."""
        bounds = [
            *("bound: autopilot's fence" for each in self.vehicles if each.settings.fence_on and not each.fence),
            *(f"bound: {area.kind} area" for each in self.vehicles for area in each.fence),
            *("bound: hemmed in" for each in self.vehicles if each.is_hemmed),
            *("bound: ceiling" for each in self.vehicles if each.flight_limits.ceiling_m < FlightLimits().ceiling_m),
            *(("bound: wind",) if self.wind.north_m_s or self.wind.east_m_s else ()),
        ]
        found = [
            f"geometry: {self.geometry}",
            f"vehicles: {len(self.vehicles)}",
            *sorted({f"mode: {each.way.kind}" for each in self.vehicles}),
            *(sorted({f"autopilot: {each.persona}" for each in self.vehicles}) if self.is_wired else ()),
            *sorted(set(bounds)),
            *sorted({f"failsafe: {each.failsafe}" for each in self.vehicles if each.failsafe}),
            *sorted({f"fault: {trouble.kind}" for trouble in self.troubles} or {"fault: none"}),
        ]
        return tuple(found)

    def __str__(self) -> str:
        ways = ", ".join(f"{each.persona}: {each}" if self.is_wired else str(each) for each in self.vehicles)
        return f"{self.geometry}: {ways}; {', '.join(map(str, self.troubles)) or 'no fault'}"


def are_apart(places: Sequence[Vector]) -> bool:
    """Whether no two of them are near each other."""
    return all(
        one.minus(other).horizontal >= APART_M or abs(one.down - other.down) >= APART_Z_M
        for one, other in combinations(places, 2)
    )
