"""How high a straight way is above the ground, and which ways are too low. Pure.

Autopilots climb and sink at once, or along the straight line: the lower of both ends is what a way is judged by.
"""

from typing import Final, NamedTuple

from dyknow.navigation.geodesy import distance_m
from dyknow.navigation.terrain.elevation import Elevation
from dyknow.navigation.terrain.grid import HighGround

HOVERS_M: Final = 1.0
"""A vehicle that is so much lower than its last place hovers there."""
STOPS_M: Final = 30.0
"""A vehicle that is too low already may stop or climb within this distance, besides its braking distance."""
_BRAKES_M_S2, _REACTS_S, _TOLERANCE_M = 2.5, 0.5, 0.01


class AerialPlace(NamedTuple):
    """WGS-84 degrees, metres above mean sea level."""

    latitude_deg: float
    longitude_deg: float
    altitude_m: float


class GroundJudgement(NamedTuple):
    """The judgement of a way by the ground below it.

    Attributes:
        refusal: why it is not flown, or None.
        unknown: a place on it whose elevation is not known, or None.
    """

    refusal: str | None = None
    unknown: tuple[float, float] | None = None


def judge_way(
    elevation: Elevation, start: AerialPlace | None, end: AerialPlace, floor_m: float, speed_m_s: float = 0.0
) -> GroundJudgement:
    """Whether a vehicle that flies straight from `start` to `end` stays `floor_m` above the ground that is known.

    A vehicle that is too low already may stop, and climb where it is.

    Args:
        elevation: of the ground.
        start: where it is; None: only the place is judged.
        end: where it would fly to.
        floor_m: how high it stays above the highest ground within 30 m.
        speed_m_s: how fast it is now.
    """
    there = elevation.highest(end[:2], end[:2], end.altitude_m - floor_m + _TOLERANCE_M)
    if start is None:
        words = _words(end.altitude_m, there, "there", floor_m) if there.is_high else None
        return GroundJudgement(words, there.unknown)
    lowest_m = min(end.altitude_m, start.altitude_m + HOVERS_M)
    found = there if there.is_high else elevation.highest(start[:2], end[:2], lowest_m - floor_m + _TOLERANCE_M)
    if not found.is_high or _may_anyway(elevation, start, end, floor_m, speed_m_s):
        return GroundJudgement(None, found.unknown)
    if there.is_high:
        return GroundJudgement(_words(end.altitude_m, there, "there", floor_m), found.unknown)
    if lowest_m == end.altitude_m:
        return GroundJudgement(_words(lowest_m, found, "on the way there", floor_m), found.unknown)
    words = _words(start.altitude_m, found, "on the way there", floor_m)
    return GroundJudgement(f"{words}: let the vehicle climb where it is first", found.unknown)


def _may_anyway(elevation: Elevation, start: AerialPlace, end: AerialPlace, floor_m: float, speed_m_s: float) -> bool:
    """Whether it is too low already, and stops or climbs."""
    if end.altitude_m < start.altitude_m - _TOLERANCE_M:
        return False
    stops_m = STOPS_M + speed_m_s * (_REACTS_S + speed_m_s / (2.0 * _BRAKES_M_S2))
    if distance_m(*start[:2], *end[:2]) > stops_m:
        return False
    here = elevation.highest(start[:2], start[:2], start.altitude_m - floor_m)
    return here.is_high


def _words(altitude_m: float, ground: HighGround, where: str, floor_m: float) -> str:
    above_m = altitude_m - ground.height_m
    side = "above" if above_m >= 0.0 else "below"
    place = f"{ground.height_m:.1f} m at {ground.latitude_deg:.5f},{ground.longitude_deg:.5f}"
    return (
        f"{altitude_m:.1f} m is {abs(above_m):.1f} m {side} the ground {where} ({place}); the floor is {floor_m:.0f} m"
    )
