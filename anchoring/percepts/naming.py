"""Names for detections that have none: what is found where something was expected gets its name.

A detector without a tracker says where things are, image by image. Here each detection is a percept from the first on: a thing is
expected to move on as it did, at first as fast as its kind, and what is nearest to that within the gate is it. After a silence
of some periods its name has ended, and which object comes back is for links to say.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from anchoring.links.assignment import assigned
from anchoring.links.motion import BIKE, CAR, WALKER, kind_of
from anchoring.links.rhythm import Rhythm
from anchoring.links.states import ObjectState
from dyknow import US_PER_S

_GATE: Final = 20.0
"""The square of the distance, in standard deviations, that one detection in 20 000 of the thing exceeds: it would have two names."""
_SPEED_SD_M_S: Final = 6.0
"""On each axis, of a thing that was detected once, and names no kind."""
_SPEEDS_SD_M_S: Final = {WALKER: 1.5, BIKE: 4.0, CAR: 10.0}
_CHANGE_M2_S3: Final = 2.0
"""Density of the noise of its acceleration."""
_LEAST_SILENCE_US: Final = US_PER_S // 2
_SILENCES: Final = 2
"""A name outlives what ends a percept by that factor: the detector overlooked the thing for some images."""
_ALL = ""


class _Named:
    """One thing: a Kalman filter with constant velocity, whose axes have one covariance: position, both, velocity."""

    __slots__ = ("covariance", "hits", "name", "place", "seen_us", "velocity")

    def __init__(self, name: str, state: ObjectState) -> None:
        self.name, self.seen_us, self.hits = name, state.valid_us, 1
        self.place, self.velocity = (state.x_m, state.y_m), (state.vx_m_s, state.vy_m_s)
        kind = kind_of(state)
        speed_m_s = _SPEED_SD_M_S if kind is None else _SPEEDS_SD_M_S[kind]
        speed_variance = min(speed_m_s**2, float(state.covariance[2, 2]))
        self.covariance = _variance(state), 0.0, speed_variance

    def expected(self, now_us: int) -> tuple[float, float, tuple[float, float, float]]:
        """Where it is expected, and the covariance of an axis then."""
        dt = (now_us - self.seen_us) / US_PER_S
        (x, y), (vx, vy), (pp, pv, vv) = self.place, self.velocity, self.covariance
        q = _CHANGE_M2_S3
        return x + dt * vx, y + dt * vy, (pp + 2 * dt * pv + dt * dt * vv + q * dt**3 / 3, pv + dt * vv + q * dt * dt / 2, vv + q * dt)  # fmt: skip

    def take(self, state: ObjectState) -> None:
        x, y, (pp, pv, vv) = self.expected(state.valid_us)
        whole = pp + _variance(state)
        gain, gain_v = pp / whole, pv / whole
        off_x, off_y = state.x_m - x, state.y_m - y
        self.place = x + gain * off_x, y + gain * off_y
        self.velocity = self.velocity[0] + gain_v * off_x, self.velocity[1] + gain_v * off_y
        self.covariance = (1 - gain) * pp, (1 - gain) * pv, vv - gain_v * pv
        self.seen_us, self.hits = state.valid_us, self.hits + 1


class NamedDetection(NamedTuple):
    """A detection and the name of the thing that it is of."""

    name: str
    state: ObjectState


class DetectionNames:
    """Detections of one kind in, names out.

    Args:
        prefix: of the names.
    """

    def __init__(self, prefix: str = "d") -> None:
        self._prefix, self._count = prefix, 0
        self._known: list[_Named] = []
        self._rhythm = Rhythm()

    def named(self, now_us: int, detections: Sequence[ObjectState]) -> list[NamedDetection]:
        """All detections of one instant, after those of earlier ones; there may be none. Things that were followed come first."""
        self._rhythm.on_sample(_ALL, now_us)
        silence_us = max(_LEAST_SILENCE_US, _SILENCES * self._rhythm.silence_us(_ALL))
        self._known = [each for each in self._known if now_us - each.seen_us <= silence_us]
        found: dict[int, str] = {}
        for things in (
            [each for each in self._known if each.hits > 1],
            [each for each in self._known if each.hits == 1],
        ):
            left = [number for number in range(len(detections)) if number not in found]
            for thing, number in _pairs(now_us, things, detections, left):
                thing.take(detections[number])
                found[number] = thing.name
        for number, state in enumerate(detections):
            if number not in found:
                self._count += 1
                found[number] = f"{self._prefix}{self._count}"
                self._known.append(_Named(found[number], state))
        return [NamedDetection(found[number], state) for number, state in enumerate(detections)]


def _pairs(
    now_us: int, things: Sequence[_Named], detections: Sequence[ObjectState], left: Sequence[int]
) -> list[tuple[_Named, int]]:
    if not things or not left:
        return []
    expected = [thing.expected(now_us) for thing in things]
    places = np.array([each[:2] for each in expected])
    seen = np.array([detections[number][1:3] for number in left])
    spreads = np.add.outer([each[2][0] for each in expected], [_variance(detections[number]) for number in left])
    distances = ((places[:, None, :] - seen[None, :, :]) ** 2).sum(axis=2) / spreads
    near = zip(*(each.tolist() for each in np.nonzero(distances < _GATE)), strict=True)
    scores = {(str(index), str(left[at])): float(distances[index, at]) for index, at in near}
    return [(things[int(index)], int(number)) for index, number in assigned(scores)]


def _variance(state: ObjectState) -> float:
    """Of a position on one axis, in the mean."""
    return float(state.covariance[0, 0] + state.covariance[1, 1]) / 2.0
