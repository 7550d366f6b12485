"""Measures of a picture: which platforms are near each other, and how far each monitor is from its alarm."""

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

from dyknow.console.picture.differences import Row
from dyknow.navigation.geodesy import metres_per_degree

CLOSE_M, CLOSE_ABOVE_M = 60.0, 30.0
"""Platforms nearer than this, horizontally and vertically, are a close pair."""
CURVE_POINTS: Final = 120
EVERY_US: Final = 1_000_000


def close_pairs(platforms: Mapping[str, Row], before: Mapping[str, Row] = {}) -> dict[str, Row]:
    """The pairs that are near each other, horizontally, and how high above each other they are, in metres."""
    flying = [(unit, row["at"], row.get("altitude")) for unit, row in platforms.items() if row.get("at")]
    if not flying:
        return {}
    north_m, east_m = metres_per_degree(flying[0][1][0])
    spots = [(unit, at[1] * east_m, at[0] * north_m, altitude) for unit, at, altitude in flying]
    found: dict[str, Row] = {}
    for index, (unit, x, y, altitude) in enumerate(spots):
        for other, other_x, other_y, other_altitude in spots[index + 1 :]:
            if abs(x - other_x) < CLOSE_M and abs(y - other_y) < CLOSE_M:
                apart_m = math.hypot(x - other_x, y - other_y)
                if apart_m < CLOSE_M and (
                    altitude is None or other_altitude is None or abs(altitude - other_altitude) < CLOSE_ABOVE_M
                ):
                    above = (
                        None if altitude is None or other_altitude is None else round(abs(altitude - other_altitude), 1)
                    )
                    row = {"units": [unit, other], "apart": round(apart_m, 1), "above": above}
                    name = f"{unit} {other}"
                    found[name] = before[name] if before.get(name) == row else row
    return found


@dataclass(slots=True)
class Curves:
    """By monitor, the last two minutes, a point a second: of a pair metres between the two, else the formula's margin."""

    _at_us: int = 0
    _points: dict[str, "deque[tuple[int, float]]"] = field(default_factory=dict)

    def on_time(self, now_us: int, platforms: Mapping[str, Row], monitors: Mapping[str, Row]) -> None:
        """Measure, if a second has passed."""
        if now_us - self._at_us < EVERY_US:
            return
        self._at_us = now_us
        for name, row in monitors.items():
            measured = _apart_m(
                [at for unit in row["units"] if (at := platforms.get(unit, {}).get("at"))], row["units"]
            )
            measured = row.get("margin") if measured is None else measured
            if measured is not None:
                self._points.setdefault(name, deque(maxlen=CURVE_POINTS)).append((now_us, measured))
        for name in self._points.keys() - monitors.keys():
            del self._points[name]

    def points(self) -> dict[str, list[list[float]]]:
        """Pairs of time and measure."""
        return {name: [[at_us, measured] for at_us, measured in curve] for name, curve in self._points.items()}

    def copy(self) -> "Curves":
        """The same, measured by itself from now on."""
        return Curves(self._at_us, {name: deque(curve, CURVE_POINTS) for name, curve in self._points.items()})


def _apart_m(places: list[list[float]], units: list[str]) -> float | None:
    """Horizontally, of the two units of a pair, where both are known."""
    if not len(units) == len(places) == 2:
        return None
    (one, other), (north_m, east_m) = places, metres_per_degree(places[0][0])
    return round(math.hypot((one[0] - other[0]) * north_m, (one[1] - other[1]) * east_m), 1)
