"""Roads that lie somewhere else than objects, and conditions on roads where there are none."""

import pytest

from dyknow.anchoring.roads.network import RoadNetwork
from dyknow.model.errors import TextError, TextErrors
from dyknow.navigation import LocalFrame
from tests.kpl.linking.test_linking import PERCEPTS, ROADS, WORLD, Camera, OnTheRoad, specifications

HERE = "define ORIGIN_LATITUDE_DEG = 58.4\ndefine ORIGIN_LONGITUDE_DEG = 15.6\n"
SEEN_ON_ROADS = """
strmgen slow = link(world, SameState, eventually[0, oo] on_road[from], eventually[0, 1s] xy_dist[from, to] < 5, true)
stream found = slow
"""


def test_roads_with_another_origin_than_is_defined_are_refused() -> None:
    with pytest.raises(TextError, match="1114 m from the place where x_m and y_m of the roads are 0") as wrong:
        specifications(HERE + WORLD, RoadNetwork((), (), frame=LocalFrame(58.41, 15.6, 0.0)))
    assert "define ORIGIN_LATITUDE_DEG = 58.41" in wrong.value.repair
    assert (wrong.value.line, wrong.value.column) == (4, 17)


@pytest.mark.parametrize("frame", [None, LocalFrame(58.4, 15.6, 0.0), LocalFrame(58.400001, 15.6, 20.0)])
def test_roads_with_the_same_origin_or_none_are_taken(frame: LocalFrame | None) -> None:
    assert specifications(HERE + WORLD, RoadNetwork((), (), frame=frame))


def test_roads_are_about_the_origin_of_the_cameras() -> None:
    text = PERCEPTS + WORLD + "stream found = world\n"
    there = RoadNetwork((), (), frame=LocalFrame(58.4, 15.6, 0.0))
    with pytest.raises((TextError, TextErrors), match="1114 m from those of the cameras") as wrong:
        Camera(text, roads=there, frame=LocalFrame(58.41, 15.6, 0.0))
    assert "a.kpl:" in str(wrong.value)
    assert '"origin": [15.6000000, 58.4100000] in the file of roads' in str(wrong.value)
    assert Camera(text, roads=there, frame=LocalFrame(58.4, 15.6, 90.0))
    assert Camera(text, roads=RoadNetwork((), ()), frame=LocalFrame(58.41, 15.6, 0.0)), "a local map says no place"


def test_a_condition_on_roads_is_refused_where_there_are_none() -> None:
    same = "compunit world-object SameState(world-object)\n"
    with pytest.raises((TextError, TextErrors), match="on_road is never true"):
        Camera(PERCEPTS + WORLD + same + SEEN_ON_ROADS)
    assert OnTheRoad(ROADS + PERCEPTS + WORLD + same + SEEN_ON_ROADS)


def test_percepts_may_say_themselves_that_they_are_on_a_road() -> None:
    percepts = PERCEPTS.replace("colour in text, end", "colour in text, on_road in bool, end", 1)
    same = "compunit world-object SameState(world-object)\n"
    assert Camera(percepts + WORLD + same + SEEN_ON_ROADS)
