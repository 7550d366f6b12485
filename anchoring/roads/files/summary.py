"""The contents of a road network, and how much can be recognised on it, in a few numbers."""

from collections import Counter
from typing import Final, NamedTuple

from dyknow.anchoring.roads.elements import LEAVE, DirectedLink
from dyknow.anchoring.roads.files.problems import WARNING, RoadProblem
from dyknow.anchoring.roads.network import RoadNetwork
from dyknow.anchoring.roads.turns import LEFT, RIGHT, STRAIGHT, UTURN

STABLE_S: Final = 0.5
"""A car is on a link once it has been there for so long: the filter behind its link and its crossing."""
_MOST_NAMED: Final = 3


class RoadSummary(NamedTuple):
    """A road network in numbers.

    Attributes:
        parts: how many parts have no road between them; crossings without roads do not count.
        dead_ends: crossings with one link, and ends of links without a crossing.
        turns: ways through crossings that can be recognised; `left`, `right`, `straight` and `back` are how many of each.
        hidden_turns: the ways that cannot, since one of their links has no stretch outside of crossings that takes half
            a second at its speed limit.
        forks: ends of links, in the direction of travel, at which a car has more than one way out.
        ways: links, in each direction in which they can be travelled.
        both_ways: links that can be travelled in both directions, on which a change of direction can be recognised.
        hidden_links: the links of hidden turns.
    """

    crossings: int
    links: int
    lanes: int
    areas: int
    length_m: float
    parts: int
    dead_ends: int
    turns: int
    left: int
    right: int
    straight: int
    back: int
    hidden_turns: int
    forks: int
    ways: int
    both_ways: int
    hidden_links: tuple[str, ...]

    def warnings(self) -> tuple[RoadProblem, ...]:
        """Warnings of ways and links on which turns cannot be recognised."""
        if self.hidden_turns:
            named = ", ".join(map(repr, self.hidden_links[:_MOST_NAMED]))
            more = len(self.hidden_links) - _MOST_NAMED
            named += f" and {more} more" if more > 0 else ""
            message = (
                f"{self.hidden_turns} of {self.turns + self.hidden_turns} turns cannot be recognised: a car is on {named} "
                f"for less than {STABLE_S:g} s between two crossings"
            )
            remedy = "make these crossings smaller, or one of them; for OpenStreetMap, netconvert --junctions.join does"
            return (RoadProblem(WARNING, None, None, message, remedy),)
        if not self.turns:
            message = "no turn can be recognised on it: no link leads to another"
            return (RoadProblem(WARNING, None, None, message, "name the crossings where links meet"),)
        return ()


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
    ways = [DirectedLink(link.id, direction) for link in links for direction in link.directions]
    turns, hidden = _turns(network)
    return RoadSummary(
        crossings=len(network.crossings),
        links=len(links),
        lanes=sum(len(link.lanes) for link in links),
        areas=len(network.areas),
        length_m=sum(link.length_m for link in links),
        parts=nx.number_connected_components(graph),
        dead_ends=open_ends + sum(len(arms) == 1 for arms in network.arms.values()),
        turns=turns.total(),
        left=turns[LEFT],
        right=turns[RIGHT],
        straight=turns[STRAIGHT],
        back=turns[UTURN],
        hidden_turns=hidden.total() // 2,
        forks=sum(len(network.turns.exits(way)) > 1 for way in ways),
        ways=len(ways),
        both_ways=len(ways) - len({way.link for way in ways}),
        hidden_links=tuple(sorted(name for name in hidden if _is_hidden(network, name))),
    )


def _turns(network: RoadNetwork) -> tuple[Counter[str], Counter[str]]:
    """How many ways of each kind can be recognised; for each link, of how many others it is a part."""
    seen, hidden = Counter[str](), Counter[str]()
    short = {name for name in network.links if _is_hidden(network, name)}
    for name in network.links:
        for kind, pairs in network.turns.attributes(name).items():
            for _, other in pairs:
                if short.isdisjoint((name, other)):
                    seen[kind] += 1
                else:
                    hidden.update((name, other))
    return seen, hidden


def _is_hidden(network: RoadNetwork, name: str) -> bool:
    """Whether what lies outside of crossings is passed in less than `STABLE_S`: one is left at more than its radius."""
    link = network.links[name]
    radii = [0.0 if each is None else network.crossings[each].radius_m for each in (link.start, link.end)]
    return link.length_m - sum(radii) - (LEAVE - 1.0) * min(radii) < STABLE_S * link.speed_m_s
