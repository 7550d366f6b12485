"""A camera on a mount that can be turned: its view from the present position, and the time it takes to turn there."""

from collections.abc import Sequence
from math import pi, radians
from typing import NamedTuple

import numpy as np

from dyknow.navigation.cameras.pinhole import CameraPose, FloatArray, Intrinsics, PanTilt, aimed


class TurnLimits(NamedTuple):
    """How far a mount turns down, and how fast both ways."""

    least_tilt_rad: float = radians(-10.0)
    most_tilt_rad: float = radians(90.0)
    rate_rad_s: float = radians(90.0)


class TurnableCamera(NamedTuple):
    """A camera, where it is and looks now, and how its mount turns.

    Attributes:
        reach_m: farther away a detector finds too little.
        ground_m: of places on the ground, metres down in the frame of the pose.
    """

    intrinsics: Intrinsics
    pose: CameraPose
    limits: TurnLimits = TurnLimits()
    reach_m: float = 250.0
    ground_m: float = 0.0

    def aim(self, x_m: float, y_m: float) -> PanTilt:
        """The angles that look at a place on the ground, as far as the mount turns; no place closer than 0.5 m below."""
        at = np.array([y_m, x_m, max(self.ground_m, float(self.pose.position_m[2]) + 0.5)])
        pan, tilt = aimed(self.pose.attitude, self.pose.position_m, at)
        return PanTilt(pan, min(max(tilt, self.limits.least_tilt_rad), self.limits.most_tilt_rad))

    def turns_s(self, angles: PanTilt) -> float:
        """How long the mount takes to turn there, both axes at once."""
        now = self.pose.mount
        pan = abs((angles.pan_rad - now.pan_rad + pi) % (2.0 * pi) - pi)
        return max(pan, abs(angles.tilt_rad - now.tilt_rad)) / self.limits.rate_rad_s

    def sees(self, angles: Sequence[PanTilt], x_m: FloatArray, y_m: FloatArray, *, margin: float = 1.0) -> FloatArray:
        """(M, N) of 0 or 1: which places, (N,) or (M, N), are in the image at which angles; `margin` of its size counts."""
        position, attitude = self.pose.position_m, self.pose.attitude.rotation()
        turned = np.array([attitude @ each.rotation() for each in angles]).reshape(-1, 3, 3)
        x_m, y_m = (np.broadcast_to(np.atleast_2d(each), (len(angles), np.shape(each)[-1])) for each in (x_m, y_m))
        rays = np.stack([y_m - position[0], x_m - position[1], np.full_like(x_m, self.ground_m - position[2])], axis=2)
        right, down, ahead = np.moveaxis(rays @ turned, 2, 0)
        width, height = (margin * size / 2.0 / self.intrinsics.focal_px for size in self.intrinsics[:2])
        inside = (ahead > 0.0) & (np.abs(right) <= width * ahead) & (np.abs(down) <= height * ahead)
        near = (rays * rays).sum(axis=2) <= self.reach_m**2
        seen: FloatArray = (inside & near).astype(np.float64)
        return seen
