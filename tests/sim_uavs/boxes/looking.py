"""A simulated UAV with a camera and what its platform makes of the images, without the rest of the platform."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from dyknow import NO_VALUE
from dyknow.agents.capabilities.cameras.perception import ImageLook, Perception
from dyknow.navigation.fusion import PositionFilter
from dyknow.navigation.geodesy import LocalFrame
from dyknow.navigation.searching.landing import Drop, landing
from dyknow.navigation.searching.search import PlacedPercept, SightSearch
from dyknow.navigation.vehicle import AttitudeReport, Command, GoToOrder, MountReport
from dyknow.sim_uavs.boxes.handled import Handling, Placed
from dyknow.sim_uavs.boxes.shared import BoxesOnGround, HandlingList
from dyknow.sim_uavs.boxes.winch import MagnetHoist
from dyknow.sim_uavs.depot import boxes_of, hoist_of, loader
from dyknow.sim_uavs.dynamics.scenarios import scenario
from dyknow.sim_uavs.dynamics.vehicles import SimulatedVehicle
from dyknow.sim_uavs.streets import watching

START_US = 1_700_000_000_000_000
IMAGE_US = 200_000


class Looking:
    """Hovers at `height_m` above its home; `step` flies on by 20 ms and returns what the images showed."""

    def __init__(self, seed: int, height_m: float = 15.0) -> None:
        situation = scenario("logistics", 1, seed)
        assert situation.depot is not None
        unit = situation.units[0]
        self.boxes = boxes_of(situation, seed, HandlingList())
        self.hoist: MagnetHoist = hoist_of(situation, unit, seed, self.boxes)
        self._onboard, rig = watching(situation, unit, seed, BoxesOnGround(self.boxes))
        self._frame = LocalFrame(*situation.origin)
        flown = replace(loader(unit.vehicle(1), situation.depot), airborne_m=height_m, seed=seed)
        self.vehicle = SimulatedVehicle(flown, START_US)
        self.vehicle.carry(self.hoist)
        self._perception, self._fusion = Perception(rig, "vp"), PositionFilter(100_000)
        self.now_us = START_US

    def go_to(self, x_m: float, y_m: float, height_m: float) -> None:
        place = self._frame.from_ned(y_m, x_m, -height_m)
        self.vehicle.on_command(Command(1, GoToOrder(*place)), self.now_us, self.now_us)

    def placed(self, name: str) -> Placed:
        return next(each for each in self.boxes.at(self.now_us) if each.thing.name == name)

    def step(self) -> list[ImageLook]:
        self.now_us += 20_000
        for report in self.vehicle.on_time(self.now_us, self.now_us):
            if isinstance(report, MountReport):
                self._perception.on_mount(report)
            elif isinstance(report, AttitudeReport):
                self._perception.on_attitude(report)
            for sample in self._fusion.on_report(report, self.now_us):
                if sample.value is not NO_VALUE:
                    self._perception.on_estimate(sample.valid_us, sample.value)
        looking = self.vehicle.looking(self.now_us) if self.now_us % IMAGE_US == 0 else None
        image = None if looking is None else self._onboard.image(self.now_us, *looking)
        if image is not None:
            self._perception.on_image(image)
        return self._perception.looks(self.now_us)


class SearchOutcome(NamedTuple):
    """How far from the truth the box was believed (None: it was not found), the places looked from, and the time."""

    off_m: float | None
    stops: int
    took_s: float
    is_exhausted: bool


def seen(look: ImageLook) -> list[PlacedPercept]:
    """As `vision-percepts` has them."""
    return [
        PlacedPercept(each.symbol, state.x_m, state.y_m, state.deviation_m, str(state.attributes.get("colour")))
        for each in look.percepts
        if (state := each.state) is not None
    ]


def search_for_dropped(seed: int, *, hidden: bool = False) -> SearchOutcome:
    """Drop b1 somewhere, at a height and a speed that the seed draws; the wind is not known to the UAV."""
    rng = np.random.default_rng((seed, 77))
    flown = Looking(seed)
    x, y = rng.uniform(-60.0, 60.0, 2).tolist()
    up, speed, turn = rng.uniform(2.0, 25.0), rng.uniform(0.0, 8.0), rng.uniform(0.0, 2.0 * np.pi)
    vx, vy = float(speed * np.cos(turn)), float(speed * np.sin(turn))
    flown.boxes.do(Handling(START_US, "take", "b1", "x", (0.0, 0.0, 0.0)))
    flown.boxes.do(Handling(START_US, "release", "b1", "x", (x, y, up), (vx, vy, 0.0)))
    late_s = rng.uniform(0.0, 0.4)
    noted = np.array([x + vx * late_s, y + vy * late_s]) + rng.normal(0.0, 0.4, 2)
    prior = landing(Drop(*noted.tolist(), up, vx, vy))
    if hidden:
        flown.boxes.do(Handling(START_US + 9_000_000, "take", "b1", "x", (x, y, 0.0)))
    known = [(each.place[0], each.place[1]) for each in flown.boxes.at(START_US) if each.thing.name != "b1"]
    search, stops, there = SightSearch(prior, known, "red"), 0, None
    while (place := search.waypoint) is not None and flown.now_us < START_US + 600_000_000:
        if place != there:
            flown.go_to(*place)
            there, stops = place, stops + 1
        if hidden and flown.now_us % 1_000_000 == 0:
            flown.boxes.do(Handling(flown.now_us, "carry", "b1", "x", (500.0, 500.0, 50.0)))
        for look in flown.step():
            search.on_look(look.valid_us, look.view_m, seen(look))
    took_s, off_m = (flown.now_us - START_US) / 1e6, None
    if search.found is not None:
        truth = flown.placed("b1").place
        off_m = float(np.hypot(search.found.x_m - truth[0], search.found.y_m - truth[1]))
    return SearchOutcome(off_m, stops, took_s, search.is_exhausted)
