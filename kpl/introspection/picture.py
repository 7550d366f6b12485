"""A network as a picture, SVG: streams with the streams made of them, from left to right.

A node's layer is the length of the longest path to it from a node without inputs; an edge over several layers has a
place in each of them. Places in a layer are ordered by the mean of those that they are connected with, back and forth a
few times (Sugiyama, Tagawa and Toda, 1981).
"""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from itertools import pairwise
from typing import Final, TypeAlias

from kpl.introspection.graph import Graph, GraphNode

_CHAR, _HIGH, _GAP_X, _GAP_Y, _PAD, _MARGIN = 6.2, 34.0, 34.0, 10.0, 10.0, 12.0
"""Pixels: a character of 11 px, a box, what lies between boxes."""
_SWEEPS: Final = 12
_FILLS: Final[Mapping[str, str]] = {
    "source": "#e3f0e3", "unit": "#ffffff", "state": "#e8eefb", "stream": "#fdf2d8", "monitor": "#f8dcd8",
    "chronicles": "#efe3f6", "objects": "#eeeeee", "import": "#e3f0e3", "export": "#fdf2d8",
}  # fmt: skip
_BLACK, _GREY = "#222222", "#666666"
_RECOGNISED: Final = {"recognition", "prediction", "partial"}
_ROUND: Final = {"source", "stream", "import", "export"}

_Place: TypeAlias = tuple[str, int]
"""A node, or where an edge passes a layer: its name and the layer."""


def as_svg(graph: Graph) -> str:
    """A picture of the network; an edge that leads back is drawn, and counts for no layer.

    Chronicles without a reader, and their partial instances, are left out.
    """
    taken = {edge.source for edge in graph.edges}
    nodes = {node.name: node for node in graph.nodes if node.name in taken or node.sort not in _RECOGNISED}
    for edge in graph.edges:
        nodes.setdefault(edge.source, GraphNode(edge.source, ""))
    edges = list(dict.fromkeys((edge.source, edge.target) for edge in graph.edges if edge.target in nodes))
    layer = _layers(nodes, edges)
    ways = [_way(source, target, layer) for source, target in edges]
    columns = _ordered(layer, ways)
    wide = {name: _PAD * 2 + _CHAR * max(map(len, _lines(node))) for name, node in nodes.items()}
    at = _positions(columns, wide)
    right = max((x + wide.get(name, 0.0) for (name, _), (x, _) in at.items()), default=0.0) + _MARGIN
    bottom = max((y for _, y in at.values()), default=0.0) + _HIGH / 2 + _MARGIN
    parts = [
        (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {right:.0f} {bottom:.0f}" width="{right:.0f}" '
            f'height="{bottom:.0f}" font-family="Helvetica, Arial, sans-serif" font-size="11" fill="#222222">'
        ),
        f'<rect width="{right:.0f}" height="{bottom:.0f}" fill="#ffffff"/>',
        *dict.fromkeys(_line(one, other, at, wide) for way in ways for one, other in pairwise(way)),
        *(_box(node, at[name, layer[name]], wide[name]) for name, node in nodes.items()),
        "</svg>",
    ]
    return "".join(f"{part}\n" for part in parts)


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


def _positions(columns: Sequence[Sequence[_Place]], wide: Mapping[str, float]) -> dict[_Place, tuple[float, float]]:
    """The left end and the middle of each place, each layer centred."""
    high = {at: sum(map(_height, column)) for at, column in enumerate(columns)}
    highest = max(high.values(), default=0.0)
    found: dict[_Place, tuple[float, float]] = {}
    x = _MARGIN
    for at, column in enumerate(columns):
        y = _MARGIN + (highest - high[at]) / 2
        for place in column:
            found[place] = x, y + (_height(place) - _GAP_Y) / 2
            y += _height(place)
        x += max((wide.get(name, 0.0) for name, _ in column), default=0.0) + _GAP_X
    return found


def _height(place: _Place) -> float:
    """The height of a box, or of an edge that passes, with the gap below it."""
    return _GAP_Y * 1.5 if "\n" in place[0] else _HIGH + _GAP_Y


def _lines(node: GraphNode) -> list[str]:
    """The name, and the kind or maker."""
    kind = node.made_by or ("" if node.kind in {"stream", "monitor", "source", ""} else node.kind)
    return [node.name, *([kind] if kind else [])]


def _line(one: _Place, other: _Place, at: Mapping[_Place, tuple[float, float]], wide: Mapping[str, float]) -> str:
    (x, y), (end_x, end_y) = at[one], at[other]
    x += wide.get(one[0], 0.0)
    bend = abs(end_x - x) / 2
    return (
        f'<path d="M{x:.0f},{y:.0f} C{x + bend:.0f},{y:.0f} {end_x - bend:.0f},{end_y:.0f} {end_x:.0f},{end_y:.0f}" '
        f'fill="none" stroke="#8a8a8a"/>'
    )


def _box(node: GraphNode, place: tuple[float, float], wide: float) -> str:
    x, y = place
    lines = _lines(node)
    top = y - _HIGH / 2
    texts = [
        f'<text x="{x + wide / 2:.0f}" y="{y + 4 + (14 * number - 7 * (len(lines) - 1)):.0f}" text-anchor="middle" '
        f'fill="{_GREY if number else _BLACK}">{escape(text)}</text>'
        for number, text in enumerate(lines)
    ]
    corner = 14 if node.kind in _ROUND else 2
    fill = _FILLS.get(node.kind, "#ffffff")
    return (
        f'<rect x="{x:.0f}" y="{top:.0f}" width="{wide:.0f}" height="{_HIGH:.0f}" rx="{corner}" fill="{fill}" '
        f'stroke="#444444"/>{"".join(texts)}'
    )
