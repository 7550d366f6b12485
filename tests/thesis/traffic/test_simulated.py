"""Cars of the road simulator, which knows nothing of relations, overtake and turn: what they did is what is recognised."""

import os

import numpy as np
import pytest

from bench.crossings.recognition import CHRONICLE_OF, anchored, chronicles, links, snapped, stable
from bench.overtakes.drives import Seen
from bench.overtakes.recognition import recognised
from dyknow import Label
from dyknow.reasoning.chronicles import ChangeEvents, Recogniser
from dyknow.sim_uavs.roads.drivers import Driver
from dyknow.sim_uavs.roads.layouts import cross, network_of, straight
from dyknow.sim_uavs.roads.traffic import SimulatedTraffic

SEEDS = range(40 if os.environ.get("DYKNOW_FULL") else 2)
ERROR_M = 2.0


def driven(roads, drivers, rng, lasts_s):
    """Times in us, and the positions of each car, (n, 2), while all of them are there."""
    traffic, at_us = SimulatedTraffic(roads, drivers, rng), []
    places: dict[str, list[tuple[float, float]]] = {driver.name: [] for driver in drivers}
    for now_us in range(100_000, round(lasts_s * 1e6), 100_000):
        traffic.advance(now_us)
        states = traffic.states()
        if len(states) < len(drivers):
            break
        at_us.append(now_us)
        for state in states:
            places[state.name].append((state.x_m, state.y_m))
    return at_us, {name: np.array(each) for name, each in places.items()}


def noisy(places, rng):
    return {name: each + rng.uniform(-ERROR_M, ERROR_M, each.shape) for name, each in places.items()}


@pytest.mark.parametrize("seed", SEEDS)
def test_8_7_5_who_was_behind_and_is_in_front_has_overtaken(seed):
    rng = np.random.default_rng((seed, 875))
    drivers = [
        Driver("slow", ("west", "east"), start_m=100.0, cruise_m_s=rng.uniform(9.0, 12.0)),
        Driver("fast", ("west", "east"), start_m=rng.uniform(20.0, 50.0), cruise_m_s=rng.uniform(16.0, 20.0)),
    ]
    at_us, places = driven(network_of(straight()), drivers, rng, 80.0)
    ahead_m = places["fast"][:, 0] - places["slow"][:, 0]
    assert ahead_m[0] < 0.0
    assert ahead_m[-1] > 30.0
    level_s = at_us[int(np.argmax(ahead_m > 0.0))] / 1e6
    found = recognised(Seen(at_us, noisy(places, rng), 90.0), filtered=True)
    assert {one.chronicle for one in found} == {"overtake", "passes"}
    assert {(one.bindings["?car1"], one.bindings["?car2"]) for one in found} == {("fast", "slow")}
    assert all(abs(one.recognised_ms / 1000 - level_s) < 4.0 for one in found)
    assert len(found) == 2


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("way", [anchored, snapped])
def test_8_7_4_cars_that_turn_are_recognised_by_their_arms(seed, way):
    rng = np.random.default_rng((seed, 874))
    roads = network_of(cross())
    exits = rng.permutation(["north", "east", "south"])[0]
    at_us, places = driven(roads, [Driver("c", ("west", "middle", exits), start_m=120.0)], rng, 60.0)
    recogniser = Recogniser.of(chronicles())
    events = ChangeEvents(recogniser)
    for label in links(roads):
        events.on_sample(label, 0, value=True)
    found = [
        one
        for valid_us, symbol, areas in stable(way(roads, at_us, noisy(places, rng)["c"].tolist()))
        for name, value in zip(("link", "crossing"), areas, strict=True)
        for one in events.on_sample(Label(f"cars.{name}", (symbol,)), valid_us, value)
    ]
    turn = roads.turns.relation_of("west_arm", "middle", f"{exits}_arm")
    assert [one.chronicle for one in found] == ["through_crossing", CHRONICLE_OF[turn]]
    assert (found[0].bindings["?l1"], found[0].bindings["?l2"]) == ("west_arm", f"{exits}_arm")
