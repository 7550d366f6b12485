"""Routes through a road network: the shortest, the fastest, and those that an emergency vehicle can pass (networkx)."""

from collections.abc import Callable, Container, Iterator, Mapping
from itertools import islice
from typing import Any, Final, NamedTuple, TypeAlias

from dyknow.anchoring.roads.elements import DirectedLink, RoadLink
from dyknow.anchoring.roads.network import RoadNetwork

Speeds: TypeAlias = Mapping[DirectedLink, float]
"""Metres per second as they are measured; a link that is not there is taken at its limit."""
BY_LENGTH, BY_TIME = "length", "time"

_Cost: TypeAlias = Callable[[DirectedLink], float | None]
_FROM: Final = "from"
_TO: Final = "to"


class RoadRoute(NamedTuple):
    """Links in the order of travel; `time_s` at the measured speeds."""

    links: tuple[DirectedLink, ...]
    length_m: float
    time_s: float


class RoadNeeds(NamedTuple):
    """The needs of an emergency vehicle on a link: this width of road, and traffic no slower than this."""

    width_m: float = 3.0
    least_speed_m_s: float = 2.0


class RoadRoutes:
    """Routes from a crossing, or from the end of a link, to a crossing; U-turns only at dead ends."""

    def __init__(self, network: RoadNetwork) -> None:
        import networkx as nx

        self._nx: Any = nx
        self._network = network
        self._graph: Any = nx.DiGraph()
        for name, departures in network.departures.items():
            self._graph.add_edges_from(((_FROM, name), departure) for departure in departures)
        for link in network.links.values():
            for direction in link.directions:
                arrived = DirectedLink(link.id, direction)
                self._graph.add_edges_from((arrived, departure) for departure in network.turns.exits(arrived))
                if (crossing := link.crossing_at(direction)) is not None:
                    self._graph.add_edge(arrived, (_TO, crossing))

    def shortest(
        self,
        start: str | DirectedLink,
        end: str,
        by: str = BY_LENGTH,
        speeds: Speeds | None = None,
        closed: Container[str] = (),
    ) -> RoadRoute | None:
        """The route of least length or least time that leads over none of the closed links; None if there is none.

        Raises:
            KeyError: a crossing or link is not there.
        """
        if start == end:
            return RoadRoute((), 0.0, 0.0)
        measured = speeds or {}

        def cost(step: DirectedLink) -> float | None:
            if step.link in closed:
                return None
            return self._length_m(step) if by == BY_LENGTH else self._time_s(step, measured)

        source, target = self._ends(start, end)
        try:
            path = self._nx.dijkstra_path(self._graph, source, target, weight=_weight(cost))
        except self._nx.NetworkXNoPath:
            return None
        return self._route(path, start, measured)

    def passable(
        self, start: str | DirectedLink, end: str, speeds: Speeds, vehicle: RoadNeeds | None = None, most: int = 3
    ) -> tuple[RoadRoute, ...]:
        """Routes that a vehicle can pass now, the fastest first, at most `most`.

        Raises:
            KeyError: a crossing or link is not there.
        """
        if start == end:
            return (RoadRoute((), 0.0, 0.0),)
        needs = vehicle or RoadNeeds()
        source, target = self._ends(start, end)
        open_links = self._nx.subgraph_view(
            self._graph, filter_node=lambda node: node == source or self._is_open(node, speeds, needs)
        )
        weight = _weight(lambda step: self._time_s(step, speeds))
        routes: Iterator[Any] = self._nx.shortest_simple_paths(open_links, source, target, weight=weight)
        try:
            return tuple(self._route(path, start, speeds) for path in islice(routes, most))
        except (self._nx.NetworkXNoPath, self._nx.NodeNotFound):
            return ()

    def _is_open(self, node: Any, speeds: Speeds, vehicle: RoadNeeds) -> bool:
        if not isinstance(node, DirectedLink):
            return True
        return is_passable(self._network.links[node.link], speeds.get(node), vehicle)

    def _ends(self, start: str | DirectedLink, end: str) -> tuple[Any, Any]:
        source = start if isinstance(start, DirectedLink) else (_FROM, self._network.crossings[start].id)
        target = (_TO, self._network.crossings[end].id)
        if isinstance(start, DirectedLink) and start.direction not in self._network.links[start.link].directions:
            raise KeyError(start)
        self._graph.add_nodes_from([source, target])
        return source, target

    def _length_m(self, step: DirectedLink) -> float:
        return self._network.links[step.link].length_m

    def _time_s(self, step: DirectedLink, speeds: Speeds) -> float | None:
        """At the measured speed, or the limit; None for traffic that stands."""
        link = self._network.links[step.link]
        speed_m_s = speeds.get(step, link.speed_m_s)
        return link.length_m / speed_m_s if speed_m_s > 0.0 else None

    def _route(self, path: list[Any], start: str | DirectedLink, speeds: Speeds) -> RoadRoute:
        """A route that starts at the end of a link does not hold that link."""
        steps = tuple(node for node in path if isinstance(node, DirectedLink))
        links = steps[1:] if isinstance(start, DirectedLink) else steps
        time_s = sum(self._time_s(step, speeds) or float("inf") for step in links)
        return RoadRoute(links, sum(map(self._length_m, links)), time_s)


def is_passable(link: RoadLink, speed_m_s: float | None, vehicle: RoadNeeds) -> bool:
    """Whether a vehicle can pass a link; unmeasured traffic is as fast as the limit."""
    return (
        link.width_m >= vehicle.width_m
        and (link.speed_m_s if speed_m_s is None else speed_m_s) >= vehicle.least_speed_m_s
    )


def _weight(cost: _Cost) -> Callable[[Any, Any, Any], float | None]:
    """The weight of an edge: the cost of the link to which it leads."""
    return lambda _from, to, _about: cost(to) if isinstance(to, DirectedLink) else 0.0
