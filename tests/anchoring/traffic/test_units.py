"""Units and sources of a network in specifications: traffic on links and passable routes as streams."""

import json
import math

import pytest

from dyknow import NO_VALUE, US_PER_S
from dyknow.anchoring.roads.network import RoadNetwork
from dyknow.anchoring.traffic.units import road_units
from dyknow.compunits.registry import Catalogue, library
from dyknow.model.members import MAX_MEMBERS
from tests.anchoring.roads.towns import crossing, link, read_roads, text
from tests.kpl.instances import Running
from tests.thesis.traffic.written import EXAMPLES

ROADS = read_roads(
    text(crossing("a", 0, 0), crossing("b", 218, 0), link("a b", "a", "b", [(0, 0), (218, 0)], width_m=7, speed_m_s=10))
)
SPECIFICATION = """
sort seen-object(symbol in text, x_m in m, y_m in m)
source seen-object tracker
source wanted-route dispatcher
source instant seconds
compunit link-traffic LinkTraffic(seen-object, instant)
compunit route-state PassableRoutes(seen-object, wanted-route, instant)
compunit seen-car OnMap(seen-object)
strmgen cars = tracker
strmgen wanted = dispatcher
strmgen second = seconds
strmgen traffic = LinkTraffic(cars, second)
strmgen routes = PassableRoutes(cars, wanted, second)
stream figures = traffic
stream way = routes
"""


class Streets(Running):
    def __init__(self, text=SPECIFICATION, roads=ROADS):
        super().__init__(text, [*library().values(), *road_units(roads)], sorts={})

    def drive(self, seconds, cars, begin_s=0.0, period_s=0.5):
        """Cars whose places are given as functions of time, seconds."""
        for step in range(int(seconds / period_s)):
            at_s = begin_s + step * period_s
            self.wait(round(at_s * US_PER_S))
            for symbol, place in cars.items():
                self.push("tracker", (symbol, *place(at_s)), round(at_s * US_PER_S))
        self.wait(round((begin_s + seconds) * US_PER_S))


def through(speed_m_s, begin_m=9.0, y_m=-1.75):
    return lambda at_s: (begin_m + speed_m_s * at_s, y_m)


def test_flow_speed_and_density_of_a_stream_of_cars_are_those_that_were_driven() -> None:
    """One car each 4 s at 10 m/s: 900 an hour, and 25 on a kilometre, where the link is whole in view: 200 m for 20 s."""
    streets = Streets()
    cars = {f"c{n}": through(10.0, 9.0 - 40.0 * n) for n in range(16)}
    streets.drive(64.0, cars)
    symbol, flow, speed, density, _, open_m, obstacles = streets.values("figures")[-1]
    assert symbol == "a_b"
    assert flow == pytest.approx(900, rel=0.15)
    assert speed == pytest.approx(10.0, rel=0.01)
    assert density == pytest.approx(25.0, rel=0.15)
    assert flow == pytest.approx(speed * 3.6 * density)
    assert (open_m, obstacles) == (7.0, "")


def test_a_link_that_was_left_has_one_more_state_without_traffic() -> None:
    streets = Streets()
    streets.drive(10.0, {"c": through(10.0)})
    streets.wait(200 * US_PER_S)
    last = [sample for name, sample in streets.outputs if name == "figures"][-1]
    assert last.value == ("a_b", 0.0, NO_VALUE, 0.0, 0.0, 7.0, "")
    assert last.valid_us == pytest.approx(70 * US_PER_S, abs=1.5 * US_PER_S)


def test_both_directions_are_apart() -> None:
    streets = Streets()
    streets.drive(12.0, {"there": through(10.0), "back": through(-5.0, 209.0, 1.75)})
    figures = {value[0]: value[2] for value in streets.values("figures")}
    assert figures == {"a_b": pytest.approx(10.0), "a_b-back": pytest.approx(5.0)}


