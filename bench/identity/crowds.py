"""Scenes of cars, bikes and walkers, and the percepts of a tracker that knows nothing of what it saw before.

Things enter at an edge, move as their kind does, and leave; the truth of each ends when it has left. They are seen for some seconds
and hidden for some, after that under a new name; some samples are missed, and there are percepts of nothing.
"""

from collections.abc import Callable, Iterator
from math import tau
from typing import Final, NamedTuple

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from dyknow.sim_uavs.roads.percepts import SeenPercept

Track = NDArray[np.float64]
"""(n, 2): a place for each step."""
STEP_S: Final = 0.02
_RNG: Final = 77


class Place(NamedTuple):
    """Where a thing is."""

    name: str
    x_m: float
    y_m: float


class CrowdLook(NamedTuple):
    """One instant: the truth of what has not left, and the percepts of it."""

    t_us: int
    truth: tuple[Place, ...]
    percepts: tuple[SeenPercept, ...]


class Crowd(NamedTuple):
    """A kind of scene.

    Attributes:
        reaches_m: of a tracker that is tuned for it.
        tracks: of all things, with the second at which each enters.
        hz: looks a second.
        sd_m: of the error of a position, on each axis.
        near_m: an object nearer to a thing than this may be it.
        seen_s, hidden_s: shortest and longest.
        clutter_s: percepts of nothing that begin in a second.
    """

    tracks: Callable[[Generator, float], list[tuple[float, Track]]]
    hz: float
    sd_m: float
    near_m: float
    reaches_m: tuple[float, ...]
    seen_s: tuple[float, float] = (3.0, 8.0)
    hidden_s: tuple[float, float] = (1.0, 3.0)
    clutter_s: float = 1.0
    missed: float = 0.05
    clutter_lasts_s: tuple[float, float] = (0.1, 1.5)
    lasts_s: float = 30.0


def crowd(name: str, seed: int, lasts_s: float | None = None) -> tuple[CrowdLook, ...]:
    """The looks of a scene; equal seeds give equal ones."""
    kind = CROWDS[name]
    moving_rng, seeing_rng = np.random.default_rng((seed, _RNG, sorted(CROWDS).index(name))).spawn(2)
    lasts_s = lasts_s or kind.lasts_s
    return tuple(_looks(kind, kind.tracks(moving_rng, lasts_s), seeing_rng, lasts_s))


def _looks(kind: Crowd, tracks: list[tuple[float, Track]], rng: Generator, lasts_s: float) -> Iterator[CrowdLook]:
    times_s = np.arange(0.0, lasts_s, 1.0 / kind.hz)
    names = _Names()
    shown = [_shown(kind, rng, lasts_s) for _ in tracks]
    open_: dict[str, str] = {}
    spans: dict[str, int] = {}
    corners = np.concatenate([track for _, track in tracks])
    clutter = _Clutter(kind, corners.min(axis=0), corners.max(axis=0), rng, names)
    for at_s in times_s.tolist():
        t_us = round(at_s * 1e6)
        truth, percepts = [], []
        for number, (enters_s, track) in enumerate(tracks):
            step = round((at_s - enters_s) / STEP_S)
            if not 0 <= step < len(track):
                continue
            place = Place(f"t{number}", float(track[step, 0]), float(track[step, 1]))
            truth.append(place)
            span = int(np.searchsorted(shown[number], at_s, side="right"))
            if span % 2 and spans.get(place.name) != span:
                open_[place.name], spans[place.name] = names.next(), span
            if span % 2 and rng.random() >= kind.missed:
                percepts.append(_seen(kind, rng, t_us, open_[place.name], place.name, place.x_m, place.y_m))
        yield CrowdLook(t_us, tuple(truth), (*percepts, *clutter.at(at_s, t_us)))


def _shown(kind: Crowd, rng: Generator, lasts_s: float) -> Track:
    """When it comes into view and goes out of it, in turn, from some time before the beginning on."""
    edges = [-float(rng.uniform(0.0, kind.seen_s[1]))]
    while edges[-1] < lasts_s:
        edges.append(edges[-1] + float(rng.uniform(*(kind.seen_s if len(edges) % 2 else kind.hidden_s))))
    return np.array(edges)


