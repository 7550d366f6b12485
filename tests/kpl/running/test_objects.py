"""Specifications over objects that appear and vanish: for, forall, pairs, select, merge, chronicles, features of objects."""

import gc
import tracemalloc
from pathlib import Path

import pytest

from dyknow import NO_VALUE
from dyknow.kpl import parse_specification, print_specification
from dyknow.model.errors import SourceText
from dyknow.reasoning.features.proximity import offset_m
from tests.kpl.instances import Running

CARS = """
sort car(symbol in text, x_m in m, y_m in m, vx_m_s in m/s, vy_m_s in m/s, colour in text, end in bool)
source car seen
strmgen cars = seen
"""


class Road(Running):
    """An instance that sees cars."""

    def see(self, symbol, at_us, x_m=0.0, vx_m_s=1.0, colour="red", *, end=False):
        self.push("seen", (symbol, x_m, 0.0, vx_m_s, 0.0, colour, end), at_us)

    def drive(self, xs_m, begin_us=0, period_us=100_000):
        """One row of positions by symbol after the other; None: it is not there, or no longer."""
        there = set()
        for k, row in enumerate(xs_m):
            at_us = begin_us + k * period_us
            self.wait(at_us)
            with self.network.instant.whole():
                for symbol in sorted(there - row.keys()):
                    self.see(symbol, at_us, end=True)
                for symbol, x_m in row.items():
                    self.see(symbol, at_us, x_m)
            there = set(row)


@pytest.mark.parametrize("domain", ["cars", "cars.objects"])
def test_what_is_declared_for_each_object_comes_and_goes_with_it(domain):
    road = Road(f"{CARS}for c in {domain} stream x = cars.x_m[c]\n")
    road.drive([{}, {"car1": 1.0}, {"car1": 2.0, "car2": 9.0}, {"car2": 8.0}, {}])
    assert road.values("x-car1") == [1.0, 2.0]
    assert road.values("x-car2") == [9.0, 8.0]
    assert road.instance.streams == {}
    assert [str(label) for label in road.network.labels()] == ["cars", "cars.objects"]


def test_a_formula_over_objects_is_about_those_that_are_there_newcomers_included():
    road = Road(f'{CARS}monitor all_red = always forall c in cars: colour[c] = "red"\n')
    road.drive([{"car1": 1.0}] * 5)
    for k in range(5, 12):
        road.see("car1", k * 100_000)
        road.see("car2", k * 100_000, colour="blue", end=k > 8)
    road.wait(4_000_000)
    assert [(each.event, each.valid_us) for each in road.alarms] == [("opened", 600_000), ("closed", 900_000)]
    (reason,) = road.alarms[0].because
    assert (dict(reason.binding), reason.samples) == ({"c": "car2"}, {"colour[car2]": "blue"})


def test_a_formula_over_pairs_of_objects_and_their_derived_features():
    road = Road(f"{CARS}monitor apart = always forall a in cars: forall b in cars - {{a}}: xy_dist[a, b] > 5\n")
    road.drive([{"car1": 1.0, "car2": 20.0 - 2 * k} for k in range(9)] + [{"car1": 1.0}] * 20)
    assert [each.event for each in road.alarms][:1] == ["opened"]
    opened = road.alarms[0]
    assert opened.valid_us == 700_000
    assert opened.values["xy_dist[car1, car2]"] == pytest.approx(5.0, abs=1e-3)
    assert {tuple(dict(each.binding).values()) for each in opened.because} <= {("car1", "car2"), ("car2", "car1")}


def test_temporal_formulas_hold_of_each_object_by_itself():
    formula = "always forall c in cars: (speed[c] > 15 -> eventually[0, 300] speed[c] <= 15)"
    road = Road(f"{CARS}monitor calm = {formula} with close after 1\n")
    for k in range(12):
        road.see("car1", k * 100_000, vx_m_s=20.0 if k % 2 else 10.0)
        if k >= 4:
            road.see("car2", k * 100_000, vx_m_s=20.0)
    road.wait(3_000_000)
    (opened, *_) = road.alarms
    assert (opened.event, opened.valid_us) == ("opened", 800_000)
    assert [label for label, value in opened.values.items() if value == 20.0 and "car2" in label] == ["speed[car2]"]


