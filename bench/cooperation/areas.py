"""Platforms that each see a part of a simulated town, or of one road, and report what they link there.

Everything is by chance from one seed: cars, errors of percepts, and an error of each platform that wanders and is the same
for all that it sees, as that of its position. Percepts become objects as on a platform, and objects reports.
"""

from collections.abc import Iterable, Mapping
from math import exp, sqrt
from typing import Final, NamedTuple

import numpy as np
from numpy.random import Generator

from dyknow.anchoring.cooperation.reports import TrackReport
from dyknow.anchoring.links.states import ObjectState, diagonal
from dyknow.anchoring.links.structures import LinkOutcome, ObjectLinkage, Percept
from dyknow.anchoring.ready import VISION, WORLD, ready_specification
from dyknow.sim_uavs.roads.drivers import RoadState

PERIOD_US: Final = 100_000
PERCEPT_SD_M: Final = 1.0
WANDER_SD_M: Final = 0.8
"""Of the error that a platform makes of all places alike."""
_WANDER_S: Final = 10.0
VAGUE_M: Final = 20.0
"""What is predicted worse than this is not reported."""
_OVERLOOKED: Final = 0.1
_LOST: Final = 0.01
"""The share of looks at which the tracker loses what it follows, and begins it under another name."""


class Place(NamedTuple):
    """Where something is, by name."""

    name: str
    x_m: float
    y_m: float
    colour: str = "grey"


class Area(NamedTuple):
    """What a platform sees: a rectangle about a point."""

    x_m: float
    y_m: float
    across_m: float = 58.0
    along_m: float = 44.0

    def has(self, place: Place | RoadState) -> bool:
        """Whether it is seen there."""
        return abs(place.x_m - self.x_m) <= self.across_m and abs(place.y_m - self.y_m) <= self.along_m


class Watcher:
    """One platform: its percepts, its links.

    Attributes:
        tracked: the objects that it sees at the last look, by symbol.
    """

    def __init__(self, unit: str, area: Area, rng: Generator) -> None:
        self.unit, self.area, self._rng = unit, area, rng
        self.linkage = ObjectLinkage([each for each in ready_specification(None) if each.target == WORLD])
        self._percepts: dict[str, str] = {}
        self._number = 0
        self._error_m = rng.normal(0.0, WANDER_SD_M, 2)
        self.tracked: dict[str, ObjectState] = {}
        self.visible: dict[str, tuple[float, float]] = {}

    def look(self, places: Iterable[Place | RoadState], now_us: int) -> list[TrackReport]:
        """What it reports of a look."""
        percepts = self.percepts(places, now_us)
        return self.reports(self.linkage.on_percepts(now_us, percepts))

    def percepts(self, places: Iterable[Place | RoadState], now_us: int) -> list[Percept]:
        """What its detectors follow."""
        kept = exp(-PERIOD_US / 1e6 / _WANDER_S)
        self._error_m = kept * self._error_m + sqrt(1.0 - kept * kept) * self._rng.normal(0.0, WANDER_SD_M, 2)
        visible = {each.name: each for each in places if self.area.has(each)}
        self.visible = {name: (each.x_m, each.y_m) for name, each in visible.items()}
        gone = [name for name in self._percepts if name not in visible or self._rng.random() < _LOST]
        found = [Percept(self._percepts.pop(name), VISION, None) for name in gone]
        for name, place in visible.items():
            if self._rng.random() < _OVERLOOKED:
                continue
            if name not in self._percepts:
                self._number += 1
                self._percepts[name] = f"vp{self.unit}_{self._number}"
            x_m, y_m = np.array((place.x_m, place.y_m)) + self._error_m + self._rng.normal(0.0, PERCEPT_SD_M, 2)
            state = ObjectState(now_us, float(x_m), float(y_m), 0.0, 0.0, diagonal(PERCEPT_SD_M))
            found.append(Percept(self._percepts[name], VISION, state))
        return found

    def reports(self, outcome: LinkOutcome) -> list[TrackReport]:
        """The states of its objects as reports."""
        made = [
            TrackReport(self.unit, each.symbol, each.state, is_anchored=self.linkage.anchored(each.symbol))
            for each in outcome.states
            if each.type == WORLD and each.state.deviation_m <= VAGUE_M
        ]
        self.tracked = {each.symbol: each.state for each in made if each.is_anchored}
        ended = (each.target for each in outcome.events if each.kind == "forgotten" and each.target_type == WORLD)
        last = {each.symbol: each.state for each in made}
        return made + [TrackReport(self.unit, name, last[name], has_ended=True) for name in ended if name in last]


def watchers(areas: Mapping[str, Area], rng: Generator) -> dict[str, Watcher]:
    """One for each area."""
    return {
        unit: Watcher(unit, area, each) for (unit, area), each in zip(areas.items(), rng.spawn(len(areas)), strict=True)
    }
