"""Road scenes by name: a network, drivers, how they are seen, for how long; run, a scene is a recording.

The kinds are those by which object linkage is judged: a car as in Figure 5 of the paper on it, with noise, two cars, six,
six in clutter, twelve, gaps of 4 s, two looks a second, and dense traffic.
"""

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.random import Generator

from dyknow.anchoring.roads.network import RoadNetwork
from dyknow.model.errors import WrongCall
from dyknow.sim_uavs.roads.drivers import Driver, RoadState, drawn
from dyknow.sim_uavs.roads.layouts import RoadsJson, bends, cross, network_of, town
from dyknow.sim_uavs.roads.percepts import Area, PerceptSource, Seeing, SeenPercept
from dyknow.sim_uavs.roads.traffic import SimulatedTraffic

_SCENE_RNG = 21  # keeps the generators of scenes apart from others of the same seed


class RoadScene(NamedTuple):
    """`roads` is GeoJSON."""

    roads: RoadsJson
    drivers: tuple[Driver, ...]
    seeing: Seeing
    lasts_us: int = 60_000_000


class Look(NamedTuple):
    """One instant: the truth, and the percepts of it."""

    t_us: int
    truth: tuple[RoadState, ...]
    percepts: tuple[SeenPercept, ...]


class RoadRecording(NamedTuple):
    """A simulated scene: its percepts and the truth."""

    name: str
    seed: int
    scene: RoadScene
    looks: tuple[Look, ...]

    def records(self) -> Iterator[dict[str, Any]]:
        """The percepts as lines of JSON."""
        return (percept.record() for look in self.looks for percept in look.percepts)


def recorded(name: str, seed: int) -> RoadRecording:
    """Run the scene of that name with that seed; equal seeds give equal recordings.

    Raises:
        WrongCall: there is no such scene.
    """
    if name not in _SCENES:
        raise WrongCall(f"no road scene is called {name!r}; there are {', '.join(SCENES)}")
    drivers_rng, traffic_rng, seeing_rng = np.random.default_rng((seed, _SCENE_RNG)).spawn(3)
    scene = _SCENES[name](drivers_rng)
    return RoadRecording(name, seed, scene, tuple(looks(scene, traffic_rng, seeing_rng)))


def looks(scene: RoadScene, traffic_rng: Generator, seeing_rng: Generator) -> Iterator[Look]:
    """Run a scene, look by look."""
    network = network_of(scene.roads)
    traffic = SimulatedTraffic(network, scene.drivers, traffic_rng)
    source = PerceptSource(scene.seeing, area_of(network), seeing_rng)
    for now_us in range(0, scene.lasts_us, scene.seeing.period_us):
        traffic.advance(now_us)
        states = tuple(traffic.states())
        yield Look(now_us, states, tuple(source.look(states, now_us)))


def area_of(network: RoadNetwork, margin_m: float = 20.0) -> Area:
    """The area of the network, and a margin around it."""
    xs = [x for link in network.links.values() for x, _ in link.line.points]
    ys = [y for link in network.links.values() for _, y in link.line.points]
    return min(xs) - margin_m, min(ys) - margin_m, max(xs) + margin_m, max(ys) + margin_m


def _one(rng: Generator, sd_m: float) -> RoadScene:
    """Seen four times for 3 s each: twice lost before the crossing, once inside it; there it takes any exit."""
    end = ("north", "end", "south")[int(rng.integers(3))]
    driver = Driver(
        "car1",
        ("start", "x1", end),
        start_m=4.0,
        cruise_m_s=float(rng.uniform(11.5, 12.5)),
        enters_us=20_000,
        passes=False,
    )
    return RoadScene(bends(), (driver,), Seeing(sd_m=sd_m, together=True), 18_000_000)


def _two(rng: Generator) -> RoadScene:
    """Two cars, one behind the other, that part at a crossing or do not, as chance has it."""
    exits = ("north", "east", "south")
    drivers = [
        drawn(f"car{number}", ("west", "middle", exits[int(rng.integers(3))]), rng, start_m=start_m)._replace(
            kind="car", cruise_m_s=float(rng.uniform(9.0, 12.0)), passes=False
        )
        for number, start_m in ((1, 60.0 + float(rng.uniform(15.0, 25.0))), (2, 60.0))
    ]
    return RoadScene(cross(), tuple(drivers), Seeing(sd_m=0.5), 30_000_000)


def _in_town(rng: Generator, count: int, seeing: Seeing) -> RoadScene:
    """Vehicles that wander about a town, each beginning on a street of its own."""
    roads = town()
    links = network_of(roads).links.values()
    inner = [(link.start, link.end) for link in links if _inside(link.start) and _inside(link.end)]
    drivers = []
    for number, index in enumerate(rng.permutation(len(inner))[:count], 1):
        start, end = inner[int(index)][:: 1 if rng.random() < 0.5 else -1]
        route = _walk(network_of(roads), (str(start), str(end)), rng)
        drivers.append(drawn(f"car{number}", route, rng, start_m=float(rng.uniform(5.0, 60.0))))
    return RoadScene(roads, tuple(drivers), seeing)


def _walk(network: RoadNetwork, street: tuple[str, str], rng: Generator, length: int = 12) -> tuple[str, ...]:
    """A route that begins with a street, turns by chance, and neither turns round nor leaves the town."""
    route = list(street)
    while len(route) < length:
        reached = [network.links[way.link].crossing_at(way.direction) for way in network.departures[route[-1]]]
        onward = [name for name in reached if name is not None and name != route[-2] and _inside(name)]
        route.append(onward[int(rng.integers(len(onward)))])
    return tuple(route)


def _inside(crossing: str | None) -> bool:
    return crossing is not None and all(0 <= int(number) < 3 for number in crossing[1:].split("_"))


def _dense(rng: Generator) -> RoadScene:
    """Six vehicles in a row on each arm towards one crossing, 18 m apart, and the queues that come of it."""
    drivers = [
        drawn(f"{arm}{number}", (arm, "middle"), rng, start_m=60.0 + 18.0 * number)
        for arm in ("west", "east", "south", "north")
        for number in range(6)
    ]
    return RoadScene(cross(), tuple(drivers), Seeing(sd_m=1.0), 30_000_000)


_SCENES: dict[str, Callable[[Generator], RoadScene]] = {
    "one": lambda rng: _one(rng, 0.5),
    "noise": lambda rng: _one(rng, 2.0),
    "two": _two,
    "six": lambda rng: _in_town(rng, 6, Seeing(sd_m=0.5)),
    "clutter": lambda rng: _in_town(rng, 6, Seeing(sd_m=0.5, clutter_s=4.0)),
    "twelve": lambda rng: _in_town(rng, 12, Seeing(sd_m=0.5)),
    "gaps": lambda rng: _in_town(rng, 6, Seeing(sd_m=0.5, hidden_us=4_000_000)),
    "slow": lambda rng: _in_town(rng, 6, Seeing(sd_m=0.5, period_us=500_000)),
    "dense": _dense,
}
SCENES = tuple(_SCENES)
