"""Scanning an area by sight: cells of a grid that were in view for long enough, and the lanes over those that were not. Pure.

Lanes are those of a lawn-mower: parallel to the longer side of the area, as far apart as the camera sees to both sides,
each from the first to the last unseen cell. Places are metres east and north.
"""

from collections.abc import Sequence
from math import ceil, hypot
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from dyknow.navigation.cameras.rig import CameraRig

Floats: TypeAlias = NDArray[np.float64]
Flags: TypeAlias = NDArray[np.bool_]
SEEN_US: Final = 5_000_000
"""So long a place is in view before it counts as seen: a person is one after that time (thesis 7.1.1)."""
PAUSE_US: Final = 500_000
"""Looks that are further apart do not belong together."""
MOST_CELLS: Final = 1000
LEAST_CELL_M: Final = 3.0
SWATH: Final = 0.65
"""The distance of lanes, as a share of the shorter side of the view, so that each place is seen over its length."""
INSET: Final = 0.3
"""A lane ends so far before the last cell, in swaths: that is in view from there."""


def swath_m(rig: CameraRig, height_m: float) -> float:
    """How far apart lanes are flown at a height above the ground, the camera straight down."""
    narrow = min(min(each.width_px, each.height_px) / each.focal_px for each in rig.cameras.values())
    return SWATH * narrow * height_m


class ScanGrid:
    """The cells of an area, and which were seen.

    Args:
        border: (n, 2), corners of the area.

    Attributes:
        cells: (m, 2), middles of those inside the border.
        seen: (m,), by any platform.
    """

    def __init__(self, border: Floats) -> None:
        low, high = border.min(axis=0), border.max(axis=0)
        side_m = max(LEAST_CELL_M, float(np.sqrt(np.prod(high - low) / MOST_CELLS)))
        steps = [np.arange(start + side_m / 2.0, end, side_m) for start, end in zip(low, high, strict=True)]
        every = np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, 2)
        self.cells: Floats = every[within(border, every)]
        self.seen: Flags = np.zeros(len(self.cells), dtype=np.bool_)
        self._in_view_us = np.zeros(len(self.cells))
        self._looked_us: int | None = None

    def look(self, valid_us: int, view_m: Floats) -> None:
        """Take what was in view (4, 2) at a time; looks come in its order."""
        since_us = 0 if self._looked_us is None else valid_us - self._looked_us
        self._looked_us = valid_us
        if 0 < since_us <= PAUSE_US:
            self._in_view_us[within(view_m, self.cells)] += since_us
            self.seen |= self._in_view_us >= SEEN_US

    @property
    def share(self) -> float:
        """How much of the area was seen."""
        return float(self.seen.mean()) if len(self.seen) else 1.0

    def text(self) -> str:
        """The cells that were seen, in hexadecimal digits."""
        return np.packbits(self.seen).tobytes().hex()

    def merge(self, text: str) -> bool:
        """Take what another has seen of the same area; whether it is a text of such a grid."""
        try:
            given = np.unpackbits(np.frombuffer(bytes.fromhex(text), dtype=np.uint8))
        except ValueError:
            return False
        if len(given) != -(-len(self.seen) // 8) * 8:
            return False
        self.seen |= given[: len(self.seen)].astype(np.bool_)
        return True


def within(corners: Floats, points: Floats) -> Flags:
    """Which of (n, 2) points lie in a polygon: a ray to the east crosses its border an odd number of times."""
    (x0, y0), (x1, y1) = corners.T[:, None, :], np.roll(corners, -1, axis=0).T[:, None, :]
    x, y = points[:, 0:1], points[:, 1:2]
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = x0 + (y - y0) / (y1 - y0) * (x1 - x0)
    crosses = ((y0 > y) != (y1 > y)) & (x < crossing)
    return np.asarray(crosses.sum(axis=1) % 2 == 1)


def lawn_mower(cells: Floats, apart_m: float, start: tuple[float, float]) -> list[tuple[float, float]]:
    """Where to fly to in turn so that all cells (n, 2) come into view, beginning at the end that is nearest to `start`."""
    if not len(cells):
        return []
    centred = cells - cells.mean(axis=0)
    spread = cells.max(axis=0) - cells.min(axis=0)
    axes = np.eye(2)[::-1] if spread[1] >= spread[0] else np.eye(2)
    turned = centred @ axes.T
    low, high = turned[:, 1].min(), turned[:, 1].max()
    lanes = max(1, ceil((high - low) / apart_m))
    width_m = max((high - low) / lanes, 1e-6)
    band = np.minimum((turned[:, 1] - low) // width_m, lanes - 1)
    ends = []
    for lane in range(lanes):
        along = turned[band == lane, 0]
        if len(along):
            inset = min(INSET * apart_m, (along.max() - along.min()) / 2.0)
            ends.append((lane, along.min() + inset, along.max() - inset))
    middle = cells.mean(axis=0)

    def places(order: Sequence[tuple[int, float, float]], *, back: bool) -> list[tuple[float, float]]:
        found: list[tuple[float, float]] = []
        for at, (lane, first, last) in enumerate(order):
            pair = (last, first) if (at % 2 == 1) != back else (first, last)
            for along in pair:
                x_m, y_m = (middle + np.array([along, low + (lane + 0.5) * width_m]) @ axes).tolist()
                found.append((x_m, y_m))
        return found

    ways = [places(order, back=back) for order in (ends, ends[::-1]) for back in (False, True)]
    return min(ways, key=lambda way: hypot(way[0][0] - start[0], way[0][1] - start[1]))
