"""A vehicle as its platform sees it: reports in, commands out. Units and frames are SI and WGS-84 here.

Edges (the MAVLink feed, a log, the simulated world) turn their messages into these reports; times are already
federation time, mapped as each edge documents.
"""

from collections.abc import Mapping
from enum import StrEnum
from typing import NamedTuple, TypeAlias

from dyknow.navigation.cruise import CruiseReport
from dyknow.navigation.fences import FenceArea
from dyknow.navigation.heard_aircraft import HeardAircraft
from dyknow.navigation.mission_plans import MissionPlanReport

LONGEST_LINE_M = 50.0


def stopping_distance_m(speed_m_s: float) -> float:
    """How far a copter flies on after an order to stop: half a second, and braking at 2.5 m/s^2 (ArduCopter's default)."""
    return 0.5 * speed_m_s + speed_m_s**2 / 5.0


class PositionReport(NamedTuple):
    """Latitude and longitude in degrees (WGS-84), altitude in metres above mean sea level.

    `altitude_m` is None where the source states no usable altitude (before home was set). Standard deviations are
    metres; None means the message states none. `height_m` is metres above home, where the message carries it.
    """

    valid_us: int
    source: str
    latitude_deg: float
    longitude_deg: float
    altitude_m: float | None
    horizontal_sd_m: float | None = None
    vertical_sd_m: float | None = None
    height_m: float | None = None


class VelocityReport(NamedTuple):
    """North, east, down in metres per second; None where the message does not say."""

    valid_us: int
    source: str
    north_m_s: float
    east_m_s: float
    down_m_s: float | None
    sd_m_s: float | None = None


class LocalPositionReport(NamedTuple):
    """North, east, down in metres from the vehicle's own origin (LOCAL_POSITION_NED), with velocity."""

    valid_us: int
    source: str
    north_m: float
    east_m: float
    down_m: float
    north_m_s: float
    east_m_s: float
    down_m_s: float


class AttitudeReport(NamedTuple):
    """Roll, pitch, yaw in radians, body relative to NED."""

    valid_us: int
    source: str
    roll_rad: float
    pitch_rad: float
    yaw_rad: float


class AccelerationReport(NamedTuple):
    """Specific force in the body frame (forward, right, down), metres per second squared, gravity included."""

    valid_us: int
    source: str
    x_m_s2: float
    y_m_s2: float
    z_m_s2: float


class BatteryReport(NamedTuple):
    """Remaining charge as a fraction of full, 0..1; current in amperes where known."""

    valid_us: int
    fraction: float
    current_a: float | None = None


class HomeReport(NamedTuple):
    """Where the vehicle took off: degrees, metres above mean sea level."""

    valid_us: int
    latitude_deg: float
    longitude_deg: float
    altitude_m: float


class StatusReport(NamedTuple):
    """The autopilot's report about itself; None where it states nothing."""

    valid_us: int
    armed: bool
    guided: bool
    airborne: bool | None
    mode: str


class TargetReport(NamedTuple):
    """Where a guided vehicle is flying to (POSITION_TARGET_GLOBAL_INT)."""

    valid_us: int
    latitude_deg: float
    longitude_deg: float
    altitude_m: float


class TextReport(NamedTuple):
    """A sentence of the autopilot's for its operator (STATUSTEXT); MAVLink severities, 0 emergency to 4 warning."""

    valid_us: int
    severity: int
    text: str


class MissionReport(NamedTuple):
    """Which item of its mission the vehicle flies, or would fly (MISSION_CURRENT)."""

    valid_us: int
    item: int


class FenceReport(NamedTuple):
    """The autopilot's own fence: metres above home, and metres from home; None where it sets no such bound.

    Attributes:
        areas: polygons and circles that it keeps to, or stays out of.
        is_union: it keeps to one of its inclusions, wherever they overlap or not; else to all of them at once.
    """

    valid_us: int
    lowest_m: float | None = None
    highest_m: float | None = None
    radius_m: float | None = None
    areas: tuple[FenceArea, ...] = ()
    is_union: bool = False


