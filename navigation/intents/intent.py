"""An operational intent: where a vehicle will be, and where it goes when its link is lost (ASTM F3548, InterUSS).

Places are WGS-84 degrees and metres above mean sea level, velocities metres per second north, east, down, times federation time.
"""

from enum import IntEnum, StrEnum
from typing import Final, NamedTuple

MOST_LEGS: Final = 16
CLIMB_M_S, DESCENT_M_S = 2.5, 1.5
"""The climb and sink rates of autopilots unless they are set otherwise (ArduCopter WPNAV_SPEED_UP, WPNAV_SPEED_DN)."""
SPEED_M_S: Final = 5.0


class IntendedPlace(NamedTuple):
    """The end of a straight leg."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float


class IntentEnding(StrEnum):
    """The end of the intent, after the last leg."""

    HOVER = "hover"
    LAND = "land"
    OPEN = "open"
    """Nothing is known: its present motion, and everything that it can reach from there."""


class IntentSource(StrEnum):
    """By whose word it flies so."""

    GROUND = "ground"
    HOVER = "hover"
    ROUTE = "route"
    ORDER = "order"
    STATION = "station"
    MISSION = "mission"
    MANOEUVRE = "manoeuvre"
    RETURN = "return"
    LANDING = "landing"
    TAKE_OFF = "take-off"
    PILOT = "pilot"
    STRAIGHT = "straight"
    """It has not stated an intent: its motion counts."""


class RightOfWay(IntEnum):
    """The reason of a right of way; the smaller goes first, of equal ones the vehicle whose name sorts first."""

    CANNOT = 0
    """It cannot be commanded: its pilot, a mission that may not be interrupted, RTL, LAND, silence, no member."""
    URGENT = 1
    LANDING = 2
    """It lands or takes off, and may be commanded."""
    COMMITTED = 3
    """It flies an agreed manoeuvre: that is not changed for a newcomer while another one can yield."""
    NAMED = 4


class Contingency(NamedTuple):
    """The legs after the link has been lost for `after_s`; until then, and without any, those of the intent."""

    after_s: float
    legs: tuple[IntendedPlace, ...]
    ending: IntentEnding


class Intent(NamedTuple):
    """Where one vehicle will be.

    Attributes:
        at_us: when it was at the place, with the velocity, from which it flies the legs.
        speed_m_s, climb_m_s, descent_m_s: how fast it flies them, at most.
        radius_m, half_height_m: how far off the line it may be.
        contingency: the way if platform or link die; None: the legs are flown to their end.
    """

    at_us: int
    latitude_deg: float
    longitude_deg: float
    altitude_m: float
    north_m_s: float
    east_m_s: float
    down_m_s: float
    source: IntentSource
    rank: RightOfWay
    legs: tuple[IntendedPlace, ...] = ()
    ending: IntentEnding = IntentEnding.HOVER
    speed_m_s: float = SPEED_M_S
    climb_m_s: float = CLIMB_M_S
    descent_m_s: float = DESCENT_M_S
    radius_m: float = 1.0
    half_height_m: float = 0.5
    contingency: Contingency | None = None

    @property
    def is_airborne(self) -> bool:
        """Whether it is traffic at all."""
        return self.source is not IntentSource.GROUND
