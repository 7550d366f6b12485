"""The state of a camera as a knowledge process: from the platform's fused position, its attitude and the mount's angles.

Values at the time of an image are interpolated between those before and after it, or predicted a little: positions by
their velocity, angles by their last turn rate. Pure; time is an argument.
"""

from collections import deque
from collections.abc import Iterator, Sequence
from math import pi
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from dyknow import US_PER_S
from dyknow.navigation.cameras.geolocation import USUAL_ERRORS, PoseErrors
from dyknow.navigation.cameras.pinhole import Attitude, CameraPose, FloatArray, PanTilt
from dyknow.navigation.fusion import Estimate
from dyknow.navigation.geodesy import LocalFrame
from dyknow.navigation.vehicle import AttitudeReport

LONGEST_US = 300_000
"""How far beyond the last position, attitude or angle a pose is predicted."""
_KEPT = 64

T = TypeVar("T")


class CameraState(NamedTuple):
    """The pose of a camera, and how certain its parts are."""

    pose: CameraPose
    errors: PoseErrors


class CameraStateEstimator:
    """Reports in, the state of the camera at a time out.

    Args:
        frame: in which places are north, east, down.
        arm_m: (3,), from the vehicle's reference point to the camera, in body axes.
        errors: the assumed ones; the accuracy of the position is that of the fusion.
        is_level: the mount keeps the camera level, so that neither roll nor pitch of the vehicle turns it.
    """

    def __init__(
        self,
        frame: LocalFrame,
        arm_m: FloatArray | None = None,
        errors: PoseErrors = USUAL_ERRORS,
        *,
        is_level: bool = False,
    ) -> None:
        self._frame, self._errors, self._is_level = frame, errors, is_level
        self._arm_m = np.zeros(3) if arm_m is None else arm_m
        self._estimates: _Recent[Estimate] = _Recent()
        self._attitudes: _Recent[Attitude] = _Recent()
        self._mounts: _Recent[PanTilt] = _Recent()

    def on_estimate(self, valid_us: int, estimate: Estimate) -> None:
        """Take the fused position of the platform; one older than the last is left out, as in the other methods."""
        self._estimates.add(valid_us, estimate)

    def on_attitude(self, report: AttitudeReport) -> None:
        self._attitudes.add(report.valid_us, Attitude(report.roll_rad, report.pitch_rad, report.yaw_rad))

    def on_mount(self, valid_us: int, mount: PanTilt) -> None:
        self._mounts.add(valid_us, mount)

    @property
    def whole_until_us(self) -> int | None:
        """The newest time for which nothing has to be predicted; None: a part was never known."""
        newest = [each.newest_us for each in (self._estimates, self._attitudes, self._mounts)]
        return None if None in newest else min(each for each in newest if each is not None)

    def at(self, valid_us: int) -> CameraState | None:
        """The state at a time; None: a part of it is not known for that time."""
        known = self._estimates.covers(valid_us), self._attitudes.covers(valid_us), self._mounts.covers(valid_us)
        if not all(known):
            return None
        attitude = Attitude(*_between(*self._attitudes.around(valid_us)))
        mount = PanTilt(*_between(*self._mounts.around(valid_us)))
        seen_us, estimate = self._estimates.nearest(valid_us)
        seconds = (valid_us - seen_us) / US_PER_S
        place = np.array(self._frame.to_ned(estimate.latitude_deg, estimate.longitude_deg, estimate.altitude_m))
        moved = place + seconds * np.array([estimate.north_m_s, estimate.east_m_s, estimate.down_m_s])
        at_m = moved + attitude.rotation() @ self._arm_m
        pose = CameraPose(valid_us, at_m, Attitude(0.0, 0.0, attitude.yaw_rad) if self._is_level else attitude, mount)
        grown = seconds * seconds
        level = max(estimate.var_n + grown * estimate.var_vn, estimate.var_e + grown * estimate.var_ve)
        vertical = estimate.var_d + grown * estimate.var_vd
        return CameraState(pose, self._errors._replace(level_m=level**0.5, vertical_m=vertical**0.5))


class _Recent(Generic[T]):
    """The last values, in order of their valid times."""

    def __init__(self) -> None:
        self._kept: deque[tuple[int, T]] = deque(maxlen=_KEPT)

    def add(self, valid_us: int, value: T) -> None:
        """Keep a value; a value that is not newer than the last is left out."""
        if not self._kept or valid_us > self._kept[-1][0]:
            self._kept.append((valid_us, value))

    @property
    def newest_us(self) -> int | None:
        return self._kept[-1][0] if self._kept else None

    def covers(self, valid_us: int) -> bool:
        kept = self._kept
        return bool(kept) and kept[0][0] - LONGEST_US <= valid_us <= kept[-1][0] + LONGEST_US

    def nearest(self, valid_us: int) -> tuple[int, T]:
        return min(self._kept, key=lambda each: abs(each[0] - valid_us))

    def around(self, valid_us: int) -> tuple[T, T, float]:
        """The values before and after a time and its share of the way between; beyond the ends of the two there."""
        kept = self._kept
        if len(kept) == 1:
            return kept[0][1], kept[0][1], 0.0
        later = next((number for number, (at_us, _) in enumerate(kept) if at_us >= valid_us), len(kept) - 1)
        (from_us, before), (to_us, after) = kept[max(later, 1) - 1], kept[max(later, 1)]
        return before, after, (valid_us - from_us) / (to_us - from_us)


def _between(before: Sequence[float], after: Sequence[float], share: float) -> Iterator[float]:
    """Angles, the shorter way round."""
    return (a + share * ((b - a + pi) % (2.0 * pi) - pi) for a, b in zip(before, after, strict=True))