class LinkLossAction(StrEnum):
    """An autopilot's reaction to the loss of its link."""

    CARRY_ON = "carry-on"
    """The order under way is carried out, or the mission flown, and it stands there."""
    HOLD = "hold"
    RETURN = "return"
    LAND = "land"
    TERMINATE = "terminate"


class FailsafeReport(NamedTuple):
    """The autopilot's reaction when no ground station is heard, by its parameters; None where they are unknown.

    Attributes:
        action: in a guided mode.
        delay_s: how long the link has been lost when it begins.
        in_mission: its reaction in a mission (AUTO).
        in_offboard: its reaction where targets are streamed, and no longer come (PX4: OFFBOARD).
        return_height_m: metres above home to which it climbs before it returns; it does not descend to it.
        final_height_m: metres above home at which a return ends; 0: it lands.
        station: the system id whose heartbeats it waits for; None: of any ground station.
    """

    valid_us: int
    action: LinkLossAction | None = None
    delay_s: float | None = None
    in_mission: LinkLossAction | None = None
    in_offboard: LinkLossAction | None = None
    return_height_m: float | None = None
    final_height_m: float | None = None
    station: int | None = None


NO_ANSWER = "no answer"
"""The reason of a command that was not acknowledged, however often it was sent."""
SUPERSEDED = "superseded"
"""The reason of a command whose place a newer one took."""
OVERTAKEN = "overtaken by a change of mode"
"""The reason of a command that was not sent again, since the vehicle's mode had changed meanwhile."""
UNCONFIRMED = "sent, and not acknowledged by this kind of autopilot"
"""The reason of a command that counts as accepted because no answer can come: its effect shows it."""


class FixReport(NamedTuple):
    """Whether the satellite receiver has a fix in three dimensions; reported when that changes."""

    valid_us: int
    has_fix: bool


class MountReport(NamedTuple):
    """Where the mount of a camera points: right of the vehicle's heading, and down from the horizon, radians.

    Neither the vehicle's roll nor its pitch is in it: mounts keep the camera level, and MAVLink reports them that way.
    """

    valid_us: int
    source: str
    pan_rad: float
    tilt_rad: float


class WinchReport(NamedTuple):
    """A winch's report about its line (WINCH_STATUS); None where it states nothing.

    Attributes:
        line_m: how much of it is out.
        speed_m_s: positive while it is let out.
        load_kg: the mass on it.
    """

    valid_us: int
    line_m: float | None
    speed_m_s: float | None
    load_kg: float | None
    is_healthy: bool
    is_moving: bool


class ImageDetection(NamedTuple):
    """Something that a detector found in an image: pixels from the left and from the top, and what else it found of it.

    Attributes:
        channel: the camera's name.
        attributes: names and values, as ("colour", "red").
    """

    channel: str
    u_px: float
    v_px: float
    attributes: tuple[tuple[str, str | float | bool], ...] = ()


class ImageReport(NamedTuple):
    """The detections in the images that all cameras took at one instant; often there are none."""

    valid_us: int
    detections: tuple[ImageDetection, ...]


class TrafficReport(NamedTuple):
    """The aircraft that the vehicle's own receivers have heard since the report before, and why others were left out."""

    valid_us: int
    aircraft: tuple[HeardAircraft, ...]
    left_out: tuple[tuple[str, int], ...] = ()


class LinkReport(NamedTuple):
    """Whether the vehicle is heard well enough, and in words the vehicle or the trouble; reported on change."""

    valid_us: int
    ok: bool
    text: str


class StationReport(NamedTuple):
    """The activity of a ground station on a forwarded link; `commands`: it changed the mode, or flies the vehicle."""

    valid_us: int
    commands: bool
    text: str


class CommandResult(NamedTuple):
    """The vehicle's answer to `Command.number`: accepted, or why not: "denied", or one of the reasons above."""

    valid_us: int
    number: int
    accepted: bool
    reason: str


