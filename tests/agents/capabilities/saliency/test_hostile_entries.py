"""What a member with a valid key sends on purpose: false persons are shown as its own, and no other's entry goes."""

from math import nan

from dyknow.agents.capabilities.saliency.saliency import Saliency
from dyknow.agents.effects import Fed
from tests.agents.specification.test_specification_part import Pair

SPEC = "source saliency-entry found\nstrmgen mine = found\nexport saliency-entries = mine\n"
HEARS = "source bool nothing\n"


class Members(Pair):
    """Platform 0 makes the map, platforms 1 and 2 send entries that a test makes up."""

    def __init__(self):
        super().__init__(HEARS, SPEC, SPEC)
        self.world.add_command_centre("cc")
        self.world.run_for(2.0)

    def send(self, unit, *entries):
        at_us = self.world.now_us // 1_000_000 * 1_000_000
        for symbol, x_m, y_m, changed in entries:
            record = {
                "symbol": symbol, "x_m": x_m, "y_m": y_m, "xx_m2": 0.3, "xy_m2": 0.0, "yy_m2": 0.3,
                "since_s": at_us / 1e6 - 20.0, "seen_s": at_us / 1e6, "observed_s": 7.0, "thermal": 0.8, "colour": 0.7,
                "thermal_image": "t", "colour_image": "c", "end": False, **changed,
            }  # fmt: skip
            self.world._reach(self.world.nodes[unit], Fed(self.world.now_us, "found", at_us, tuple(record.values())))
        self.world.run_for(2.0)

    @property
    def part(self):
        return self.world.platform("0").part(Saliency)


def test_false_persons_are_shown_as_of_the_member_that_sends_them_and_take_none_away():
    members = Members()
    members.send("1", ("s1", 10.0, 20.0, {}))
    members.send("2", ("f1", 80.0, 20.0, {}), ("f2", 10.2, 20.1, {"xx_m2": 1e-9, "yy_m2": 1e-9}))
    by = {tuple(each.name for each in place.entries): place.by for place in members.part.map.places()}
    assert by[("2:f1",)] == ("2",)
    assert ("1:s1", "2:f2") in by
    members.send("2", ("s1", 0.0, 0.0, {"end": True}), ("f1", 80.0, 20.0, {"end": True}))
    assert {entry.name for place in members.part.map.places() for entry in place.entries} == {"1:s1", "2:f2"}


def test_what_cannot_be_is_refused_counted_and_told():
    members = Members()
    members.send("1", ("s1", 10.0, 20.0, {}))
    members.send("2", ("f1", 1e7, 0.0, {}))
    members.send("2", ("f2", 0.0, 0.0, {"seen_s": 4e10}))
    members.send("2", ("f3", 0.0, 0.0, {"thermal": 40.0}))
    members.send("2", ("f4", nan, 0.0, {}))
    assert [place.by for place in members.part.map.places()] == [("1",)]
    assert members.part.map.gate.refused["2", "too far"] == 1
    assert members.part.map.gate.refused["2", "no score"] == 1
    assert members.part.map.gate.refused["2", "another time"] == 1
    assert any("left out: of platform 2" in note for note in members.notes("0"))
