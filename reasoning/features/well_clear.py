"""Well clear as NASA DAIDALUS defines it (WCV_TAUMOD): whether two aircraft keep well clear, and when they no longer do.

Vectors are of the other aircraft relative to the own one (or all the other way round): two horizontal components, then
the vertical one; position s in metres, velocity v in m/s. On straight courses well clear is violated while both hold:

* horizontally: |s| <= D, or the horizontal miss distance is <= D and 0 <= tau_mod <= T, where
  tau_mod = (D^2 - s.s) / (s.v) of those that close in (s.v < 0): the range over the closing speed, corrected by D;
* vertically: |s_z| <= Z, or the time to one altitude, -s_z / v_z, is >= 0 and <= T_coa.

The times of a violation are one interval. Source: Munoz et al., DAIDALUS: Detect and Avoid Alerting Logic for Unmanned
Systems, DASC 2015; RTCA DO-365.
"""

from collections.abc import Sequence
from math import hypot, inf, isclose, sqrt
from typing import Final, NamedTuple


class Thresholds(NamedTuple):
    """The volume that two aircraft keep from each other.

    Attributes:
        d_m: horizontal distance, DTHR, which DO-365 calls DMOD and HMD; more than 0.
        z_m: vertical distance, ZTHR; more than 0.
        tau_s: modified tau, TTHR; 0: the distance alone counts.
        coaltitude_s: time to one altitude, TCOA; 0: the distance alone counts.
    """

    d_m: float
    z_m: float
    tau_s: float = 0.0
    coaltitude_s: float = 0.0


AMONG_SMALL: Final = Thresholds(12.0, 8.0, 6.0, 6.0)
"""Of small unmanned aircraft from each other."""
FROM_CREWED: Final = Thresholds(609.6, 76.2)
"""Of a small unmanned aircraft from a crewed aircraft: 2000 ft and 250 ft, ASTM F3442."""
LOOKAHEAD_S: Final = 180.0
"""How far ahead a violation is looked for, as in DAIDALUS."""


class ViolationInterval(NamedTuple):
    """When well clear is violated on straight courses, in seconds from now."""

    time_in_s: float
    time_out_s: float


def is_well_clear(s_m: Sequence[float], v_m_s: Sequence[float], thresholds: Thresholds = AMONG_SMALL) -> bool:
    """Whether two aircraft keep well clear at this instant."""
    return not (
        _is_near_vertically(s_m[2], v_m_s[2], thresholds)
        and _is_near_horizontally(s_m[0], s_m[1], v_m_s[0], v_m_s[1], thresholds)
    )


def violation_interval(
    s_m: Sequence[float],
    v_m_s: Sequence[float],
    thresholds: Thresholds = AMONG_SMALL,
    lookahead_s: float = LOOKAHEAD_S,
    from_s: float = 0.0,
) -> ViolationInterval | None:
    """When the two violate well clear between `from_s` and `lookahead_s` seconds from now; None: they do not.

    An interval of a single instant is a violation here; DAIDALUS calls it no conflict.
    """
    low_s, high_s = _vertical_interval(s_m[2], v_m_s[2], thresholds, from_s, lookahead_s)
    if low_s > high_s:
        return None
    vx, vy = v_m_s[0], v_m_s[1]
    x, y = s_m[0] + vx * low_s, s_m[1] + vy * low_s
    if isclose(low_s, high_s, rel_tol=_RELATIVE, abs_tol=_NOTHING):
        return ViolationInterval(low_s, high_s) if _is_near_horizontally(x, y, vx, vy, thresholds) else None
    in_s, out_s = _horizontal_interval(x, y, vx, vy, thresholds, high_s - low_s)
    return ViolationInterval(low_s + in_s, low_s + out_s) if in_s <= out_s else None


def time_to_violation_s(
    s_m: Sequence[float],
    v_m_s: Sequence[float],
    thresholds: Thresholds = AMONG_SMALL,
    lookahead_s: float = LOOKAHEAD_S,
) -> float:
    """Seconds until well clear is violated: 0 if it is, `lookahead_s` if it is not until then, as in DAIDALUS."""
    if not is_well_clear(s_m, v_m_s, thresholds):
        return 0.0
    violation = violation_interval(s_m, v_m_s, thresholds, lookahead_s)
    return lookahead_s if violation is None else violation.time_in_s


_NOTHING: Final = 1e-13
_RELATIVE: Final = 3e-12
"""Two numbers this near are one, as in DAIDALUS (16 348 units in the last place)."""
_SLOWEST: Final = 1e-24
"""Squared horizontal speed, m^2/s^2, below which two aircraft do not come nearer."""


def _is_near_horizontally(x: float, y: float, vx: float, vy: float, thresholds: Thresholds) -> bool:
    range_m = hypot(x, y)
    if range_m <= thresholds.d_m:
        return True
    closing = x * vx + y * vy
    if closing >= 0.0:
        return False
    at_s = -closing / max(vx * vx + vy * vy, _SLOWEST)
    if hypot(x + vx * at_s, y + vy * at_s) > thresholds.d_m:
        return False
    return (thresholds.d_m * thresholds.d_m - (x * x + y * y)) / closing <= thresholds.tau_s


def _is_near_vertically(z: float, vz: float, thresholds: Thresholds) -> bool:
    return abs(z) <= thresholds.z_m or (vz != 0.0 and 0.0 <= -z / vz <= thresholds.coaltitude_s)


def _horizontal_interval(
    x: float, y: float, vx: float, vy: float, thresholds: Thresholds, lookahead_s: float
) -> tuple[float, float]:
    """Entry and exit within `lookahead_s`; (inf, -inf) if there are none."""
    d2, tau_s = thresholds.d_m * thresholds.d_m, thresholds.tau_s
    s2, sv, v2 = x * x + y * y, x * vx + y * vy, vx * vx + vy * vy
    if s2 <= d2:
        if v2 < _NOTHING:
            return 0.0, lookahead_s
        return 0.0, min(lookahead_s, _exit_s(s2 - d2, sv, v2))
    b, c = 2.0 * sv + tau_s * v2, s2 + tau_s * sv - d2
    discriminant = b * b - 4.0 * v2 * c
    across = x * vy - y * vx
    if sv >= 0.0 or v2 < _SLOWEST or discriminant < 0.0 or d2 * v2 < across * across:
        return inf, -inf
    entry_s = (-b - sqrt(discriminant)) / (2.0 * v2)
    if entry_s > lookahead_s:
        return inf, -inf
    return max(0.0, entry_s), min(lookahead_s, _exit_s(s2 - d2, sv, v2))


def _exit_s(c: float, sv: float, v2: float) -> float:
    """When the circle is left."""
    return (-sv + sqrt(max(0.0, sv * sv - v2 * c))) / v2


def _vertical_interval(
    z: float, vz: float, thresholds: Thresholds, from_s: float, until_s: float
) -> tuple[float, float]:
    """Entry and exit between two times; (inf, -inf) if there are none."""
    if abs(vz) < _NOTHING:
        return (from_s, until_s) if abs(z) <= thresholds.z_m else (inf, -inf)
    sign = 1.0 if vz >= 0.0 else -1.0
    entry_s = (-sign * max(thresholds.z_m, abs(vz) * thresholds.coaltitude_s) - z) / vz
    exit_s = (sign * thresholds.z_m - z) / vz
    if until_s < entry_s or exit_s < from_s:
        return inf, -inf
    return max(from_s, entry_s), min(until_s, exit_s)
