"""Names for detections without names: a detection where an object was expected gets its name.

A detector without a tracker says where things are, image by image. Here each detection is a percept from the first on: a thing is
expected to move on as it did, at first as fast as its kind, or the others. All detections of an image are assigned together, each
to the thing for which it is likelier than that another one has come into view there. After a silence of some periods a name has
ended, and which object comes back is for links to say.
"""

from collections.abc import Sequence
from math import hypot, pi
from typing import Final, NamedTuple

import numpy as np

from dyknow import US_PER_S
from dyknow.anchoring.links.assignment import assigned
from dyknow.anchoring.links.motion import BIKE, CAR, WALKER, Spacing, kind_of
from dyknow.anchoring.links.rhythm import Rhythm
from dyknow.anchoring.links.states import ObjectState

_GATE: Final = 20.0
"""The square of the distance, in standard deviations, that one detection in 20 000 of the thing exceeds: it would have two names."""
_SPEED_SD_M_S: Final = 6.0
"""On each axis, of a thing that was detected once and names no kind, before any is known."""
_SLOWEST_SD_M_S, _FASTEST_SD_M_S, _FOLLOWED, _ENOUGH = 1.0, 15.0, 5, 5
"""Bounds of the learnt standard deviation of speeds; detections of an object, and objects, from which it is learnt."""
_STRANGERS: Final = 0.003
"""New things that come into view in one image, as a share of those that are there."""
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

    def __init__(self, name: str, state: ObjectState, speed_sd_m_s: float) -> None:
        self.name, self.seen_us, self.hits = name, state.valid_us, 1
        self.place, self.velocity = (state.x_m, state.y_m), (state.vx_m_s, state.vy_m_s)
        kind = kind_of(state)
        speed_sd_m_s = speed_sd_m_s if kind is None else _SPEEDS_SD_M_S[kind]
        speed_variance = min(speed_sd_m_s**2, float(state.covariance[2, 2]))
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
        self._rhythm, self._spacing = Rhythm(), Spacing()
        self._speed_sd_m_s = _SPEED_SD_M_S

    def named(self, now_us: int, detections: Sequence[ObjectState]) -> list[NamedDetection]:
        """All detections of one instant, after those of earlier ones; there may be none. Things that were followed come first."""
        self._rhythm.on_sample(_ALL, now_us)
        silence_us = max(_LEAST_SILENCE_US, _SILENCES * self._rhythm.silence_us(_ALL))
        self._known = [each for each in self._known if now_us - each.seen_us <= silence_us]
        self._spacing.on_states(now_us, detections)
        self._learn_speed()
        found: dict[int, str] = {}
        for thing, number in self._pairs(now_us, detections):
            thing.take(detections[number])
            found[number] = thing.name
        for number, state in enumerate(detections):
            if number not in found:
                self._count += 1
                found[number] = f"{self._prefix}{self._count}"
                self._known.append(_Named(found[number], state, self._speed_sd_m_s))
        return [NamedDetection(found[number], state) for number, state in enumerate(detections)]

    def _learn_speed(self) -> None:
        """New objects are expected to move as fast as the others do."""
        speeds = [hypot(*each.velocity) for each in self._known if each.hits >= _FOLLOWED]
        if len(speeds) >= _ENOUGH:
            self._speed_sd_m_s = min(_FASTEST_SD_M_S, max(_SLOWEST_SD_M_S, float(np.median(speeds))))

    def _pairs(self, now_us: int, detections: Sequence[ObjectState]) -> list[tuple[_Named, int]]:
        """The assignment whose pairs are more likely than one object overlooked and another one that appeared."""
        if not self._known or not detections:
            return []
        expected = [thing.expected(now_us) for thing in self._known]
        places = np.array([each[:2] for each in expected])
        seen = np.array([state[1:3] for state in detections])
        spreads = np.add.outer([each[2][0] for each in expected], [_variance(state) for state in detections])
        distances = ((places[:, None, :] - seen[None, :, :]) ** 2).sum(axis=2) / spreads
        scores = distances + 2.0 * np.log(2.0 * pi * spreads * _STRANGERS / self._spacing.apart_m**2)
        near = zip(*(each.tolist() for each in np.nonzero((distances < _GATE) & (scores < 0.0))), strict=True)
        pairs = {(str(index), str(number)): float(scores[index, number]) for index, number in near}
        return [(self._known[int(index)], int(number)) for index, number in assigned(pairs, alone=0.0)]


def _variance(state: ObjectState) -> float:
    """Of a position on one axis, in the mean."""
    return float(state.covariance[0, 0] + state.covariance[1, 1]) / 2.0
