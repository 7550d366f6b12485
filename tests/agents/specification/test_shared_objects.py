"""Objects that one platform sees, on another: exported, imported, a domain there as here; units and objects together."""

import pytest

from dyknow import NO_VALUE, Sample
from dyknow.agents.effects import Fed
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import CheckFormula
from tests.agents.specification.test_specification_part import Pair

LABEL = (
    "label seen-cars : car(symbol in text, x_m in m, y_m in m, vx_m_s in m/s, vy_m_s in m/s, colour in text, end in bool) "
    '"cars that a platform sees"\n'
)
SEES = f"""{LABEL}source car seen
source position own
strmgen cars = seen
strmgen heli-position[self] = own
export seen-cars = cars
define ORIGIN_LATITUDE_DEG = 58.4
define ORIGIN_LONGITUDE_DEG = 15.6
monitor near = always forall c in cars: xy_dist[self, c] > 30
"""
IMPORTS = f"""{LABEL}import seen-cars from 0 as cars with max delay 1s
stream theirs = cars.objects
for c in cars stream x = cars.x_m[c]
monitor slow = always forall c in cars: speed[c] < 15
"""


class Road(Pair):
    """One platform sees cars, at times of their own, the other imports them."""

    def drive(self, seconds, cars):
        """`cars` gives the states of all cars at a time in seconds: symbol, x_m, speed, whether it is the last."""
        begin_us = self.world.now_us
        while (self.world.now_us - begin_us) / 1e6 < seconds:
            at_us = self.world.now_us
            for symbol, x_m, speed_m_s, end in cars((at_us - begin_us) / 1e6):
                self.feed("seen", (symbol, x_m, 0.0, speed_m_s, 0.0, "red", end))
            if at_us % 100_000 < 37_000:
                self.feed("own", (58.4, 15.6), at_us // 100_000 * 100_000)
            self.world.run_for(0.037)

    def feed(self, source, value, valid_us=None):
        world = self.world
        at_us = world.now_us
        world._reach(world.nodes["0"], Fed(at_us, source, at_us if valid_us is None else valid_us, value))

    def values(self, unit, stream):
        return [each["value"] for each in self.told(unit, "sample") if each["stream"] == stream]


def two_cars(at_s):
    if at_s < 2.95:
        yield "car1", 50.0 - 10.0 * at_s, 10.0, at_s > 2.9
    yield "car2", 200.0 + at_s, 20.0 if at_s > 2 else 10.0, False


def test_an_exported_stream_of_objects_is_a_domain_where_it_is_imported():
    road = Road(SEES, IMPORTS)
    road.world.run_for(2)
    road.drive(3, two_cars)
    road.world.run_for(2)
    assert road.notes("0") == road.notes("1") == []
    named = [set(value or ()) for value in road.values("1", "theirs")]
    assert {"car1", "car2"} in named
    assert named[-1] == {"car2"}
    xs = road.values("1", "x-car1")
    assert len(xs) >= 25
    assert xs == sorted(xs, reverse=True)
    assert len(road.values("1", "x-car2")) >= 25


def test_attributes_that_are_not_known_travel_and_the_end_of_an_object_does_too():
    road = Road(SEES, IMPORTS)
    nan = float("nan")
    road.world.run_for(2)
    road.drive(1, lambda at_s: [("car1", 5.0 + at_s, 1.0, False)])
    generator = road.declared("0").instance.network.generator("cars")
    for end in (False, True):
        road.world.run_for(0.2)
        now_us = road.world.now_us
        road.world.call(
            "0",
            lambda _platform, _at_us, now_us=now_us, end=end: generator.push(
                Sample(now_us, now_us, ("car1", 9.0, 0.0, nan, NO_VALUE, "", end))
            ),
        )
        road.world.run_for(0.5)
    assert road.values("1", "x-car1")[-1] == 9.0
    assert road.values("1", "theirs")[-1] == []


def test_each_object_has_one_state_in_each_period_of_what_is_exported():
    road = Road(SEES, IMPORTS)
    road.world.run_for(2)
    road.drive(3, two_cars)
    valid_us = [each["valid_us"] for each in road.told("1", "sample") if each["stream"] == "x-car2"]
    periods = [each // 100_000 for each in valid_us]
    assert len(periods) > 25
    assert periods == sorted(set(periods))


def test_monitors_over_objects_of_another_platform_alarm_and_say_for_which():
    road = Road(SEES, IMPORTS)
    road.world.run_for(2)
    road.drive(4, two_cars)
    road.world.run_for(2)
    opened = road.told("1", "alarm-opened")
    assert [each["monitor"] for each in opened] == ["slow"]
    assert "car2" in str(opened[0]["because"])


def test_a_platform_watches_how_far_it_is_from_what_it_sees():
    road = Road(SEES, IMPORTS)
    road.world.run_for(2)
    road.drive(4, two_cars)
    road.world.run_for(2)
    opened = road.told("0", "alarm-opened")
    assert [each["monitor"] for each in opened] == ["near"]
    assert "xy_dist[0, car1]" in str(opened[0])


def test_a_formula_over_platforms_and_objects_is_about_each_pair():
    both = "monitor both = always forall u in units growing: forall c in cars: xy_dist[u, c] > 30\n"
    road = Road(SEES + both, "source position own\nstrmgen pos = own\nexport heli-position = pos\n")
    road.world.run_for(2)

    def cars(at_s):
        world, now_us = road.world, road.world.now_us
        if now_us % 100_000 < 37_000:
            place = (58.4, 15.6005 + at_s * 1e-5)
            world._reach(world.nodes["1"], Fed(now_us, "own", now_us // 100_000 * 100_000, place))
        yield "car1", 100.0 - 10.0 * at_s, 1.0, False

    road.drive(6, cars)
    road.world.run_for(2)
    (opened,) = (each for each in road.told("0", "alarm-opened") if each["monitor"] == "both")
    (reason,) = opened["because"]
    assert reason["members"] == {"u": "1", "c": "car1"}
    assert opened["values"].keys() == {"xy_dist[0, car1]", "xy_dist[1, car1]"}


PRIVATE = SEES.replace("export seen-cars", "export private seen-cars")


@pytest.mark.parametrize(
    ("text", "sees"),
    [
        ("always forall c in cars: xy_dist[self, c] > 1", True),
        ('eventually forall c in cars: colour[c] = "red"', True),
        ("eventually xy_dist[car1, car2] > 1", True),
        ("always forall c in cars: xy_dist[self, c] > 1", False),
        ('eventually colour[car1] = "red"', False),
        ("eventually cars.x_m[car1] > 0", False),
        ("eventually speed[car1] > 0", False),
        ("eventually exists c in cars: c != self", False),
    ],
)
def test_others_check_formulas_over_objects_that_they_may_see(text, sees):
    road = Road(SEES if sees else PRIVATE, IMPORTS)
    road.world.run_for(1)
    road.drive(1, two_cars)
    asked = road.world.ask("1", "0", CheckFormula(text=text, timeout_s=2.0), Performative.QUERY_IF)
    road.drive(3, two_cars)
    if sees:
        assert not asked.trouble
        assert asked.results[-1].verdict in {"true", "undecided"}
        assert not asked.results[-1].missing
    else:
        assert not asked.results
        assert "seen-cars" in asked.trouble


def test_a_name_that_becomes_that_of_a_platform_is_that_platform():
    road = Road(f"{SEES}stream d = xy_dist[self, 2]\n", IMPORTS)
    road.world.run_for(1)
    objects = road.declared("0").instance.parts.objects
    assert not objects.is_other("2")
    road.world.add("2")
    road.world.run_for(5)
    assert objects.is_other("2")
    assert "2" in road.declared("0")._keeper.needs()
