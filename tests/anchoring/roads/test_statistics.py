"""Flow, speed and density of links."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow import US_PER_S
from dyknow.anchoring.roads.elements import DirectedLink
from dyknow.anchoring.roads.files.formats import read_roads
from dyknow.anchoring.roads.routes import RoadRoutes
from dyknow.anchoring.roads.snapping import snap
from dyknow.anchoring.roads.statistics import LONGEST_GAP_US, LinkTraffic, RoadTraffic
from tests.anchoring.roads.towns import grid, link, text

STREET = read_roads(text(link("l", None, None, [(0, 0), (1000, 0)], oneway=True)))
WAY = DirectedLink("l", 1)


def drive(traffic: RoadTraffic, name: str, from_s: float, speed_m_s: float, to_s: float, start_m: float = 0.0) -> None:
    """One vehicle along the street, a place every half second, until it has left it."""
    at_s = from_s
    while at_s <= to_s:
        x_m = start_m + speed_m_s * (at_s - from_s)
        place = snap(STREET, x_m, 0.5, (speed_m_s, 0.0)) if x_m <= 1000 else None
        traffic.on_place(name, round(at_s * US_PER_S), place)
        at_s += 0.5


def test_a_steady_stream_has_the_flow_of_its_headway() -> None:
    traffic = RoadTraffic(STREET)
    for n in range(40):
        drive(traffic, f"car{n}", 4.0 * n - 60.0, 20.0, 60.0)
    figure = traffic.figures(60 * US_PER_S)[WAY]
    assert figure.flow_per_s == pytest.approx(0.25, rel=0.03)
    assert figure.speed_m_s == pytest.approx(20.0)
    assert figure.density_per_m == pytest.approx(0.0125, rel=0.03)
    assert 26 <= figure.vehicles <= 30


def test_a_standing_queue_has_density_and_no_flow() -> None:
    traffic = RoadTraffic(STREET)
    for n in range(10):
        drive(traffic, f"car{n}", 0.0, 0.0, 60.0, start_m=900.0 - 10 * n)
    assert traffic.figures(60 * US_PER_S)[WAY] == LinkTraffic(0.0, 0.0, pytest.approx(0.01), 10)


def test_before_the_window_is_full_the_figures_are_over_the_time_there_was() -> None:
    traffic = RoadTraffic(STREET)
    drive(traffic, "car", 0.0, 10.0, 10.0)
    assert traffic.figures(10 * US_PER_S)[WAY] == pytest.approx((0.01, 10.0, 0.001, 1))
    assert traffic.figures(0) == {}
    assert RoadTraffic(STREET).figures(0) == {}


def test_what_is_older_than_the_window_is_forgotten() -> None:
    traffic = RoadTraffic(STREET, window_us=10 * US_PER_S)
    drive(traffic, "car", 0.0, 10.0, 10.0)
    half = traffic.figures(15 * US_PER_S)[WAY]
    assert half.density_per_m == pytest.approx(0.0005)
    assert traffic.figures(20 * US_PER_S) == {}
    traffic.on_time(20 * US_PER_S)
    assert not traffic._stretches
    assert not traffic._last


def test_a_vehicle_that_was_out_of_sight_did_not_stand_there() -> None:
    traffic = RoadTraffic(STREET)
    for at_us, x_m in ((0, 0.0), (LONGEST_GAP_US + 1, 50.0), (LONGEST_GAP_US + US_PER_S + 1, 60.0)):
        traffic.on_place("car", at_us, snap(STREET, x_m, 0.0, (10.0, 0.0)))
    assert traffic.figures(LONGEST_GAP_US + US_PER_S + 1)[WAY].speed_m_s == pytest.approx(10.0)
    traffic.on_place("car", 0, None)
    assert "car" in traffic._last, "time does not go back"


def test_measured_speeds_close_routes_to_emergency_vehicles() -> None:
    town = grid(2)
    traffic = RoadTraffic(town)
    for at_s in range(10):
        traffic.on_place("jam", at_s * US_PER_S, snap(town, 50.0 + 0.1 * at_s, -1.0, (2.0, 0.0)))
    speeds = traffic.speeds(9 * US_PER_S)
    assert speeds == {DirectedLink("e 0,0", 1): pytest.approx(0.1)}
    routes = RoadRoutes(town).passable("0,0", "0,1", speeds)
    assert [[way.link for way in route.links] for route in routes] == [["n 0,0", "e 1,0", "n 0,1"]]


@given(
    st.lists(
        st.tuples(st.sampled_from("abc"), st.integers(0, 100), st.floats(-10, 210), st.floats(-20, 210)), max_size=40
    )
)
def test_flow_is_density_times_speed_and_nothing_is_negative(
    places: list[tuple[str, int, float, float]],
) -> None:
    town = grid(3)
    traffic = RoadTraffic(town, window_us=30 * US_PER_S)
    for name, at_s, x_m, y_m in sorted(places, key=lambda each: each[1]):
        traffic.on_place(name, at_s * US_PER_S, snap(town, x_m, y_m, (x_m - 100, y_m - 100)))
    for figure in traffic.figures(100 * US_PER_S).values():
        assert figure.flow_per_s == pytest.approx(figure.density_per_m * figure.speed_m_s)
        assert min(figure) >= 0
