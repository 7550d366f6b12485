"""Scenarios with streets: their roads, their cars, and the cameras of the vehicles that fly over them."""

from math import radians

import numpy as np

from dyknow.model.errors import WrongCall
from dyknow.navigation.cameras.pinhole import Intrinsics
from dyknow.navigation.cameras.rig import CameraRig
from dyknow.navigation.geodesy import LocalFrame
from dyknow.sim_uavs.cameras.detectors import COLOUR, COLOUR_CAMERA, THERMAL, THERMAL_CAMERA, Obstacle
from dyknow.sim_uavs.cameras.onboard import OnboardCameras, Scene
from dyknow.sim_uavs.dynamics.scenarios import Scenario, Unit
from dyknow.sim_uavs.roads.layouts import RoadsJson, blocks
from dyknow.sim_uavs.roads.shared import SharedTraffic

ACROSS_RAD = radians(84.0)
"""The angle of view of cameras that watch traffic from above."""
_TREES_M, _TREETOPS_M, _BRANCHES_M = 10.0, 8.0, 5.0
_IMAGES_RNG = 23  # keeps the generators of detectors apart from others of the same seed


def roads_of(situation: Scenario) -> RoadsJson:
    """The streets of a scenario, with their place on earth."""
    streets, origin = situation.streets, situation.origin
    if streets is None:
        raise WrongCall(f"the scenario {situation.name} has no streets; traffic has")
    roads = blocks(streets.across, streets.down, streets.apart_m)
    return {**roads, "origin": [origin.longitude_deg, origin.latitude_deg]}


def trees_of(situation: Scenario) -> tuple[Obstacle, ...]:
    """The trees that hide crossings of a scenario."""
    streets = situation.streets
    if streets is None:
        return ()
    middles = [(column * streets.apart_m, row * streets.apart_m) for column, row in streets.under_trees]
    return tuple(
        Obstacle(x_m - _TREES_M, y_m - _TREES_M, x_m + _TREES_M, y_m + _TREES_M, _TREETOPS_M, _BRANCHES_M)
        for x_m, y_m in middles
    )


def traffic_of(situation: Scenario, seed: int) -> SharedTraffic:
    """The cars of a scenario, the same in every process."""
    return SharedTraffic(roads_of(situation), seed, 0 if situation.streets is None else situation.streets.cars)


def carried_over(situation: Scenario, unit: Unit, seed: int) -> tuple[OnboardCameras, CameraRig]:
    """The cameras of a vehicle in a scenario with streets, and its platform's knowledge of them."""
    return watching(situation, unit, seed, traffic_of(situation, seed), trees_of(situation))


def watching(
    situation: Scenario, unit: Unit, seed: int, scene: Scene, obstacles: tuple[Obstacle, ...] = ()
) -> tuple[OnboardCameras, CameraRig]:
    """Cameras of a vehicle that watch a scene from above, and its platform's knowledge of them."""
    cameras = {
        name: camera._replace(intrinsics=Intrinsics.of_view(*camera.intrinsics[:2], ACROSS_RAD))
        for name, camera in ((COLOUR, COLOUR_CAMERA), (THERMAL, THERMAL_CAMERA))
    }
    frame = LocalFrame(*situation.origin)
    rng = np.random.default_rng((seed, unit.number, _IMAGES_RNG))
    onboard = OnboardCameras(scene, cameras, np.array(frame.to_ned(*unit.home)), rng, obstacles)
    return onboard, CameraRig({name: camera.intrinsics for name, camera in cameras.items()}, frame)
