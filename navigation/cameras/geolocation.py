"""From a pixel to a place on the ground, with the covariance that the errors of pose, mount, pixel and ground bring.

To first order: the ray c + s d meets the ground with normal n; with errors dc of the camera's place, dd of the direction and
dh of the ground's height the place moves by A (dc + s dd) + d (n_d / n.d) dh, A = I - d n' / n.d. An error of an angle
about an axis a turns the direction, dd = a x d: yaw about down, pitch about the levelled right, roll about forward; pan
about the body's down, tilt about the camera's right axis. An error of a pixel moves the direction along the camera's right
or down axis, by the error over the focal length.
All errors are independent.
"""

from math import cos, sin
from typing import NamedTuple

import numpy as np

from dyknow.navigation.cameras.ground import GroundModel, Hit
from dyknow.navigation.cameras.pinhole import CameraPose, FloatArray, Intrinsics, Pixel


class PoseErrors(NamedTuple):
    """Standard deviations: metres, radians, pixels. The defaults are those of a small vehicle with a fused position.

    Attributes:
        level_m, vertical_m: of the camera's place.
        lean_rad: of roll and of pitch.
        yaw_rad: of the heading.
        mount_rad: of pan and of tilt.
        pixel_px: of the place in the image, on each axis.
        ground_m: of the height of the ground.
    """

    level_m: float = 0.4
    vertical_m: float = 0.6
    lean_rad: float = 0.006
    yaw_rad: float = 0.02
    mount_rad: float = 0.004
    pixel_px: float = 1.5
    ground_m: float = 0.3


USUAL_ERRORS = PoseErrors()


class GroundPoint(NamedTuple):
    """A place on the ground that was seen.

    Attributes:
        covariance: (2, 2), of north and east, m^2.
        range_m: from the camera.
    """

    north_m: float
    east_m: float
    down_m: float
    covariance: FloatArray
    range_m: float


def geolocate(
    camera: Intrinsics, pose: CameraPose, pixel: Pixel, ground: GroundModel, errors: PoseErrors = USUAL_ERRORS
) -> GroundPoint | None:
    """Where on the ground a pixel looks, and how certain that is; None: the ray does not meet the ground."""
    rotation = pose.rotation()
    direction: FloatArray = rotation @ camera.ray(pixel)
    hit = ground.meet(pose.position_m, direction)
    if hit is None:
        return None
    covariance = _covariance(camera, pose, rotation, direction, hit, errors)
    north, east, down = hit.place_m.tolist()
    return GroundPoint(north, east, down, covariance, hit.reach * float(np.linalg.norm(direction)))


def _covariance(
    camera: Intrinsics, pose: CameraPose, rotation: FloatArray, direction: FloatArray, hit: Hit, errors: PoseErrors
) -> FloatArray:
    """(2, 2), of north and east."""
    meets = float(hit.normal @ direction)
    slides = np.eye(3) - np.outer(direction, hit.normal) / meets
    turns = hit.reach * slides
    body = pose.attitude.rotation()
    yaw = pose.attitude.yaw_rad
    axes = (
        (body[:, 0], errors.lean_rad),
        (np.array([-sin(yaw), cos(yaw), 0.0]), errors.lean_rad),
        (np.array([0.0, 0.0, 1.0]), errors.yaw_rad),
        (body[:, 2], errors.mount_rad),
        (rotation[:, 0], errors.mount_rad),
    )
    moves = [
        *(slides[:, axis] * sd for axis, sd in enumerate((errors.level_m, errors.level_m, errors.vertical_m))),
        *(turns @ np.cross(axis, direction) * sd for axis, sd in axes),
        *(turns @ rotation[:, axis] * (errors.pixel_px / camera.focal_px) for axis in (0, 1)),
        direction * (hit.normal[2] / meets) * errors.ground_m,
    ]
    level = np.array(moves)[:, :2]
    covariance: FloatArray = level.T @ level
    return covariance
