"""Which ground a camera has seen lately: places to search, each with the time at which it was in the image last."""

from collections.abc import Iterable, Sequence
from math import hypot
from typing import Final

import numpy as np

from dyknow import US_PER_S
from dyknow.anchoring.roads.elements import RoadLink
from dyknow.anchoring.roads.geometry import Point2
from dyknow.anchoring.roads.network import RoadNetwork
from dyknow.navigation import LocalFrame
from dyknow.navigation.cameras.pinhole import FloatArray

MOST_PLACES: Final = 2000
OLD_US: Final = 30 * US_PER_S
"""Ground that was not seen for so long, or never, is as good as any other."""


class SearchedGround:
    """Ground that is searched for unknown objects.

    Args:
        places: metres east and north; beyond `MOST_PLACES` every second, third, ... is kept.
    """

    def __init__(self, places: Sequence[Point2] = ()) -> None:
        kept = places[:: 1 + len(places) // (MOST_PLACES + 1)]
        self.x_m, self.y_m = np.array(kept, dtype=np.float64).reshape(-1, 2).T
        self._seen_us = np.full(len(self.x_m), -(2**62), dtype=np.int64)

    def on_view(self, now_us: int, in_view: FloatArray) -> None:
        """(N,) of 0 or 1: the places in the image now."""
        self._seen_us[in_view > 0.0] = now_us

    def staleness(self, now_us: int) -> FloatArray:
        """(N,) of 0, seen now, to 1, not seen for `OLD_US`."""
        age: FloatArray = np.clip((now_us - self._seen_us) / OLD_US, 0.0, 1.0)
        return age

    def stalest(self, now_us: int, most: int, near: FloatArray) -> list[tuple[float, float]]:
        """Of the places in reach, (N,) of 0 or 1, some that were not seen for longest, apart from each other in the order given."""
        stale = self.staleness(now_us) * near
        chosen = np.flatnonzero((stale > 0.0) & (stale >= 0.5 * stale.max(initial=0.0))).tolist()
        chosen = chosen[:: max(1, len(chosen) // most)][:most]
        return [(float(self.x_m[index]), float(self.y_m[index])) for index in chosen]


def along(links: Iterable[RoadLink], apart_m: float = 30.0) -> list[Point2]:
    """Places on the centre lines of roads."""
    places: list[Point2] = []
    for link in links:
        count = max(1, round(link.length_m / apart_m))
        places += [link.line.at((number + 0.5) * link.length_m / count)[:2] for number in range(count)]
    return places


def roads_near(
    network: RoadNetwork, frame: LocalFrame, x_m: float, y_m: float, reach_m: float, apart_m: float = 30.0
) -> list[Point2]:
    """Places on roads within reach of a place, both in `frame`; roads without a place on earth are taken to be in it."""
    own = network.frame or frame
    middle_m, right_m, _ = own.to_ned(*frame.from_ned(y_m, x_m, 0.0))
    near = [link for link, _ in network.index.links_near(right_m, middle_m, reach_m)]
    placed = [frame.to_ned(*own.from_ned(north_m, east_m, 0.0)) for east_m, north_m in along(near, apart_m)]
    return [(east_m, north_m) for north_m, east_m, _ in placed if hypot(east_m - x_m, north_m - y_m) <= reach_m]


def around(x_m: float, y_m: float, reach_m: float, apart_m: float = 40.0) -> list[Point2]:
    """A grid around a place."""
    steps = np.arange(-reach_m, reach_m + 1.0, apart_m)
    return [(x_m + float(east), y_m + float(north)) for east in steps for north in steps]