def _seen(kind: Crowd, rng: Generator, t_us: int, name: str, of: str | None, x_m: float, y_m: float) -> SeenPercept:
    dx, dy = (float(each) for each in rng.normal(0.0, kind.sd_m, 2))
    return SeenPercept(t_us, name, of, x_m + dx, y_m + dy, kind.sd_m)


class _Names:
    def __init__(self) -> None:
        self._count = 0

    def next(self) -> str:
        self._count += 1
        return f"p{self._count}"


class _Clutter:
    """Percepts of nothing, anywhere where things are."""

    def __init__(self, kind: Crowd, least: Track, most: Track, rng: Generator, names: _Names) -> None:
        self._kind, self._least, self._most, self._rng, self._names = kind, least, most, rng, names
        self._live: list[tuple[str, float, float, float]] = []

    def at(self, at_s: float, t_us: int) -> Iterator[SeenPercept]:
        kind, rng = self._kind, self._rng
        self._live = [each for each in self._live if each[3] > at_s]
        for _ in range(int(rng.poisson(kind.clutter_s / kind.hz))):
            x_m, y_m = (float(each) for each in rng.uniform(self._least, self._most))
            self._live.append((self._names.next(), x_m, y_m, at_s + float(rng.uniform(*kind.clutter_lasts_s))))
        for name, x_m, y_m, _ in self._live:
            yield _seen(kind, rng, t_us, name, None, x_m, y_m)


# How things move


def walkers(count: int, width_m: float, length_m: float) -> Callable[[Generator, float], list[tuple[float, Track]]]:
    """A street of walkers in both directions: alone, in twos and threes, and some that stand for a while."""

    def made(rng: Generator, lasts_s: float) -> list[tuple[float, Track]]:
        found: list[tuple[float, Track]] = []
        while len(found) < count:
            together = min(int(rng.choice((1, 1, 1, 2, 2, 3))), count - len(found))
            way, speed_m_s = int(rng.choice((-1, 1))), float(rng.normal(1.35, 0.2))
            crossing_s = length_m / max(0.6, speed_m_s)
            enters_s = float(rng.uniform(-0.7 * crossing_s, max(0.1, lasts_s - 3.0)))
            heading, lane_m = (0.0 if way > 0 else tau / 2), float(rng.uniform(0.0, width_m))
            leader = _wandered(rng, crossing_s, max(0.6, speed_m_s), heading, turns=0.12, stops=0.15)
            leader += (0.0 if way > 0 else length_m, lane_m)
            for number in range(together):
                sway = np.cumsum(rng.normal(0.0, 0.01, leader.shape), axis=0)
                found.append((enters_s, leader + sway + (0.0, 0.7 * number)))
        return found

    return made


def bikes(count: int, size_m: float) -> Callable[[Generator, float], list[tuple[float, Track]]]:
    """Bikes over a square, from one side to another in curves, with walkers among them and a car for every ten."""

    def made(rng: Generator, lasts_s: float) -> list[tuple[float, Track]]:
        found = []
        for number in range(count):
            usual_m_s, turns = (9.0, 0.05) if number % 10 == 9 else (4.5, 0.15) if number % 2 else (1.4, 0.15)
            speed_m_s = usual_m_s * float(rng.uniform(0.7, 1.3))
            side = int(rng.integers(4)) * tau / 4
            crossing_s = size_m / speed_m_s
            enters_s = float(rng.uniform(-0.7 * crossing_s, max(0.1, lasts_s - 3.0)))
            track = _wandered(rng, crossing_s, speed_m_s, side + float(rng.uniform(-0.5, 0.5)), turns=turns, stops=0.1)
            centre = np.array([np.cos(side), np.sin(side)]) * -size_m / 2
            across = np.array([-np.sin(side), np.cos(side)]) * float(rng.uniform(-0.3, 0.3)) * size_m
            found.append((enters_s, track + centre + across))
        return found

    return made


