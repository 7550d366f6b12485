"""Cars that every simulated UAV of a federation sees: a function of the seed and of federation time, and of nothing else.

Each process runs the same traffic for itself and asks for it image by image. Time is cut into rounds, each with cars of its
own, so that a process that joins late, or again, has at most one round to catch up with; at the end of a round the cars of
the next take the place of its own.
"""

from typing import Final

import numpy as np

from dyknow import US_PER_S
from dyknow.anchoring.roads.network import RoadNetwork
from dyknow.sim_uavs.roads.drivers import Driver, RoadState, drawn
from dyknow.sim_uavs.roads.layouts import RoadsJson, network_of
from dyknow.sim_uavs.roads.traffic import STEP_US, SimulatedTraffic

ROUND_US: Final = 600 * US_PER_S
STRIDE_US: Final = 5 * US_PER_S
"""So much of a round is caught up with at a time."""
_SHARED_RNG = 22  # keeps the generators of shared traffic apart from others of the same seed


class SharedTraffic:
    """The traffic of one seed on roads that lead nowhere else.

    Args:
        cars: how many drive in each round.
    """

    def __init__(self, roads: RoadsJson, seed: int, cars: int) -> None:
        self.network = network_of(roads)
        self._seed, self._cars = seed, cars
        self._round = -1
        self._traffic: SimulatedTraffic | None = None

    def at(self, now_us: int) -> list[RoadState] | None:
        """The cars at a time (federation time), which does not go back; None: it was not caught up with yet.

        States are those of the last multiple of 20 ms.
        """
        number, within_us = divmod(now_us, ROUND_US)
        if self._traffic is None or number != self._round:
            self._round, self._traffic = number, self._begun(number)
        self._traffic.advance(min(within_us, self._traffic.now_us + STRIDE_US))
        return self._traffic.states() if within_us - self._traffic.now_us < STEP_US else None

    def _begun(self, number: int) -> SimulatedTraffic:
        rng = np.random.default_rng((self._seed, number, _SHARED_RNG))
        return SimulatedTraffic(self.network, _drivers(self.network, self._cars, rng), rng)


def _drivers(network: RoadNetwork, count: int, rng: np.random.Generator) -> list[Driver]:
    """At most one for each direction of each street; chance decides at every crossing."""
    streets = sorted((str(link.start), str(link.end)) for link in network.links.values())
    streets += [(end, start) for start, end in streets]
    return [
        drawn(f"car{number}", streets[int(index)], rng, start_m=float(rng.uniform(5.0, 40.0)))
        for number, index in enumerate(rng.permutation(len(streets))[:count], 1)
    ]
