"""Percepts of one platform's detectors become a person once they were observed for 5 s (thesis 7.1.1). Pure.

Percepts that are near each other are of one body, also those of another pass, or after a gap. It is a person while both
channels score above the limit on average: warmth alone, or form alone, is not enough.
"""

from dataclasses import dataclass, field
from math import hypot, isfinite
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dyknow import US_PER_S
from dyknow.anchoring.saliency.entries import FARTHEST_M, MOST_SD_M, PersonEntry

OBSERVED_US: Final = 5 * US_PER_S
"""So long a body is observed before it counts as a person."""
THERMAL_LEAST: Final = 0.6
COLOUR_LEAST: Final = 0.58
"""Mean scores of a person."""
PAUSE_US: Final = 400_000
"""Two looks that are further apart were no observation in between."""
NEAR_M: Final = 4.0
"""Percepts that far from each other are of two bodies, however vague they are."""
GATE: Final = 9.21
MODEL_SD_M: Final = 0.5
MOST_BODIES: Final = 500
"""The one that was seen longest ago, and is no person, is forgotten for another."""


class PersonLook(NamedTuple):
    """A percept of one instant; None: that channel did not find it. `covariance` is (xx, xy, yy), m^2."""

    valid_us: int
    x_m: float
    y_m: float
    covariance: tuple[float, float, float]
    thermal: float | None
    colour: float | None
    thermal_image: str = ""
    colour_image: str = ""

    @property
    def is_sound(self) -> bool:
        """Whether it can be a place and scores."""
        xx, xy, yy = self.covariance
        scores = [each for each in (self.thermal, self.colour) if each is not None]
        return (
            all(map(isfinite, (self.x_m, self.y_m, xx, xy, yy)))
            and max(abs(self.x_m), abs(self.y_m)) < FARTHEST_M
            and 0.0 < min(xx, yy) <= max(xx, yy) < MOST_SD_M**2
            and xx * yy > xy * xy
            and all(0.0 <= each <= 1.0 for each in scores)
        )


@dataclass(slots=True)
class _Channel:
    """The scores of one channel, and the best image."""

    total: float = 0.0
    count: int = 0
    best: float = -1.0
    image: str = ""

    def take(self, score: float | None, image: str) -> None:
        if score is None:
            return
        self.total, self.count = self.total + score, self.count + 1
        if score > self.best:
            self.best, self.image = score, image

    @property
    def mean(self) -> float:
        return self.total / self.count if self.count else 0.0


@dataclass(slots=True)
class _SeenBody:
    """One body: the mean of the places at which it was seen, and the mean of their covariances.

    The errors of a vehicle's pose are much the same from image to image, so that many of them make a place no surer.
    """

    symbol: str
    since_us: int
    seen_us: int
    count: int = 0
    observed_us: int = 0
    mean: NDArray[np.float64] = field(default_factory=lambda: np.zeros(2))
    spread: NDArray[np.float64] = field(default_factory=lambda: np.zeros((2, 2)))
    thermal: _Channel = field(default_factory=_Channel)
    colour: _Channel = field(default_factory=_Channel)

    def take(self, look: PersonLook) -> None:
        pause_us = look.valid_us - self.seen_us
        self.observed_us += pause_us if 0 < pause_us <= PAUSE_US else 0
        self.seen_us, self.count = max(self.seen_us, look.valid_us), self.count + 1
        share = 1.0 / self.count
        self.mean = self.mean + share * (np.array([look.x_m, look.y_m]) - self.mean)
        xx, xy, yy = look.covariance
        self.spread = self.spread + share * (np.array([[xx, xy], [xy, yy]]) - self.spread)
        self.thermal.take(look.thermal, look.thermal_image)
        self.colour.take(look.colour, look.colour_image)

    @property
    def is_person(self) -> bool:
        is_like_one = self.thermal.mean >= THERMAL_LEAST and self.colour.mean >= COLOUR_LEAST
        return self.observed_us >= OBSERVED_US and is_like_one

    def distance(self, look: PersonLook) -> float | None:
        """The square of the Mahalanobis distance; None: it is of another body."""
        off = np.array([look.x_m, look.y_m]) - self.mean
        if hypot(*off) > NEAR_M:
            return None
        xx, xy, yy = look.covariance
        spread = self.spread + np.array([[xx, xy], [xy, yy]]) + np.eye(2) * MODEL_SD_M**2
        found = float(off @ np.linalg.solve(spread, off))
        return found if found < GATE else None


class PersonSearch:
    """The bodies that one platform has seen.

    Args:
        unit: the platform.
        first: the number of its first symbol; symbols of a later life are others.

    Attributes:
        left_out: looks that could not be.
    """

    def __init__(self, unit: str, first: int = 1) -> None:
        self._unit, self._next = unit, first
        self._bodies: list[_SeenBody] = []
        self.left_out = 0

    def on_look(self, look: PersonLook) -> None:
        """Take what a detector followed at one instant, in the order of time."""
        if not look.is_sound:
            self.left_out += 1
            return
        near = [(distance, at) for at, each in enumerate(self._bodies) if (distance := each.distance(look)) is not None]
        body = self._bodies[min(near)[1]] if near else self._new(look.valid_us)
        body.take(look)

    def _new(self, valid_us: int) -> _SeenBody:
        if len(self._bodies) >= MOST_BODIES:
            oldest = min(self._bodies, key=lambda each: (each.is_person, each.seen_us))
            self._bodies.remove(oldest)
        body = _SeenBody(f"s{self._next}", valid_us, valid_us)
        self._next += 1
        self._bodies.append(body)
        return body

    @property
    def observed(self) -> int:
        """How many bodies were seen, persons or not."""
        return len(self._bodies)

    def entries(self) -> list[PersonEntry]:
        """The persons."""
        return [self._entry(each) for each in self._bodies if each.is_person]

    def _entry(self, body: _SeenBody) -> PersonEntry:
        (xx, xy), (_, yy) = body.spread.tolist()
        x_m, y_m = body.mean.tolist()
        return PersonEntry(
            self._unit, body.symbol, x_m, y_m, (xx, xy, yy), body.since_us, body.seen_us, body.observed_us / US_PER_S,
            body.thermal.mean, body.colour.mean, body.thermal.image, body.colour.image,
        )  # fmt: skip
