"""Fences of autopilots: areas that a vehicle keeps to or stays out of, and which ways they forbid. Pure.

Degrees are WGS-84. Distances are in a plane about the vehicle's place: within a decimetre over 10 km.
"""

from collections.abc import Sequence
from enum import StrEnum
from math import ceil, hypot
from typing import Final, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from dyknow.navigation.geodesy import metres_per_degree

FENCE_MARGIN_M: Final = 2.0
"""A vehicle that touches its own fence flies home: stay inside by what ArduPilot keeps (FENCE_MARGIN)."""
_TOLERANCE_M, _STEP_M, _MOST_STEPS = 0.01, 0.5, 4000

LevelPlace: TypeAlias = tuple[float, float]
"""Latitude and longitude, degrees."""
_Metres: TypeAlias = npt.NDArray[np.float64]


class FenceKind(StrEnum):
    """On which side of a fence a vehicle stays."""

    INCLUSION = "inclusion"
    EXCLUSION = "exclusion"


class FenceArea(NamedTuple):
    """A polygon or a circle, from the ground up.

    Attributes:
        kind: whether the vehicle stays inside, or outside.
        corners: of a polygon in their order, at least 3, the last joined to the first; empty: a circle.
        centre: of a circle.
        radius_m: of a circle.
    """

    kind: FenceKind
    corners: tuple[LevelPlace, ...] = ()
    centre: LevelPlace | None = None
    radius_m: float = 0.0

    def __str__(self) -> str:
        form = f"{len(self.corners)} corners" if self.corners else f"circle of {self.radius_m:.0f} m"
        return f"{self.kind} fence ({form})"


def fence_refusal(
    areas: Sequence[FenceArea],
    start: LevelPlace | None,
    end: LevelPlace,
    *,
    union: bool = False,
    margin_m: float = FENCE_MARGIN_M,
) -> str | None:
    """Why a vehicle may not fly straight from `start` to `end`, or None.

    A vehicle that is on the wrong side already, or nearer than `margin_m`, may stay, come nearer to the right side or
    cross to it.

    Args:
        areas: the fences of its autopilot.
        start: where it is; None: only the place is judged.
        end: where it would fly to.
        union: one inclusion that has the way is enough (PX4); else every inclusion has it (ArduPilot).
        margin_m: how far it keeps from the edge of an area.
    """
    here = end if start is None else start
    inclusions = [area for area in areas if area.kind is FenceKind.INCLUSION]
    if union and len(inclusions) > 1:
        areas = [area for area in areas if area.kind is FenceKind.EXCLUSION]
        refusal = _outside_of_all(inclusions, here, end, margin_m, is_placed=start is not None)
        if refusal is not None:
            return refusal
    return next(filter(None, (_refusal(area, here, end, margin_m, start is not None) for area in areas)), None)


def clearance_m(area: FenceArea, place: LevelPlace) -> float:
    """How far `place` is on the right side of the area's edge; negative on the wrong side."""
    return float(_clearances_m(area, place, np.zeros((1, 2)))[0])


def _refusal(area: FenceArea, start: LevelPlace, end: LevelPlace, margin_m: float, is_placed: bool) -> str | None:
    here_m, there_m = clearance_m(area, start), clearance_m(area, end)
    needed_m = (min(margin_m, here_m) if is_placed else margin_m) - _TOLERANCE_M
    if there_m < needed_m:
        side = "inside" if area.kind is FenceKind.INCLUSION else "outside of"
        return f"the place is not {margin_m:.0f} m {side} the autopilot's {area}"
    if here_m >= 0.0 and is_placed and _edge_distance_m(area, start, end) < needed_m:
        return (
            f"the straight way there crosses the autopilot's {area}, or comes within {margin_m:.0f} m of it; "
            "order places on a way around it"
        )
    return None


