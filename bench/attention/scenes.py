"""Scenes in which a camera sees a part of the roads only: a crossing, a town, a town of houses and bridges."""

from collections.abc import Callable

from numpy.random import Generator

from bench.attention.flights import WatchedScene, rng_of
from dyknow.anchoring.roads.network import RoadNetwork
from dyknow.sim_uavs.cameras.detectors import Obstacle
from dyknow.sim_uavs.roads.drivers import Driver, drawn
from dyknow.sim_uavs.roads.layouts import cross, network_of, town

_HALF_HOUSE_M, _ROOF_M = 45.0, 12.0
_BRIDGES = ((70.0, 0), (210.0, 1), (70.0, 2))
"""Where roads to the east are crossed: metres east, and which of the roads from the south."""


def scene(name: str, seed: int) -> WatchedScene:
    """The scene of that name, with drivers of that seed."""
    return SCENES[name](rng_of(seed))


def _crossing(rng: Generator) -> WatchedScene:
    """Cars that come to one crossing one after the other and leave it by any arm."""
    arms = ("west", "east", "south", "north")
    drivers = []
    for number in range(8):
        start = arms[int(rng.integers(4))]
        ends = [arm for arm in arms if arm != start]
        route = (start, "middle", ends[int(rng.integers(3))])
        drivers.append(drawn(f"car{number}", route, rng, start_m=20.0, enters_us=4_000_000 * number))
    return WatchedScene(cross(), tuple(drivers), (), (0.0, 0.0, 70.0))


def _town(rng: Generator, count: int, up_m: float, obstacles: tuple[Obstacle, ...] = ()) -> WatchedScene:
    roads = town()
    network = network_of(roads)
    links = [(str(link.start), str(link.end)) for link in network.links.values()]
    inner = [each for each in links if _inside(each[0]) and _inside(each[1])]
    drivers: list[Driver] = []
    for number, index in enumerate(rng.permutation(len(inner))[:count].tolist()):
        start, end = inner[index][:: 1 if rng.random() < 0.5 else -1]
        drivers.append(
            drawn(f"car{number}", _walk(network, (start, end), rng), rng, start_m=float(rng.uniform(5.0, 60.0)))
        )
    return WatchedScene(roads, tuple(drivers), obstacles, (140.0, 140.0, up_m))


def _walk(network: RoadNetwork, street: tuple[str, str], rng: Generator, length: int = 12) -> tuple[str, ...]:
    """A route that turns by chance, and neither turns round nor leaves the town."""
    route = list(street)
    while len(route) < length:
        reached = [network.links[way.link].crossing_at(way.direction) for way in network.departures[route[-1]]]
        onward = [name for name in reached if name is not None and name != route[-2] and _inside(name)]
        route.append(onward[int(rng.integers(len(onward)))])
    return tuple(route)


def _inside(crossing: str) -> bool:
    return all(0 <= int(number) < 3 for number in crossing[1:].split("_"))


def _houses() -> tuple[Obstacle, ...]:
    """A house in each block, and bridges over three streets."""
    blocks = [(70.0 + 140.0 * column, 70.0 + 140.0 * row) for column in range(2) for row in range(2)]
    half = _HALF_HOUSE_M
    houses = [Obstacle(x - half, y - half, x + half, y + half, _ROOF_M) for x, y in blocks]
    bridges = [Obstacle(x - 8.0, 140.0 * row - 20.0, x + 8.0, 140.0 * row + 20.0, 8.0, 6.0) for x, row in _BRIDGES]
    return (*houses, *bridges)


SCENES: dict[str, Callable[[Generator], WatchedScene]] = {
    "crossing": _crossing,
    "town": lambda rng: _town(rng, 4, 100.0),
    "six": lambda rng: _town(rng, 6, 100.0),
    "low": lambda rng: _town(rng, 4, 60.0),
    "houses": lambda rng: _town(rng, 4, 100.0, _houses()),
}
