"""What is in a road network, in a few numbers."""

from typing import NamedTuple

from anchoring.roads.network import RoadNetwork


class RoadSummary(NamedTuple):
    """A road network in numbers.

    Attributes:
        parts: how many parts have no road between them; crossings without roads do not count.
        dead_ends: crossings with one link, and ends of links without a crossing.
        turns: ways through crossings that are recognised: left, right, straight on and back.
    """

    crossings: int
    links: int
    lanes: int
    areas: int
    length_m: float
    parts: int
    dead_ends: int
    turns: int


def summary_of(network: RoadNetwork) -> RoadSummary:
    """The numbers of a network."""
    import networkx as nx

    links = network.links.values()
    graph = nx.Graph()
    for link in links:
        ends = [("end", end) for end in (link.start, link.end) if end is not None]
        graph.add_node(("link", link.id))
        graph.add_edges_from((("link", link.id), end) for end in ends)
    open_ends = sum((link.start is None) + (link.end is None) for link in links)
    return RoadSummary(
        len(network.crossings),
        len(links),
        sum(len(link.lanes) for link in links),
        len(network.areas),
        sum(link.length_m for link in links),
        nx.number_connected_components(graph),
        open_ends + sum(len(arms) == 1 for arms in network.arms.values()),
        sum(len(ways) for link in network.links for ways in network.turns.attributes(link).values()),
    )
