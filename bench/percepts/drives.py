"""Vehicles that drive about a town, and the percepts of them: seen for 3 s, hidden for 2 s, ten times a second."""

from collections.abc import Iterator
from itertools import count, pairwise
from typing import Final, NamedTuple

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from dyknow.anchoring.links.states import ObjectState, diagonal
from dyknow.anchoring.links.structures import Percept
from dyknow.anchoring.ready import VISION
from dyknow.anchoring.roads.elements import DirectedLink
from dyknow.anchoring.roads.network import RoadNetwork
from dyknow.sim_uavs.roads.layouts import network_of, town

PERIOD_US: Final = 100_000
SEEN_S, CYCLE_S = 3.0, 5.0
ERROR_M: Final = 0.5
BLOCKS_A_VEHICLE: Final = 0.9
"""Streets of a town whose size grows with its traffic."""


class Drive(NamedTuple):
    """A way, its length at each of its points, and how it is driven and seen."""

    x_m: NDArray[np.float64]
    y_m: NDArray[np.float64]
    done_m: NDArray[np.float64]
    speed_m_s: float
    phase_s: float

    def at(self, seconds: float) -> tuple[float, float]:
        """Where it is then; at the end of its way it begins again."""
        along_m = (self.speed_m_s * seconds) % self.done_m[-1]
        return float(np.interp(along_m, self.done_m, self.x_m)), float(np.interp(along_m, self.done_m, self.y_m))


def town_for(vehicles: int) -> RoadNetwork:
    """A town in which there is always as much traffic on a street."""
    return network_of(town(across=max(3, round((vehicles * BLOCKS_A_VEHICLE / 2) ** 0.5) + 1)))


def drives(network: RoadNetwork, vehicles: int, rng: Generator, length_m: float = 1500.0) -> list[Drive]:
    """Ways by chance, without turning round, in the right lane."""
    links = sorted(name for name, link in network.links.items() if link.start and link.end)
    return [_drive(network, links[int(rng.integers(len(links)))], rng, length_m) for _ in range(vehicles)]


def _drive(network: RoadNetwork, link: str, rng: Generator, length_m: float) -> Drive:
    way = DirectedLink(link, 1 if rng.random() < 0.5 else -1)
    points: list[tuple[float, float]] = []
    length = 0.0
    while length < length_m:
        points += _lane(network, way)
        length += network.links[way.link].length_m
        onward = list(network.turns.exits(way))
        if not onward:
            break
        way = onward[int(rng.integers(len(onward)))]
    x_m, y_m = (np.array(axis) for axis in zip(*points, strict=True))
    done_m = np.concatenate([[0.0], np.cumsum([np.hypot(c - a, d - b) for (a, b), (c, d) in pairwise(points)])])
    return Drive(x_m, y_m, done_m, float(rng.uniform(7.0, 13.0)), float(rng.uniform(0.0, CYCLE_S)))


def _lane(network: RoadNetwork, way: DirectedLink, from_crossing_m: float = 12.0) -> list[tuple[float, float]]:
    """Points on a lane between the crossings of a link."""
    link = network.links[way.link]
    offset_m = link.lanes[link.lanes_of(way.direction)[0]].offset_m
    stations = np.linspace(from_crossing_m, link.length_m - from_crossing_m, 12).tolist()
    places = [link.line.at(station_m, offset_m)[:2] for station_m in stations[:: way.direction]]
    return [(x_m, y_m) for x_m, y_m in places]


def ticks(driven: list[Drive], seconds: float, rng: Generator) -> Iterator[tuple[int, list[Percept]]]:
    """Valid time, and the percepts of it; each time that a vehicle comes into view it is another one."""
    names, named = count(1), dict[int, str]()
    for tick in range(round(seconds * 1e6 / PERIOD_US)):
        at_s = tick * PERIOD_US / 1e6
        seen = []
        for number, drive in enumerate(driven):
            if (at_s + drive.phase_s) % CYCLE_S >= SEEN_S:
                if number in named:
                    seen.append(Percept(named.pop(number), VISION, None))
                continue
            if number not in named:
                named[number] = f"vp{next(names)}"
            seen.append(percept(named[number], tick * PERIOD_US, drive.at(at_s), rng))
        yield tick * PERIOD_US, seen


def percept(name: str, valid_us: int, place: tuple[float, float], rng: Generator) -> Percept:
    """What is seen there, with an error."""
    x_m, y_m = place[0] + rng.normal(0.0, ERROR_M), place[1] + rng.normal(0.0, ERROR_M)
    return Percept(name, VISION, ObjectState(valid_us, x_m, y_m, 0.0, 0.0, diagonal(ERROR_M)))
