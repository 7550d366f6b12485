"""An overtake that begins in the area of one platform and ends in that of another, on platforms of a federation."""

import numpy as np
import pytest

from bench.cooperation.handover import places, spanning
from dyknow.agents.capabilities.cooperation.handover import Handover
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import ObjectEvents, Share
from tests.agents.capabilities.cooperation.federations import PERCEPTS, SPEC, Federation
from tests.agents.specification.test_specification_part import Pair

P = Performative


class Overtake(Federation):
    """Platform 0 sees the beginning, 1 the end; car a is 1 at platform 0, car b is 2; at platform 1 they are 3 and 4."""

    def __init__(self, seed=3, level="states"):
        self.level = level
        super().__init__(SPEC, PERCEPTS if level == "percepts" else SPEC)
        self.spanning = spanning(np.random.default_rng((seed, 37)))
        self.rng = np.random.default_rng(seed)
        self.world.run_for(11 if level == "percepts" else 1)
        self.begins_s = (self.world.now_us - self.world.start_us) / 1e6

    def seen(self, t):
        run, areas = self.spanning
        at_s = min(max(t - self.begins_s, 0.0), run.last_s)
        before = {each.name: each for each in places(run, at_s - 0.1)}
        found = {unit: [] for unit in areas}
        for each in places(run, at_s):
            velocity = (each.x_m - before[each.name].x_m) / 0.1, (each.y_m - before[each.name].y_m) / 0.1
            for unit, area in areas.items():
                if area.has(each):
                    symbol = f"co{'ab'.index(each.name) + 1 + 2 * int(unit)}"
                    noise = self.rng.normal(0.0, 0.4, 4)
                    found[unit].append(
                        (
                            symbol,
                            each.x_m + noise[0],
                            each.y_m + noise[1],
                            velocity[0] + noise[2],
                            velocity[1] + noise[3],
                        )
                    )
        return found

    def record(self, unit, symbol, *state):
        if self.level == "percepts" and unit == "1":
            return (symbol, *state[:2], 0.6, "red", False)
        return super().record(unit, symbol, *state)

    def share(self, **content):
        asked = self.world.ask("1", "0", Share(**content))
        self.world.run_for(0.5)
        return asked

    def recognised(self):
        return [each.name for each in self.world.platform("0").part(Handover).recognised]

    def drive_all(self):
        self.drive(self.spanning.run.last_s - 0.2, self.seen)
        self.world.run_for(5)


@pytest.mark.parametrize("level", ["events", pytest.param("relations", marks=pytest.mark.full), "states", "percepts"])
def test_an_overtake_that_ends_in_the_area_of_another_platform_is_recognised(level):
    federation = Overtake(level=level)
    federation.share(level=level)
    federation.begins_s += 0.5
    federation.drive(8, federation.seen)
    names = federation.name("0", "co1"), federation.name("0", "co2")
    federation.drive_all()
    assert federation.recognised() == [f"passes[{names[0]}, {names[1]}]"]
    asked = federation.world.ask("1", "0", ObjectEvents(symbol=names[0]), P.QUERY_REF)
    federation.world.run_for(1)
    (event,) = (each for each in asked.results[0].events if each.event == "recognised")
    assert level in event.because


def test_without_sharing_it_is_not():
    federation = Overtake()
    federation.share(level="none")
    federation.begins_s += 0.5
    federation.drive_all()
    assert federation.recognised() == []


def test_what_is_shared_is_changed_while_it_runs_by_level_or_by_bandwidth():
    federation = Overtake()
    handover = federation.world.platform("0").part(Handover)
    assert handover.levels == {"1": "states"}
    federation.share(level="events", unit="1")
    assert handover.levels == {"1": "events"}
    assert federation.world.platform("0").ports.exports is not None
    federation.share(level="auto")
    assert handover.levels == {"1": "states"}
    federation.share(kbit_s=3)
    assert handover.levels["1"] in {"events", "relations"}
    federation.share(kbit_s=0)
    assert handover.levels == {"1": "states"}
    assert "expected none or events, relations, states" in federation.share(level="percepts").trouble
    assert "shares nothing" in federation.share(level="events", unit="7").trouble


OWN = """domain Bool = {true, false}
attribute car_relations.behind[?a, ?b] { ?value in Bool }
attribute car_relations.in_front[?a, ?b] { ?value in Bool }
attribute car_relations.close[?a, ?b] { ?value in Bool }
attribute speed[?a]

chronicle leaves_behind[?a, ?b] {
    event(car_relations.behind[?a, ?b]:(true, false), t1)
    event(car_relations.in_front[?a, ?b]:(?, true), t2)
    event(car_relations.close[?a, ?b]:(true, false), t3)
    t1 <= t2 < t3
    t3 - t1 <= 1min
}

chronicle alone[?a] { event(speed[?a]:(?, fast), t) }
"""


class Declared(Overtake):
    """Platform 0 declares a chronicle of its own, which begins in its area and ends in that of platform 1."""

    def specify(self, unit, text):
        named = ()
        if unit == "0":
            text, named = f'{text}chronicle file "own.chr" with max delay 400\n', (("own.chr", OWN),)
        self.world.specify(unit, text, f"{unit}.kpl", named)
        self.world.run_for(0.001)


@pytest.mark.parametrize("level", ["events", "relations"])
def test_any_chronicle_of_relations_that_a_platform_declares_is_handed_over(level):
    federation = Declared(level=level)
    federation.share(level=level)
    federation.begins_s += 0.5
    federation.drive(8, federation.seen)
    names = federation.name("0", "co1"), federation.name("0", "co2")
    federation.drive_all()
    assert sorted(federation.recognised()) == [
        f"leaves_behind[{names[0]}, {names[1]}]",
        f"passes[{names[0]}, {names[1]}]",
    ]
    assert federation.notes("0") == [] or not any("own.chr" in each for each in federation.notes("0"))


def test_what_a_platform_declares_no_longer_is_no_longer_handed_over():
    federation = Declared(level="events")
    federation.share(level="events")
    Pair.specify(federation, "0", SPEC)
    federation.begins_s += 0.5
    federation.drive(8, federation.seen)
    names = federation.name("0", "co1"), federation.name("0", "co2")
    federation.drive_all()
    assert federation.recognised() == [f"passes[{names[0]}, {names[1]}]"]
