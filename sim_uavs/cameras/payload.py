"""The cameras of one UAV: mount, detectors, camera state, fusion and tracker; images at 25 Hz in, percepts out.

The truth (where the vehicle and the cars really are) makes the images. The processing of images knows only the
platform's fused position, its attitude and the angles that the mount reports. Pure; time is an argument.
"""

from collections.abc import Sequence

from numpy.random import Generator

from dyknow.anchoring.links.structures import Percept
from dyknow.anchoring.percepts.tracking import PerceptTracker
from dyknow.navigation.cameras.channels import Detection, GroundDetection, fused, located
from dyknow.navigation.cameras.geolocation import PoseErrors
from dyknow.navigation.cameras.ground import FlatGround, GroundModel
from dyknow.navigation.cameras.pinhole import Attitude, CameraPose, FloatArray
from dyknow.navigation.cameras.state import CameraState, CameraStateEstimator
from dyknow.navigation.geodesy import LocalFrame
from dyknow.sim_uavs.cameras.detectors import (
    COLOUR,
    COLOUR_CAMERA,
    THERMAL,
    THERMAL_CAMERA,
    CameraModel,
    Obstacle,
    detect,
)
from dyknow.sim_uavs.cameras.mount import Mount, MountLimits
from dyknow.sim_uavs.roads.drivers import RoadState


class CameraPayload:
    """Both cameras of one vehicle. Its estimator takes what the platform knows; `see` what is the case.

    Args:
        frame: of north, east, down; percepts are metres east and north of its origin.
        obstacles: the obstacles that hide vehicles.
        ground: the platform's model of the ground; the truth is level, at `down_m` = 0.
    """

    def __init__(
        self,
        frame: LocalFrame,
        rng: Generator,
        *,
        obstacles: Sequence[Obstacle] = (),
        ground: GroundModel | None = None,
        limits: MountLimits | None = None,
        tracker: PerceptTracker | None = None,
    ) -> None:
        self._cameras: dict[str, CameraModel] = {COLOUR: COLOUR_CAMERA, THERMAL: THERMAL_CAMERA}
        self._intrinsics = {name: camera.intrinsics for name, camera in self._cameras.items()}
        self._rng, self._obstacles = rng, obstacles
        self._ground = FlatGround() if ground is None else ground
        self.mount = Mount(MountLimits() if limits is None else limits, rng)
        self.estimator = CameraStateEstimator(frame, errors=PoseErrors())
        self._tracker = PerceptTracker() if tracker is None else tracker
        self._now_us: int | None = None

    def see(
        self, now_us: int, position_m: FloatArray, attitude: Attitude, states: Sequence[RoadState]
    ) -> list[Percept]:
        """Take an image with each camera, the vehicle really being at (3,) NED; the percepts that are due.

        Without a camera state for that time nothing is found.
        """
        known = self.estimator.at(now_us)
        seconds = 0.0 if self._now_us is None else (now_us - self._now_us) / 1e6
        self._now_us = now_us
        believed = (attitude, position_m) if known is None else (known.pose.attitude, known.pose.position_m)
        self.mount.advance(seconds, *believed)
        self.estimator.on_mount(now_us, self.mount.reported())
        state = self.estimator.at(now_us)
        if state is None:
            return []
        truth = CameraPose(now_us, position_m, attitude, self.mount.angles)
        return self._tracker.on_detections(now_us, self._fused(state, truth, states))

    def _fused(self, state: CameraState, truth: CameraPose, states: Sequence[RoadState]) -> list[GroundDetection]:
        by_channel = [
            located(self._detected(name, truth, states), self._intrinsics, state, self._ground)
            for name in self._cameras
        ]
        colour, thermal = by_channel
        return fused(colour, thermal)

    def _detected(self, name: str, truth: CameraPose, states: Sequence[RoadState]) -> list[Detection]:
        return detect(name, self._cameras[name], truth, states, self._obstacles, self._rng)
