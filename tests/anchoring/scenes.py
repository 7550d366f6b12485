"""Seeded scenes of cars on a small network, and the scores of what was made of them."""

import math
import random
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from dyknow.anchoring.links.states import ObjectState, diagonal
from dyknow.anchoring.links.structures import ObjectLinkage, Percept, StateRecord
from dyknow.anchoring.ready import VISION, WORLD, ready_specification
from dyknow.anchoring.roads.network import RoadNetwork
from tests.anchoring.roads.towns import grid

Place = tuple[float, float]
HIT_M = 5.0
COVERED_M = 15.0
STEP_US = 10_000


@dataclass(frozen=True)
class Kind:
    """One kind of scene; times in seconds."""

    cars: int = 1
    noise_m: float = 0.3
    seen_s: float = 3.0
    hidden_s: float = 2.0
    hz: float = 10.0
    clutter: int = 0
    seconds: float = 40.0
    rows: int = 3
    block_m: float = 120.0
    together: bool = False
    with_velocity: bool = False


KINDS = {
    "one": Kind(),
    "noise": Kind(noise_m=2.0),
    "two": Kind(cars=2, noise_m=0.5),
    "six": Kind(cars=6, noise_m=0.5),
    "clutter": Kind(cars=6, noise_m=0.5, clutter=3),
    "twelve": Kind(cars=12, noise_m=0.5),
    "gaps": Kind(cars=6, noise_m=0.5, hidden_s=4.0),
    "2hz": Kind(cars=6, noise_m=0.5, hz=2.0),
    "dense": Kind(cars=12, noise_m=1.0, rows=2, block_m=60.0),
}


@dataclass
class Scene:
    """Percepts, and what is true: where each car is, and whether it is seen, by time."""

    roads: RoadNetwork
    ticks: list[tuple[int, list[Percept]]]
    places: dict[int, dict[str, Place]]
    seen: dict[int, set[str]]
    clutter: set[str] = field(default_factory=set)


def path(rng: random.Random, roads: RoadNetwork, seconds: float) -> list[Place]:
    """Where a car is every `STEP_US`: along lane centres, slower at turns, corners rounded."""
    start = rng.choice(sorted(roads.links))
    way = rng.choice([one for name in roads.departures for one in roads.departures[name] if one.link == start])
    corners: list[Place] = []
    slow: list[bool] = []
    travelled = 0.0
    while travelled < 16.0 * seconds:
        link = roads.links[way.link]
        lane = link.lanes[link.lanes_of(way.direction)[0]]
        margin = 6.0
        ends = [margin, link.length_m - margin]
        for offset in ends if way.direction > 0 else reversed(ends):
            x, y, _ = link.line.at(offset, lane.offset_m)
            corners.append((x, y))
        crossing = link.crossing_at(way.direction)
        options = [one for one in roads.departures[crossing] if one.link != way.link] or [way.back]
        following = rng.choice(options)
        slow.append(abs(roads.turns.angle_rad(crossing, way, following)) > 0.5)
        way, travelled = following, travelled + link.length_m
    return _driven(rng, corners, slow, seconds)


def _driven(rng: random.Random, corners: list[Place], slow: list[bool], seconds: float) -> list[Place]:
    usual = rng.uniform(7.0, 13.0)
    points = np.array(corners)
    lengths = np.hypot(*np.diff(points, axis=0).T)
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    turns = [
        along[2 * at + 1] + lengths[2 * at + 1] / 2 for at in range(len(slow)) if slow[at] and 2 * at + 1 < len(lengths)
    ]
    at, speed, found = rng.uniform(0.0, 60.0), usual, []
    step = STEP_US / 1e6
    for _ in range(round(seconds / step) + 1):
        near = min((abs(one - at) for one in turns), default=math.inf)
        wanted = min(usual, 5.0 + 0.25 * near)
        speed += max(-3.0 * step, min(2.0 * step, wanted - speed))
        at += speed * step
        found.append((float(np.interp(at, along, points[:, 0])), float(np.interp(at, along, points[:, 1]))))
    kernel = np.hanning(81)
    kernel /= kernel.sum()
    array = np.array(found)
    padded = np.pad(array, ((40, 40), (0, 0)), mode="edge")
    smooth = np.stack([np.convolve(padded[:, axis], kernel, "valid") for axis in (0, 1)], axis=1)
    return [(float(x), float(y)) for x, y in smooth]


