"""A UAV that hovers over simulated roads: images at 25 Hz, percepts, links, and a mount that something turns."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.random import Generator

from bench.linkage.scores import Shown, Track
from dyknow.anchoring.attention.deciding import Attention, Gaze
from dyknow.anchoring.attention.ground import along
from dyknow.anchoring.attention.view import TurnableCamera, TurnLimits
from dyknow.anchoring.attention.watched import watched
from dyknow.anchoring.links.structures import ObjectLinkage
from dyknow.anchoring.ready import WORLD, ready_specification
from dyknow.anchoring.roads.network import RoadNetwork
from dyknow.navigation.cameras.pinhole import Attitude, CameraPose
from dyknow.navigation.fusion import Estimate
from dyknow.navigation.geodesy import LocalFrame
from dyknow.navigation.vehicle import AttitudeReport
from dyknow.sim_uavs.autopilot.server import IMAGE_US
from dyknow.sim_uavs.cameras.detectors import COLOUR_CAMERA, Obstacle, in_view
from dyknow.sim_uavs.cameras.mount import MountLimits
from dyknow.sim_uavs.cameras.payload import CameraPayload
from dyknow.sim_uavs.roads.drivers import Driver, RoadState
from dyknow.sim_uavs.roads.layouts import RoadsJson, network_of
from dyknow.sim_uavs.roads.traffic import SimulatedTraffic

FRAME = LocalFrame(58.4, 15.6, 0.0)
DECIDES_US, SCORED_US = 200_000, 100_000
_POSITION_SD_M, _HEIGHT_SD_M, _LEAN_SD_RAD, _YAW_SD_RAD, _WIND_RAD = 0.3, 0.4, 0.004, 0.015, 0.03


class WatchedScene(NamedTuple):
    """Roads, cars, what hides them, and where the vehicle hovers: metres east, north and up."""

    roads: RoadsJson
    drivers: tuple[Driver, ...]
    obstacles: tuple[Obstacle, ...]
    at_m: tuple[float, float, float]
    lasts_us: int = 60_000_000


class Instant(NamedTuple):
    """What is the case, which cars the camera can see, what is known of them, and where it looks."""

    now_us: int
    truth: tuple[RoadState, ...]
    visible: frozenset[str]
    track: Track
    look: Gaze | None


class Hover:
    """One flight over one scene; `aim` is called before each image."""

    def __init__(self, scene: WatchedScene, seed: int) -> None:
        traffic_rng, self._rng = np.random.default_rng((seed, 31)).spawn(2)
        self.network = network_of(scene.roads)
        self.specifications = ready_specification(self.network)
        self.linkage = ObjectLinkage(self.specifications)
        self.payload = CameraPayload(FRAME, self._rng, obstacles=scene.obstacles)
        self._traffic = SimulatedTraffic(self.network, scene.drivers, traffic_rng)
        self._scene = scene
        east_m, north_m, up_m = scene.at_m
        self._place = np.array([north_m, east_m, -up_m])
        self._error = self._rng.normal(0.0, (_POSITION_SD_M, _POSITION_SD_M, _HEIGHT_SD_M))
        self._yaw_error = float(self._rng.normal(0.0, _YAW_SD_RAD))

    def fly(self, aim: "Aim") -> list[Instant]:
        """All instants at which the run is scored."""
        instants = []
        for now_us in range(0, self._scene.lasts_us, IMAGE_US):
            self._traffic.advance(now_us)
            attitude = self._lean(now_us)
            look = aim(now_us, self)
            states = self._traffic.states()
            percepts = self.payload.see(now_us, self._place, attitude, states)
            if percepts:
                self.linkage.on_percepts(now_us, percepts)
            else:
                self.linkage.on_time(now_us)
            if now_us % SCORED_US == 0:
                instants.append(
                    Instant(now_us, tuple(states), self._visible(now_us, attitude, states), self._track(), look)
                )
        return instants

    def _lean(self, now_us: int) -> Attitude:
        """The true attitude. The platform gets it with a small error."""
        roll_rad, pitch_rad = self._rng.normal(0.0, _WIND_RAD, 2).tolist()
        attitude = Attitude(roll_rad, pitch_rad, 0.5)
        variance = (_POSITION_SD_M**2, _POSITION_SD_M**2, _HEIGHT_SD_M**2, 0.01, 0.01, 0.01)
        estimate = Estimate(*FRAME.from_ned(*(self._place + self._error)), 0.0, 0.0, 0.0, *variance)
        self.payload.estimator.on_estimate(now_us, estimate)
        roll, pitch = np.add(attitude[:2], self._rng.normal(0.0, _LEAN_SD_RAD, 2)).tolist()
        report = AttitudeReport(now_us, "imu", roll, pitch, attitude.yaw_rad + self._yaw_error)
        self.payload.estimator.on_attitude(report)
        return attitude

    def _visible(self, now_us: int, attitude: Attitude, states: Sequence[RoadState]) -> frozenset[str]:
        pose = CameraPose(now_us, self._place, attitude, self.payload.mount.angles)
        seen = in_view(COLOUR_CAMERA.intrinsics, pose, states, self._scene.obstacles)
        return frozenset(state.name for state, _, _ in seen)

    def _track(self) -> Track:
        return {
            symbol: Shown(one.state.x_m, one.state.y_m, self.linkage.anchored(symbol))
            for symbol, one in self.linkage.objects(WORLD).items()
        }


Aim = Callable[[int, Hover], Gaze | None]


def looks_down(_now_us: int, _hover: Hover) -> Gaze | None:
    """The mount stays as it is at first."""
    return None


class LooksAttentively:
    """Attention, five times a second, with what the platform knows."""

    def __init__(self, network: RoadNetwork) -> None:
        self._attention = Attention(along(network.links.values()))
        limits = MountLimits()
        self._limits = TurnLimits(limits.least_tilt_rad, limits.most_tilt_rad, limits.rate_rad_s)

    def __call__(self, now_us: int, hover: Hover) -> Gaze | None:
        payload = hover.payload
        state = payload.estimator.at(now_us)
        if now_us % DECIDES_US == 0 and state is not None:
            camera = TurnableCamera(COLOUR_CAMERA.intrinsics, state.pose, self._limits)
            objects = list(watched(hover.linkage, hover.specifications))
            look = self._attention.decide(now_us, camera, objects)
            if look is not None:
                payload.mount.look_at(look.y_m, look.x_m)
        return self._attention.looks


def rng_of(seed: int) -> Generator:
    """The generator of the drivers of a scene."""
    return np.random.default_rng((seed, 32))
