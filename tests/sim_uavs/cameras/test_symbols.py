"""From the cameras to symbols: what the percepts of a hovering UAV become, with a bridge in its view."""

from collections import Counter, defaultdict
from math import hypot

import numpy as np

from dyknow.anchoring.links.structures import ObjectLinkage
from dyknow.anchoring.ready import WORLD, ready_specification
from dyknow.sim_uavs.cameras.detectors import Obstacle
from dyknow.sim_uavs.roads.drivers import Driver
from dyknow.sim_uavs.roads.layouts import network_of, straight
from tests.sim_uavs.cameras.flights import hover

ROADS = straight(300.0)
BRIDGE = Obstacle(34.0, -50.0, 46.0, 50.0, 8.0, 6.0)


def test_a_car_keeps_its_symbol_below_a_bridge() -> None:
    drivers = [
        Driver("a", ("west", "east"), start_m=0.0, cruise_m_s=10.0, colour="red", passes=False),
        Driver("b", ("east", "west"), start_m=205.0, cruise_m_s=9.0, colour="blue", passes=False),
    ]
    images = hover(ROADS, drivers, 8.0, at_m=(0.0, 40.0, -70.0), obstacles=[BRIDGE])
    linkage = ObjectLinkage(ready_specification(network_of(ROADS)))
    symbols: dict[str, Counter[str]] = defaultdict(Counter)
    percepts: dict[str, set[str]] = defaultdict(set)
    misses = []
    for image in images:
        for state in linkage.on_percepts(image.now_us, image.percepts).states:
            if state.type == WORLD and state.prediction is None:
                off_m, name = min(
                    (hypot(each.x_m - state.state.x_m, each.y_m - state.state.y_m), each.name) for each in image.truth
                )
                symbols[name][state.symbol] += 1
                percepts[name] |= {*state.linked_to}
                misses.append(off_m)
    assert {name: len(each) for name, each in symbols.items()} == {"a": 1, "b": 1}
    assert all(len(each) == 2 for each in percepts.values())
    assert np.quantile(misses, 0.95) < 2.0