def test_figures_are_valid_half_a_second_before_they_are_made_and_come_each_second() -> None:
    streets = Streets()
    streets.drive(8.0, {"c": through(10.0)})
    samples = [sample for name, sample in streets.outputs if name == "figures"]
    assert [sample.valid_us for sample in samples] == [US_PER_S * n - US_PER_S // 2 for n in range(1, 8)]
    assert {sample.available_us - sample.valid_us for sample in samples} == {US_PER_S // 2}


def test_a_route_is_reported_when_it_changes_and_every_ten_seconds() -> None:
    streets = Streets()
    streets.push("dispatcher", ("ambulance", "a", "b", 2.6), 0)
    streets.drive(30.0, {"stands": lambda _at_s: (100.0, -1.75), "opposite": lambda _at_s: (104.0, 1.75)}, begin_s=1.0)
    told = [(sample.valid_us // US_PER_S, sample.value[1]) for name, sample in streets.outputs if name == "way"]
    assert told == [(0, True), (5, False), (15, False), (25, False)]
    assert streets.values("way")[-1][-1].startswith("stands and opposite stand on a b at 100 m and leave 0 m of 7 m")


def test_a_route_that_is_no_longer_wanted_is_not_reported_and_comes_again() -> None:
    streets = Streets()
    streets.push("dispatcher", ("ambulance", "a", "b", 2.6), 0)
    streets.wait(5 * US_PER_S)
    streets.push("dispatcher", ("ambulance", "a", "b", 0.0), 5 * US_PER_S)
    streets.wait(60 * US_PER_S)
    assert len(streets.values("way")) == 1
    streets.push("dispatcher", ("ambulance", "a", "b", 9.0), 60 * US_PER_S)
    streets.wait(70 * US_PER_S)
    assert streets.values("way")[-1] == (
        "ambulance", False, "", NO_VALUE, NO_VALUE, "a b is 7 m wide, 9 m are needed; no other way is open"
    )  # fmt: skip


def test_what_is_no_place_and_objects_beyond_the_limit_are_left_out_and_that_is_said() -> None:
    streets = Streets()
    streets.push("tracker", ("c", math.nan, 0.0), 0)
    streets.push("tracker", ("c", 1e300, 0.0), 0)
    for n in range(MAX_MEMBERS + 2):
        streets.push("tracker", (f"c{n}", 50.0, -1.75), 0)
    assert {said for _, said in streets.faults if "4096 objects" in said}
    streets.drive(10.0, {"c1": through(10.0)}, begin_s=1.0)
    assert streets.values("figures")[-1][4] == 1.0


def test_names_that_are_no_names_of_objects_are_made_ones_and_stay_apart() -> None:
    roads = read_roads(
        text(
            link("1:2", None, None, [(0, 0), (100, 0)]),
            link("1.2", None, None, [(0, 50), (100, 50)]),
            link("-5", None, None, [(0, 90), (100, 90)]),
        )
    )
    streets = Streets(roads=roads)
    streets.drive(5.0, {name: through(10.0, 10.0, y_m) for name, y_m in {"a": -1.75, "b": 48.0, "c": 88.0}.items()})
    assert {value[0] for value in streets.values("figures")} == {"_1_2", "_1_2_2", "_5"}
    assert streets.faults == []


def test_a_module_offers_what_is_in_a_tuple() -> None:
    class Module:
        UNITS = road_units(ROADS)
        __file__ = "roads.py"

    names = Catalogue([Module]).names
    assert {"LinkTraffic", "PassableRoutes", "OnMap", "seconds", "left_turns"} <= set(names)


def test_the_example_says_when_and_why_a_crane_and_an_ambulance_cannot_pass() -> None:
    roads = read_roads((EXAMPLES / "streets.geojson").read_bytes())
    streets = Streets(roads=roads)
    for line in map(json.loads, (EXAMPLES / "streets.jsonl").read_text().splitlines()):
        streets.wait(line["t_ms"] * 1000)
        for name in ("tracker", "dispatcher"):
            if name in line:
                streets.push(name, tuple(line[name]), line["t_ms"] * 1000)
    streets.wait(82 * US_PER_S)
    told = [(value[0], value[1], value[2]) for value in streets.values("way")]
    assert list(dict.fromkeys(told)) == [
        ("ambulance", True, "main river"),
        ("crane", True, "main river"),
        ("crane", False, ""),
        ("ambulance", True, "hill park"),
    ]


def carriageways(apart_m: float) -> RoadNetwork:
    """Two links of one lane each, the one there along y = 0 and the other back."""
    return read_roads(
        text(
            crossing("a", 0, 0), crossing("b", 300, 0),
            link("out", "a", "b", [(0, 0), (300, 0)], lanes=1, width_m=3.2, oneway=True),
            link("back", "b", "a", [(300, apart_m), (0, apart_m)], lanes=1, width_m=3.2, oneway=True),
        )
    )  # fmt: skip


ON_MAP = """
sort seen-object(symbol in text, x_m in m, y_m in m)
source seen-object tracker
compunit seen-car OnMap(seen-object)
strmgen cars = tracker
strmgen on = OnMap(cars)
stream at = on
"""


@pytest.mark.parametrize(("speed_m_s", "links"), [(12.0, {"out"}), (-12.0, {"back"})])
def test_a_track_that_strays_onto_the_lane_of_the_other_way_stays_on_its_own_while_it_goes_its_way(
    speed_m_s: float, links: set[str]
) -> None:
    streets = Streets(ON_MAP, carriageways(3.2))
    begin_m = 40.0 if speed_m_s > 0 else 260.0
    streets.drive(15.0, {"c": lambda at_s: (begin_m + speed_m_s * at_s, 1.6 + 2.4 * math.sin(at_s))}, period_s=0.2)
    found = streets.values("at")
    assert {link_name for *_, link_name, _ in found[2:]} == links
    assert max(abs(value[2] - 1.6) for value in found) > 2.0
    assert len({value[3] for value in found[2:]}) == 1


def test_what_drives_against_its_lane_is_on_the_lane_where_it_is() -> None:
    streets = Streets(ON_MAP, carriageways(9.0))
    streets.drive(15.0, {"c": lambda at_s: (280.0 - 12.0 * at_s, 0.0)}, period_s=0.2)
    assert {link_name for *_, link_name, _ in streets.values("at")} == {"out"}


CUT = read_roads(
    text(
        crossing("a", 0, 0, 1.0), crossing("b", 300, 0, 4.0), crossing("c", 700, 0, 1.0),
        link("before", "a", "b", [(0, 0), (300, 0)], lanes=1, width_m=3.2, oneway=True),
        link("after", "b", "c", [(300, 0), (700, 0)], lanes=1, width_m=3.2, oneway=True),
    )
)  # fmt: skip
FOLLOWING = """
sort seen-object(symbol in text, x_m in m, y_m in m)
source seen-object tracker
compunit seen-car OnMap(seen-object)
compunit car CarInLane(seen-car)
compunit pairs NearPairs(seen-object)
compunit following {unit}(car, car)
strmgen cars = tracker
for c in cars strmgen on[c] = OnMap(cars[c])
for c in cars strmgen car[c] = CarInLane(on[c])
strmgen near = NearPairs(cars)
for a, b in near strmgen follows[a, b] = {unit}(car[a], car[b])
for a, b in near stream follow = follows[a, b]
"""


@pytest.mark.parametrize(("unit", "holds"), [("FollowingOnMap", True), ("StableFollowing", False)])
def test_who_follows_too_closely_does_so_past_the_joint_of_two_links_of_a_road(unit: str, *, holds: bool) -> None:
    streets = Streets(FOLLOWING.format(unit=unit), CUT)
    cars = {name: through(15.0, begin_m, 0.0) for name, begin_m in (("back", 100.0), ("front", 110.0))}
    streets.drive(25.0, cars, period_s=0.1)
    found = [sample for name, sample in streets.outputs if name == "follow-back-front"]
    too_close = [each for each in found if each.value is not NO_VALUE and each.value[-1]]
    assert too_close
    at_joint = [each for each in found if 12.0 * US_PER_S < each.valid_us < 16.0 * US_PER_S and each.value is NO_VALUE]
    assert (not at_joint) == holds
