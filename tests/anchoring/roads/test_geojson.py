"""GeoJSON to road networks: what is read, and the feature, cause and remedy of what is not."""

import json
import math
import os
import time
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow.anchoring.roads.elements import Lane
from dyknow.anchoring.roads.files.formats import read_roads
from dyknow.anchoring.roads.files.geojson import survey_roads
from dyknow.anchoring.roads.files.problems import MOST_PROBLEMS
from dyknow.anchoring.roads.network import RoadNetwork
from dyknow.model.errors import RoadsError
from tests.anchoring.roads.towns import NO_LINE, cross, crossing, feature, grid_text, link, text

LINE = [(0.0, 0.0), (100.0, 0.0)]
X = crossing("x", 0.0, 0.0)


def only(**about: Any) -> Any:
    return read_roads(text(link("l", None, None, LINE, **about))).links["l"]


def test_a_cross_has_its_crossing_and_four_links() -> None:
    network = read_roads(cross(speed_m_s=12.5, width_m=6, lanes=2))
    assert list(network.links) == ["e", "n", "w", "s"]
    assert network.crossings["x"].radius_m == 8.0
    east = network.links["e"]
    assert (east.start, east.end, east.length_m, east.width_m, east.speed_m_s) == ("x", None, 200.0, 6.0, 12.5)
    assert east.lanes == (Lane(1.5, 1), Lane(-1.5, -1))


def test_what_a_link_does_not_say_has_a_default() -> None:
    made = only()
    assert (made.width_m, made.speed_m_s, made.lanes) == (7.0, 13.9, (Lane(1.75, 1), Lane(-1.75, -1)))


@pytest.mark.parametrize(
    ("about", "lanes"),
    [
        ({"lanes": 1}, [(0.0, 0)]),
        ({"lanes": 1, "oneway": True}, [(0.0, 1)]),
        ({"lanes": 3, "width_m": 9}, [(3.0, 1), (0.0, 1), (-3.0, -1)]),
        ({"lanes": 4, "width_m": 8}, [(3.0, 1), (1.0, 1), (-1.0, -1), (-3.0, -1)]),
        ({"lanes": 2, "width_m": 6, "oneway": True}, [(1.5, 1), (-1.5, 1)]),
        ({"lanes": [2.5, -1.0, 0.0]}, [(2.5, 1), (-1.0, -1), (0.0, 0)]),
        ({"lanes": [2.5, -1.0], "oneway": True}, [(2.5, 1), (-1.0, 1)]),
    ],
)
def test_lanes_are_a_number_or_offsets(about: dict[str, Any], lanes: list[tuple[float, int]]) -> None:
    assert only(**about).lanes == tuple(Lane(*each) for each in lanes)


@pytest.mark.parametrize("lanes", [2, [1.75, -1.75]])
def test_where_one_drives_on_the_left_the_lanes_do(lanes: object) -> None:
    network = read_roads(text(link("l", None, None, LINE, lanes=lanes), traffic="left"))
    assert set(network.links["l"].lanes) == {Lane(-1.75, 1), Lane(1.75, -1)}


def test_degrees_become_metres_about_their_middle() -> None:
    line = [(15.60, 58.40), (15.61, 58.40)]
    network = read_roads(text(link("l", None, None, line), frame=None))
    (ax, ay), (bx, by) = network.links["l"].line.points
    assert ax == pytest.approx(-bx)
    assert network.links["l"].length_m == pytest.approx(584.7, abs=0.5)
    assert network.to_local(58.40, 15.60) == pytest.approx((ax, ay))
    assert abs(by) < 0.1


def test_roads_across_the_date_line_stay_together() -> None:
    network = read_roads(text(link("l", None, None, [(179.999, -17.0), (-179.999, -17.0)]), frame=None))
    assert network.links["l"].length_m == pytest.approx(213.0, abs=1.0)


def test_one_coordinate_far_off_is_the_one_that_is_named() -> None:
    lines = [link(f"l{n}", None, None, [(15.6, 58.4 + n / 100), (15.61, 58.4)]) for n in range(5)]
    stray = link("stray", None, None, [(15.6, 58.4), (0.0, 0.0)])
    with pytest.raises(RoadsError) as caught:
        read_roads(text(*lines, stray, frame=None))
    assert len(caught.value.problems) == 1
    assert "feature 5 ('stray'): [0.0, 0.0] is farther than 500 km" in str(caught.value)


def test_a_local_frame_with_an_origin_is_somewhere_on_earth_and_without_one_it_is_not() -> None:
    placed = read_roads(text(link("l", None, None, LINE), origin=[15.6, 58.4]))
    assert placed.links["l"].line.points == ((0.0, 0.0), (100.0, 0.0))
    assert placed.to_local(58.4, 15.6) == pytest.approx((0.0, 0.0))
    with pytest.raises(ValueError, match="no origin on earth"):
        read_roads(cross()).to_local(58.4, 15.6)


