"""The vehicles that close lanes: those that stand, or move more slowly than traffic that is to be passed through.

The speed of a vehicle is measured over its last `OVER_US`, from place to place, so that an error of one position counts
little; while that much of it has not been seen it closes nothing.
"""

import math
from collections import Counter, deque
from functools import cache, partial
from itertools import pairwise
from typing import Final, NamedTuple

from dyknow import US_PER_S
from dyknow.anchoring.roads.elements import RoadLink
from dyknow.anchoring.roads.snapping import RoadPlace
from dyknow.anchoring.roads.statistics import LONGEST_GAP_US

OVER_US: Final = 5 * US_PER_S
_STEP_US: Final = US_PER_S // 2
"""At least so long lies between two places that are kept of a vehicle."""
BESIDE_M: Final = 15.0
"""Between obstacles that are farther apart along a link a vehicle can change lanes."""


class LaneObstacle(NamedTuple):
    """A vehicle that is slow or stands in a lane of a link.

    Attributes:
        offset_m: along the link, from its start.
    """

    vehicle: str
    link: str
    lane: int
    offset_m: float
    speed_m_s: float


class Narrowest(NamedTuple):
    """The place of a link with the least open width, and what closes the rest there."""

    open_m: float
    offset_m: float
    obstacles: tuple[LaneObstacle, ...]


class SlowVehicles:
    """Collects the places of vehicles. Times are valid times, microseconds; places that go back in time are left out."""

    def __init__(self) -> None:
        self._places: dict[str, deque[tuple[int, RoadPlace]]] = {}

    def on_place(self, vehicle: str, valid_us: int, place: RoadPlace | None) -> None:
        """Where a vehicle is; None: off the roads."""
        if place is None:
            self._places.pop(vehicle, None)
            return
        kept = self._places.setdefault(vehicle, deque())
        if kept and valid_us < kept[-1][0] + _STEP_US:
            return
        if kept and valid_us - kept[-1][0] > LONGEST_GAP_US:
            kept.clear()
        kept.append((valid_us, place))
        while len(kept) > 1 and kept[1][0] <= valid_us - OVER_US:
            kept.popleft()

    def on_time(self, now_us: int) -> None:
        """Forget what has not been seen for long."""
        oldest_us = now_us - LONGEST_GAP_US
        self._places = {vehicle: kept for vehicle, kept in self._places.items() if kept[-1][0] >= oldest_us}

    def slower_than(self, speed_m_s: float) -> dict[str, list[LaneObstacle]]:
        """The vehicles on lanes that are slower, by link, in the order of the link."""
        found: dict[str, list[LaneObstacle]] = {}
        for vehicle, kept in self._places.items():
            (from_us, first), (to_us, last) = kept[0], kept[-1]
            if last.link is None or last.lane is None or to_us - from_us < OVER_US:
                continue
            travelled_m = math.hypot(last.x_m - first.x_m, last.y_m - first.y_m)
            speed = travelled_m * US_PER_S / (to_us - from_us)
            if speed < speed_m_s:
                one = LaneObstacle(vehicle, last.link, last.lane, last.offset_m, speed)
                found.setdefault(last.link, []).append(one)
        return {link: sorted(each, key=lambda one: one.offset_m) for link, each in found.items()}


def narrowest(link: RoadLink, obstacles: list[LaneObstacle]) -> Narrowest:
    """Where least of a link's width is open: the widest run of lanes next to each other without an obstacle near there.

    Lanes of both directions count, since an emergency vehicle may use either.
    """
    order = sorted(obstacles, key=lambda one: one.offset_m)
    offsets_m = [one.offset_m for one in order]
    lanes = Counter[int]()
    open_m = cache(partial(_widest_open_m, link))
    least, first, beyond = Narrowest(link.width_m, 0.0, ()), 0, 0
    for one in order:
        while beyond < len(order) and offsets_m[beyond] - one.offset_m <= BESIDE_M:
            lanes[order[beyond].lane] += 1
            beyond += 1
        while one.offset_m - offsets_m[first] > BESIDE_M:
            lanes[order[first].lane] -= 1
            first += 1
        left_m = open_m(frozenset(+lanes))
        if left_m < least.open_m:
            least = Narrowest(left_m, one.offset_m, tuple(order[first:beyond]))
    return least


def _widest_open_m(link: RoadLink, closed: frozenset[int]) -> float:
    """Lanes meet in the middle between their centres; the outermost reach to the edges of the road."""
    order = sorted(range(len(link.lanes)), key=lambda lane: link.lanes[lane].offset_m)
    centres = [link.lanes[lane].offset_m for lane in order]
    inner = [(one + other) / 2 for one, other in pairwise(centres)]
    edges = [-link.width_m / 2, *inner, link.width_m / 2]
    widest_m = run_m = 0.0
    for lane, (left_m, right_m) in zip(order, pairwise(edges), strict=True):
        run_m = 0.0 if lane in closed else run_m + right_m - left_m
        widest_m = max(widest_m, run_m)
    return widest_m
