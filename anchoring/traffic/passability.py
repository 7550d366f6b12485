"""Which routes between two crossings a vehicle can pass now, and what closes the others."""

from collections.abc import Mapping
from typing import Final, NamedTuple

from dyknow.anchoring.roads.names import way_name
from dyknow.anchoring.roads.network import RoadNetwork
from dyknow.anchoring.roads.routes import BY_TIME, RoadRoute, RoadRoutes, Speeds
from dyknow.anchoring.traffic.obstacles import LaneObstacle, Narrowest

_NAMED: Final = 3
"""At most this number of vehicles is named in a reason."""


class WantedRoute(NamedTuple):
    """A route that is wanted, from a crossing to a crossing, for a vehicle so wide."""

    start: str
    goal: str
    width_m: float


class RouteState(NamedTuple):
    """Whether a wanted route can be passed.

    Attributes:
        route: the fastest that can; None if there is none.
        because: why it is not the fastest of an empty network, or why there is none; empty: nothing is in the way.
    """

    route: RoadRoute | None
    because: str


class Passability:
    """Answers for one network. `narrow` has the narrowest place of each link with obstacles."""

    def __init__(self, network: RoadNetwork) -> None:
        self._network, self._routes = network, RoadRoutes(network)

    def state(self, wanted: WantedRoute, narrow: Mapping[str, Narrowest], speeds: Speeds) -> RouteState:
        """The fastest route that is open, at the speeds of its traffic."""
        for name in (wanted.start, wanted.goal):
            if name not in self._network.crossings:
                return RouteState(None, f"there is no crossing {name!r}")
        closed = self._closed(narrow, wanted.width_m)
        direct = self._routes.shortest(wanted.start, wanted.goal, BY_TIME)
        if direct is None:
            return RouteState(None, f"no road leads from {wanted.start} to {wanted.goal}")
        moving = {way: speed for way, speed in speeds.items() if speed > 0.0}
        route = self._routes.shortest(wanted.start, wanted.goal, BY_TIME, moving, closed)
        reasons = [
            closed_because(self._network, step.link, narrow.get(step.link), wanted.width_m)
            for step in direct.links
            if step.link in closed
        ]
        if route is None:
            reasons.append("no other way is open")
        elif not reasons:
            left = [way for way in direct.links if way not in route.links and way in moving]
            reasons = [f"traffic on {way_name(way)} moves at {moving[way]:.0f} m/s" for way in left]
        return RouteState(route, "; ".join(dict.fromkeys(reasons)))

    def _closed(self, narrow: Mapping[str, Narrowest], width_m: float) -> frozenset[str]:
        links = self._network.links
        too_narrow = {name for name, link in links.items() if link.width_m < width_m}
        return frozenset(too_narrow | {name for name, place in narrow.items() if place.open_m < width_m})


def closed_because(network: RoadNetwork, link: str, place: Narrowest | None, width_m: float) -> str:
    """Why a vehicle cannot pass a link; empty if it can."""
    whole_m = network.links[link].width_m
    if whole_m < width_m:
        return f"{link} is {whole_m:g} m wide, {width_m:g} m are needed"
    if place is None or place.open_m >= width_m:
        return ""
    return f"{obstructed(link, place)} of {whole_m:g} m, {width_m:g} m are needed"


def obstructed(link: str, place: Narrowest) -> str:
    """The obstacles that narrow a link at its narrowest place."""
    several = len(place.obstacles) > 1
    return (
        f"{_names(place.obstacles)} stand{'' if several else 's'} on {link}"
        f" at {place.offset_m:.0f} m and leave{'' if several else 's'} {place.open_m:g} m"
    )


def _names(obstacles: tuple[LaneObstacle, ...]) -> str:
    names = [one.vehicle for one in obstacles]
    if len(names) > _NAMED:
        return f"{', '.join(names[: _NAMED - 1])} and {len(names) - _NAMED + 1} more"
    return " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))
