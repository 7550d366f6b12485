"""Well clear of many pairs at once: the formulas of `dyknow.reasoning.features.well_clear` on whole arrays.

Positions and velocities are arrays (..., 3) of metres and m/s that broadcast against each other, relative as there.
"""

from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dyknow.reasoning.features.well_clear import AMONG_SMALL, LOOKAHEAD_S, Thresholds

Floats: TypeAlias = NDArray[np.float64]
Booleans: TypeAlias = NDArray[np.bool_]

_NOTHING: Final = 1e-13
_RELATIVE: Final = 3e-12
_SLOWEST: Final = 1e-24


def are_well_clear(s_m: Floats, v_m_s: Floats, thresholds: Thresholds = AMONG_SMALL) -> Booleans:
    """Whether each pair keeps well clear at this instant."""
    s, v = np.broadcast_arrays(np.asarray(s_m, float), np.asarray(v_m_s, float))
    z, vz = s[..., 2], v[..., 2]
    with np.errstate(all="ignore"):
        coaltitude_s = -z / vz
        near = (np.abs(z) <= thresholds.z_m) | (
            (vz != 0.0) & (coaltitude_s >= 0.0) & (coaltitude_s <= thresholds.coaltitude_s)
        )
        result: Booleans = ~(near & _are_near_horizontally(s[..., 0], s[..., 1], v[..., 0], v[..., 1], thresholds))
    return result


def violation_intervals(
    s_m: Floats,
    v_m_s: Floats,
    thresholds: Thresholds = AMONG_SMALL,
    lookahead_s: float | Floats = LOOKAHEAD_S,
    from_s: float | Floats = 0.0,
) -> tuple[Floats, Floats]:
    """When each pair violates well clear: entries and exits, seconds from now; (inf, -inf) where it does not.

    `lookahead_s` and `from_s` are numbers, or arrays that broadcast against the pairs.
    """
    s, v = np.broadcast_arrays(np.asarray(s_m, float), np.asarray(v_m_s, float))
    vx, vy = v[..., 0], v[..., 1]
    with np.errstate(all="ignore"):
        low_s, high_s, none = _vertical_intervals(s[..., 2], v[..., 2], thresholds, from_s, lookahead_s)
        x, y = s[..., 0] + vx * low_s, s[..., 1] + vy * low_s
        in_s, out_s = _horizontal_intervals(x, y, vx, vy, thresholds, high_s - low_s)
        apart_s = np.abs(high_s - low_s)
        instant = apart_s <= np.maximum(_RELATIVE * np.maximum(np.abs(low_s), np.abs(high_s)), _NOTHING)
        near = _are_near_horizontally(x, y, vx, vy, thresholds)
        entry_s = np.where(instant, low_s, low_s + in_s)
        exit_s = np.where(instant, high_s, low_s + out_s)
        none |= np.where(instant, ~near, ~(in_s <= out_s))
    return np.where(none, np.inf, entry_s), np.where(none, -np.inf, exit_s)


def times_to_violation_s(
    s_m: Floats, v_m_s: Floats, thresholds: Thresholds = AMONG_SMALL, lookahead_s: float = LOOKAHEAD_S
) -> Floats:
    """Seconds until each pair violates well clear: 0 if it does, `lookahead_s` if it does not until then."""
    entry_s = np.minimum(violation_intervals(s_m, v_m_s, thresholds, lookahead_s)[0], lookahead_s)
    return np.where(are_well_clear(s_m, v_m_s, thresholds), entry_s, 0.0)


def _are_near_horizontally(x: Floats, y: Floats, vx: Floats, vy: Floats, thresholds: Thresholds) -> Booleans:
    closing = x * vx + y * vy
    at_s = -closing / np.maximum(vx * vx + vy * vy, _SLOWEST)
    miss_m = np.hypot(x + vx * at_s, y + vy * at_s)
    tau_s = (thresholds.d_m * thresholds.d_m - (x * x + y * y)) / closing
    near: Booleans = (np.hypot(x, y) <= thresholds.d_m) | (
        (closing < 0.0) & (miss_m <= thresholds.d_m) & (tau_s <= thresholds.tau_s)
    )
    return near


def _horizontal_intervals(
    x: Floats, y: Floats, vx: Floats, vy: Floats, thresholds: Thresholds, lookahead_s: Floats
) -> tuple[Floats, Floats]:
    d2, tau_s = thresholds.d_m * thresholds.d_m, thresholds.tau_s
    s2, sv, v2 = x * x + y * y, x * vx + y * vy, vx * vx + vy * vy
    inside = s2 <= d2
    b, c = 2.0 * sv + tau_s * v2, s2 + tau_s * sv - d2
    discriminant = b * b - 4.0 * v2 * c
    entry_s = (-b - np.sqrt(np.maximum(discriminant, 0.0))) / (2.0 * v2)
    exit_s = (-sv + np.sqrt(np.maximum(sv * sv - v2 * (s2 - d2), 0.0))) / v2
    exit_s = np.minimum(lookahead_s, np.where(inside & (v2 < _NOTHING), lookahead_s, exit_s))
    meets = (
        (sv < 0.0)
        & (v2 >= _SLOWEST)
        & (discriminant >= 0.0)
        & (d2 * v2 >= (x * vy - y * vx) ** 2)
        & (entry_s <= lookahead_s)
    )
    entry_s = np.where(inside, 0.0, np.maximum(entry_s, 0.0))
    none = ~(inside | meets)
    return np.where(none, np.inf, entry_s), np.where(none, -np.inf, exit_s)


def _vertical_intervals(
    z: Floats, vz: Floats, thresholds: Thresholds, from_s: float | Floats, until_s: float | Floats
) -> tuple[Floats, Floats, Booleans]:
    """Entry, exit, and where there are none."""
    level = np.abs(vz) < _NOTHING
    sign = np.where(vz >= 0.0, 1.0, -1.0)
    entry_s = (-sign * np.maximum(thresholds.z_m, np.abs(vz) * thresholds.coaltitude_s) - z) / vz
    exit_s = (sign * thresholds.z_m - z) / vz
    none = np.where(level, np.abs(z) > thresholds.z_m, (until_s < entry_s) | (exit_s < from_s))
    low_s = np.where(level, from_s, np.maximum(from_s, entry_s))
    high_s = np.where(level, until_s, np.minimum(until_s, exit_s))
    none |= low_s > high_s
    return np.where(none, 0.0, low_s), np.where(none, 0.0, high_s), none