def test_ids_may_be_numbers_and_stand_where_geojson_has_them() -> None:
    made = link("", 7, None, LINE)
    del made["properties"]["id"]
    network = read_roads(text(crossing(7, 0.0, 0.0), made | {"id": 12}))  # type: ignore[arg-type]
    assert network.links["12"].start == "7"


def test_points_that_repeat_and_heights_are_left_out() -> None:
    network = read_roads(text(link("l", None, None, [(0, 0, 9), (0, 0, 9), (3, 4, 9)])))
    assert network.links["l"].line.points == ((0.0, 0.0), (3.0, 4.0))


def test_areas_hold_what_is_in_them_without_their_holes() -> None:
    rings = [[(0, 0), (10, 0), (10, 10), (0, 10), (0, 0)], [(4, 4), (6, 4), (6, 6), (4, 6), (4, 4)]]
    network = read_roads(
        text(feature("Polygon", rings, id="a", kind="road", of="l"), link("l", None, None, [(99, 0), (99, 9)]))
    )
    assert [area.id for area in network.index.areas_at(2.0, 2.0)] == ["a"]
    assert not list(network.index.areas_at(5.0, 5.0))
    assert network.areas["a"].of == "l"
    assert network.on_road(2.0, 2.0)
    assert not network.on_road(5.0, 5.0)


def test_a_road_leaves_the_network_where_it_names_a_crossing_that_no_other_meets() -> None:
    survey = survey_roads(text(crossing("x", 50.0, 60.0), link("l", "y", "xx", LINE)))
    assert survey.network is not None
    assert (survey.network.links["l"].start, survey.network.links["l"].end) == (None, None)
    for problem, role, name in zip(survey.problems, ("from", "to"), ("y", "xx"), strict=True):
        assert problem.severity == "warning"
        wrong = (
            f"feature 1 ('l'): \"{role}\" is {name!r}, and no crossing has this id: the road leaves the network there"
        )
        assert problem.drawn.startswith(f"{wrong}; add a Point of kind crossing with this id if others meet it.")
    assert "Did you mean 'x'?" in survey.problems[1].drawn


def test_links_that_name_a_crossing_without_a_point_meet_where_their_ends_are() -> None:
    survey = survey_roads(
        text(link("a", None, "n", LINE), link("b", "n", None, [(104.0, 0.0), (104.0, 90.0)], width_m=10.0))
    )
    assert survey.network is not None
    joint = survey.network.crossings["n"]
    assert (joint.x_m, joint.y_m, joint.radius_m) == (102.0, 0.0, 5.0)
    assert survey.network.adjacent("a", "b")
    assert "it is taken to be where 2 links meet, with a radius of 5.0 m; add a Point" in survey.problems[0].drawn


def test_links_that_name_a_crossing_without_a_point_and_end_far_apart_are_wrong() -> None:
    assert "links that name it end 50.0 m from their middle; add a Point" in wrong(
        link("a", None, "n", LINE), link("b", "n", None, [(200.0, 0.0), (200.0, 90.0)])
    )


def wrong(*features: Any, **more: Any) -> str:
    """The message of the one problem."""
    with pytest.raises(RoadsError) as caught:
        read_roads(text(*features, **more), "town.geojson")
    assert len(caught.value.problems) == 1
    return str(caught.value)


