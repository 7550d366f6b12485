"""Scenarios with boxes: the winch and the cameras of their vehicles, and the list of handlings that their processes share."""

from dataclasses import replace
from pathlib import Path
from typing import Final

from dyknow.model.errors import WrongCall
from dyknow.navigation.cameras.rig import CameraRig
from dyknow.navigation.geodesy import LocalFrame
from dyknow.runtime.configuration.run_directory import HANDLINGS_FILE
from dyknow.sim_uavs.bodies import OnField, bodies_of
from dyknow.sim_uavs.boxes.bodies import Air
from dyknow.sim_uavs.boxes.handled import BoxWorld
from dyknow.sim_uavs.boxes.shared import BoxesOnGround, HandlingFile, HandlingList, HandlingLog, SharedBoxes
from dyknow.sim_uavs.boxes.winch import MagnetHoist
from dyknow.sim_uavs.cameras.onboard import OnboardCameras, Scene
from dyknow.sim_uavs.dynamics.quadcopter import AirframeLimits
from dyknow.sim_uavs.dynamics.scenarios import Depot, Scenario, Unit
from dyknow.sim_uavs.dynamics.settings import VehicleConfig
from dyknow.sim_uavs.streets import watching

LOADER: Final = AirframeLimits(mass_kg=8.0, hover_w=900.0, capacity_wh=450.0)
"""An airframe that lifts a carrier with four boxes."""


def loader(flown: VehicleConfig, depot: Depot) -> VehicleConfig:
    """A vehicle that can carry, in the wind of its scenario, with a camera on a mount."""
    return replace(flown, limits=LOADER, wind=depot.wind, has_mount=True)


def boxes_of(situation: Scenario, seed: int, log: HandlingLog) -> SharedBoxes:
    """The boxes and carriers of a scenario; raises WrongCall if it has none."""
    depot = situation.depot
    if depot is None:
        raise WrongCall(f"the scenario {situation.name} has no boxes; logistics has")
    air = Air(depot.wind.east_m_s, depot.wind.north_m_s)
    return SharedBoxes(BoxWorld(depot.things, seed, air), log)


def hoist_of(situation: Scenario, unit: Unit, seed: int, boxes: SharedBoxes) -> MagnetHoist:
    """The winch of a vehicle."""
    north_m, east_m, _ = LocalFrame(*situation.origin).to_ned(*unit.home)
    return MagnetHoist(str(unit.number), boxes, (east_m, north_m), seed + unit.number)


def scene_of(situation: Scenario, seed: int, boxes: SharedBoxes) -> Scene:
    """The objects for cameras: boxes, and the bodies on the field of the scenario, if it has one."""
    ground = BoxesOnGround(boxes)
    return ground if situation.field is None else OnField(bodies_of(situation.field, seed), ground)


def at_work(
    situation: Scenario, unit: Unit, seed: int, near: Path | None
) -> tuple[OnboardCameras, CameraRig, MagnetHoist]:
    """The equipment of a vehicle; handlings are shared with all processes whose sockets for hosts are next to `near`.

    Raises:
        OSError: their file cannot be written.
    """
    log = HandlingList() if near is None else HandlingFile(near.parent / HANDLINGS_FILE)
    boxes = boxes_of(situation, seed, log)
    onboard, rig = watching(situation, unit, seed, scene_of(situation, seed, boxes))
    return onboard, rig, hoist_of(situation, unit, seed, boxes)