Report: TypeAlias = (
    PositionReport | VelocityReport | LocalPositionReport | AttitudeReport | AccelerationReport | BatteryReport | HomeReport
    | StatusReport | TargetReport | TextReport | MissionReport | FenceReport | FailsafeReport | CruiseReport | FixReport | MountReport
    | MissionPlanReport | WinchReport | ImageReport | TrafficReport | LinkReport | StationReport | CommandResult
)  # fmt: skip


class Arm(NamedTuple):
    armed: bool = True


class SetGuided(NamedTuple):
    """Ask for the mode in which the vehicle takes positions (ArduPilot GUIDED, PX4 HOLD/OFFBOARD family)."""


class TakeOffOrder(NamedTuple):
    height_m: float


class GoToOrder(NamedTuple):
    """Fly to a point; altitude above mean sea level; speed None leaves the vehicle's own.

    `stops`: the point is where it is, and it is to stop there or as soon as it can, perhaps at another height.
    """

    latitude_deg: float
    longitude_deg: float
    altitude_m: float
    speed_m_s: float | None = None
    stops: bool = False


class HoldOrder(NamedTuple):
    """Stop and stay; `any_mode`: the vehicle is to leave its mode for that, if that takes no positions."""

    any_mode: bool = False


class LandOrder(NamedTuple):
    pass


class ReturnHomeOrder(NamedTuple):
    pass


class InterruptOrder(NamedTuple):
    """Leave the mission that is being flown, and go to a point; altitude above mean sea level; `stops` as of a `GoToOrder`."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float
    stops: bool = False


class ResumeMissionOrder(NamedTuple):
    """Fly the mission again, from the item at which it is."""


class MissionItemOrder(NamedTuple):
    """Continue the mission at this item."""

    item: int


class PointMountOrder(NamedTuple):
    """Turn the camera to these angles and keep them while the vehicle moves, in the sense of `MountReport`."""

    pan_rad: float
    tilt_rad: float


class LookAtOrder(NamedTuple):
    """Keep the camera on a place; altitude above mean sea level."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float


class GripOrder(NamedTuple):
    """Have the gripper or the electromagnet hold what is there, or release it.

    It is accepted also where there is nothing to hold; the mass on the line shows that (`WinchReport.load_kg`).
    """

    holds: bool


class LineOrder(NamedTuple):
    """Have so much of the winch's line out."""

    line_m: float


MountOrder: TypeAlias = PointMountOrder | LookAtOrder
"""Orders that move the camera and not the vehicle: they are no concern of the pilot's."""

Order: TypeAlias = (
    Arm
    | SetGuided
    | TakeOffOrder
    | GoToOrder
    | HoldOrder
    | LandOrder
    | ReturnHomeOrder
    | InterruptOrder
    | ResumeMissionOrder
    | MissionItemOrder
    | PointMountOrder
    | LookAtOrder
    | GripOrder
    | LineOrder
)


class Command(NamedTuple):
    """Effect: have the vehicle do `order`; the answer comes back as `CommandResult(number)`."""

    number: int
    order: Order


MISSION_MODES = frozenset({"AUTO", "AUTO.MISSION"})
MODES_OF: Mapping[type, frozenset[str]] = {
    TakeOffOrder: frozenset({"AUTO.TAKEOFF"}),
    LandOrder: frozenset({"LAND", "AUTO.LAND"}),
    ReturnHomeOrder: frozenset({"RTL", "SMART_RTL", "AUTO.RTL"}),
    ResumeMissionOrder: MISSION_MODES,
    MissionItemOrder: MISSION_MODES,
}
"""The modes (see `StatusReport`) that show an order, where a mode shows it."""
INTERRUPTIBLE_MODES = MISSION_MODES | MODES_OF[LandOrder] | MODES_OF[ReturnHomeOrder]
"""The modes that a vehicle leaves for a while to give way, and is in again afterwards, if that is permitted."""
