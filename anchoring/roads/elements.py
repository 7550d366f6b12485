"""The elements of a road network: crossings, links with lanes, areas.

A link is a polyline from one crossing to another. Its lanes lie at signed offsets: positive ones on the right of the
direction from `start` to `end`. A link can be travelled in the directions of its lanes: 1 from start to end, -1 back.
"""

from functools import lru_cache
from typing import Final, NamedTuple

from dyknow.anchoring.roads.geometry import Point2, Polyline

CROSSING, ROAD = "crossing", "road"
"""Kinds of areas that are part of the road system."""
LEAVE: Final = 1.2
"""A crossing is entered at its radius and left at its radius times this (hysteresis)."""
_KNOWN: Final = 1024
"""Kinds of roads, by their lanes, whose directions are kept."""


class Crossing(NamedTuple):
    """A place where links meet; a position within `radius_m` is in the crossing."""

    id: str
    x_m: float
    y_m: float
    radius_m: float


class Lane(NamedTuple):
    """The centre of a lane, right of the link's centre line; `direction` is 1, -1, or 0 where both use it."""

    offset_m: float
    direction: int


class DirectedLink(NamedTuple):
    """A link, travelled from its start to its end (1) or back (-1)."""

    link: str
    direction: int

    @property
    def back(self) -> "DirectedLink":
        return DirectedLink(self.link, -self.direction)


class RoadLink(NamedTuple):
    """A road between two crossings; `start` or `end` is None where it leaves the network.

    Attributes:
        speed_m_s: the speed limit.
    """

    id: str
    start: str | None
    end: str | None
    line: Polyline
    width_m: float
    lanes: tuple[Lane, ...]
    speed_m_s: float

    @property
    def length_m(self) -> float:
        return self.line.length_m

    @property
    def directions(self) -> tuple[int, ...]:
        """In which directions it can be travelled."""
        return _directions(self.lanes)

    def lanes_of(self, direction: int) -> tuple[int, ...]:
        """Indices of the lanes in which one travels in `direction`; all for 0, or where none leads there."""
        return _lanes_of(self.lanes, direction)

    def lane_near(self, across_m: float, direction: int, previous: int | None = None, stay_m: float = 0.0) -> int:
        """The lane of `direction` whose centre is nearest to `across_m`; the previous one counts `stay_m` nearer."""
        return min(
            self.lanes_of(direction),
            key=lambda n: abs(self.lanes[n].offset_m - across_m) - (stay_m if n == previous else 0.0),
        )

    def crossing_at(self, direction: int) -> str | None:
        """Where travelling in `direction` leads."""
        return self.end if direction > 0 else self.start


@lru_cache(maxsize=_KNOWN)
def _directions(lanes: tuple[Lane, ...]) -> tuple[int, ...]:
    return tuple(each for each in (1, -1) if any(lane.direction in {0, each} for lane in lanes))


@lru_cache(maxsize=_KNOWN)
def _lanes_of(lanes: tuple[Lane, ...], direction: int) -> tuple[int, ...]:
    chosen = tuple(n for n, lane in enumerate(lanes) if not direction or lane.direction in {0, direction})
    return chosen or tuple(range(len(lanes)))


class RoadArea(NamedTuple):
    """A polygon of kind `road`, `crossing` or another; rings of points, the outer one first.

    Attributes:
        of: the link or crossing that it belongs to, if it says so.
    """

    id: str
    kind: str
    rings: tuple[tuple[Point2, ...], ...]
    of: str | None = None
