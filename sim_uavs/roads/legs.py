"""Where one can drive on a network: lanes of links, and curves through crossings from lane to lane."""

from collections.abc import Sequence
from functools import cache
from math import hypot, pi

from dyknow.anchoring.roads.elements import DirectedLink
from dyknow.anchoring.roads.network import RoadNetwork
from dyknow.model.errors import WrongCall
from dyknow.sim_uavs.roads.lines import DrivenLine, curve, turned

TURN_M_S = 6.0
"""How fast a right angle is driven; a wider turn faster, up to the limit."""
_APART_M = 2.6


class Leg:
    """One lane of a link in its direction (`crossing` is None), or a curve through a crossing (`link` is None).

    Attributes:
        way: the link it is on, or comes from.
        lane: counted from the middle of the road.
        crosses: the crossing at its end, or in which it is; None where the road leaves the network.
        exit: the leg on which a curve ends.
    """

    __slots__ = ("crosses", "crossing", "exit", "lane", "limit_m_s", "line", "link", "way")

    def __init__(
        self,
        way: DirectedLink,
        lane: int,
        line: DrivenLine,
        limit_m_s: float,
        crosses: str | None,
        exit_: "Leg | None" = None,
    ) -> None:
        self.way, self.lane, self.line, self.limit_m_s = way, lane, line, limit_m_s
        self.crosses, self.exit = crosses, exit_
        self.link = way.link if exit_ is None else None
        self.crossing = None if exit_ is None else crosses


class Driveways:
    """The legs of a network."""

    def __init__(self, network: RoadNetwork) -> None:
        self.network = network
        self._lanes: dict[tuple[DirectedLink, int], Leg] = {}
        self._curves: dict[tuple[Leg, Leg], Leg] = {}
        self.conflict = cache(self._conflict)

    def way(self, from_crossing: str, to_crossing: str) -> DirectedLink:
        """The way between two neighbours.

        Raises:
            WrongCall: no link leads there.
        """
        for way in self.network.departures.get(from_crossing, ()):
            if self.network.links[way.link].crossing_at(way.direction) == to_crossing:
                return way
        raise WrongCall(f"no link leads from {from_crossing!r} to {to_crossing!r}; name two neighbours of the network")

    def onward(self, way: DirectedLink) -> list[DirectedLink]:
        """The ways that begin where this one ends, without the way back."""
        end = self.network.links[way.link].crossing_at(way.direction)
        return [] if end is None else [each for each in self.network.departures[end] if each.link != way.link]

    def lanes(self, way: DirectedLink) -> int:
        """How many lanes lead this way."""
        return len(self.network.links[way.link].lanes_of(way.direction))

    def lane(self, way: DirectedLink, lane: int = 0) -> Leg:
        """The leg of a lane, between the rims of the crossings at its ends; the outermost if there are fewer."""
        leg = self._lanes.get((way, lane))
        if leg is None:
            leg = self._lanes[way, lane] = self._made(way, lane)
        return leg

    def _made(self, way: DirectedLink, lane: int) -> Leg:
        network, direction = self.network, way.direction
        link = network.links[way.link]
        offsets_m = sorted((link.lanes[n].offset_m * direction for n in link.lanes_of(direction)), key=abs)
        middle = DrivenLine(link.line.points[::direction])
        start_m, end_m = (
            0.0 if name is None else network.crossings[name].radius_m
            for name in (link.crossing_at(-direction), link.crossing_at(direction))
        )
        cut = middle.between(start_m, middle.length_m - end_m)
        aside_m = offsets_m[min(lane, len(offsets_m) - 1)]
        return Leg(way, lane, cut.parallel(-aside_m), link.speed_m_s, link.crossing_at(direction))

    def through(self, leg: Leg, onto: Leg) -> Leg:
        """The curve from the end of one lane to the start of another."""
        found = self._curves.get((leg, onto))
        if found is None:
            start, end = leg.line.at(leg.line.length_m), onto.line.at(0.0)
            angle = abs(turned(start.heading_rad, end.heading_rad))
            limit = min(leg.limit_m_s, onto.limit_m_s, TURN_M_S * max(1.0, (pi / 2.0) / max(angle, 0.1)))
            found = self._curves[leg, onto] = Leg(leg.way, leg.lane, curve(start, end), limit, leg.crosses, onto)
        return found

    def _conflict(self, one: Leg, other: Leg) -> bool:
        """Whether two curves through a crossing may not be driven at the same time."""
        if one.way == other.way:
            return False
        if one.exit is other.exit:
            return True
        return _closest_m(_spots(one.line), _spots(other.line)) < _APART_M


def _spots(line: DrivenLine) -> Sequence[tuple[float, float]]:
    count = max(2, round(line.length_m))
    return [line.at(line.length_m * step / count)[:2] for step in range(count + 1)]


def _closest_m(one: Sequence[tuple[float, float]], other: Sequence[tuple[float, float]]) -> float:
    return min(hypot(x0 - x1, y0 - y1) for x0, y0 in one for x1, y1 in other)
