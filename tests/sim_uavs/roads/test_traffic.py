"""Vehicles on the road: nothing overlaps, nothing leaves the road, and what is driven is what was asked for."""

from collections import Counter
from itertools import combinations, pairwise
from math import hypot, pi

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow.anchoring.roads.network import RoadNetwork
from dyknow.model.errors import DyknowError
from dyknow.sim_uavs.roads.drivers import BUILDS, Driver, RoadState, drawn
from dyknow.sim_uavs.roads.layouts import LAYOUTS, bends, cross, layout, network_of, straight, town
from dyknow.sim_uavs.roads.lines import DrivenLine, turned
from dyknow.sim_uavs.roads.traffic import SimulatedTraffic


def driven(network: RoadNetwork, drivers: list[Driver], seconds: int, seed: int = 1) -> list[list[RoadState]]:
    """Every 0.2 s."""
    traffic = SimulatedTraffic(network, drivers, np.random.default_rng(seed))
    states = []
    for now_us in range(0, seconds * 1_000_000, 200_000):
        traffic.advance(now_us)
        states.append(traffic.states())
    return states


def from_outside(network: RoadNetwork, count: int, seed: int, seconds: int) -> list[Driver]:
    """Drivers that enter at the ends of the network, by chance; where it has none, on its links."""
    rng = np.random.default_rng(seed)
    ends = {
        name: network.links[ways[0].link].crossing_at(ways[0].direction)
        for name, ways in network.departures.items()
        if len(ways) == 1
    }
    routes = [(name, str(first)) for name, first in ends.items()]
    routes = routes or [(str(link.start), str(link.end)) for link in network.links.values()]
    return [
        drawn(f"v{n}", routes[n % len(routes)], rng, enters_us=int(rng.integers(seconds * 1_000_000)))
        for n in range(count)
    ]


def middle_circles(state: RoadState) -> list[tuple[float, float]]:
    """Points along the middle of a vehicle, half a width apart or closer, that stay within it."""
    build = BUILDS[state.kind]
    reach = (build.length_m - build.width_m) / 2.0
    along = np.linspace(-reach, reach, 7)
    return [
        (state.x_m + float(a * np.cos(state.heading_rad)), state.y_m + float(a * np.sin(state.heading_rad)))
        for a in along
    ]


def overlap(one: RoadState, other: RoadState) -> bool:
    width_m = (BUILDS[one.kind].width_m + BUILDS[other.kind].width_m) / 2.0
    if hypot(one.x_m - other.x_m, one.y_m - other.y_m) > 12.0:
        return False
    return any(
        hypot(x0 - x1, y0 - y1) < 0.9 * width_m for x0, y0 in middle_circles(one) for x1, y1 in middle_circles(other)
    )


@pytest.mark.parametrize("roads", ["town", "cross"])
def test_no_two_vehicles_overlap_and_all_get_through(roads: str) -> None:
    network = network_of(layout(roads))
    drivers = from_outside(network, 24, 5, 30)
    looks = driven(network, drivers, 150)
    hits = [(a.name, b.name) for states in looks for a, b in combinations(states, 2) if overlap(a, b)]
    assert not hits
    seen = {state.name for states in looks for state in states}
    assert len(seen) == len(drivers)
    if roads == "cross":
        assert not looks[-1]


@pytest.mark.parametrize("roads", LAYOUTS)
def test_whoever_drives_is_on_the_road(roads: str) -> None:
    network = network_of(layout(roads))
    for states in driven(network, from_outside(network, 8, 2, 20), 60):
        assert all(network.on_road(state.x_m, state.y_m) for state in states)
        assert all((state.link is None) != (state.crossing is None) for state in states)


def test_the_same_seed_drives_the_same_way_in_whatever_steps_time_comes() -> None:
    network = network_of(town())
    drivers = from_outside(network, 10, 3, 20)
    one, other = (SimulatedTraffic(network, drivers, np.random.default_rng(4)) for _ in range(2))
    one.advance(45_000_000)
    for now_us in range(0, 45_000_001, 35_000):
        other.advance(now_us)
    other.advance(45_000_000)
    assert one.states() == other.states()


@pytest.mark.parametrize(("end", "turn"), [("north", pi / 2), ("south", -pi / 2), ("east", 0.0)])
def test_a_route_is_driven_through_its_crossing(end: str, turn: float) -> None:
    looks = driven(network_of(cross()), [Driver("a", ("west", "middle", end))], 60)
    states = [states[0] for states in looks if states]
    assert [name for name in dict.fromkeys(state.link for state in states) if name] == ["west_arm", f"{end}_arm"]
    assert {state.crossing for state in states} == {None, "middle"}
    assert turned(states[0].heading_rad, states[-1].heading_rad) == pytest.approx(turn, abs=0.05)
    slowest = min(state.speed_m_s for state in states)
    assert slowest == pytest.approx(6.0, abs=1.0) if turn else slowest > 11.0


