"""A UAV that hovers over simulated roads and looks down with its cameras."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from dyknow.anchoring.links.structures import Percept
from dyknow.navigation.cameras.pinhole import Attitude
from dyknow.navigation.fusion import Estimate
from dyknow.navigation.geodesy import LocalFrame
from dyknow.navigation.vehicle import AttitudeReport
from dyknow.sim_uavs.autopilot.server import IMAGE_US
from dyknow.sim_uavs.cameras.detectors import Obstacle
from dyknow.sim_uavs.cameras.payload import CameraPayload
from dyknow.sim_uavs.roads.drivers import Driver, RoadState
from dyknow.sim_uavs.roads.layouts import RoadsJson, network_of
from dyknow.sim_uavs.roads.traffic import SimulatedTraffic

FRAME = LocalFrame(58.4, 15.6, 0.0)
POSITION_SD_M, HEIGHT_SD_M, LEAN_SD_RAD, YAW_SD_RAD = 0.3, 0.4, 0.004, 0.015


class Image(NamedTuple):
    now_us: int
    truth: list[RoadState]
    percepts: list[Percept]


def hover(
    roads: RoadsJson,
    drivers: Sequence[Driver],
    seconds: float,
    *,
    at_m: tuple[float, float, float] = (0.0, 0.0, -50.0),
    seed: int = 1,
    obstacles: Sequence[Obstacle] = (),
    aim: Callable[[CameraPayload, list[RoadState]], None] = lambda payload, states: None,
    from_us: int = 0,
) -> list[Image]:
    """Images of a vehicle that hovers in light wind, with errors of its fused position that wander slowly."""
    rng = np.random.default_rng(seed)
    traffic = SimulatedTraffic(network_of(roads), drivers, rng)
    payload = CameraPayload(FRAME, rng, obstacles=obstacles)
    place = np.array(at_m)
    error = rng.normal(0.0, (POSITION_SD_M, POSITION_SD_M, HEIGHT_SD_M))
    yaw_error = rng.normal(0.0, YAW_SD_RAD)
    images = []
    for now_us in range(from_us, from_us + round(seconds * 1e6), IMAGE_US):
        traffic.advance(now_us)
        attitude = Attitude(*rng.normal(0.0, 0.03, 2), 0.5)
        estimate = Estimate(
            *FRAME.from_ned(*(place + error)), 0.0, 0.0, 0.0,
            POSITION_SD_M**2, POSITION_SD_M**2, HEIGHT_SD_M**2, 0.01, 0.01, 0.01,
        )  # fmt: skip
        payload.estimator.on_estimate(now_us, estimate)
        leans = np.add(attitude[:2], rng.normal(0.0, LEAN_SD_RAD, 2)).tolist()
        payload.estimator.on_attitude(AttitudeReport(now_us, "imu", *leans, attitude.yaw_rad + yaw_error))
        states = traffic.states()
        aim(payload, states)
        images.append(Image(now_us, states, payload.see(now_us, place, attitude, states)))
    return images
