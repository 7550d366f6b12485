"""From where to look: a ring around candidates, a grid over an area. Metres east and north. Pure."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import ceil, cos, hypot, pi, sin
from typing import Final, NamedTuple

MOST_A_SIDE: Final = 4
"""Places of a search on each side of its grid."""
RING: Final = 4


class Viewpoint(NamedTuple):
    """A place to look from."""

    x_m: float
    y_m: float


@dataclass(frozen=True, slots=True)
class Viewpoints:
    """Places by name, and the ways between them."""

    places: Mapping[str, Viewpoint]
    ways: Mapping[str, Sequence[str]]


def ring(prefix: str, targets: Sequence[Viewpoint], own: Viewpoint, standoff_m: float) -> Viewpoints:
    """Places around all targets, `standoff_m` from the outermost; the first is the nearest to `own`, then round about."""
    middle = Viewpoint(
        sum(each.x_m for each in targets) / len(targets), sum(each.y_m for each in targets) / len(targets)
    )
    radius_m = standoff_m + max(hypot(each.x_m - middle.x_m, each.y_m - middle.y_m) for each in targets)
    around = [
        Viewpoint(middle.x_m + radius_m * sin(turn), middle.y_m + radius_m * cos(turn))
        for turn in (2.0 * pi * number / RING for number in range(RING))
    ]
    nearest = min(range(RING), key=lambda at: (hypot(around[at].x_m - own.x_m, around[at].y_m - own.y_m), at))
    places = {f"{prefix}{number + 1}": around[(nearest + number) % RING] for number in range(RING)}
    return Viewpoints(places, {name: [each for each in places if each != name] for name in places})


def grid(prefix: str, middle: Viewpoint, within_m: float, view_m: float) -> tuple[Viewpoints, float]:
    """Places from which a view `view_m` wide covers a square about `middle`, neighbours joined; and half its side."""
    side = min(MOST_A_SIDE, max(1, ceil(2.0 * within_m / view_m)))
    pitch_m = min(view_m, 2.0 * within_m / side)
    first_m = -pitch_m * (side - 1) / 2.0
    cells = {
        (column, row): Viewpoint(middle.x_m + first_m + pitch_m * column, middle.y_m + first_m + pitch_m * row)
        for row in range(side)
        for column in range(side)
    }
    names = {cell: f"{prefix}{number}" for number, cell in enumerate(cells, 1)}
    ways = {
        names[column, row]: [names[each] for each in _beside(column, row) if each in names] for column, row in cells
    }
    return Viewpoints({names[cell]: place for cell, place in cells.items()}, ways), pitch_m * side / 2.0


def nearest(places: Mapping[str, Viewpoint], own: Viewpoint) -> str:
    """The name of the place that is nearest."""
    return min(places, key=lambda name: (hypot(places[name].x_m - own.x_m, places[name].y_m - own.y_m), name))


def _beside(column: int, row: int) -> tuple[tuple[int, int], ...]:
    return (column + 1, row), (column - 1, row), (column, row + 1), (column, row - 1)
