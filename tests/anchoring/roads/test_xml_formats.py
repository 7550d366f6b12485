"""OpenStreetMap and SUMO to road networks."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow.anchoring.roads.elements import DirectedLink, Lane
from dyknow.anchoring.roads.files import geojson, xml_elements
from dyknow.anchoring.roads.files.formats import GEOJSON, OPENSTREETMAP, SUMO, format_of, survey_any
from dyknow.anchoring.roads.files.openstreetmap import JOINT_M, survey_openstreetmap
from dyknow.anchoring.roads.files.sumo import survey_sumo
from dyknow.anchoring.roads.network import RoadNetwork
from tests.anchoring.roads.towns import cross

NODES = {
    1: (58.4000, 15.6000),
    2: (58.4000, 15.6020),
    3: (58.4000, 15.6040),
    4: (58.4010, 15.6020),
    5: (58.4000, 15.6060),
}


def osm(*ways: str, nodes: dict[int, tuple[float, float]] = NODES) -> str:
    listed = "".join(f'<node id="{name}" lat="{lat}" lon="{lon}"/>' for name, (lat, lon) in nodes.items())
    return f'<?xml version="1.0"?><osm version="0.6">{listed}{"".join(ways)}<relation id="9"/></osm>'


def way(name: str, *nodes: int, highway: str = "residential", **tags: str) -> str:
    listed = "".join(f'<nd ref="{node}"/>' for node in nodes)
    tagged = "".join(f'<tag k="{key}" v="{value}"/>' for key, value in {"highway": highway, **tags}.items())
    return f'<way id="{name}">{listed}{tagged}</way>'


def roads(text: str) -> RoadNetwork:
    return survey_any(text).required()


def test_ways_are_cut_where_they_meet() -> None:
    town = roads(osm(way("10", 1, 2, 3), way("20", 2, 4), way("30", 3, 5)))
    assert list(town.links) == ["10.0", "10.1", "20", "30"]
    assert (town.links["10.0"].start, town.links["10.0"].end) == ("1", "2")
    assert town.links["20"].length_m == pytest.approx(111.4, abs=0.2)
    assert town.crossings["2"].radius_m == 4.5
    assert town.crossings["3"].radius_m == JOINT_M, "the road continues there"
    assert town.turns.relation_of("10.0", "2", "20") == "left"
    assert town.frame is not None
    assert town.to_local(58.4000, 15.6020) == pytest.approx((town.crossings["2"].x_m, town.crossings["2"].y_m))


def test_a_way_that_meets_itself_is_cut_there() -> None:
    town = roads(osm(way("10", 1, 2, 3, 4, 2)))
    assert [(link.start, link.end) for link in town.links.values()] == [("1", "2"), ("2", "2")]


@pytest.mark.parametrize(
    ("tags", "expected"),
    [
        ({}, (7.0, 40 / 3.6, (1, -1))),
        ({"lanes": "1"}, (3.5, 40 / 3.6, (1, -1))),
        ({"oneway": "yes"}, (3.5, 40 / 3.6, (1,))),
        ({"junction": "roundabout"}, (3.5, 40 / 3.6, (1,))),
        ({"highway": "motorway", "lanes": "2"}, (7.0, 120 / 3.6, (1,))),
        ({"maxspeed": "30"}, (7.0, 30 / 3.6, (1, -1))),
        ({"maxspeed": "30 mph"}, (7.0, 48.28 / 3.6, (1, -1))),
        ({"maxspeed": "none"}, (7.0, 40 / 3.6, (1, -1))),
        ({"maxspeed": "0"}, (7.0, 40 / 3.6, (1, -1))),
        ({"width": "5.5 m", "lanes": "two"}, (5.5, 40 / 3.6, (1, -1))),
        ({"width": "9999", "lanes": "99"}, (200.0, 40 / 3.6, (1, -1))),
    ],
)
def test_tags_say_width_speed_and_directions(tags: dict[str, str], expected: tuple[object, ...]) -> None:
    link = roads(osm(way("10", 1, 2, **tags))).links["10"]
    width_m, speed_m_s, directions = expected
    assert (link.width_m, link.directions) == (width_m, directions)
    assert link.speed_m_s == pytest.approx(speed_m_s, abs=0.01)


def test_a_street_that_is_one_way_against_its_nodes_is_turned_round() -> None:
    link = roads(osm(way("10", 1, 2, oneway="-1"))).links["10"]
    assert (link.start, link.end, link.directions) == ("2", "1", (1,))
    assert link.line.points[0][0] > link.line.points[1][0]


@pytest.mark.parametrize(
    "tags", [{"highway": "footway"}, {"access": "private"}, {"motor_vehicle": "no"}, {"area": "yes"}]
)
def test_what_is_no_road_for_cars_is_left_out(tags: dict[str, str]) -> None:
    assert list(roads(osm(way("10", 1, 2), way("20", 2, 3, **tags))).links) == ["10"]


def test_nodes_that_an_extract_lacks_are_a_warning() -> None:
    survey = survey_openstreetmap(osm(way("10", 1, 2, 77)))
    assert survey.network is not None
    assert "way 0 ('10'): 1 of its nodes are not in the text" in survey.problems[0].drawn


def test_a_way_without_length_is_left_out() -> None:
    survey = survey_openstreetmap(osm(way("10", 1, 2), way("20", 4, 4)))
    assert survey.network is not None
    assert list(survey.network.links) == ["10"]
    assert "way 1 ('20'): its length is zero; it is left out" in survey.problems[0].drawn


@pytest.mark.parametrize("begin", ["{", "<osm>", "<net>"])
def test_a_text_that_is_too_long_is_not_read(begin: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (geojson, xml_elements):
        monkeypatch.setattr(module, "MOST_BYTES", 100)
    survey = survey_any(begin + " " * 100)
    assert any("at most 100 are read" in each.message for each in survey.problems)


LANE = '<lane id="{id}_{n}" index="{n}" speed="13.9" length="90" {more} shape="{shape}"/>'


def lane(edge: str, number: int, form: str, more: str = "") -> str:
    return LANE.format(id=edge, n=number, shape=form, more=more)


def edge(name: str, start: str, end: str, *lanes: str, more: str = "") -> str:
    return f'<edge id="{name}" from="{start}" to="{end}" {more}>{"".join(lanes)}</edge>'


JUNCTIONS = (
    '<junction id="A" type="dead_end" x="0" y="0" shape="0,0 0,-6.4"/>'
    '<junction id="B" type="priority" x="100" y="0" shape="96,3 104,3 104,-3 96,-3"/>'
    '<junction id=":B_0" type="internal" x="99" y="0"/>'
)
EAST = edge("ab", "A", "B", lane("ab", 0, "0,-4.8 96,-4.8"), lane("ab", 1, "0,-1.6 96,-1.6"))
WEST = edge("ba", "B", "A", lane("ba", 0, "96,1.6 0,1.6", 'width="3.0"'))


def sumo(*parts: str) -> str:
    return f'<?xml version="1.0"?>\n<net version="1.16"><location netOffset="0,0"/>{"".join(parts)}</net>'


def test_edges_are_links_of_one_way_between_junctions() -> None:
    town = roads(sumo(edge(":B_0", "B", "B", more='function="internal"'), EAST, WEST, JUNCTIONS))
    assert list(town.links) == ["ab", "ba"]
    assert set(town.crossings) == {"A", "B"}
    assert town.crossings["B"].radius_m == pytest.approx(
        math.hypot(4.0, 1.6)
    )  # where lanes end, not its corners, at 5 m
    east, west = town.links["ab"], town.links["ba"]
    assert east.lanes == (Lane(pytest.approx(1.6), 1), Lane(pytest.approx(-1.6), 1))
    assert east.line.points == ((0, 0), (0, pytest.approx(-3.2)), (96, pytest.approx(-3.2)), (100, 0))
    assert (west.width_m, west.directions) == (3.0, (1,))
    assert town.turns.relation(DirectedLink("ab", 1), DirectedLink("ba", 1)) == "uturn"
    assert town.on_road(50.0, -4.8)


def test_lanes_of_other_traffic_are_left_out() -> None:
    walk = lane("ab", 0, "0,-8 96,-8", 'allow="pedestrian"')
    rail = edge("r", "A", "B", lane("r", 0, "0,0 96,0", 'disallow="passenger"'))
    town = roads(
        sumo(edge("ab", "A", "B", walk, lane("ab", 1, "0,-4.8 96,-4.8", 'allow="passenger bus"')), rail, JUNCTIONS)
    )
    assert {name: len(link.lanes) for name, link in town.links.items()} == {"ab": 1}


def test_lanes_with_other_numbers_of_points_are_laid_next_to_the_first() -> None:
    town = roads(
        sumo(edge("ab", "A", "B", lane("ab", 0, "0,-4.8 96,-4.8"), lane("ab", 1, "0,-1.6 40,-1.6 96,-1.6")), JUNCTIONS)
    )
    assert town.links["ab"].line.points[1:3] == ((0, pytest.approx(-3.2)), (96, pytest.approx(-3.2)))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("<osm>", "it is no XML"),
        ("<osm></osm>", "no way in it is a road for cars"),
        (osm(way("10", 1)), "no way in it is a road for cars"),
        (osm(nodes={1: (math.nan, 0.0)}), "node '1' has no latitude and longitude"),
        (osm(nodes={1: (91.0, 0.0)}), "node '1' has no latitude and longitude"),
        (osm(way("10", 1, 2), way("10", 2, 3)), "way 1 ('10'): way 0 is a link with the same id"),
        (osm(way("10", 1, 2), nodes={1: (0.0, 0.0), 2: (40.0, 0.0)}), "farther than 500 km"),
        ('<!DOCTYPE a [<!ENTITY b "c">]><osm>&b;</osm>', "it has a document type"),
        ("<osm\0>", "it has a document type, or is not UTF-8"),
        ("<net></net>", "no edge in it is a road"),
        ("<html></html>", "its root is <html>; the root is <net>"),
        (
            sumo(edge("ab", "A", "B", lane("ab", 0, "0,nan 1,1")), JUNCTIONS),
            "edge 0 ('ab'): '0,nan' is no point in metres",
        ),
        (sumo(edge("ab", "A", "B", lane("ab", 0, "0 1,1")), JUNCTIONS), "'0' is no point in metres"),
        (sumo(edge("aa", "A", "A", lane("aa", 0, "0,0 0,0")), JUNCTIONS), "the length of its lanes is zero"),
        (sumo(edge("ab", "A", "B", lane("ab", 0, "0,0 9,0", 'width="x"')), JUNCTIONS), "a lane has the number 'x'"),
        (sumo('<junction id="A" x="0"/>', EAST), "junction 'A' lacks its place"),
    ],
)
def test_broken_texts_name_the_way_or_edge_the_cause_and_the_remedy(text: str, says: str) -> None:
    survey = survey_any(text)
    assert survey.network is None
    assert any(says in each.drawn for each in survey.problems), survey.problems


def test_the_beginning_of_a_text_tells_its_format() -> None:
    assert [format_of(each) for each in (cross(), osm(), sumo(), sumo().encode(), "\ufeff<osm>", "?")] == [
        GEOJSON, OPENSTREETMAP, SUMO, SUMO, OPENSTREETMAP, GEOJSON
    ]  # fmt: skip
    assert survey_sumo(osm()).problems
    assert len(roads(cross()).links) == 4


GOOD = (
    osm(way("10", 1, 2, 3, lanes="2", maxspeed="50"), way("20", 2, 4, oneway="-1")),
    sumo(EAST, WEST, JUNCTIONS),
)


@given(
    text=st.sampled_from(GOOD),
    at=st.floats(0.0, 1.0),
    length=st.integers(0, 12),
    other=st.text(st.sampled_from('0123456789.,- "<>/=&;eain'), max_size=6),
)
def test_a_damaged_text_has_problems_or_is_read_and_nothing_crashes(
    text: str, at: float, length: int, other: str
) -> None:
    begin = round(at * len(text))
    survey = survey_any(text[:begin] + other + text[begin + length :])
    assert (survey.network is None) == any(each.severity == "error" for each in survey.problems)
    if survey.network is not None:
        assert all(math.isfinite(link.length_m) for link in survey.network.links.values())


@pytest.mark.parametrize(
    ("root", "name", "converter"),
    [
        ("OpenDRIVE", "OpenDRIVE", "netconvert --opendrive-files FILE -o town.net.xml"),
        ("commonRoad", "CommonRoad", "crdesigner --input-file FILE --output-file sumo/town.net.xml crsumo"),
        ("nodes", "SUMO nodes", "netconvert"),
        ("net2", SUMO, "root is <net>"),
    ],
)
def test_a_format_of_others_is_refused_with_what_converts_it(root: str, name: str, converter: str) -> None:
    text = f"<?xml version='1.0'?><!-- <osm> made by --><{root}><road/></{root}>"
    survey = survey_any(text)
    assert survey.network is None
    assert format_of(text) == name
    (problem,) = survey.problems
    assert f"<{root}>" in problem.message
    assert converter in problem.remedy


LANELET = '<relation id="2"><tag k="type" v="lanelet"/></relation>'


def test_lanelets_are_no_ways_of_roads() -> None:
    survey = survey_any(osm('<way id="7"><nd ref="1"/><nd ref="2"/><tag k="type" v="line_thin"/></way>', LANELET))
    assert survey.network is None
    (problem,) = survey.problems
    assert problem.drawn.startswith("lanelets in it (Lanelet2) are not read: 1; convert it")
    assert "lanelet2cr" in problem.remedy
    assert "crsumo" in problem.remedy


def test_roads_next_to_lanelets_are_read_and_the_lanelets_are_a_warning() -> None:
    survey = survey_any(osm(way("10", 1, 2), LANELET, LANELET))
    assert survey.network is not None
    assert [each.drawn[:42] for each in survey.problems] == ["lanelets in it (Lanelet2) are not read: 2;"]
