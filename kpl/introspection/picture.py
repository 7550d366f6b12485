"""A network as a picture, SVG: streams with the streams made of them, from left to right.

A node's layer is the length of the longest path to it from a node without inputs; an edge over several layers has a
place in each of them. Places in a layer are ordered by the mean of those that they are connected with, back and forth a
few times (Sugiyama, Tagawa and Toda, 1981).
"""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Final, NamedTuple, TypeAlias

from dyknow.kpl.introspection.graph import Graph, GraphNode
from dyknow.kpl.introspection.svg import BLACK, box, curve, document, words

_CHAR, _HIGH, _GAP_X, _GAP_Y, _PAD, _MARGIN = 6.2, 34.0, 34.0, 10.0, 10.0, 12.0
"""Pixels: a character of 11 px, a box, what lies between boxes."""
_SWEEPS: Final = 13
"""Odd, so that the last goes from left to right: no edges of a tree cross."""
_FILLS: Final[Mapping[str, str]] = {
    "source": "#e3f0e3", "unit": "#ffffff", "state": "#e8eefb", "stream": "#fdf2d8", "monitor": "#f8dcd8",
    "chronicles": "#efe3f6", "objects": "#eeeeee", "import": "#e3f0e3", "export": "#fdf2d8",
}  # fmt: skip
_GREY: Final = "#666666"
_RECOGNISED: Final = {"recognition", "prediction", "partial"}
_ROUND: Final = {"source", "stream", "import", "export"}

_Place: TypeAlias = tuple[str, int]
"""A node, or where an edge passes a layer: its name and the layer."""


class NodeBox(NamedTuple):
    """A node as it is drawn: its lines, the first of them black."""

    lines: Sequence[str]
    fill: str = "#ffffff"
    corner: int = 2

    @property
    def wide(self) -> float:
        return _PAD * 2 + _CHAR * max(map(len, self.lines))

    @property
    def high(self) -> float:
        return max(_HIGH, 14.0 * len(self.lines) + 6.0)


def as_svg(graph: Graph) -> str:
    """A picture of the network.

    Chronicles without a reader, and their partial instances, are left out.
    """
    taken = {edge.source for edge in graph.edges}
    nodes = {node.name: node for node in graph.nodes if node.name in taken or node.sort not in _RECOGNISED}
    for edge in graph.edges:
        nodes.setdefault(edge.source, GraphNode(edge.source, ""))
    edges = {(edge.source, edge.target): "" for edge in graph.edges if edge.target in nodes}
    return layered_svg({name: _node_box(node) for name, node in nodes.items()}, edges)


def _node_box(node: GraphNode) -> NodeBox:
    """The name, and the maker."""
    kind = node.made_by or ("" if node.kind in {"stream", "monitor", "source", ""} else node.kind)
    lines = [node.name, *([kind] if kind else [])]
    return NodeBox(lines, _FILLS.get(node.kind, "#ffffff"), 14 if node.kind in _ROUND else 2)


def layered_svg(boxes: Mapping[str, NodeBox], edges: Mapping[tuple[str, str], str]) -> str:
    """Boxes by name, and the words of each edge; an edge that leads back is drawn, and counts for no layer."""
    layer = _layers(boxes, list(edges))
    ways = [_way(source, target, layer) for source, target in edges]
    gap = _GAP_X + _CHAR * max(map(len, edges.values()), default=0)
    at = _positions(_ordered(layer, ways), boxes, gap)
    ends = {place: (x + (boxes[place[0]].wide if place[0] in boxes else 0.0), y) for place, (x, y) in at.items()}
    right = max((x for x, _ in ends.values()), default=0.0) + _MARGIN
    bottom = max((y + _height(place, boxes) / 2 for place, (_, y) in at.items()), default=0.0) + _MARGIN
    lines = dict.fromkeys(curve(*ends[one], *at[other]) for way in ways for one, other in pairwise(way))
    texts = (
        words(at[way[-1]][0] - 6, at[way[-1]][1] + (14 if at[way[-1]][1] > at[way[0]][1] else -5), text, "end", _GREY)
        for way, text in zip(ways, edges.values(), strict=True)
        if text
    )
    drawn = (part for name, each in boxes.items() for part in _box(each, *at[name, layer[name]]))
    return document(right, bottom, (*lines, *texts, *drawn))


