"""A search by sight: places to fly to go out, looks of a camera come in; then a box was found, or all was looked at. Pure.

A percept counts as the box if it is where the box can be, is none of the things whose places are known, is seen for a second,
and has its colour in most looks.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from math import hypot, log, pi, sqrt
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dyknow import US_PER_S
from dyknow.navigation.searching.landing import Floats, LandingPrior
from dyknow.navigation.searching.pattern import expanding_square

SWATH_PER_HEIGHT: Final = 0.9
"""The side of a square that is in view whichever way the camera is turned, over the height: for an angle of view of 84 degrees."""
STAYS_US: Final = 2 * US_PER_S
"""So long it looks from each place."""
SEEN_US: Final = US_PER_S
LOOKS: Final = 6
_PAUSE_US: Final = 500_000
"""Looks that are further apart do not belong together."""
_COLOUR_SHARE: Final = 0.6
_DEVIATIONS: Final = 5.0
_FARTHEST_M: Final = 1e6
_POINTS: Final = 400
_GOLDEN_RAD: Final = pi * (3.0 - sqrt(5.0))


class SearchPlace(NamedTuple):
    """Where to look from: metres east and north, and above the ground, straight down."""

    x_m: float
    y_m: float
    height_m: float


class PlacedPercept(NamedTuple):
    """A percept of one look; the fields of `vision-percepts`."""

    symbol: str
    x_m: float
    y_m: float
    sd_m: float
    colour: str | None = None


class FoundBox(NamedTuple):
    """Where it is: metres east and north, and the standard deviation of each."""

    x_m: float
    y_m: float
    sd_m: float
    symbol: str


@dataclass(slots=True)
class _Candidate:
    """The sightings of one percept."""

    first_us: int
    places: list[tuple[float, float, float]] = field(default_factory=list)
    looks: int = 0
    right: int = 0
    last_us: int = 0


class SightSearch:
    """A search for one box.

    Args:
        prior: where it can lie.
        known: places of other things of its kind, metres east and north.
        colour: of the box; None: any.
        height_m: from which it looks.
        near_m: a percept nearer to a known place is that thing.

    Attributes:
        found: the box, once it was found.
    """

    def __init__(
        self,
        prior: LandingPrior,
        known: Iterable[tuple[float, float]] = (),
        colour: str | None = None,
        height_m: float = 15.0,
        near_m: float = 1.2,
    ) -> None:
        self._prior, self._known, self._colour, self._height_m = prior, tuple(known), colour, height_m
        self._near_m = near_m
        self._swath_m = SWATH_PER_HEIGHT * height_m
        self._stops = expanding_square(prior, self._swath_m)
        self._precision = np.linalg.inv(prior.covariance + np.eye(2))
        self._points = _quantiles(prior)
        self._seen_us = np.zeros(len(self._points))
        self._candidates: dict[str, _Candidate] = {}
        self._stop, self._stayed_us = 0, 0
        self._looked_us: int | None = None
        self.found: FoundBox | None = None

    @property
    def waypoint(self) -> SearchPlace | None:
        """Where to look from now; None: it was found, or all was looked at."""
        if self.found is not None or self._stop >= len(self._stops):
            return None
        x_m, y_m = self._stops[self._stop].tolist()
        return SearchPlace(x_m, y_m, self._height_m)

    @property
    def is_exhausted(self) -> bool:
        """Whether all places were looked at in vain."""
        return self.found is None and self._stop >= len(self._stops)

    @property
    def coverage(self) -> float:
        """The probability of the prior's places that were in view for a second."""
        return float((self._seen_us >= SEEN_US).mean())

    def on_look(self, valid_us: int, view_m: Floats | None, percepts: Sequence[PlacedPercept]) -> None:
        """Take what one image showed, in the order of time.

        `view_m` are the corners (4, 2), east and north, of the ground in view, in order around; None: it showed no ground.
        """
        since_us = _PAUSE_US if self._looked_us is None else valid_us - self._looked_us
        if since_us <= 0 or self.found is not None:
            return
        self._looked_us = valid_us
        for percept in percepts:
            self._take(valid_us, percept)
        if view_m is not None and since_us <= _PAUSE_US:
            self._see(view_m, since_us)

    def _see(self, view_m: Floats, since_us: int) -> None:
        self._seen_us[_within(view_m, self._points)] += since_us
        if self._stop >= len(self._stops):
            return
        away = np.abs(view_m.mean(axis=0) - self._stops[self._stop])
        if float(np.hypot(*away)) <= self._swath_m / 4.0 and _within(view_m, self._stops[self._stop][None])[0]:
            self._stayed_us += since_us
        if self._stayed_us >= STAYS_US and not self._is_promising:
            self._stop, self._stayed_us = self._stop + 1, 0

    @property
    def _is_promising(self) -> bool:
        """Whether something in view may still turn out to be the box: then it stays."""
        return self._stayed_us < 2 * STAYS_US and any(
            self._looked_us is not None
            and self._looked_us - each.last_us <= _PAUSE_US
            and each.looks < 2 * LOOKS
            and each.right * 2 >= each.looks
            for each in self._candidates.values()
        )

    def _take(self, valid_us: int, percept: PlacedPercept) -> None:
        if self.found is not None or not self._is_possible(percept):
            return
        seen = self._candidates.setdefault(percept.symbol, _Candidate(valid_us))
        seen.looks, seen.last_us = seen.looks + 1, valid_us
        seen.right += self._colour is None or percept.colour is None or percept.colour == self._colour
        seen.places = [*seen.places[-(4 * LOOKS - 1) :], (percept.x_m, percept.y_m, percept.sd_m)]
        if seen.looks >= LOOKS and valid_us - seen.first_us >= SEEN_US and seen.right >= _COLOUR_SHARE * seen.looks:
            x_m, y_m, sd_m = np.median(np.array(seen.places), axis=0).tolist()
            self.found = FoundBox(x_m, y_m, sd_m, percept.symbol)

    def _is_possible(self, percept: PlacedPercept) -> bool:
        """Whether it is where the box can be, and no known thing."""
        off = np.array([percept.x_m, percept.y_m]) - self._prior.mean
        if not (np.abs(off) < _FARTHEST_M).all() or float(off @ self._precision @ off) > _DEVIATIONS**2:
            return False
        return all(hypot(percept.x_m - x, percept.y_m - y) > self._near_m for x, y in self._known)


def _quantiles(prior: LandingPrior) -> Floats:
    """(n, 2) places of equal probability."""
    number = np.arange(_POINTS)
    radius = np.array([sqrt(-2.0 * log(1.0 - (each + 0.5) / _POINTS)) for each in number])
    ring = np.stack([radius * np.cos(number * _GOLDEN_RAD), radius * np.sin(number * _GOLDEN_RAD)], axis=1)
    variances, axes = np.linalg.eigh(prior.covariance)
    scaled: Floats = prior.mean + (ring * np.sqrt(np.maximum(variances, 0.0))) @ axes.T
    return scaled


def _within(corners: Floats, points: Floats) -> NDArray[np.bool_]:
    """Which of (n, 2) points lie in a convex polygon, whichever way round its corners are."""
    along = np.roll(corners, -1, axis=0) - corners
    to = points[:, None, :] - corners[None, :, :]
    sides = along[None, :, 0] * to[:, :, 1] - along[None, :, 1] * to[:, :, 0]
    return np.asarray((sides >= 0.0).all(axis=1) | (sides <= 0.0).all(axis=1))
