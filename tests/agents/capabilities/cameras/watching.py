"""A platform over streets, stepped by hand: its vehicle reports what it senses, its cameras what their detectors find."""

from dataclasses import replace
from typing import Any

from dyknow import Label, Policy, Sample
from dyknow.agents.config import PlatformConfig
from dyknow.agents.effects import Effect, Reported, Specify
from dyknow.agents.platform import Platform
from dyknow.navigation.vehicle import Command, Order
from dyknow.sim_uavs.dynamics.scenarios import scenario
from dyknow.sim_uavs.dynamics.vehicles import SimulatedVehicle
from dyknow.sim_uavs.roads.drivers import RoadState
from dyknow.sim_uavs.roads.shared import ROUND_US
from dyknow.sim_uavs.streets import carried_over, traffic_of

IMAGE_US, START_US = 40_000, 2_833_333 * ROUND_US
"""A round of traffic begins."""


class Watching:
    """One platform of the scenario `traffic`.

    Attributes:
        samples: of the streams that are looked at, by label.
        truth: the cars, by the time of each image.
    """

    def __init__(self, seed: int = 1, index: int = 0, **config: Any) -> None:
        situation = scenario("traffic", 2, seed)
        unit = situation.units[index]
        self.onboard, rig = carried_over(situation, unit, seed)
        self._traffic = traffic_of(situation, seed)
        flown = unit.vehicle(1, airborne=True)
        self.vehicle = SimulatedVehicle(replace(flown, has_mount=True), START_US)
        self.platform = Platform(PlatformConfig("0", 1, cameras=rig, **config), START_US)
        self.platform.start(START_US)
        self.now_us = START_US
        self.samples: dict[str, list[Sample]] = {}
        self.truth: dict[int, list[RoadState]] = {}
        self.effects: list[Effect] = []

    @classmethod
    def without_cameras(cls) -> Platform:
        return Platform(PlatformConfig("0", 1), START_US)

    def look_at(self, *labels: str) -> None:
        for label in labels:
            taken = self.samples.setdefault(label, [])
            self.platform.ports.network.connect(Label.parse(label), Policy(), taken.append)

    def specify(self, event: Specify) -> None:
        self.effects += self.platform.on_event(event, self.now_us)

    def order(self, order: Order) -> None:
        self.vehicle.on_command(Command(1, order), self.now_us, self.now_us)

    def run(self, seconds: float, *, sees: bool = True) -> None:
        end_us = self.now_us + round(seconds * 1e6)
        while self.now_us < end_us:
            self.now_us += 20_000
            for report in self.vehicle.on_time(self.now_us, self.now_us):
                self.report(report)
            if sees and self.now_us % IMAGE_US == 0:
                self._image()
            if self.platform.deadline_us <= self.now_us:
                self.effects += self.platform.on_time(self.now_us)

    def _image(self) -> None:
        self.truth[self.now_us] = self._traffic.at(self.now_us) or []
        seen = self.vehicle.looking(self.now_us)
        image = None if seen is None else self.onboard.image(self.now_us, *seen)
        if image is not None:
            self.report(image)

    def report(self, report: Any) -> None:
        self.effects += self.platform.on_event(Reported(self.now_us, report), self.now_us)