def test_traffic_keeps_right() -> None:
    looks = driven(network_of(straight(400.0)), [Driver("a", ("west", "east")), Driver("b", ("east", "west"))], 20)
    sides = {(state.name, round(state.y_m, 2)) for states in looks for state in states}
    assert sides == {("a", -1.75), ("b", 1.75)}


def test_a_faster_one_overtakes_and_returns_unless_somebody_comes() -> None:
    network = network_of(straight(1500.0))
    slow = Driver("slow", ("west", "east"), start_m=60.0, cruise_m_s=8.0)
    fast = Driver("fast", ("west", "east"), cruise_m_s=13.5)
    free = driven(network, [slow, fast], 60)
    passing = [state for states in free for state in states if state.passing]
    assert {state.passing for state in passing} == {"slow"}
    assert max(state.y_m for state in passing) == pytest.approx(1.75, abs=0.01)
    assert next(state.y_m for state in free[-1] if state.name == "fast") == pytest.approx(-1.75, abs=0.01)
    column = [
        Driver(f"facing{n}", ("east", "west"), start_m=40.0 * n + 5.0, cruise_m_s=12.0, passes=False) for n in range(30)
    ]
    taken = driven(network, [slow, fast, *column], 40)
    assert not [state for states in taken for state in states if state.passing]


def test_an_overtake_on_two_lanes_of_one_direction_needs_nobody_to_be_away_that_comes() -> None:
    network = network_of(straight(1500.0, lanes=4))
    slow = Driver("slow", ("west", "east"), start_m=60.0, cruise_m_s=8.0, lane=1)
    fast = Driver("fast", ("west", "east"), cruise_m_s=13.5, lane=1)
    facing = [Driver(f"facing{n}", ("east", "west"), start_m=40.0 * n + 5.0, cruise_m_s=12.0) for n in range(30)]
    looks = driven(network, [slow, fast, *facing], 40)
    assert {state.passing for states in looks for state in states if state.name == "fast"} == {None, "slow"}


def test_vehicles_queue_behind_one_that_stands_and_follow_it_at_a_distance() -> None:
    drivers = [
        Driver(f"v{n}", ("west", "east"), start_m=100.0 - 20.0 * n, cruise_m_s=0.01 if n == 0 else 12.0)
        for n in range(4)
    ]
    last = driven(network_of(straight(400.0)), [driver._replace(passes=False) for driver in drivers], 60)[-1]
    places = sorted(state.x_m for state in last)
    assert all(6.0 < b - a < 9.0 for a, b in pairwise(places))
    assert all(state.speed_m_s < 0.3 for state in last)


def test_one_drives_into_a_crossing_at_a_time_where_curves_touch() -> None:
    network = network_of(cross())
    drivers = from_outside(network, 16, 8, 15)
    inside = Counter(
        len({state.name for state in states if state.crossing == "middle"}) for states in driven(network, drivers, 90)
    )
    assert inside[1] > 0
    assert max(inside) <= 4


def test_impossible_routes_are_refused() -> None:
    with pytest.raises(DyknowError, match="no link leads from 'west' to 'north'"):
        SimulatedTraffic(network_of(cross()), [Driver("a", ("west", "north"))], np.random.default_rng(1)).advance(
            100_000
        )
    with pytest.raises(DyknowError, match="no road layout is called 'tower'; there are bends, blocks, cross"):
        layout("tower")


finite = st.floats(-100.0, 100.0, allow_nan=False)


@given(st.lists(st.tuples(finite, finite), min_size=2, max_size=6), st.floats(0.0, 1.0), finite)
def test_a_pose_on_a_line_lies_as_far_aside_as_asked(
    points: list[tuple[float, float]], share: float, left: float
) -> None:
    if len({*points}) < 2:
        with pytest.raises(DyknowError, match="two different points"):
            DrivenLine([points[0], points[0]])
        return
    line = DrivenLine(points)
    on, aside = line.at(share * line.length_m), line.at(share * line.length_m, left)
    assert hypot(on.x_m - aside.x_m, on.y_m - aside.y_m) == pytest.approx(abs(left), abs=1e-6)
    assert line.length_m == pytest.approx(line.between(0.0, line.length_m).length_m)


def test_the_road_of_figure_5_bends_before_its_crossing() -> None:
    line = network_of(bends()).links["l1"].line
    headings = [line.at(offset)[2] for offset in range(0, 150, 10)]
    assert max(headings) - min(headings) > 0.4