@pytest.mark.parametrize(
    ("bad", "says"),
    [
        (link("l", 1.5, None, LINE), '"from" is 1.5; write the id of a crossing'),
        (NO_LINE, "feature 1 ('zero'): its length is zero; a LineString has two different points"),
        (feature("LineString", [], id="l"), "the coordinates of its LineString are []"),
        (feature("LineString", [[0, 0]], id="l"), "its length is zero"),
        (feature("LineString", [[0, math.nan], [1, 1]], id="l"), "a coordinate is [0, NaN]; write [x, y], two finite"),
        (feature("LineString", [[0, math.inf], [1, 1]], id="l"), "a coordinate is [0, Infinity]"),
        (feature("LineString", [[0, "1"], [1, 1]], id="l"), 'a coordinate is [0, "1"]'),
        (feature("LineString", [[0], [1, 1]], id="l"), "a coordinate is [0]"),
        (feature("LineString", [[True, 0], [1, 1]], id="l"), "a coordinate is [true, 0]"),
        (feature("LineString", [[0, 0], [6e5, 1]], id="l"), "[600000.0, 1.0] is farther than 500 km"),
        (feature("LineString", [[0, 0], [10**400, 1]], id="l"), "a coordinate is [1000"),
        (feature("LineString", 5, id="l"), "the coordinates of its LineString are 5"),
        (feature("MultiLineString", [LINE], id="l"), 'its geometry is "MultiLineString"; Point, LineString and Polygon'),
        (feature("LineString", LINE), "feature 1: it has no id; write"),
        (feature("LineString", LINE, id=""), 'its id is ""'),
        (feature("LineString", LINE, id="a\nb"), 'its id is "a\\nb"'),
        (feature("LineString", LINE, id=True), "its id is true"),
        (link("l", None, None, LINE, width_m=-1), '"width_m" is -1; write a number from 0.1 to 200'),
        (link("l", None, None, LINE, width_m=math.nan), '"width_m" is NaN'),
        (link("l", None, None, LINE, width_m="7"), '"width_m" is "7"'),
        (link("l", None, None, LINE, speed_m_s=0), '"speed_m_s" is 0'),
        (link("l", None, None, LINE, lanes=0), '"lanes" is 0; write how many, 1 to 32, or the offsets'),
        (link("l", None, None, LINE, lanes=[]), '"lanes" is []'),
        (link("l", None, None, LINE, lanes=[9.0]), '"lanes" is 9.0; write a number from -3.5 to 3.5'),
        (link("l", None, None, LINE, lanes=True), '"lanes" is true'),
        (link("l", None, None, LINE, oneway="yes"), '"oneway" is "yes"; write true or false'),
        (crossing("y", 0, 0, radius_m=-1), '"radius_m" is -1; write a number from 0.1'),
        (crossing("x", 5, 5), "feature 1 ('x'): feature 0 is a crossing with the same id"),
        (feature("Point", [0, 0], id="y"), "a Point has a kind"),
        (feature("Polygon", [[[0, 0], [1, 0], [1, 1]]], id="a", kind="road"), "a ring of its Polygon is not closed"),
        (feature("Polygon", [[[0, 0], [1, 1], [1, 0], [0, 1], [0, 0]]], id="a", kind="road"), "its Polygon is not valid"),
        (feature("Polygon", [[[0, 0], [1, 0], [1, 1], [0, 0]]], id="a"), "a Polygon has a kind"),
        ({"type": "Feature", "geometry": None, "properties": {"id": "l"}}, "its geometry is null"),
        ({"type": "Feature", "geometry": {"type": "Point", "coordinates": [0, 0]}}, "it has no properties"),
        ("road", "feature 1: it is no Feature"),
    ],
)  # fmt: skip
def test_an_error_names_the_feature_the_cause_and_the_remedy(bad: Any, says: str) -> None:
    message = wrong(X, bad)
    assert message.startswith("town.geojson: feature 1")
    assert says in message


def test_two_links_of_one_id_are_an_error_and_a_link_and_a_crossing_of_one_id_are_not() -> None:
    assert "feature 0 is a link with the same id" in wrong(link("l", None, None, LINE), link("l", None, None, LINE))
    assert read_roads(text(X, link("x", "x", None, LINE))).links["x"].start == "x"


def test_a_name_that_is_nearly_right_is_suggested() -> None:
    message = wrong(crossing("main-square", 0, 0), link("l", "main-sqare", None, LINE))
    assert "Did you mean 'main-square'?" in message


@pytest.mark.parametrize(
    ("raw", "says"),
    [
        ("", "it is no JSON"),
        ("{", "it is no JSON"),
        ("[" * 100_000, "it is no JSON"),
        (b"\xff\xfe", "it is no JSON"),
        ("9" * 5000, "it is no JSON"),
        ("[]", "it is no FeatureCollection"),
        ("{}", "it is no FeatureCollection"),
        ('{"type": "FeatureCollection"}', "it has no list of features"),
        ('{"type": "FeatureCollection", "features": {}}', "it has no list of features"),
        (text(X, frame="utm"), '"frame" is "utm"; it is "local" or "wgs84"'),
        (text(X, traffic=[]), '"traffic" is []; it is "left" or "right"'),
        (text(X, origin=[200, 0]), '"origin": [200.0, 0.0] is no longitude and latitude'),
    ],
)
def test_a_text_that_is_no_collection_says_what_to_write(raw: str | bytes, says: str) -> None:
    with pytest.raises(RoadsError) as caught:
        read_roads(raw)
    assert says in str(caught.value)


def test_metres_without_a_frame_are_met_by_the_remedy() -> None:
    with pytest.raises(RoadsError, match='for coordinates in metres write "frame": "local"'):
        read_roads(text(link("l", None, None, [(0, 0), (500, 0)]), frame=None))


