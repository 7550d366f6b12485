"""The cameras of a simulated UAV in flight: what their detectors find in the images of the instant, 25 times a second. Pure."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.random import Generator

from navigation.cameras.pinhole import Attitude, CameraPose, FloatArray, PanTilt
from navigation.vehicle import ImageDetection, ImageReport
from sim_uavs.cameras.detectors import CameraModel, Obstacle, detect
from sim_uavs.roads.shared import SharedTraffic


class OnboardCameras:
    """Cameras on one mount.

    Args:
        offset_m: (3,), the vehicle's home from the origin of the roads, NED.
        obstacles: what hides cars.
    """

    def __init__(
        self,
        traffic: SharedTraffic,
        cameras: Mapping[str, CameraModel],
        offset_m: FloatArray,
        rng: Generator,
        obstacles: Sequence[Obstacle] = (),
    ) -> None:
        self._traffic, self._cameras, self._offset_m = traffic, dict(cameras), offset_m
        self._rng, self._obstacles = rng, obstacles

    def image(self, now_us: int, position: Sequence[float], heading: Attitude, mount: PanTilt) -> ImageReport | None:
        """What is found, the vehicle being there (NED of its home); None: there is no traffic yet at that time."""
        states = self._traffic.at(now_us)
        if states is None:
            return None
        pose = CameraPose(now_us, np.array(position) + self._offset_m, heading, mount)
        found = (
            detection
            for name, camera in self._cameras.items()
            for detection in detect(name, camera, pose, states, self._obstacles, self._rng)
        )
        return ImageReport(
            now_us, tuple(ImageDetection(each.channel, *each.pixel, tuple(each.attributes.items())) for each in found)
        )
