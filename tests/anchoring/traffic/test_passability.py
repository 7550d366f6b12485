"""Routes that an emergency vehicle can pass, and the reasons why not."""

import pytest

from dyknow.anchoring.roads.elements import DirectedLink
from dyknow.anchoring.roads.files.formats import read_roads
from dyknow.anchoring.traffic.obstacles import LaneObstacle, narrowest
from dyknow.anchoring.traffic.passability import Passability, WantedRoute
from tests.anchoring.roads.towns import crossing, link, text

A, B, C = (crossing(name, *at) for name, at in {"a": (0, 0), "b": (200, 0), "c": (100, 100)}.items())
FAR = crossing("far", 900, 900)
ROADS = read_roads(
    text(
        A, B, C, FAR,
        link("ab", "a", "b", [(0, 0), (200, 0)], width_m=7, speed_m_s=20),
        link("ac", "a", "c", [(0, 0), (100, 100)], width_m=5, speed_m_s=10),
        link("cb", "c", "b", [(100, 100), (200, 0)], width_m=5, speed_m_s=10),
        link("alone", "far", None, [(900, 900), (950, 900)]),
    )
)  # fmt: skip
ASKED = Passability(ROADS)


def narrow(*obstacles):
    found = {}
    for one in obstacles:
        found.setdefault(one.link, []).append(one)
    return {name: narrowest(ROADS.links[name], each) for name, each in found.items()}


def state(width_m=2.6, obstacles=(), speeds=None, start="a", goal="b"):
    return ASKED.state(WantedRoute(start, goal, width_m), narrow(*obstacles), speeds or {})


def links(found):
    return None if found.route is None else [step.link for step in found.route.links]


CAR, OTHER = LaneObstacle("car1", "ab", 0, 60.0, 0.0), LaneObstacle("car2", "ab", 1, 66.0, 0.4)


def test_an_open_road_is_taken_and_there_is_nothing_to_say() -> None:
    found = state()
    assert (links(found), found.because) == (["ab"], "")


def test_one_lane_is_enough_for_what_is_no_wider() -> None:
    assert links(state(3.5, [CAR])) == ["ab"]
    found = state(3.6, [CAR])
    assert links(found) == ["ac", "cb"]
    assert found.because == "car1 stands on ab at 60 m and leaves 3.5 m of 7 m, 3.6 m are needed"


def test_both_lanes_closed_leave_another_way_or_none() -> None:
    found = state(2.6, [CAR, OTHER])
    assert links(found) == ["ac", "cb"]
    assert found.because == "car1 and car2 stand on ab at 60 m and leave 0 m of 7 m, 2.6 m are needed"
    found = state(5.5, [CAR, OTHER])
    assert links(found) is None
    assert found.because.endswith("5.5 m are needed; no other way is open")


def test_a_road_that_is_too_narrow_says_so() -> None:
    found = state(6.0, start="a", goal="c")
    assert links(found) is None
    assert found.because == "ac is 5 m wide, 6 m are needed; no other way is open"


def test_slow_traffic_leads_another_way_and_is_named() -> None:
    found = state(speeds={DirectedLink("ab", 1): 2.0, DirectedLink("ab", -1): 20.0})
    assert links(found) == ["ac", "cb"]
    assert found.because == "traffic on ab moves at 2 m/s"


def test_many_are_not_all_named() -> None:
    queue = [LaneObstacle(f"car{n}", "ab", n % 2, 60.0 + n, 0.0) for n in range(6)]
    assert "car0, car1 and 4 more stand on ab" in state(2.6, queue).because


@pytest.mark.parametrize(
    ("start", "goal", "because"),
    [("a", "markt", "there is no crossing 'markt'"), ("a", "far", "no road leads from a to far")],
)
def test_what_is_not_there_is_said(start, goal, because) -> None:
    assert state(start=start, goal=goal) == (None, because)
