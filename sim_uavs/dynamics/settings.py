"""The configuration of a simulated vehicle: its place, its flight, the wind, the errors of its sensors. Pure data."""

from dataclasses import dataclass, field
from typing import Literal, NamedTuple, TypeAlias

from dyknow.navigation.fences import FenceArea
from dyknow.sim_uavs.dynamics.faults import ScheduledFault
from dyknow.sim_uavs.dynamics.quadcopter import AirframeLimits, Wind
from dyknow.sim_uavs.dynamics.sensors import GpsNoise, ImuNoise

Peer: TypeAlias = tuple[str, int]  # host and UDP port
PersonaName: TypeAlias = Literal["ardupilot", "ardupilot-3.3", "px4"]
FENCE_HIGHEST, FENCE_RADIUS, FENCE_AREAS, FENCE_LOWEST = 1, 2, 4, 8
"""The bits of `fence_kinds`, as ArduPilot's FENCE_TYPE has them."""


class HomePlace(NamedTuple):
    """WGS-84 degrees, metres above mean sea level."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float


@dataclass(slots=True)
class VehicleSettings:
    """The settings that an operator may change in flight through the vehicle's parameters. Speeds m/s, heights m above
    home.

    `battery_low_action`: its reaction, once, when `battery_low` is reached in the air: 0 warns, 1 lands, 2 returns.
    """

    cruise_m_s: float = 8.0
    climb_m_s: float = 3.0
    descent_m_s: float = 2.0
    land_m_s: float = 1.0
    take_off_m: float = 10.0
    return_m: float = 20.0
    battery_low: float = 0.25
    battery_critical: float = 0.08
    battery_low_action: float = 0.0
    disarm_s: float = 10.0
    fence_on: float = 0.0
    fence_kinds: float = 7.0
    fence_highest_m: float = 100.0
    fence_lowest_m: float = -10.0
    fence_radius_m: float = 300.0
    fence_options: float = 0.0
    link_loss_action: float = 0.0
    link_loss_s: float = 5.0
    link_loss_options: float = 0.0
    link_loss_wait_s: float = 0.0
    station_id: float = 255.0
    final_m: float = 0.0
    offboard_loss_action: float = 0.0
    offboard_loss_s: float = 1.0
    gripper_on: float = 0.0
    winch_type: float = 0.0
    winch_m_s: float = 1.0

    @property
    def fence(self) -> tuple[float | None, float | None, float | None]:
        """Lowest, highest and farthest from home that the fence allows, in metres; None where it has no such bound."""
        kinds = int(self.fence_kinds) if self.fence_on else 0
        return (
            self.fence_lowest_m if kinds & FENCE_LOWEST else None,
            self.fence_highest_m if kinds & FENCE_HIGHEST else None,
            self.fence_radius_m if kinds & FENCE_RADIUS else None,
        )

    @property
    def keeps_areas(self) -> bool:
        """Whether polygons and circles count."""
        return bool(self.fence_on and int(self.fence_kinds) & FENCE_AREAS)

    def is_fenced_off(self, away_m: float, height_m: float) -> bool:
        """Whether a point so far from home and so high above it lies outside of the fence, by the kinds that are on."""
        lowest_m, highest_m, radius_m = self.fence
        return bool(
            (highest_m is not None and height_m > highest_m)
            or (radius_m is not None and away_m > radius_m)
            or (lowest_m is not None and height_m < lowest_m)
        )


@dataclass(frozen=True, slots=True)
class VehicleConfig:
    """One vehicle. `airborne_m` above 0 starts it armed and guided, hovering at that height above home.

    `has_mount`: whether it carries a camera on a mount. `faults` begin by themselves. `fence`: the
    polygons and circles of its autopilot, kept to while `settings.fence_on`. `peers` are sent everything from the
    start and never forgotten; others are learned when they speak.
    """

    system_id: int
    home: HomePlace
    persona: PersonaName = "ardupilot"
    heading_deg: float = 0.0
    airborne_m: float = 0.0
    charge: float = 1.0
    seed: int = 0
    peers: tuple[Peer, ...] = ()
    has_mount: bool = False
    faults: tuple[ScheduledFault, ...] = ()
    fence: tuple[FenceArea, ...] = ()
    limits: AirframeLimits = field(default_factory=AirframeLimits)
    wind: Wind = field(default_factory=Wind)
    gps: GpsNoise = field(default_factory=GpsNoise)
    imu: ImuNoise = field(default_factory=ImuNoise)
    settings: VehicleSettings = field(default_factory=VehicleSettings)
