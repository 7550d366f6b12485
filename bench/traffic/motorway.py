"""A motorway of two or three lanes, as drives from seeds, and where a camera sees the cars.

Cars follow each other by the intelligent driver model, change lanes where another one is free and keep right. In one or all lanes
there is something that stops them for a while. A camera sees a stretch: cars enter its view and leave it for good, some of them in
its middle; they are hidden for some seconds, single samples are missing, and positions have an error.
"""

from collections.abc import Callable, Iterator
from math import cos, hypot, inf, pi, sin, sqrt
from typing import Any, Final, NamedTuple

import numpy as np

STEP_S: Final = 0.1
LANE_M: Final = 3.5
WARM_S: Final = 45.0
ROAD_M: Final = (-400.0, 1100.0)
VIEW_M: Final = (0.0, 650.0)
LENGTH_M: Final = 4.5
TIMES: Final = (1.0, 3.0)
"""How long a car is hidden, s."""
MISSED: Final = 0.03


class CarAt(NamedTuple):
    """Where a car really is, metres along the road and to its right; `is_seen`: a sample has it at this time."""

    along_m: float
    right_m: float
    speed_m_s: float
    is_seen: bool


class Minute(NamedTuple):
    """What happened at each tenth of a second.

    Attributes:
        at_ms: the times.
        cars: of each time those in the view that have not left it for good, hidden ones as well.
        seen: the samples of each time, where a car is seen, as the source of `overtakes.kpl`.
        place: metres east and north of a place on the road, and the direction of the road there.
        lanes: how many it has.
    """

    at_ms: list[int]
    cars: list[dict[str, CarAt]]
    seen: list[list[list[Any]]]
    place: Callable[[CarAt], tuple[float, float, float]] | None = None
    lanes: int = 0

    def lines(self) -> Iterator[dict[str, Any]]:
        """The feed of `dyknow kpl run`, for the source `seen`."""
        for at_ms, samples in zip(self.at_ms, self.seen, strict=True):
            for sample in samples:
                yield {"t_ms": at_ms, "seen": sample}


class _Car:
    """One car; its lane is where it is or drives to, 0 on the right."""

    def __init__(self, name: str, lane: int, speed_m_s: float, wants_m_s: float) -> None:
        self.name, self.lane, self.from_lane = name, lane, lane
        self.along_m, self.speed_m_s, self.wants_m_s = ROAD_M[0], speed_m_s, wants_m_s
        self.changed_s = inf
        self.side = float(lane)

    def is_in(self, lane: int) -> bool:
        return self.lane == lane or abs(self.side - lane) < 0.6


class _Stop(NamedTuple):
    """Nobody drives faster than `most_m_s` there."""

    lanes: set[int]
    along_m: float
    begin_s: float
    end_s: float
    most_m_s: float