def motorway(count: int, lanes: int, speed_m_s: float) -> Callable[[Generator, float], list[tuple[float, Track]]]:
    """Cars in lanes that follow each other, faster and slower as waves go through; some change lanes, and they leave at the end."""

    def made(rng: Generator, lasts_s: float) -> list[tuple[float, Track]]:
        steps = round((lasts_s + 20.0) / STEP_S)
        length_m = speed_m_s * 25.0
        found: list[tuple[float, Track]] = []
        for lane in range(lanes):
            ahead: Track | None = None
            at_m = length_m * 0.9
            for _ in range(count // lanes):
                own_m_s = speed_m_s * float(rng.uniform(0.85, 1.15))
                along = _followed(rng, steps, at_m, own_m_s, ahead)
                ahead, at_m = along, at_m - float(rng.uniform(0.9, 1.8)) * (6.0 + own_m_s)
                across = np.full(steps, 3.5 * lane) + _lane_change(rng, steps)
                on = (along >= 0.0) & (along <= length_m)
                if on.sum() > 1.0 / STEP_S:
                    first = int(on.argmax())
                    found.append((first * STEP_S, np.stack([along, across], axis=1)[on]))
        return [each for each in found if each[0] < lasts_s - 1.0]

    return made


def _followed(rng: Generator, steps: int, at_m: float, usual_m_s: float, ahead: Track | None) -> Track:
    """Where a car is along its lane: it accelerates to its own speed and keeps a gap of a second and 7 m."""
    found, speed_m_s = np.empty(steps), usual_m_s
    waves = np.interp(
        np.arange(steps), np.arange(0, steps + 500, 500), rng.uniform(0.5, 1.1, len(range(0, steps + 500, 500)))
    )
    for step in range(steps):
        wanted_m_s = usual_m_s * float(waves[step])
        if ahead is not None:
            wanted_m_s = min(wanted_m_s, max(0.0, float(ahead[step]) - at_m - 7.0))
        speed_m_s += min(2.0 * STEP_S, max(-4.0 * STEP_S, wanted_m_s - speed_m_s))
        speed_m_s = max(0.0, speed_m_s)
        at_m += speed_m_s * STEP_S
        found[step] = at_m
    return found


def _lane_change(rng: Generator, steps: int) -> Track:
    if rng.random() > 0.2:
        return np.zeros(steps)
    begins, lasts = int(rng.integers(steps)), round(4.0 / STEP_S)
    share = np.clip((np.arange(steps) - begins) / lasts, 0.0, 1.0)
    return np.asarray(3.5 * (3.0 * share**2 - 2.0 * share**3) * rng.choice((-1.0, 1.0)))


def crossing(count: int, size_m: float = 90.0) -> Callable[[Generator, float], list[tuple[float, Track]]]:
    """Cars over one crossing: straight on or through a curve before which they slow down, some after a stop."""

    def made(rng: Generator, lasts_s: float) -> list[tuple[float, Track]]:
        found: list[tuple[float, Track]] = []
        for _ in range(12 * count):
            if len(found) == count:
                break
            usual_m_s, arm = float(rng.uniform(8.0, 13.0)), int(rng.integers(4)) * tau / 4
            turn = int(rng.choice((-1, 0, 0, 1)))
            stop_s = float(rng.uniform(1.0, 8.0)) if rng.random() < 0.4 else 0.0
            points = _turned(size_m, turn)
            rotated = points @ np.array([[np.cos(arm), np.sin(arm)], [-np.sin(arm), np.cos(arm)]])
            track = _driven(rotated, usual_m_s, 5.5 if turn else usual_m_s, stop_s)
            lasts = len(track) * STEP_S
            enters_s = float(rng.uniform(-0.6 * lasts, max(0.1, lasts_s - 3.0)))
            if not any(_collide((enters_s, track), other) for other in found):
                found.append((enters_s, track))
        return found

    return made


def _collide(one: tuple[float, Track], other: tuple[float, Track], apart_m: float = 4.0) -> bool:
    (first_s, first), (second_s, second) = sorted((one, other), key=lambda each: each[0])
    begins = round((second_s - first_s) / STEP_S)
    both = min(len(first) - begins, len(second))
    return both > 0 and bool((np.hypot(*(first[begins : begins + both] - second[:both]).T) < apart_m).any())


def _turned(size_m: float, turn: int) -> Track:
    """A lane to the east through the middle, then on, or round a corner of 8 m."""
    edge, lane_m, radius_m = size_m / 2, -1.75, 8.0
    before = [(-edge, lane_m), (-radius_m, lane_m)]
    if not turn:
        return np.array([*before, (edge, lane_m)])
    angles = np.linspace(0.0, tau / 4, 8)
    arc = [(-radius_m + radius_m * np.sin(a), lane_m + turn * radius_m * (1.0 - np.cos(a))) for a in angles]
    return np.array([*before, *arc[1:], (0.0, turn * edge)])


def _driven(points: Track, usual_m_s: float, slow_m_s: float, stop_s: float) -> Track:
    lengths = np.hypot(*np.diff(points, axis=0).T)
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    slow_at_m, at_m, speed_m_s, found, stood = along[1], 0.0, usual_m_s, [], 0.0
    while at_m < along[-1]:
        left_m = slow_at_m - at_m
        target = 0.0 if stop_s > stood else slow_m_s
        wanted = usual_m_s if left_m < -10.0 else float(np.sqrt(target**2 + 5.0 * max(0.0, left_m)))
        speed_m_s = max(0.0, speed_m_s + min(2.0 * STEP_S, max(-5.0 * STEP_S, min(usual_m_s, wanted) - speed_m_s)))
        if speed_m_s < 0.3 and target == 0.0:
            stood, speed_m_s = stood + STEP_S, 0.0
        at_m += speed_m_s * STEP_S
        found.append((np.interp(at_m, along, points[:, 0]), np.interp(at_m, along, points[:, 1])))
    return np.array(found)


def _wandered(rng: Generator, lasts_s: float, speed_m_s: float, heading: float, turns: float, stops: float) -> Track:
    """From 0, 0: turn rate and speed are random and correlated over some seconds, the heading returns to where it goes."""
    steps = max(2, round(lasts_s / STEP_S))
    offset, rate, speed, found = 0.0, 0.0, speed_m_s, np.zeros((steps, 2))
    stop_from, stop_to = (int(rng.integers(steps)),) * 2
    if rng.random() < stops:
        stop_to += round(float(rng.uniform(1.0, 5.0)) / STEP_S)
    for step in range(1, steps):
        rate += STEP_S * (-rate / 1.5 - 0.5 * offset) + turns * float(rng.normal()) * STEP_S**0.5
        offset += rate * STEP_S
        wanted = 0.0 if stop_from <= step < stop_to else speed_m_s
        speed += STEP_S * (wanted - speed) * 1.5 + 0.08 * speed_m_s * float(rng.normal()) * STEP_S**0.5
        found[step] = found[step - 1] + max(0.0, speed) * STEP_S * np.array(
            [np.cos(heading + offset), np.sin(heading + offset)]
        )
    return found


CROWDS: Final[dict[str, Crowd]] = {
    "motorway": Crowd(motorway(32, 4, 14.0), 10.0, 0.5, 5.0, (2.5, 5.0, 10.0, 20.0), seen_s=(2.0, 5.0), lasts_s=15.0),
    "queues": Crowd(motorway(20, 2, 5.0), 10.0, 0.5, 5.0, (1.25, 2.5, 5.0, 10.0), seen_s=(2.0, 5.0), lasts_s=15.0),
    "crossing": Crowd(crossing(16), 25.0, 0.3, 2.5, (1.25, 2.5, 5.0, 10.0), lasts_s=20.0),
    "square": Crowd(bikes(40, 60.0), 10.0, 0.3, 1.5, (0.75, 1.5, 3.0, 6.0), lasts_s=30.0),
    "street": Crowd(walkers(40, 10.0, 20.0), 2.5, 0.3, 1.0, (0.5, 1.0, 2.0, 4.0), lasts_s=40.0),
    "crowd": Crowd(walkers(130, 5.0, 20.0), 8.0, 0.1, 0.5, (0.25, 0.5, 1.0, 2.0), clutter_s=2.0, lasts_s=20.0),
}  # fmt: skip
"""Cars on a motorway, in queues and over a crossing; bikes, walkers and cars on a square; walkers in a street, and many of them."""
