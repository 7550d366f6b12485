"""Chronicles over attributes of objects that begin in the area of one platform and end in that of another."""

import random

import pytest

from dyknow import NO_VALUE, Sample
from dyknow.agents.capabilities.cooperation.handover import Handover
from dyknow.agents.capabilities.cooperation.track_records import ATTRIBUTES, object_attribute
from dyknow.agents.effects import Fed
from dyknow.federation.messages.contents import Share
from tests.agents.capabilities.cooperation.federations import Federation, car

SPEC = """source tracked-object seen
strmgen cars = seen
export object-tracks = cars
sort what-is(symbol in text, lane in text, link in text, warm in bool)
sort gap-is(too_close in bool)
source what-is known
strmgen marks = known
source gap-is gap
strmgen follows[co1, co2] = gap
strmgen follows[co3, co4] = gap
chronicle file "own.chr" with max delay 400
"""
CHRONICLES = """attribute marks.lane[?c]
attribute marks.link[?c]
attribute marks.warm[?c]
attribute follows.too_close[?a, ?b]
chronicle there_and_back[?c] {
    event(marks.lane[?c]:(0, 1), t1)
    event(marks.lane[?c]:(1, 0), t2)
    t2 - t1 in [1, 30s]
}
chronicle turn[?c] {
    event(marks.link[?c]:(l1, no_link), t1)
    event(marks.link[?c]:(no_link, l2), t2)
    t2 - t1 in [1, 30s]
}
chronicle warms[?c] {
    event(marks.warm[?c]:(?, false), t1)
    event(marks.warm[?c]:(false, true), t2)
    t2 - t1 in [1, 30s]
}
chronicle closes_and_opens[?a, ?b] {
    event(follows.too_close[?a, ?b]:(false, true), t1)
    event(follows.too_close[?a, ?b]:(true, false), t2)
    t2 - t1 in [1, 30s]
}
"""
EXPECTED = ("closes_and_opens", "there_and_back", "turn", "warms")


class Areas(Federation):
    """Platform 1 sees two cars first and platform 0 afterwards, with a second in common or, `apart_s`, none for so long."""

    def __init__(self, level, seed, apart_s=-1.0):
        super().__init__(SPEC, SPEC)
        rng = random.Random(seed)
        self.world.run_for(1)
        self.world.ask("1", "0", Share(level=level))
        self.world.run_for(0.5)
        self.begin_s = (self.world.now_us - self.world.start_us) / 1e6
        self.out_s = rng.uniform(6.0, 8.0)
        self.in_s = self.out_s + apart_s
        self.first_s, self.last_s = rng.uniform(4.0, 5.5), self.out_s + rng.uniform(3.0, 5.0)
        self.cars = car(0.0), car(20.0)

    def specify(self, unit, text):
        self.world.specify(unit, text, f"{unit}.kpl", (("own.chr", CHRONICLES),))
        self.world.run_for(0.001)

    def seen(self, t):
        at_s = t - self.begin_s
        found = {"0": [], "1": []}
        for unit, is_seen, symbols in (
            ("1", at_s < self.out_s, ("co3", "co4")),
            ("0", at_s >= self.in_s, ("co1", "co2")),
        ):
            if is_seen:
                found[unit] = [(symbol, *each(at_s)) for symbol, each in zip(symbols, self.cars, strict=True)]
                self.know(unit, symbols[0], at_s)
        return found

    def know(self, unit, symbol, at_s):
        begun, over = at_s >= self.first_s, at_s >= self.last_s
        link = "l2" if over else "no_link" if begun else "l1"
        for source, value in (
            ("known", (symbol, "1" if begun and not over else "0", link, over)),
            ("gap", (begun and not over,)),
        ):
            node = self.world.nodes[unit]
            self.world._reach(node, Fed(self.world.now_us, source, self.world.now_us // 100_000 * 100_000, value))

    def recognised(self):
        return sorted(each.name for each in self.world.platform("0").part(Handover).recognised)


@pytest.mark.parametrize("level", ["events", "relations"])
@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.full), pytest.param(2, marks=pytest.mark.full)])
def test_a_chronicle_of_attributes_that_begins_elsewhere_is_recognised_once(level, seed):
    federation = Areas(level, seed)
    federation.drive(14, federation.seen)
    first, second = federation.name("0", "co1"), federation.name("0", "co2")
    federation.world.run_for(5)
    of = {name: f"{first}, {second}" if "opens" in name else first for name in EXPECTED}
    assert federation.recognised() == [f"{name}[{of[name]}]" for name in EXPECTED]


def test_without_sharing_and_over_a_gap_in_which_neither_sees_the_car_nothing_is():
    alone, apart = Areas("none", 0), Areas("relations", 0, apart_s=2.5)
    apart.last_s = apart.out_s + 1.2
    for federation in (alone, apart):
        federation.drive(14, federation.seen)
        federation.world.run_for(5)
        assert not any("there_and_back" in each or "opens" in each for each in federation.recognised())


GOOD = ("lane[a]", "marks.lane", "a", "", "1", 1.0, False)


@pytest.mark.parametrize(
    ("at", "value"), [(1, ""), (1, "f" * 65), (2, ""), (3, "a"), (4, "v" * 65), (5, 3.0), (5, NO_VALUE), (4, NO_VALUE)]
)
def test_what_can_be_no_attribute_is_not_read(at, value):
    assert object_attribute(Sample(2_000_000, 2_000_000, GOOD)) is not None
    assert object_attribute(Sample(2_000_000, 2_000_000, (*GOOD[:at], value, *GOOD[at + 1 :]))) is None


def test_unknown_features_objects_of_others_and_too_many_are_refused_and_counted():
    federation = Areas("relations", 0)
    federation.drive(5, federation.seen)
    name, now_us = federation.name("1", "co3"), federation.world.now_us
    picture, take = federation.part("0").picture, federation.part("0").takers[ATTRIBUTES]
    for value in (
        (*GOOD[:1], "nonsense", name, "", "1", now_us / 1e6 - 0.1, False),
        (*GOOD[:2], "nothing", "", "1", now_us / 1e6 - 0.1, False),
        (*GOOD[:2], name, "", "1", now_us / 1e6 - 0.1, False),
    ):
        take("9" if value[2] == name and value[1] != "nonsense" else "1", Sample(now_us, now_us, value))
    assert picture.gate.refused["1", "attributes that no chronicle has"] == 1
    assert picture.gate.refused["1", "attributes of objects that it does not track"] == 1
    assert picture.gate.refused["9", "attributes of objects that it does not track"] == 1
    for _ in range(5000):
        take("1", Sample(now_us, now_us, (*GOOD[:2], name, "", "1", now_us / 1e6 - 0.1, False)))
    assert picture.gate.refused["1", "too many reports"] > 1000
