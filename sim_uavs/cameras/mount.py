"""The mount of a camera: how it turns, and the angles that it reports. Pure; time and the generator are arguments."""

from math import pi, radians
from typing import NamedTuple

import numpy as np
from numpy.random import Generator

from dyknow.navigation.cameras.pinhole import Attitude, FloatArray, PanTilt, aimed

DOWN = PanTilt(0.0, pi / 2.0)


class MountLimits(NamedTuple):
    """How far and how fast a mount turns, and how wrong the angles are that it reports (standard deviation)."""

    least_tilt_rad: float = radians(-10.0)
    most_tilt_rad: float = radians(90.0)
    rate_rad_s: float = radians(90.0)
    error_rad: float = 0.003


class Mount:
    """A pan-tilt mount that turns towards angles, or keeps looking at a place while the vehicle moves.

    Angles are in the axes of the attitude that `advance` is given: those of the body or, for a mount that keeps the
    camera level, those of its heading.
    """

    def __init__(self, limits: MountLimits, rng: Generator) -> None:
        self.angles = DOWN
        self._limits, self._rng = limits, rng
        self._wanted: PanTilt | FloatArray = DOWN

    def turn(self, angles: PanTilt) -> None:
        """Turn to these angles and stay."""
        self._wanted = angles

    def look_at(self, north_m: float, east_m: float, down_m: float = 0.0) -> None:
        """Keep looking at a place."""
        self._wanted = np.array([north_m, east_m, down_m])

    def advance(self, seconds: float, attitude: Attitude, position_m: FloatArray) -> None:
        """Turn as far as the time allows, with the vehicle believed to be there."""
        limits, wanted = self._limits, self._wanted
        pan, tilt = wanted if isinstance(wanted, PanTilt) else aimed(attitude, position_m, wanted)
        tilt = min(max(tilt, limits.least_tilt_rad), limits.most_tilt_rad)
        most = limits.rate_rad_s * seconds
        aside = (pan - self.angles.pan_rad + pi) % (2.0 * pi) - pi
        self.angles = PanTilt(
            self.angles.pan_rad + min(max(aside, -most), most),
            self.angles.tilt_rad + min(max(tilt - self.angles.tilt_rad, -most), most),
        )

    def reported(self) -> PanTilt:
        pan, tilt = self._rng.normal(self.angles, self._limits.error_rad).tolist()
        return PanTilt(pan, tilt)
