"""The fence of a simulated vehicle: polygons and circles, a place outside, and the autopilot's reaction there. Pure.

ArduCopter flies home when it has left its fence; PX4 does what GF_ACTION says. Both check the place of an order, not the way.
"""

from collections.abc import Sequence
from math import hypot
from typing import Final, NamedTuple

from dyknow.navigation.fences import FenceArea, FenceKind
from dyknow.navigation.geodesy import LocalFrame
from dyknow.navigation.vehicle import FenceReport
from dyknow.sim_uavs.dynamics.flight import Flight, Mode, StatusText
from dyknow.sim_uavs.dynamics.quadcopter import Vector
from dyknow.sim_uavs.dynamics.settings import PersonaName

_PX4_MODES: Final = {2: Mode.GUIDED, 3: Mode.RTL, 5: Mode.LAND}
_PX4_TERMINATES: Final = 4
_UNION: Final = 2
"""FENCE_OPTIONS: one of the inclusions is enough."""


class _LocalArea(NamedTuple):
    """Metres north and east of home."""

    is_inclusion: bool
    corners: tuple[tuple[float, float], ...]
    centre: tuple[float, float]
    radius_m: float

    def has(self, point: Vector) -> bool:
        if not self.corners:
            return hypot(point.north - self.centre[0], point.east - self.centre[1]) <= self.radius_m
        is_inside = False
        for (north, east), (north_2, east_2) in zip(self.corners, (*self.corners[1:], self.corners[0]), strict=True):
            if (north > point.north) is not (north_2 > point.north):
                at_east = east + (point.north - north) / (north_2 - north) * (east_2 - east)
                is_inside ^= at_east > point.east
        return is_inside


class FlightFence:
    """The areas of one flight, and the reaction outside of them.

    Attributes:
        areas: inclusions and exclusions, degrees.
    """

    def __init__(self, flight: Flight, frame: LocalFrame, persona: PersonaName) -> None:
        self._flight, self._frame, self._is_px4 = flight, frame, persona == "px4"
        self.areas: tuple[FenceArea, ...] = ()
        self._local: list[_LocalArea] = []
        self._is_breached = False
        flight.is_barred = self.is_outside

    def take(self, areas: Sequence[FenceArea]) -> None:
        """Keep to these areas from now on."""
        self.areas, home_m = tuple(areas), self._frame.altitude_m
        self._local = [
            _LocalArea(
                area.kind is FenceKind.INCLUSION,
                tuple(self._frame.to_ned(*corner, home_m)[:2] for corner in area.corners),
                (0.0, 0.0) if area.centre is None else self._frame.to_ned(*area.centre, home_m)[:2],
                area.radius_m,
            )
            for area in areas
        ]

    @property
    def _is_union(self) -> bool:
        return self._is_px4 or bool(int(self._flight.settings.fence_options) & _UNION)

    def is_outside(self, point: Vector) -> bool:
        """Whether a point is outside, while the fence is on."""
        if not (self._local and self._flight.settings.keeps_areas):
            return False
        inclusions = [area.has(point) for area in self._local if area.is_inclusion]
        is_kept = not inclusions or (any(inclusions) if self._is_union else all(inclusions))
        return not is_kept or any(area.has(point) for area in self._local if not area.is_inclusion)

    def on_time(self) -> None:
        """Act once when the vehicle has left its areas."""
        flight = self._flight
        before, self._is_breached = self._is_breached, flight.airborne and self.is_outside(flight.body.position)
        if not self._is_breached or before or not flight.armed:
            return
        flight.events.append(StatusText(2, "Geofence violation" if self._is_px4 else "Fence breached"))
        action = int(flight.settings.fence_on)
        mode = _PX4_MODES.get(action) if self._is_px4 else Mode.RTL
        if mode is not None and flight.mode not in {mode, Mode.LAND}:
            flight.set_mode(mode)
        elif self._is_px4 and action == _PX4_TERMINATES:
            flight.disarm(force=True)

    def report(self, valid_us: int) -> FenceReport:
        """The whole fence, as the settings have it on."""
        settings = self._flight.settings
        areas = self.areas if settings.keeps_areas else ()
        return FenceReport(valid_us, *settings.fence, areas, self._is_union)
