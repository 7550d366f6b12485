"""Errors of a position source, detected from its reports alone.

Each check answers with a reason (a short phrase shown to users and counted) or None.
"""

import math
from typing import NamedTuple

from dyknow.navigation.vehicle import LocalPositionReport, PositionReport, VelocityReport

NOT_FINITE = "not finite"
OUT_OF_RANGE = "out of range"
NO_FIX = "no fix"
FROZEN = "frozen position"
TELEPORT = "teleport"
TOO_LATE = "too late"
AHEAD = "ahead of time"
SILENT = "silent"
LATE = "late"
NO_ALTITUDE = "altitude unknown"
NO_POSITION = "no position yet"
NO_GPS = "without GPS"
VELOCITY_JUMP = "velocity jump"

_LOWEST_M, _HIGHEST_M = -500.0, 100_000.0


class PlausibleLimits(NamedTuple):
    """Limits of a vehicle's plausible motion.

    Attributes:
        speed_m_s: faster than this nothing moves.
        gate: largest normalised innovation squared; for three axes 30 is passed by all but one true fix in a million.
        allowance_m: the greatest honest disagreement of sources beyond their stated errors (two fixes of one autopilot
            do).
        reacquire: number of consecutive positions that agree with each other, and not with us, and are then the truth,
        reacquire_us: if they continue for so long. A glitch of a receiver is over by then.
        frozen_moving: number of equal positions from a source that moves are a frozen source.
        frozen_still: the same for a source that stands, if its noise had shown in every report before.
        ahead_us: a report from further in the future is refused.
    """

    speed_m_s: float = 100.0
    gate: float = 30.0
    allowance_m: float = 2.0
    reacquire: int = 5
    reacquire_us: int = 5_000_000
    frozen_moving: int = 3
    frozen_still: int = 10
    ahead_us: int = 1_000_000


def implausible_position(report: PositionReport) -> str | None:
    """NaN, infinities, coordinates that are none, and the 0, 0 that autopilots send without a fix."""
    stated = (report.altitude_m, report.horizontal_sd_m, report.vertical_sd_m)
    numbers = (report.latitude_deg, report.longitude_deg, *(each for each in stated if each is not None))
    if not all(map(math.isfinite, numbers)):
        return NOT_FINITE
    if report.latitude_deg == 0.0 and report.longitude_deg == 0.0:
        return NO_FIX
    level_ok = abs(report.latitude_deg) <= 90.0 and abs(report.longitude_deg) <= 180.0
    height_ok = report.altitude_m is None or _LOWEST_M <= report.altitude_m <= _HIGHEST_M
    sd_ok = all(each is None or each >= 0.0 for each in (report.horizontal_sd_m, report.vertical_sd_m))
    return None if level_ok and height_ok and sd_ok else OUT_OF_RANGE


def implausible_velocity(report: VelocityReport | LocalPositionReport, speed_m_s: float) -> str | None:
    numbers = (report.north_m_s, report.east_m_s, report.down_m_s or 0.0)
    if not all(map(math.isfinite, numbers)):
        return NOT_FINITE
    return OUT_OF_RANGE if math.hypot(*numbers) > speed_m_s else None


class FrozenSource:
    """Notices that one source repeats itself.

    While the vehicle moves, positions repeat at most by rounding. While it stands, only a source with noise in nearly
    every standing report is expected to continue to show it: a source that rounds coarsely, or has no noise, is not
    accused.
    """

    _MOVING_M_S = 0.5
    _LIVELY = 0.9

    def __init__(self, limits: PlausibleLimits) -> None:
        self._limits = limits
        self._last: tuple[float, float, float | None] | None = None
        self._equal = 0
        self._changing = 0.5

    def on_position(self, report: PositionReport, speed_m_s: float) -> str | None:
        """`speed_m_s`: how fast the vehicle is believed to move."""
        found = (report.latitude_deg, report.longitude_deg, report.altitude_m)
        moving = speed_m_s > self._MOVING_M_S
        if found != self._last:
            if self._last is not None and not moving:
                self._changing += 0.1 * ((self._equal == 0) - self._changing)
            self._last, self._equal = found, 0
            return None
        self._equal += 1
        if moving:
            return FROZEN if self._equal >= self._limits.frozen_moving else None
        return FROZEN if self._changing > self._LIVELY and self._equal >= self._limits.frozen_still else None


class Candidate(NamedTuple):
    """The last of `found` positions in a row that disagree with the filter and agree with each other."""

    report: PositionReport
    found: int
    since_us: int