class Motorway:
    """All cars of one minute from its seed."""

    def __init__(self, seed: int, cars: int = 25) -> None:
        self._rng = np.random.default_rng((seed, 9))
        self.lanes = int(self._rng.integers(2, 4))
        self._every_s = 1.0 / (cars / 18.0)
        self._cars: list[_Car] = []
        self._number, self._next_s = 0, 0.0
        self._stops: list[_Stop] = []
        if self._rng.random() < 0.7:
            lanes = set(range(self.lanes)) if self._rng.random() < 0.3 else {int(self._rng.integers(self.lanes))}
            begin_s = WARM_S + self._rng.uniform(-20.0, 30.0)
            self._stops.append(
                _Stop(lanes, self._rng.uniform(150.0, 420.0), begin_s, begin_s + self._rng.uniform(5.0, 25.0), self._rng.choice([0.0, 2.0]))
            )  # fmt: skip

    def step(self, now_s: float) -> list[_Car]:
        """The cars a tenth of a second later."""
        self._enter(now_s)
        for car in self._cars:
            self._change(car, now_s)
        wanted = [(car, self._acceleration(car, now_s)) for car in self._cars]
        for car, acceleration in wanted:
            car.speed_m_s = max(0.0, car.speed_m_s + STEP_S * acceleration)
            car.along_m += STEP_S * car.speed_m_s
            moves = min(1.0, 0.25 + car.speed_m_s / 8.0) * STEP_S / 3.0
            car.side += max(-moves, min(moves, car.lane - car.side))
        self._cars = [car for car in self._cars if car.along_m < ROAD_M[1]]
        return self._cars

    def _enter(self, now_s: float) -> None:
        if now_s < self._next_s:
            return
        rng = self._rng
        self._next_s = now_s + rng.exponential(self._every_s)
        lane = int(rng.integers(self.lanes))
        wants = rng.uniform(21.0, 25.0) if lane == 0 and rng.random() < 0.6 else rng.uniform(24.0, 38.0)
        ahead = self._ahead(ROAD_M[0], lane)
        if ahead is None or ahead.along_m - ROAD_M[0] > 25.0:
            speed = wants if ahead is None else min(wants, ahead.speed_m_s + 3.0)
            self._cars.append(_Car(f"v{self._number}", lane, speed, wants))
            self._number += 1

    def _ahead(self, along_m: float, lane: int, but: _Car | None = None) -> _Car | None:
        ahead = [car for car in self._cars if car is not but and car.along_m >= along_m and car.is_in(lane)]
        return min(ahead, key=lambda car: car.along_m, default=None)

    def _behind(self, along_m: float, lane: int, but: _Car) -> _Car | None:
        behind = [car for car in self._cars if car is not but and car.along_m <= along_m and car.is_in(lane)]
        return max(behind, key=lambda car: car.along_m, default=None)

    def _acceleration(self, car: _Car, now_s: float) -> float:
        found = [2.0 * (1.0 - (car.speed_m_s / car.wants_m_s) ** 4)]
        for lane in {car.lane, round(car.side)}:
            ahead = self._ahead(car.along_m, lane, car)
            if ahead is not None:
                found.append(_follows(car, ahead.along_m - car.along_m - LENGTH_M, ahead.speed_m_s))
        for stop in self._stops:
            is_ahead = 0.0 <= stop.along_m - car.along_m < 200.0
            if stop.begin_s <= now_s < stop.end_s and car.lane in stop.lanes and is_ahead:
                found.append(_follows(car, stop.along_m - car.along_m, stop.most_m_s))
        return max(-8.0, min(found))

    def _change(self, car: _Car, now_s: float) -> None:
        if abs(car.side - car.lane) > 0.01 or now_s - (-inf if car.changed_s == inf else car.changed_s) < 4.0:
            return
        ahead = self._ahead(car.along_m, car.lane, car)
        gap_m = inf if ahead is None else ahead.along_m - car.along_m
        is_slowed = ahead is not None and gap_m < 20.0 + 2.0 * car.speed_m_s and ahead.speed_m_s < car.wants_m_s - 2.0
        for lane in (car.lane + 1, car.lane - 1):
            wants = is_slowed if lane > car.lane else (not is_slowed and self._rng.random() < 0.05)
            if wants and 0 <= lane < self.lanes and self._is_free(car, lane, is_right=lane < car.lane):
                car.lane, car.changed_s = lane, now_s
                return

    def _is_free(self, car: _Car, lane: int, *, is_right: bool) -> bool:
        ahead, behind = self._ahead(car.along_m, lane, car), self._behind(car.along_m, lane, car)
        room_m = 60.0 + car.speed_m_s if is_right else 6.0 + max(0.0, 0.8 * car.speed_m_s)
        if ahead is not None and (
            ahead.along_m - car.along_m < room_m or (not is_right and ahead.speed_m_s < car.speed_m_s - 4.0)
        ):
            return False
        return behind is None or car.along_m - behind.along_m > 8.0 + max(
            0.3 * behind.speed_m_s, 3.0 * (behind.speed_m_s - car.speed_m_s)
        )


