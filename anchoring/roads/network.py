"""A road network as a value: crossings, links between them, areas (thesis 8.7.4)."""

import math
from collections.abc import Iterable, Mapping
from functools import cached_property

from dyknow.anchoring.roads.continuations import RoadContinuations
from dyknow.anchoring.roads.elements import CROSSING, ROAD, Crossing, DirectedLink, RoadArea, RoadLink
from dyknow.anchoring.roads.geometry import Point2
from dyknow.anchoring.roads.index import RoadIndex
from dyknow.anchoring.roads.names import object_names, way_name
from dyknow.anchoring.roads.turns import CrossingPaths, RoadTurns
from dyknow.navigation.geodesy import LocalFrame


class RoadNetwork:
    """Crossings, links and areas by id; links name crossings that are there.

    Args:
        frame: where the origin of x and y is on earth, if that is known.
    """

    def __init__(
        self,
        crossings: Iterable[Crossing],
        links: Iterable[RoadLink],
        areas: Iterable[RoadArea] = (),
        frame: LocalFrame | None = None,
    ) -> None:
        self.crossings: Mapping[str, Crossing] = {one.id: one for one in crossings}
        self.links: Mapping[str, RoadLink] = {one.id: one for one in links}
        self.areas: Mapping[str, RoadArea] = {one.id: one for one in areas}
        self.frame = frame

    @cached_property
    def index(self) -> RoadIndex:
        """The index of the parts near a position; made when it is first used."""
        return RoadIndex(self.links.values(), self.crossings.values(), self.areas.values())

    @cached_property
    def names(self) -> Mapping[str, str]:
        """The names in specifications: of links and crossings by their ids, of ways by their names on the map."""
        ways = (way_name(DirectedLink(link, direction)) for link in self.links for direction in (1, -1))
        return object_names([*ways, *self.crossings])

    @cached_property
    def arms(self) -> Mapping[str, tuple[DirectedLink, ...]]:
        """For each crossing the ends of links there, each in the direction that leads away, lanes or not."""
        arms: dict[str, list[DirectedLink]] = {name: [] for name in self.crossings}
        for link in self.links.values():
            if link.start is not None:
                arms[link.start].append(DirectedLink(link.id, 1))
            if link.end is not None:
                arms[link.end].append(DirectedLink(link.id, -1))
        return {name: tuple(each) for name, each in arms.items()}

    @cached_property
    def turns(self) -> RoadTurns:
        """The ways from link to link."""
        return RoadTurns(self.links, self.crossings, self.arms)

    @cached_property
    def paths(self) -> CrossingPaths:
        """The curves through crossings."""
        return CrossingPaths(self.links, self.crossings, self.turns)

    @cached_property
    def continuations(self) -> RoadContinuations:
        """The links that are one road."""
        return RoadContinuations(self.links, self.arms, self.turns, self.names)

    @cached_property
    def departures(self) -> Mapping[str, tuple[DirectedLink, ...]]:
        """For each crossing the links that can be travelled away from it."""
        return {
            name: tuple(arm for arm in arms if arm.direction in self.links[arm.link].directions)
            for name, arms in self.arms.items()
        }

    def adjacent(self, one: str, other: str) -> bool:
        """Whether two links meet at a crossing."""
        a, b = self.links[one], self.links[other]
        return bool(({a.start, a.end} - {None}) & {b.start, b.end})

    def on_road(self, x_m: float, y_m: float, slack_m: float = 0.0) -> bool:
        """Whether a position is on the road system.

        On it is what lies at most half a link's width and `slack_m` from its centre line, or in a crossing or in an
        area of kind road or crossing.
        """
        if not (math.isfinite(x_m) and math.isfinite(y_m)):
            return False
        index = self.index
        if index.on_link(x_m, y_m, slack_m):
            return True
        if any(distance_m <= one.radius_m for one, distance_m in index.crossings_near(x_m, y_m)):
            return True
        return any(area.kind in {ROAD, CROSSING} for area in index.areas_at(x_m, y_m))

    def to_local(self, latitude_deg: float, longitude_deg: float) -> Point2:
        """(x_m, y_m) of a point on earth.

        Raises:
            ValueError: the network does not say where on earth it is.
        """
        if self.frame is None:
            raise ValueError("the road network has no origin on earth: give it latitude and longitude, or x and y")
        north_m, east_m, _ = self.frame.to_ned(latitude_deg, longitude_deg, 0.0)
        return east_m, north_m

    def apart_m(self, latitude_deg: float, longitude_deg: float) -> float:
        """How far a point on earth is from where x = y = 0 is; 0 if that is not known."""
        return 0.0 if self.frame is None else math.hypot(*self.to_local(latitude_deg, longitude_deg))

    def __repr__(self) -> str:
        return f"RoadNetwork({len(self.crossings)} crossings, {len(self.links)} links, {len(self.areas)} areas)"
