"""Percepts from detections: detections near the expected place, image by image, are one percept.

It tracks over a few images only, as a tracker in image processing does (thesis 8.7.1); after a longer loss it makes a
new percept, and links decide which object that is.
"""

from collections.abc import Sequence
from typing import Final

from dyknow import US_PER_S
from dyknow.anchoring.links.assignment import assigned
from dyknow.anchoring.links.states import ObjectState, diagonal
from dyknow.anchoring.links.structures import Percept
from dyknow.navigation.cameras.channels import GroundDetection

CONFIRMED: Final = 4
"""Detections that make a percept."""
TENTATIVE_US: Final = 300_000
"""A candidate that is not found again for that long was nothing."""
LOST_US: Final = 500_000
"""A percept that is not found again for that long has ended."""
_GATE: Final = 9.21
"""The square of the distance, in standard deviations, that 99 of 100 detections of one thing do not exceed."""
_MODEL_SD_M: Final = 0.7
"""How far a thing may be from where it is expected, errors of the detection apart: the gate is 2 m at least."""
_ALPHA, _BETA = 0.4, 0.1


class _Track:
    """One tracked thing: an alpha-beta filter, and its detections since the last percept."""

    __slots__ = ("found", "hits", "latest", "seen_us", "symbol", "velocity", "x_m", "y_m")

    def __init__(self, now_us: int, detection: GroundDetection) -> None:
        self.x_m, self.y_m = detection.east_m, detection.north_m
        self.velocity = (0.0, 0.0)
        self.hits, self.seen_us = 1, now_us
        self.latest, self.found = detection, True
        self.symbol: str | None = None

    def expected(self, now_us: int) -> tuple[float, float]:
        seconds = (now_us - self.seen_us) / US_PER_S
        return self.x_m + seconds * self.velocity[0], self.y_m + seconds * self.velocity[1]

    def take(self, now_us: int, detection: GroundDetection) -> None:
        seconds = (now_us - self.seen_us) / US_PER_S
        x, y = self.expected(now_us)
        off_x, off_y = detection.east_m - x, detection.north_m - y
        self.x_m, self.y_m = x + _ALPHA * off_x, y + _ALPHA * off_y
        vx, vy = self.velocity
        self.velocity = vx + _BETA * off_x / seconds, vy + _BETA * off_y / seconds
        self.hits, self.seen_us, self.latest, self.found = self.hits + 1, now_us, detection, True


class PerceptTracker:
    """Detections of images in, percepts out.

    Args:
        type_: of the percepts.
        period_us: between two samples of a percept; images may come more often.
        prefix: of their symbols.

    Attributes:
        reported_us: when samples of percepts were due last, whether or not there were any.
    """

    def __init__(self, type_: str = "vision_percept", period_us: int = 100_000, prefix: str = "vp") -> None:
        self._type, self._period_us, self._prefix = type_, period_us, prefix
        self._tracks: list[_Track] = []
        self._count = 0
        self._next_us: int | None = None
        self.reported_us: int | None = None

    def on_detections(self, now_us: int, detections: Sequence[GroundDetection]) -> list[Percept]:
        """Take all detections of one instant, after those of earlier ones; the percepts that are due."""
        self._associate(now_us, detections)
        out = [
            Percept(track.symbol, self._type, None)
            for track in self._tracks
            if track.symbol and self._over(track, now_us)
        ]
        self._tracks = [track for track in self._tracks if not self._over(track, now_us)]
        if self._next_us is not None and now_us < self._next_us:
            return out
        self.reported_us, self._next_us = now_us, now_us - now_us % self._period_us + self._period_us
        return out + [percept for track in self._tracks if (percept := self._percept(track)) is not None]

    def _over(self, track: _Track, now_us: int) -> bool:
        return now_us - track.seen_us > (TENTATIVE_US if track.symbol is None else LOST_US)

    def _associate(self, now_us: int, detections: Sequence[GroundDetection]) -> None:
        """Percepts are served before candidates, so that a detection that is off begins no second track of one thing."""
        known = [each for each in self._tracks if each.symbol is not None]
        left = _assign(now_us, known, detections)
        candidates = [each for each in self._tracks if each.symbol is None]
        self._tracks += [_Track(now_us, each) for each in _assign(now_us, candidates, left)]

    def _percept(self, track: _Track) -> Percept | None:
        if track.symbol is None and track.hits >= CONFIRMED:
            self._count += 1
            track.symbol = f"{self._prefix}{self._count}"
        if track.symbol is None or not track.found:
            return None
        track.found = False
        detection = track.latest
        covariance = diagonal(1.0)
        # the frame of detections is (north, east), that of objects (east, north)
        covariance[:2, :2] = detection.covariance[::-1, ::-1]
        state = ObjectState(
            track.seen_us, detection.east_m, detection.north_m, 0.0, 0.0, covariance, dict(detection.attributes)
        )
        return Percept(track.symbol, self._type, state)


def _assign(now_us: int, tracks: Sequence[_Track], detections: Sequence[GroundDetection]) -> list[GroundDetection]:
    """Give each track its detection, if there is one; returns the others."""
    distances: dict[tuple[str, str], float] = {}
    for index, track in enumerate(tracks):
        x, y = track.expected(now_us)
        for number, detection in enumerate(detections):
            distance = _distance(detection, x, y)
            if distance < _GATE and now_us > track.seen_us:
                distances[str(index), str(number)] = distance
    pairs = [(int(index), int(number)) for index, number in assigned(distances)]
    for index, number in pairs:
        tracks[index].take(now_us, detections[number])
    taken = {number for _, number in pairs}
    return [each for number, each in enumerate(detections) if number not in taken]


def _distance(detection: GroundDetection, x_m: float, y_m: float) -> float:
    """The square of the Mahalanobis distance of a detection, whose errors differ along and across its ray, from a place."""
    (a, b), (_, c) = detection.covariance.tolist()
    a, c = a + _MODEL_SD_M**2, c + _MODEL_SD_M**2
    north_m, east_m = detection.north_m - y_m, detection.east_m - x_m
    return float((c * north_m**2 - 2.0 * b * north_m * east_m + a * east_m**2) / (a * c - b * b))