def test_select_and_merge_take_objects_as_members():
    road = Road(f"{CARS}strmgen xs = merge cars.x_m[c] for c in cars\nstream each_x = xs\n")
    road.drive([{"car1": 1.0}, {"car1": 2.0, "car2": 9.0}, {"car2": 8.0}])
    assert road.values("each_x") == [1.0, 2.0, 9.0, 8.0]


def test_chronicles_range_over_attributes_of_objects(tmp_path):
    path = tmp_path / "paint.chr"
    path.write_text(
        "chronicle painted[?c] { event(cars.colour[?c]:(red, blue), t1) }\n"
        "chronicle seen_blue[?c] { event(colour[?c]:(?, blue), t1) }\n",
        encoding="utf-8",
    )
    text = SourceText(
        f'{CARS}chronicle file "{path}" with max delay 100\nstream p = chronicle[painted]\n'
        "stream b = chronicle[seen_blue]\n",
        "a.kpl",
    )
    road = Road()
    road.instance.add(parse_specification(text, lambda name: Path(name).read_text("utf-8")), 0, text)
    for k in range(10):
        road.see("car1", k * 100_000, colour="blue" if k > 4 else "red")
        road.see("car2", k * 100_000, colour="blue", end=k > 6)
    road.wait(3_000_000)
    assert [value[0] for value in road.values("p")] == [("car1",)]
    assert [value[0] for value in road.values("b")] == [("car2",), ("car1",)]
    (watch,) = (each.watch for each in road.instance.chronicles.values())
    assert {str(label) for label in watch.proxies} == {"cars.colour[car1]", "colour[car1]"}


def test_a_platform_and_an_object_meet_on_the_grid_of_the_platform():
    """Objects are seen at times of their own; between two states they are on the line."""
    road = Road(
        f"{CARS}source position own\nstrmgen heli-position[self] = own\nstream d = xy_dist[self, car1]\n"
        "monitor far = always xy_dist[self, car1] > 27\ndefine ORIGIN_LATITUDE_DEG = 58.4\n"
        "define ORIGIN_LONGITUDE_DEG = 15.6\n"
    )
    times = [(40_000 * k + 13_000, "car1") for k in range(40)] + [(100_000 * k, "own") for k in range(1, 16)]
    for at_us, what in sorted(times):
        if what == "own":
            road.push("own", (58.4, 15.6), at_us)
        else:
            road.see("car1", at_us, at_us / 1e6 * 25.0)
    for valid_us, distance_m in [(each.valid_us, each.value) for name, each in road.outputs if name == "d"]:
        assert valid_us % 100_000 == 0
        assert distance_m == pytest.approx(valid_us / 1e6 * 25.0, abs=1e-3)
    assert len(road.values("d")) >= 14
    road.wait(4_000_000)
    assert [(each.event, each.valid_us) for each in road.alarms] == [("opened", 100_000), ("closed", 1_100_000)]


def test_metres_of_a_frame_whose_place_is_not_declared_are_compared_among_objects_only():
    road = Road(
        f"{CARS}source position own\nstrmgen heli-position[self] = own\nstream d = xy_dist[self, car1]\n"
        "stream e = xy_dist[car1, car2]\n"
    )
    for k in range(3):
        with road.network.instant.whole():
            road.see("car1", 100_000 * k, 1.0)
            road.see("car2", 100_000 * k, 4.0)
            road.push("own", (58.4, 15.6), 100_000 * k)
    assert set(road.values("d")) == {NO_VALUE}
    assert road.values("e") == [pytest.approx(3.0)] * 3
    assert [said for _, said in road.faults] == [
        "heli-position[car1] is in metres of a frame; define ORIGIN_LATITUDE_DEG and ORIGIN_LONGITUDE_DEG"
    ]


def test_positions_in_degrees_and_in_metres_are_those_of_one_earth():
    text = """
    sort ship(symbol in text, latitude_deg in deg, longitude_deg in deg)
    source ship radar
    strmgen ships = radar
    stream d = xy_dist[s1, s2]
    """
    road = Road(text)
    one, other = (58.4, 15.6), (58.401, 15.602)
    with road.network.instant.whole():
        road.push("radar", ("s1", *one), 100_000)
        road.push("radar", ("s2", *other), 100_000)
    north_m, east_m = offset_m(one, other)
    assert road.values("d") == [pytest.approx((north_m**2 + east_m**2) ** 0.5)]


