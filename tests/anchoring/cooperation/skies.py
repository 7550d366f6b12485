"""Members whose tracks are what they see, made by hand: cars by name, each with a symbol of its own at each member."""

from collections.abc import Callable, Mapping

import numpy as np

from bench.cooperation.wire import Wire
from dyknow.anchoring.cooperation.picture import GlobalPicture
from dyknow.anchoring.cooperation.reports import TrackReport
from dyknow.anchoring.links.states import ObjectState, diagonal

START_US = 1_700_000_000_000_000
STEP_US = 200_000
SD_M = 0.6

Place = tuple[float, float, float, float]
Seen = Mapping[str, Mapping[str, Place]]
"""By member and symbol."""


def state(place: Place, at_us: int, sd_m: float = SD_M) -> ObjectState:
    return ObjectState(at_us, *place, diagonal(sd_m, 0.6))


class Sky:
    """Pictures of some members, stepped together."""

    def __init__(self, units: str = "01", seed: int = 0) -> None:
        self.rng = np.random.default_rng(seed)
        self.pictures = {unit: GlobalPicture(unit) for unit in units}
        self.wire = Wire(self.pictures, self.rng)
        self.now_us = START_US
        self.extra: dict[str, Callable[[int], list[TrackReport]]] = {}

    def run(self, seconds: float, seen: Callable[[float], Seen]) -> None:
        """`seen` gives what each member tracks, at a time in seconds since the beginning."""
        for _ in range(round(seconds * 1e6 / STEP_US)):
            self.now_us += STEP_US
            tracked = seen((self.now_us - START_US) / 1e6)
            reports = {unit: self.reports(unit, tracks) for unit, tracks in tracked.items()}
            for unit, more in self.extra.items():
                reports[unit] = reports.get(unit, []) + more(self.now_us)
            self.wire.step(reports, self.now_us)

    def reports(self, unit: str, tracks: Mapping[str, Place]) -> list[TrackReport]:
        made = []
        for symbol, place in tracks.items():
            noise = np.concatenate([self.rng.normal(0.0, SD_M, 2), self.rng.normal(0.0, 0.5, 2)])
            made.append(TrackReport(unit, symbol, state(tuple(np.array(place) + noise), self.now_us)))
        return made

    def names(self, symbol: str, unit: str) -> set[str | None]:
        """What all pictures call the track of a member."""
        return {picture.name_of(unit, symbol) for picture in self.pictures.values()}

    def name(self, symbol: str, unit: str) -> str:
        """What all call it: they agree."""
        (name,) = self.names(symbol, unit)
        assert name is not None
        return name

    def kinds(self, unit: str = "0") -> list[str]:
        return [event.kind for event in self.pictures[unit].recent]


def along(start_m: float, y_m: float = 0.0, speed_m_s: float = 10.0) -> Callable[[float], Place]:
    """A car that drives to the east."""
    return lambda at_s: (start_m + speed_m_s * at_s, y_m, speed_m_s, 0.0)