def scene(kind: Kind, seed: int) -> Scene:
    rng = random.Random(seed)
    roads = grid(kind.rows, block_m=kind.block_m)
    paths = [path(rng, roads, kind.seconds) for _ in range(kind.cars)]
    phases = [0.0 if kind.together else rng.uniform(0.0, kind.seen_s + kind.hidden_s) for _ in paths]
    found = Scene(roads, [], {}, {})
    ghosts: list[tuple[str, Place, int]] = []
    cycle = kind.seen_s + kind.hidden_s
    for number in range(round(kind.seconds * kind.hz)):
        t_us = round(number * 1e6 / kind.hz)
        percepts = []
        found.places[t_us] = {f"car{car}": route[t_us // STEP_US] for car, route in enumerate(paths)}
        found.seen[t_us] = set()
        for car, phase in enumerate(phases):
            turn, into = divmod(t_us / 1e6 + phase, cycle)
            if into < kind.seen_s:
                found.seen[t_us].add(f"car{car}")
                percepts.append(measured(rng, kind, f"p{car}.{turn:.0f}", t_us, paths[car]))
        ghosts = [(name, at, left - 1) for name, at, left in ghosts if left > 1]
        while len(ghosts) < kind.clutter:
            edge = (kind.rows - 1) * kind.block_m
            name = f"c{len(found.clutter)}"
            found.clutter.add(name)
            ghosts.append((name, (rng.uniform(0, edge), rng.uniform(0, edge)), rng.randint(1, int(0.9 * kind.hz))))
        for name, (x, y), _ in ghosts:
            at = ObjectState(
                t_us, x + rng.gauss(0, kind.noise_m), y + rng.gauss(0, kind.noise_m), 0, 0, diagonal(kind.noise_m)
            )
            percepts.append(Percept(name, VISION, at))
        if percepts:
            found.ticks.append((t_us, percepts))
    return found


def measured(rng: random.Random, kind: Kind, name: str, t_us: int, route: list[Place]) -> Percept:
    x, y = route[t_us // STEP_US]
    sd = max(kind.noise_m, 0.05)
    vx = vy = 0.0
    if kind.with_velocity:
        step = min(t_us // STEP_US, len(route) - 2)
        (x0, y0), (x1, y1) = route[step], route[step + 1]
        vx, vy = ((b - a) / (STEP_US / 1e6) + rng.gauss(0, 0.5) for a, b in ((x0, x1), (y0, y1)))
    covariance = diagonal(sd, 1.0 if kind.with_velocity else None)
    state = ObjectState(t_us, x + rng.gauss(0, kind.noise_m), y + rng.gauss(0, kind.noise_m), vx, vy, covariance)
    return Percept(name, VISION, state)


class Scores(NamedTuple):
    """`idf1` over all frames, `seen` over those in which a car is seen; coverage of what is hidden; symbols a car."""

    idf1: float
    seen: float
    covered: float
    switches: int
    symbols: int


def linked(given: Scene, *, with_roads: bool = True, type_: str = WORLD) -> list[StateRecord]:
    linkage = ObjectLinkage(ready_specification(given.roads if with_roads else None))
    states = []
    for t_us, percepts in given.ticks:
        states += linkage.on_percepts(t_us, percepts).states
    return [each for each in states if each.type == type_]


def scores(given: Scene, states: Iterable[StateRecord]) -> Scores:
    by_time: dict[int, dict[str, Place]] = defaultdict(dict)
    for each in states:
        by_time[each.valid_us][each.symbol] = (each.state.x_m, each.state.y_m)
    seen = {t: {car: at for car, at in places.items() if car in given.seen[t]} for t, places in given.places.items()}
    linked_only: dict[int, dict[str, Place]] = defaultdict(dict)
    for each in states:
        if each.linked_to:
            linked_only[each.valid_us][each.symbol] = (each.state.x_m, each.state.y_m)
    hidden = covered = 0
    for t, places in given.places.items():
        started = t >= 5_000_000
        for car, at in places.items():
            if car not in given.seen[t] and started:
                hidden += 1
                covered += any(math.dist(at, there) <= COVERED_M for there in by_time.get(t, {}).values())
    return Scores(
        idf1(given.places, by_time),
        idf1(seen, linked_only),
        covered / hidden if hidden else 1.0,
        switches(seen, by_time),
        len({symbol for places in by_time.values() for symbol in places}),
    )


Frames = Mapping[int, Mapping[str, Place]]


def idf1(truth: Frames, found: Frames) -> float:
    """2 IDTP / (truth + found), by the best one-to-one matching of identities."""
    overlaps: Counter[tuple[str, str]] = Counter()
    for t, places in truth.items():
        for car, at in places.items():
            overlaps.update(
                (car, symbol) for symbol, there in found.get(t, {}).items() if math.dist(at, there) <= HIT_M
            )
    cars, symbols = sorted({car for car, _ in overlaps}), sorted({symbol for _, symbol in overlaps})
    hits = np.array([[overlaps[car, symbol] for symbol in symbols] for car in cars]).reshape(len(cars), len(symbols))
    rows, columns = linear_sum_assignment(-hits)
    total = sum(map(len, truth.values())) + sum(len(places) for t, places in found.items() if t in truth)
    return 2 * float(hits[rows, columns].sum()) / total


def switches(truth: Frames, found: Frames) -> int:
    """How often the symbol nearest to a car, within reach, is another one than before."""
    last: dict[str, str] = {}
    count = 0
    for t in sorted(truth):
        for car, at in truth[t].items():
            near = [(math.dist(at, there), symbol) for symbol, there in found.get(t, {}).items()]
            if near and min(near)[0] <= HIT_M:
                symbol = min(near)[1]
                count += car in last and last[car] != symbol
                last[car] = symbol
    return count