def _follows(car: _Car, gap_m: float, speed_m_s: float) -> float:
    """The intelligent driver model: acceleration 2, comfortable braking 3 m/s^2, a headway of a second."""
    speed = car.speed_m_s
    wanted_m = 2.0 + max(0.0, speed + speed * (speed - speed_m_s) / (2.0 * sqrt(6.0)))
    return 2.0 * (1.0 - (speed / car.wants_m_s) ** 4 - (wanted_m / max(gap_m, 0.5)) ** 2)


class Camera:
    """What is seen of the road, which bends a little or not at all.

    Args:
        sd_m: of the error of positions, in x and in y.
    """

    def __init__(self, seed: int, sd_m: float, lanes: int) -> None:
        self._rng, self._sd_m, self._lanes = np.random.default_rng((seed, 10)), sd_m, lanes
        self._from_rad = self._rng.uniform(0.0, 2.0 * pi)
        self._bend = float(self._rng.choice([0.0, 1.0, -1.0])) / self._rng.uniform(700.0, 3000.0)
        self._hidden: dict[str, list[tuple[float, float]]] = {}

    def _hides(self, name: str, now_s: float) -> bool:
        if name not in self._hidden:
            rng = self._rng
            begins = now_s + rng.uniform(0.0, 25.0, rng.integers(0, 3))
            spans = [(float(begin), float(begin + rng.uniform(*TIMES))) for begin in begins]
            if rng.random() < 0.15:
                spans.append((now_s + rng.uniform(4.0, 20.0), inf))
            self._hidden[name] = spans
        return any(begin <= now_s < end for begin, end in self._hidden[name])

    def _has_left(self, name: str, now_s: float) -> bool:
        return any(end == inf and begin <= now_s for begin, end in self._hidden[name])

    def look(self, cars: list[_Car], now_s: float) -> tuple[dict[str, CarAt], list[list[Any]]]:
        """The cars that are there, and the samples of those that are seen."""
        there: dict[str, CarAt] = {}
        samples: list[list[Any]] = []
        for car in cars:
            if not VIEW_M[0] <= car.along_m < VIEW_M[1]:
                continue
            hides = self._hides(car.name, now_s)
            if self._has_left(car.name, now_s):
                continue
            is_seen = not hides and self._rng.random() >= MISSED
            at = CarAt(car.along_m, LANE_M * ((self._lanes - 1) / 2 - car.side), car.speed_m_s, is_seen)
            there[car.name] = at
            if is_seen:
                x_m, y_m, road_deg = self.place(at)
                x_m, y_m = (each + self._rng.normal(0.0, self._sd_m) for each in (x_m, y_m))
                samples.append([car.name, round(x_m, 2), round(y_m, 2), round(road_deg, 1), "l1", "no_crossing"])
        return there, samples

    def place(self, at: CarAt) -> tuple[float, float, float]:
        """Metres east and north, and the direction of the road there, degrees clockwise from north."""
        heading = self._from_rad + self._bend * at.along_m
        if self._bend:
            east = (cos(self._from_rad) - cos(heading)) / self._bend
            north = (sin(heading) - sin(self._from_rad)) / self._bend
        else:
            east, north = at.along_m * sin(heading), at.along_m * cos(heading)
        return (
            east + at.right_m * cos(heading),
            north - at.right_m * sin(heading),
            float(np.degrees(heading)) % 360.0,
        )


def minute(seed: int, sd_m: float, cars: int = 25, seconds: float = 60.0) -> Minute:
    """The minute of a seed, with about so many cars in view."""
    motorway = Motorway(seed, cars)
    camera = Camera(seed, sd_m, motorway.lanes)
    made = Minute([], [], [], camera.place, motorway.lanes)
    for step in range(round((WARM_S + seconds) / STEP_S)):
        now_s = step * STEP_S
        cars_now = motorway.step(now_s)
        if now_s >= WARM_S:
            there, samples = camera.look(cars_now, now_s)
            made.at_ms.append(round(1000 * (now_s - WARM_S)))
            made.cars.append(there)
            made.seen.append(samples)
    return made


def apart_m(one: CarAt, other: CarAt) -> float:
    """How far two cars are from each other."""
    return hypot(one.along_m - other.along_m, one.right_m - other.right_m)
