"""A network drawn: as text, JSON, Mermaid, Graphviz, or a picture."""

import json
from typing import Any

from dyknow.kpl.introspection.graph import Edge, Graph, GraphNode
from dyknow.kpl.introspection.picture import as_svg
from dyknow.model.instants import print_span

_SHAPES = {
    "source": ('[("{}")]', "cylinder"),
    "stream": ('(["{}"])', "oval"),
    "monitor": ('{{{{"{}"}}}}', "hexagon"),
    **dict.fromkeys(("import", "export"), ('[/"{}"/]', "parallelogram")),
}
_BOX = ('["{}"]', "box")
"""How a kind of node is drawn: in Mermaid, and for Graphviz."""


def drawn(graph: Graph, form: str) -> str:
    """The graph as `text`, `json`, `mermaid`, `dot` or `svg`."""
    forms = {
        "text": as_text,
        "json": lambda found: json.dumps(as_json(found)) + "\n",
        "mermaid": as_mermaid,
        "dot": as_dot,
        "svg": as_svg,
    }
    return forms[form](graph)


def as_text(graph: Graph) -> str:
    """For display: each node, with its inputs below it."""
    lines: list[str] = []
    for node in graph.nodes:
        made = f" = {node.made_by}" if node.made_by else ""
        sort = f"{node.sort} " if node.sort not in {"", node.kind} else ""
        kind = "" if node.name.startswith(f"{node.kind} ") else f"{node.kind} "
        lines.append(f"{kind}{sort}{node.name}{made}{_figures(node)}")
        lines += [f"    <- {edge.source}{_conditions(edge)}" for edge in graph.edges if edge.target == node.name]
        lines += [f"    {each}" for each in (*node.note, *node.states.splitlines())]
        if node.counted:
            what = "ignored" if node.kind == "chronicles" else "states"
            lines.append(f"    {what} {', '.join(f'{reason}: {count}' for reason, count in node.counted.items())}")
    return "".join(f"{line}\n" for line in lines)


def as_json(graph: Graph) -> dict[str, Any]:
    """Nodes and edges as JSON has them."""
    return {
        "nodes": [{name: getattr(node, name) for name in GraphNode.__slots__} for node in graph.nodes],
        "edges": [{name: getattr(edge, name) for name in Edge.__slots__} for edge in graph.edges],
    }


def graph_of_json(text: str) -> Graph:
    """The graph that was printed as JSON.

    Raises:
        ValueError, TypeError, KeyError: the text is none.
    """
    found = json.loads(text)
    nodes = (GraphNode(**{**each, "note": tuple(each["note"])}) for each in found["nodes"])
    return Graph(tuple(nodes), tuple(Edge(**each) for each in found["edges"]))


def as_mermaid(graph: Graph) -> str:
    """A flowchart for documents that draw Mermaid."""
    ids = {node.name: f"n{i}" for i, node in enumerate(graph.nodes)}
    lines = ["flowchart LR"]
    for node in graph.nodes:
        shape, _ = _SHAPES.get(node.kind, _BOX)
        said = node.name if not node.made_by else f"{node.name}<br/>{node.made_by}"
        lines.append(f"    {ids[node.name]}{shape.format(_quoted(said))}")
    for edge in graph.edges:
        source = ids.get(edge.source)
        if source is None:
            source = ids[edge.source] = f"n{len(ids)}"
            lines.append(f'    {source}["{_quoted(edge.source)}?"]')
        said = f'|"{_quoted(edge.in_force or edge.policy)}"|' if edge.policy or edge.in_force else ""
        lines.append(f"    {source} -->{said} {ids[edge.target]}")
    return "".join(f"{line}\n" for line in lines)


def as_dot(graph: Graph) -> str:
    """For Graphviz."""
    lines = ["digraph dyknow {", "    rankdir=LR;", "    node [shape=box];"]
    for node in graph.nodes:
        said = node.name if not node.made_by else f"{node.name}\\n{node.made_by}"
        _, shape = _SHAPES.get(node.kind, _BOX)
        lines.append(f'    "{_escaped(node.name)}" [label="{_escaped(said)}", shape={shape}];')
    for edge in graph.edges:
        policy = edge.in_force or edge.policy
        said = f' [label="{_escaped(policy)}"]' if policy else ""
        lines.append(f'    "{_escaped(edge.source)}" -> "{_escaped(edge.target)}"{said};')
    return "".join(f"{line}\n" for line in [*lines, "}"])


def _figures(node: GraphNode) -> str:
    parts = []
    if node.running is False:
        parts.append("dormant: no subscriber")
    if node.rate_hz is not None:
        parts.append(f"{node.rate_hz:.3g} Hz")
    if node.delay_us is not None:
        parts.append(f"{print_span(node.delay_us)} late")
    if node.held:
        parts.append(f"{node.held} held")
    return f"  ({', '.join(parts)})" if parts else ""


def _conditions(edge: Edge) -> str:
    parts = [f" with {edge.policy}"] if edge.policy and edge.policy != "any update" else []
    if edge.in_force:
        parts.append(f", now {edge.in_force}")
    lost = ", ".join(f"{count} {reason}" for reason, count in edge.dropped.items())
    if lost:
        parts.append(f"; dropped: {lost}")
    if edge.gaps:
        parts.append(f"; {edge.gaps} gap{'' if edge.gaps == 1 else 's'}")
    if not edge.linked:
        parts.append("; no producer")
    return "".join(parts)


def _quoted(text: str) -> str:
    return text.replace('"', "#quot;")


def _escaped(text: str) -> str:
    return text.replace('"', '\\"')