def _layers(names: Iterable[str], edges: Sequence[tuple[str, str]]) -> dict[str, int]:
    """The length of the longest path to each node; edges that close a circle are left out."""
    makers = defaultdict[str, list[str]](list)
    for source, target in edges:
        makers[target].append(source)
    layer: dict[str, int] = {}
    for name in names:
        open_, path = [name], set[str]()
        while open_:
            one = open_[-1]
            waits = [each for each in makers[one] if each not in layer and each not in path and each != one]
            if one in layer or (one in path and not waits):
                layer.setdefault(one, max((layer[each] + 1 for each in makers[one] if each in layer), default=0))
                path.discard(open_.pop())
            else:
                path.add(one)
                open_ += waits
    return layer


def _way(source: str, target: str, layer: Mapping[str, int]) -> list[_Place]:
    """The places of an edge, one in each layer between its ends; edges from one source share them."""
    first, last = layer[source], layer[target]
    between = [(f"{source}\n", each) for each in range(first + 1, last)]
    return [(source, first), *between, (target, last)]


def _ordered(layer: Mapping[str, int], ways: Sequence[Sequence[_Place]]) -> list[list[_Place]]:
    """The places of each layer from top to bottom."""
    columns: list[dict[_Place, None]] = [{} for _ in range(max(layer.values(), default=-1) + 1)]
    for place in (*((name, at) for name, at in layer.items()), *(place for way in ways for place in way)):
        columns[place[1]].setdefault(place)
    near = defaultdict[_Place, list[_Place]](list)
    for way in ways:
        for one, other in pairwise(way):
            near[one].append(other)
            near[other].append(one)
    ordered = [list(column) for column in columns]
    for sweep in range(_SWEEPS):
        ahead = sweep % 2 == 0
        row = {place: number / len(column) for column in ordered for number, place in enumerate(column)}
        for at in range(len(ordered)) if ahead else reversed(range(len(ordered))):
            beside = at - 1 if ahead else at + 1

            def middle(place: _Place, beside: int = beside, row: dict[_Place, float] = row) -> float:
                rows = [row[each] for each in near[place] if each[1] == beside]
                return sum(rows) / len(rows) if rows else row[place]

            ordered[at].sort(key=middle)
            row |= {place: number / len(ordered[at]) for number, place in enumerate(ordered[at])}
    return ordered


def _positions(
    columns: Sequence[Sequence[_Place]], boxes: Mapping[str, NodeBox], gap: float
) -> dict[_Place, tuple[float, float]]:
    """The left end and the middle of each place, each layer centred."""
    high = [sum(_height(place, boxes) for place in column) for column in columns]
    found: dict[_Place, tuple[float, float]] = {}
    x = _MARGIN
    for column, sum_high in zip(columns, high, strict=True):
        y = _MARGIN + (max(high) - sum_high) / 2
        for place in column:
            step = _height(place, boxes)
            found[place] = x, y + (step - _GAP_Y) / 2
            y += step
        x += max((boxes[name].wide for name, _ in column if name in boxes), default=0.0) + gap
    return found


def _height(place: _Place, boxes: Mapping[str, NodeBox]) -> float:
    """The height of a box, or of an edge that passes, with the gap below it."""
    return boxes[place[0]].high + _GAP_Y if place[0] in boxes else _GAP_Y * 1.5


def _box(of: NodeBox, x: float, y: float) -> Iterator[str]:
    yield box(x, y - of.high / 2, of.wide, of.high, fill=of.fill, corner=of.corner)
    for number, text in enumerate(of.lines):
        at_y = y + 4 + 14 * number - 7 * (len(of.lines) - 1)
        yield words(x + of.wide / 2, at_y, text, "middle", _GREY if number else BLACK)