def test_of_two_streams_with_an_object_of_one_symbol_the_first_is_meant():
    road = Road(f"{CARS}source car other\nstrmgen vans = other\nstream c = colour[car1]\n")
    road.push("other", ("car1", 0.0, 0.0, 0.0, 0.0, "green", False), 10_000)
    road.see("car1", 20_000, colour="red")
    road.push("other", ("car1", 0.0, 0.0, 0.0, 0.0, "green", False), 30_000)
    road.see("car1", 40_000, end=True)
    road.push("other", ("car1", 0.0, 0.0, 0.0, 0.0, "blue", False), 50_000)
    assert road.values("c") == ["green", "red", "blue"]


def test_a_stream_of_objects_may_be_declared_later_or_differently():
    road = Road("define LIMIT = 15\n")
    road.add(f"{CARS}for c in cars stream col = colour[c]\n")
    road.see("car1", 100_000)
    before = road.state()
    road.add("source car more\nstrmgen vans = more\n")
    road.see("car1", 200_000, colour="blue")
    assert road.values("col-car1")[-1] == "blue"
    road.remove("source car more\nstrmgen vans = more\n")
    after = road.state()
    assert after["families"] == before["families"]


def test_what_a_formula_over_objects_is_made_of_is_said_in_kpl():
    road = Road(f"{CARS}monitor apart = always forall a in cars: forall b in cars - {{a}}: xy_dist[a, b] > 5\n")
    road.drive([{"car1": 1.0, "car2": 9.0}] * 3)
    declared = road.instance.monitors["apart"].states.declarations("apart")
    text = print_specification(declared)
    assert parse_specification(text) == declared
    assert "heli-position[car1] with sample every 100, max delay 1000, from 0 to oo, use linear" in text
    assert text.endswith("stream apart_cars_objects = cars.objects\n")


def _come_and_go(road, rounds, begin, there=20):
    for k in range(begin, begin + rounds):
        at_us = k * 100_000
        road.wait(at_us)
        with road.network.instant.whole():
            road.see(f"car{k - there}", at_us, end=True)
            for i in range(k - there + 1, k + 1):
                road.see(f"car{i}", at_us, float(i))


def test_memory_is_flat_and_the_network_clean_while_objects_come_and_go():
    road = Road(
        f"{CARS}for c in cars stream x = cars.x_m[c]\nfor c in cars monitor calm = always speed[c] < 30\n"
        'monitor red = always forall c in cars: eventually[0, 1s] colour[c] = "red"\n',
        history=100,
    )
    hooks = road.instance.hooks
    hooks.on_output = hooks.on_link = lambda _name, _what: None
    tracemalloc.start()
    _come_and_go(road, 160, 0, 5)
    labels = len(road.network.labels())
    gc.collect()
    before, _ = tracemalloc.get_traced_memory()
    _come_and_go(road, 150, 160, 5)
    gc.collect()
    after, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert len(road.network.labels()) == labels
    assert after - before < 60_000, f"{after - before} bytes more after 150 other objects"


def test_a_change_of_the_members_connects_only_what_is_new():
    road = Road(f"{CARS}monitor calm = always forall c in cars: speed[c] < 30\n")
    states = road.instance.monitors["calm"].states
    _come_and_go(road, 30, 0)
    proxies = {id(proxy) for proxy in states.proxies}
    _come_and_go(road, 1, 30)
    assert len({id(proxy) for proxy in states.proxies} - proxies) == 1
    assert len(states._eras) <= 14


def test_a_domain_of_thousands_is_followed_and_each_change_costs_one_member():
    road = Road(f"{CARS}for c in cars stream x = cars.x_m[c]\n")
    with road.network.instant.whole():
        for i in range(1000):
            road.see(f"car{i}", 100_000)
    assert len(road.instance.streams) == 1000
    proxies = {name: id(proxy) for name, proxy in road.instance.streams.items()}
    road.see("car7", 200_000, end=True)
    road.see("new", 200_000)
    now = {name: id(proxy) for name, proxy in road.instance.streams.items()}
    assert now.keys() ^ proxies.keys() == {"x-car7", "x-new"}
    assert all(now[name] == proxies[name] for name in now.keys() & proxies.keys())