def test_every_problem_is_listed_and_few_are_shown() -> None:
    survey = survey_roads(text(*[NO_LINE] * 8, crossing("x", 0, 0)))
    assert [each.feature for each in survey.problems] == list(range(8))
    assert survey.network is None
    with pytest.raises(RoadsError) as caught:
        survey.required("f")
    assert str(caught.value).count("\n") == 5
    assert str(caught.value).endswith("and 3 more")


def test_of_very_many_problems_a_limited_number_is_kept() -> None:
    survey = survey_roads(text(*[NO_LINE] * (MOST_PROBLEMS + 7)))
    assert len(survey.problems) == MOST_PROBLEMS
    assert survey.left_out == 7


def test_what_is_perhaps_not_meant_is_a_warning() -> None:
    survey = survey_roads(
        text(X, link("l", "x", None, [(40.0, 0.0), (90.0, 0.0)]), feature("Point", [0, 0], id="p", kind="lamp"))
    )
    assert isinstance(survey.network, RoadNetwork)
    assert [each.severity for each in survey.problems] == ["warning", "warning"]
    assert "it ends 40.0 m from 'x'" in survey.problems[0].message
    assert 'kind "lamp" is left out' in survey.problems[1].message
    assert "no LineString" in survey_roads(text(X)).problems[0].message


@pytest.mark.parametrize("rows", [pytest.param(224, marks=pytest.mark.full), 71])
def test_a_hundred_thousand_links_are_read_and_indexed_in_seconds(rows: int) -> None:
    raw = grid_text(rows)
    began = time.process_time()
    network = read_roads(raw)
    assert network.on_road(50.0, 0.0)
    assert len(network.links) == 2 * rows * (rows - 1)
    assert time.process_time() - began < 10.0 * (rows / 224) ** 2 + 2.0


def test_a_hundred_thousand_broken_features_are_bounded_work() -> None:
    count = 100_000 if os.environ.get("DYKNOW_FULL") else 10_000
    raw = json.dumps({"type": "FeatureCollection", "frame": "local", "features": [NO_LINE, 5] * (count // 2)})
    began = time.process_time()
    survey = survey_roads(raw)
    assert survey.left_out == count - MOST_PROBLEMS
    assert time.process_time() - began < 5.0


JSON = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=6,
)


@given(data=st.data())
def test_whatever_stands_in_a_member_there_are_problems_or_a_network_and_no_crash(data: st.DataObject) -> None:
    """One member of a good file, at any depth, replaced by any JSON."""
    area = feature("Polygon", [[[0, 0], [9, 0], [9, 9], [0, 0]]], id="a", kind="road")
    collection = json.loads(
        text(X, link("l", "x", None, LINE, lanes=[1.0], width_m=7, speed_m_s=9, oneway=False), area)
    )
    spot = collection
    while True:
        key = data.draw(st.sampled_from(sorted(spot) if isinstance(spot, dict) else range(len(spot))))
        if not isinstance(spot[key], dict | list) or not spot[key] or data.draw(st.booleans()):
            spot[key] = data.draw(JSON)
            break
        spot = spot[key]
    survey = survey_roads(json.dumps(collection))
    errors = [each for each in survey.problems if each.severity == "error"]
    assert (survey.network is None) == bool(errors)
    assert all(each.message and each.remedy for each in survey.problems)
    if survey.network is not None:
        assert survey.network.on_road(50.0, 0.0) in {True, False}


def test_all_that_is_wrong_with_one_feature_is_listed() -> None:
    """The first problem of a feature hides none of the others, wherever they are."""
    wrong = link("l", "x", 1.5, LINE, width_m="8", lanes=0, speed_m_s=-1, oneway="no")
    survey = survey_roads(text(X, wrong))
    assert [each.feature for each in survey.problems] == [1, 1, 1, 1]
    about = {each.message.partition(" is ")[0] for each in survey.problems}
    assert about == {'"to"', '"width_m"', '"oneway"', '"speed_m_s"'}
    far = link("", "x", None, [[1e9, 0], [0, 0]], width_m=-1)
    messages = [each.message for each in survey_roads(text(X, far)).problems]
    assert [message.partition(" is ")[0] for message in messages] == ["its id", "[1000000000.0, 0.0]", '"width_m"']
    area = feature("Polygon", [[[0, 0], [9, 0], [0, 0]]], id="a")
    assert [each.message[:9] for each in survey_roads(text(X, area)).problems] == ["a Polygon", "a ring of"]


def test_lanes_are_judged_by_themselves_where_the_width_is_wrong() -> None:
    survey = survey_roads(text(X, link("l", "x", None, LINE, width_m="wide", lanes=[60.0, -60.0])))
    assert [each.message for each in survey.problems] == ['"width_m" is "wide"']
