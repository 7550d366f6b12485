"""A vehicle as its platform sees it: reports in, commands out. Units and frames are SI and WGS-84 here.

Edges (the MAVLink feed, a log, the simulated world) turn their messages into these reports; times are already
federation time, mapped as each edge documents.
"""

from typing import NamedTuple, TypeAlias


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
    """What the autopilot says of itself; None where it does not say."""

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


class CommandResult(NamedTuple):
    """The vehicle's answer to `Command.number`: accepted, or why not ("denied", "timed out")."""

    valid_us: int
    number: int
    accepted: bool
    reason: str


Report: TypeAlias = (
    PositionReport
    | VelocityReport
    | LocalPositionReport
    | AttitudeReport
    | AccelerationReport
    | BatteryReport
    | HomeReport
    | StatusReport
    | TargetReport
    | CommandResult
)


class Arm(NamedTuple):
    armed: bool = True


class SetGuided(NamedTuple):
    """Ask for the mode in which the vehicle takes positions (ArduPilot GUIDED, PX4 HOLD/OFFBOARD family)."""


class TakeOffOrder(NamedTuple):
    height_m: float


class GoToOrder(NamedTuple):
    """Fly to a point; altitude above mean sea level; speed None leaves the vehicle's own."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float
    speed_m_s: float | None = None


class HoldOrder(NamedTuple):
    """Stop and stay."""


class LandOrder(NamedTuple):
    pass


class ReturnHomeOrder(NamedTuple):
    pass


Order: TypeAlias = Arm | SetGuided | TakeOffOrder | GoToOrder | HoldOrder | LandOrder | ReturnHomeOrder


class Command(NamedTuple):
    """Effect: have the vehicle do `order`; the answer comes back as `CommandResult(number)`."""

    number: int
    order: Order
