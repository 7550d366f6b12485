"""Platforms of the scenario `emergency` in the world in a box: they hover over the field, and see who lies there."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from dyknow.agents.capabilities.areas.scanning import Scanning
from dyknow.agents.capabilities.saliency.saliency import Saliency
from dyknow.agents.config import PlatformConfig
from dyknow.agents.places import FlightLimits
from dyknow.anchoring.saliency.map import SalientPlace
from dyknow.federation.messages.contents import DivideArea
from dyknow.federation.messages.dialogue import Dialogue
from dyknow.federation.security.trust import Trust
from dyknow.navigation.geodesy import LocalFrame, distance_m
from dyknow.navigation.vehicle import Command, Order, Report
from dyknow.sim_uavs.bodies import FieldBody, bodies_of
from dyknow.sim_uavs.boxes.shared import HandlingList
from dyknow.sim_uavs.cameras.onboard import OnboardCameras
from dyknow.sim_uavs.depot import boxes_of, hoist_of, loader, scene_of
from dyknow.sim_uavs.dynamics.scenarios import Unit, scenario
from dyknow.sim_uavs.dynamics.settings import HomePlace
from dyknow.sim_uavs.dynamics.vehicles import SimulatedVehicle
from dyknow.sim_uavs.streets import watching
from dyknow.sim_uavs.world.world import START_US, World


class Rescuer(SimulatedVehicle):
    """Reports images of its cameras, and keeps how far it flew."""

    def __init__(self, onboard: OnboardCameras, image_us: int, *given: Any) -> None:
        super().__init__(*given)
        self._onboard, self._image_us, self._period_us = onboard, 0, image_us
        self._before: tuple[float, float] | None = None
        self.flown_m = 0.0
        self.orders: list[tuple[int, Order]] = []

    def on_time(self, now_us: int, stamp_us: int) -> Sequence[Report]:
        found = list(super().on_time(now_us, stamp_us))
        if now_us < self._image_us + self._period_us:
            return found
        self._image_us = now_us
        true = self.truth(now_us)
        here = true.latitude_deg, true.longitude_deg
        self.flown_m += 0.0 if self._before is None else distance_m(*self._before, *here)
        self._before = here
        looking = self.looking(now_us)
        image = None if looking is None else self._onboard.image(stamp_us, *looking)
        return [*found, image] if image is not None else found

    def on_command(self, command: Command, now_us: int, stamp_us: int) -> Sequence[tuple[int, Report]]:
        self.orders.append((now_us, command.order))
        return super().on_command(command, now_us, stamp_us)


class Rescue:
    """`count` platforms; `over` places them in the air over the field, metres east and north; else they stand at the depot."""

    def __init__(
        self,
        seed: int = 1,
        count: int = 2,
        *,
        over: Sequence[tuple[float, float]] = (),
        image_us: int = 100_000,
        trust: Callable[[str], Trust | None] = lambda _unit: None,
        **config: Any,
    ) -> None:
        situation = scenario("emergency", count, seed)
        assert situation.depot is not None
        assert situation.field is not None
        self.field, self.frame = situation.field, LocalFrame(*situation.origin)
        self.bodies: tuple[FieldBody, ...] = bodies_of(situation.field, seed)
        self.boxes = boxes_of(situation, seed, HandlingList())
        self.world = World(seed, truth_us=None)
        self.vehicles: list[Rescuer] = []
        scene = scene_of(situation, seed, self.boxes)
        for standing in situation.units:
            unit = self._above(standing, over[standing.number]) if over else standing
            onboard, rig = watching(situation, unit, seed, scene)
            flown = loader(unit.vehicle(unit.number + 1, airborne=bool(over)), situation.depot)
            vehicle = Rescuer(onboard, image_us, replace(flown, seed=seed * 16 + unit.number), START_US)
            vehicle.carry(hoist_of(situation, unit, seed, self.boxes))
            self.vehicles.append(vehicle)
            limits = FlightLimits(2.0, 120.0, 1000.0)
            given = {
                "control": True,
                "simulated": True,
                "cameras": rig,
                "limits": limits,
                "trust": trust(str(unit.number)),
                **config,
            }
            self.world.add(str(unit.number), PlatformConfig(str(unit.number), 1, **given), vehicle)
        self.world.add_command_centre("cc", trust=trust("cc"))

    def _above(self, unit: Unit, place: tuple[float, float]) -> Unit:
        latitude_deg, longitude_deg, _ = self.frame.from_ned(place[1], place[0], 0.0)
        return unit._replace(home=HomePlace(latitude_deg, longitude_deg, unit.home.altitude_m), height_m=45.0)

    @property
    def persons(self) -> list[FieldBody]:
        return [each for each in self.bodies if each.kind == "person"]

    def part(self, unit: str) -> Saliency:
        return self.world.platform(unit).part(Saliency)

    def places(self, unit: str) -> list[SalientPlace]:
        return self.part(unit).map.places()

    def errors_m(self, unit: str) -> tuple[list[float], int]:
        """How far the persons that are on the map are from where they lie; how many places are of no person."""
        errors: dict[int, float] = {}
        wrong = 0
        for place in self.places(unit):
            away = [float(np.hypot(place.x_m - each.x_m, place.y_m - each.y_m)) for each in self.persons]
            nearest = int(np.argmin(away))
            if away[nearest] > 4.0 or nearest in errors:
                wrong += 1
            else:
                errors[nearest] = away[nearest]
        return list(errors.values()), wrong

    def corners(self) -> tuple[str, ...]:
        """Of the field, as acts have them."""
        field = self.field
        places = ((field.west_m, field.south_m), (field.east_m, field.south_m), (field.east_m, field.north_m), (field.west_m, field.north_m))  # fmt: skip
        found = (self.frame.from_ned(y_m, x_m, 0.0) for x_m, y_m in places)
        return tuple(f"{latitude_deg:.7f} {longitude_deg:.7f}" for latitude_deg, longitude_deg, _ in found)

    def scan(self, height_m: float = 45.0, to: str = "0") -> Dialogue:
        """Delegate the scan of the field to one platform, which divides it."""
        return self.world.ask("cc", to, DivideArea(area=self.corners(), sensor="camera-view", scan_m=height_m))

    def until_scanned(self, units: Sequence[str] = ("0", "1"), within_s: int = 600, step_s: float = 2.0) -> float:
        """Run until all have ended their scans; seconds since now."""
        begin_us = self.world.now_us
        while (self.world.now_us - begin_us) / 1e6 < within_s:
            self.world.run_for(step_s)
            scans = [self.world.platform(unit).part(Scanning).scan for unit in units]
            if all(scan is not None and scan.is_over for scan in scans):
                break
        return (self.world.now_us - begin_us) / 1e6

    def east_m(self, number: int) -> float:
        """Where a vehicle really is."""
        truth = self.vehicles[number].truth(self.world.now_us)
        return float(self.frame.to_ned(truth.latitude_deg, truth.longitude_deg, truth.altitude_m)[1])

    def notes(self, unit: str) -> list[str]:
        return self.world.nodes[unit].notes
