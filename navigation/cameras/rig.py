"""A platform's constant knowledge of its vehicle's cameras."""

from collections.abc import Mapping
from dataclasses import dataclass

from dyknow.navigation.cameras.geolocation import USUAL_ERRORS, PoseErrors
from dyknow.navigation.cameras.pinhole import Intrinsics
from dyknow.navigation.geodesy import LocalFrame


@dataclass(frozen=True)
class CameraRig:
    """Cameras on one mount that keeps them level, by name.

    Attributes:
        frame: its origin is where x and y of percepts are 0, and its altitude that of the ground.
        errors: the assumed errors of pose, mount, pixels and ground.
    """

    cameras: Mapping[str, Intrinsics]
    frame: LocalFrame
    errors: PoseErrors = USUAL_ERRORS
