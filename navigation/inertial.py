"""Acceleration of the vehicle over ground, from its attitude and its accelerometers.

a = R(roll, pitch, yaw) f + (0, 0, g): f is the specific force in the body frame, R turns body into north-east-down.
"""

import math
from collections import deque

from dyknow.navigation.vehicle import AccelerationReport, AttitudeReport

GRAVITY_M_S2 = 9.80665
_HISTORY_US = 1_500_000
_FRESH_US = 300_000
_FEWEST = 3
_LARGEST_M_S2 = 200.0


class InertialInput:
    """Mean acceleration between two instants, where the sensors report often enough to mean it.

    A single sample of a vibrating airframe is no measure of the mean, so fewer than three samples in 0.3 s, or no
    attitude within 0.3 s, count as none.
    """

    def __init__(self) -> None:
        self._attitude: AttitudeReport | None = None
        self._source = ""
        self._found: deque[tuple[int, float, float, float]] = deque(maxlen=512)

    def on_attitude(self, report: AttitudeReport) -> None:
        if all(map(math.isfinite, report[2:])):
            self._attitude = report

    def on_acceleration(self, report: AccelerationReport) -> None:
        """Turn the specific force to north-east-down with the attitude known now; the first source heard is kept."""
        force = (report.x_m_s2, report.y_m_s2, report.z_m_s2)
        attitude = self._attitude
        if attitude is None or not all(abs(each) < _LARGEST_M_S2 for each in force):
            return
        if abs(report.valid_us - attitude.valid_us) > _FRESH_US:
            return
        stale = not self._found or abs(report.valid_us - self._found[-1][0]) > _FRESH_US
        if report.source != self._source and not stale:
            return
        self._source = report.source
        if self._found and report.valid_us < self._found[-1][0]:
            return
        self._found.append((report.valid_us, *turned(attitude, force)))
        while self._found[0][0] < report.valid_us - _HISTORY_US:
            self._found.popleft()

    def mean(self, from_us: int, to_us: int) -> tuple[float, float, float] | None:
        """Metres per second squared, or None. Looks back at least 0.3 s."""
        since_us = min(from_us, to_us - _FRESH_US)
        near: list[tuple[int, float, float, float]] = []
        for each in reversed(self._found):
            if each[0] < since_us:
                break
            if each[0] <= to_us:
                near.append(each)
        if len(near) < _FEWEST:
            return None
        inside = [each for each in near if each[0] > from_us] or near[:1]
        n = len(inside)
        return sum(e[1] for e in inside) / n, sum(e[2] for e in inside) / n, sum(e[3] for e in inside) / n


def turned(attitude: AttitudeReport, force: tuple[float, float, float]) -> tuple[float, float, float]:
    """Acceleration (north, east, down) from specific force in the body frame; angles in radians, order yaw-pitch-roll."""
    x, y, z = force
    sr, cr = math.sin(attitude.roll_rad), math.cos(attitude.roll_rad)
    sp, cp = math.sin(attitude.pitch_rad), math.cos(attitude.pitch_rad)
    sy, cy = math.sin(attitude.yaw_rad), math.cos(attitude.yaw_rad)
    return (
        cp * cy * x + (sr * sp * cy - cr * sy) * y + (cr * sp * cy + sr * sy) * z,
        cp * sy * x + (sr * sp * sy + cr * cy) * y + (cr * sp * sy - sr * cy) * z,
        -sp * x + sr * cp * y + cr * cp * z + GRAVITY_M_S2,
    )
