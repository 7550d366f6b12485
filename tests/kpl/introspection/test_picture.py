"""Networks as pictures: every node and edge is there, nothing lies on anything else, and what is made is to the right."""

import re
from itertools import combinations
from xml.etree import ElementTree as ET

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dyknow.kpl.introspection.drawings import as_json, graph_of_json
from dyknow.kpl.introspection.graph import Edge, Graph, GraphNode, graph_of
from dyknow.kpl.introspection.picture import as_svg
from tests.kpl.instances import Running

NAMES = "abcdefgh"
edges = st.lists(st.tuples(st.sampled_from(NAMES), st.sampled_from(NAMES)), max_size=20)


def network(pairs, names=NAMES):
    return Graph(tuple(GraphNode(name, "unit") for name in names), tuple(Edge(*each) for each in pairs))


def boxes(svg):
    """The name of each box, and where it is: left, top, right, bottom."""
    found = {}
    root = ET.fromstring(svg)
    parts = [each for each in root if each.tag.endswith(("rect", "text"))][1:]
    for number, each in enumerate(parts):
        if each.tag.endswith("rect"):
            x, y, width, height = (float(each.get(name)) for name in ("x", "y", "width", "height"))
            found[parts[number + 1].text] = x, y, x + width, y + height
    return found


@given(edges)
@settings(max_examples=60)
def test_every_box_is_there_once_and_lies_on_no_other(pairs) -> None:
    found = boxes(as_svg(network(pairs)))
    assert set(found) == set(NAMES)
    for one, other in combinations(found.values(), 2):
        assert one[2] <= other[0] or other[2] <= one[0] or one[3] <= other[1] or other[3] <= one[1]


@given(edges)
@settings(max_examples=60)
def test_without_circles_what_is_made_is_to_the_right_of_what_it_is_made_of(pairs) -> None:
    ahead = [(min(pair), max(pair)) for pair in pairs if pair[0] != pair[1]]
    found = boxes(as_svg(network(ahead)))
    assert all(found[source][2] < found[target][0] for source, target in ahead)


def test_what_is_hostile_in_a_name_is_text() -> None:
    svg = as_svg(network([], names=('<script>alert("1")</script>', "a&b")))
    assert set(boxes(svg)) == {'<script>alert("1")</script>', "a&b"}
    assert "<script>" not in svg


def test_an_empty_network_is_a_picture_too() -> None:
    assert boxes(as_svg(Graph((), ()))) == {}


def test_a_long_chain_and_a_circle_are_drawn() -> None:
    chain = [(str(n), str(n + 1)) for n in range(2000)]
    svg = as_svg(network([*chain, ("2000", "0")], names=tuple(map(str, range(2001)))))
    assert len(re.findall("<path", svg)) >= 2001


def test_families_chronicles_and_quantified_formulas_are_connected_as_declared() -> None:
    running = Running(
        "source number n\nstrmgen n = n\ncompunit object Ids(number)\nstrmgen ids = Ids(n)\n"
        "compunit number Double(number)\nfor c in ids strmgen x[c] = Double(n)\n"
        "for c in ids strmgen y[c] = Double(x[c])\nmonitor low = always forall c in ids: y[c] < 9\n"
    )
    graph = graph_of(running.instance)
    assert {("n", "x[c]"), ("x[c]", "y[c]"), ("ids", "low")} <= {(edge.source, edge.target) for edge in graph.edges}
    assert {node.name: node.made_by for node in graph.nodes}["y[c]"] == "Double"


@pytest.mark.parametrize("pairs", [[], [("a", "b"), ("b", "c")]])
def test_a_graph_is_read_from_its_json(pairs) -> None:
    import json

    graph = network(pairs)
    assert graph_of_json(json.dumps(as_json(graph))) == graph
