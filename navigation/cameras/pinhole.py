"""A pinhole camera on a pan-tilt mount of a vehicle: from pixels to rays and back.

Frames are right-handed: NED; body (forward, right, down), turned from NED by yaw, then pitch, then roll; camera (right, down,
ahead). With the mount at rest the camera looks forward with its lines level; pan turns it to the right about the body's down
axis, then tilt downwards about its own right axis.
"""

from math import asin, atan2, cos, hypot, sin, tan
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dyknow.model.errors import WrongCall

FloatArray: TypeAlias = NDArray[np.float64]

_CAMERA_TO_MOUNT = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""From (right, down, ahead) of a camera at rest to body axes."""


class Pixel(NamedTuple):
    """From the left and from the top of the image, pixels."""

    u_px: float
    v_px: float


class Intrinsics(NamedTuple):
    """Of a camera without distortion: (u, v) = centre + focal (x / z, y / z); square pixels."""

    width_px: int
    height_px: int
    focal_px: float

    @classmethod
    def of_view(cls, width_px: int, height_px: int, across_rad: float) -> "Intrinsics":
        """With this horizontal angle of view.

        Raises:
            WrongCall: the angle is not between 0 and pi, or the image has no pixels.
        """
        if width_px < 1 or height_px < 1 or not 0.0 < across_rad < np.pi:
            raise WrongCall(
                f"a camera of {width_px} x {height_px} pixels that sees {across_rad} rad across is impossible; "
                "give at least one pixel and an angle between 0 and pi"
            )
        return cls(width_px, height_px, width_px / 2.0 / tan(across_rad / 2.0))

    def ray(self, pixel: Pixel) -> FloatArray:
        """(3,), the direction that a pixel sees, in the camera's frame, one metre ahead."""
        u, v = pixel.u_px - self.width_px / 2.0, pixel.v_px - self.height_px / 2.0
        return np.array([u / self.focal_px, v / self.focal_px, 1.0])

    def pixel(self, direction: FloatArray) -> Pixel | None:
        """Where something in this direction (camera frame) is in the image; None: behind, or outside of the image."""
        right, down, ahead = direction.tolist()
        if ahead <= 1e-9:
            return None
        u = self.width_px / 2.0 + self.focal_px * right / ahead
        v = self.height_px / 2.0 + self.focal_px * down / ahead
        return Pixel(u, v) if 0.0 <= u <= self.width_px and 0.0 <= v <= self.height_px else None


class Attitude(NamedTuple):
    """Of the body relative to NED, rad."""

    roll_rad: float
    pitch_rad: float
    yaw_rad: float

    def rotation(self) -> FloatArray:
        """(3, 3), from body to NED."""
        cr, sr = cos(self.roll_rad), sin(self.roll_rad)
        cp, sp = cos(self.pitch_rad), sin(self.pitch_rad)
        cy, sy = cos(self.yaw_rad), sin(self.yaw_rad)
        return np.array(
            [
                [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
                [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
                [-sp, cp * sr, cp * cr],
            ]
        )


class PanTilt(NamedTuple):
    """Angles of the mount: to the right of the body's nose, and down from its level, rad."""

    pan_rad: float = 0.0
    tilt_rad: float = 0.0

    def rotation(self) -> FloatArray:
        """(3, 3), from the camera's frame to the body's."""
        cp, sp, ct, st = cos(self.pan_rad), sin(self.pan_rad), cos(self.tilt_rad), sin(self.tilt_rad)
        panned = np.array([[cp, -sp, 0.0], [sp, cp, 0.0], [0.0, 0.0, 1.0]])
        tilted = np.array([[ct, 0.0, -st], [0.0, 1.0, 0.0], [st, 0.0, ct]])
        turned: FloatArray = panned @ tilted @ _CAMERA_TO_MOUNT
        return turned


class CameraPose(NamedTuple):
    """Where a camera is and where it looks: (3,) NED metres of its centre; how the vehicle and the mount stand.

    Attributes:
        valid_us: valid time.
        position_m: of the camera's centre.
    """

    valid_us: int
    position_m: FloatArray
    attitude: Attitude
    mount: PanTilt

    def rotation(self) -> FloatArray:
        """(3, 3), from the camera's frame to NED."""
        turned: FloatArray = self.attitude.rotation() @ self.mount.rotation()
        return turned

    def direction(self, camera: Intrinsics, pixel: Pixel) -> FloatArray:
        """(3,), the direction that a pixel sees, in NED."""
        seen: FloatArray = self.rotation() @ camera.ray(pixel)
        return seen

    def pixel(self, camera: Intrinsics, place_m: FloatArray) -> Pixel | None:
        """Where a place (3,), NED, is in the image; None: it is not."""
        return camera.pixel(self.rotation().T @ (place_m - self.position_m))


def aimed(attitude: Attitude, from_m: FloatArray, at_m: FloatArray) -> PanTilt:
    """The angles of the mount with which the camera looks from one place at another, both (3,) NED."""
    forward, right, down = (attitude.rotation().T @ (at_m - from_m)).tolist()
    reach = hypot(forward, right, down)
    return PanTilt(atan2(right, forward), asin(down / reach) if reach else 0.0)