def _outside_of_all(
    areas: Sequence[FenceArea], start: LevelPlace, end: LevelPlace, margin_m: float, *, is_placed: bool
) -> str | None:
    """Why the way is not in one of the areas at each place; between two that overlap it is judged every half metre."""
    holding = [area for area in areas if not is_placed or clearance_m(area, start) >= 0.0]
    if any(_refusal(area, start, end, margin_m, is_placed) is None for area in holding):
        return None
    way = _metres(start, [end])[0]
    steps = min(_MOST_STEPS, ceil(hypot(*way) / _STEP_M) + 1)
    points = np.linspace(0.0, 1.0, steps)[:, None] * way
    clearances_m = np.max([_clearances_m(area, start, points) for area in areas], axis=0)
    needed_m = min(margin_m, float(clearances_m[0])) if is_placed else margin_m
    if clearances_m[-1] < needed_m - _TOLERANCE_M:
        return f"the place is not {margin_m:.0f} m inside any of the autopilot's {len(areas)} inclusion fences"
    if np.any(clearances_m < needed_m - _TOLERANCE_M):
        return f"the straight way there leaves the autopilot's {len(areas)} inclusion fences; order places on a way within them"
    return None


def _metres(origin: LevelPlace, places: Sequence[LevelPlace]) -> _Metres:
    """North and east of `origin`, one row for each place."""
    degrees = np.array(places, dtype=np.float64) - origin
    degrees[:, 1] = (degrees[:, 1] + 180.0) % 360.0 - 180.0
    return degrees * metres_per_degree(origin[0])


def _clearances_m(area: FenceArea, origin: LevelPlace, points: _Metres) -> _Metres:
    """`clearance_m` of points in metres north and east of `origin`."""
    if area.corners:
        corners = _metres(origin, area.corners)
        nexts = np.roll(corners, -1, axis=0)
        inside_m = np.array([_signed_m(point, corners, nexts) for point in points])
    else:
        inside_m = area.radius_m - np.hypot(*(points - _metres(origin, [area.centre or origin])).T)
    return inside_m if area.kind is FenceKind.INCLUSION else -inside_m


def _signed_m(point: _Metres, corners: _Metres, nexts: _Metres) -> float:
    """The distance to the nearest edge; negative outside, by the number of edges to one side."""
    straddles = (corners[:, 0] > point[0]) != (nexts[:, 0] > point[0])
    rises = np.where(straddles, nexts[:, 0] - corners[:, 0], 1.0)
    crosses_m = corners[:, 1] + (point[0] - corners[:, 0]) / rises * (nexts[:, 1] - corners[:, 1])
    is_inside = np.count_nonzero(straddles & (crosses_m > point[1])) % 2 == 1
    away_m = float(np.min(_to_segments_m(point, corners, nexts)))
    return away_m if is_inside else -away_m


def _to_segments_m(point: _Metres, starts: _Metres, ends: _Metres) -> _Metres:
    """The distance of one point, or of one for each segment, to segments."""
    ways = ends - starts
    lengths = np.maximum(np.sum(ways * ways, axis=1), 1e-12)
    shares = np.clip(np.sum((point - starts) * ways, axis=1) / lengths, 0.0, 1.0)
    distances_m: _Metres = np.hypot(*(point - starts - shares[:, None] * ways).T)
    return distances_m


def _edge_distance_m(area: FenceArea, start: LevelPlace, end: LevelPlace) -> float:
    """The least distance of the way from the edge of an area; 0 where it crosses it. It begins on the right side."""
    here, there = np.zeros(2), _metres(start, [end])[0]
    if not area.corners:
        centre = _metres(start, [area.centre or start])[0]
        if area.kind is FenceKind.INCLUSION:
            return area.radius_m - max(hypot(*centre), hypot(*(there - centre)))
        return float(_to_segments_m(centre, here[None], there[None])[0]) - area.radius_m
    corners = _metres(start, area.corners)
    nexts = np.roll(corners, -1, axis=0)
    edges = nexts - corners
    parts_edges = _cross(there, corners) * _cross(there, nexts) < 0.0
    parts_way = _cross(edges, here - corners) * _cross(edges, there - corners) < 0.0
    if np.any(parts_edges & parts_way):
        return 0.0
    ends = np.concatenate([_to_segments_m(here, corners, nexts), _to_segments_m(there, corners, nexts)])
    to_way = _to_segments_m(corners, np.zeros_like(corners), np.broadcast_to(there, corners.shape))
    return float(min(np.min(ends), np.min(to_way)))


def _cross(one: _Metres, other: _Metres) -> _Metres:
    product: _Metres = one[..., 0] * other[..., 1] - one[..., 1] * other[..., 0]
    return product
