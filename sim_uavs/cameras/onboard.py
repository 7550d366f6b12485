"""The cameras of a simulated UAV in flight: their detections in the images of the instant, 25 times a second. Pure."""

from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np
from numpy.random import Generator

from dyknow.navigation.cameras.pinhole import Attitude, CameraPose, FloatArray, PanTilt
from dyknow.navigation.vehicle import ImageDetection, ImageReport
from dyknow.sim_uavs.cameras.detectors import CameraModel, Obstacle, Visible, detect


class Scene(Protocol):
    """The objects on the ground."""

    def at(self, now_us: int) -> Sequence[Visible] | None:
        """At a time (federation time); None: it is not known yet."""


class OnboardCameras:
    """Cameras on one mount.

    Args:
        scene: the objects on the ground.
        offset_m: (3,), the vehicle's home from the origin of the scene, NED.
        obstacles: the obstacles in front of them.
    """

    def __init__(
        self,
        scene: Scene,
        cameras: Mapping[str, CameraModel],
        offset_m: FloatArray,
        rng: Generator,
        obstacles: Sequence[Obstacle] = (),
    ) -> None:
        self._scene, self._cameras, self._offset_m = scene, dict(cameras), offset_m
        self._rng, self._obstacles = rng, obstacles

    def image(self, now_us: int, position: Sequence[float], heading: Attitude, mount: PanTilt) -> ImageReport | None:
        """The detections, the vehicle being there (NED of its home); None: the scene is not known yet at that time."""
        states = self._scene.at(now_us)
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
