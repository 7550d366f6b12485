"""The saliency map as SVG: where persons were found, metres east and north, and by which platforms."""

from collections.abc import Iterator, Sequence
from math import atan2, ceil, degrees, floor, hypot, sqrt
from typing import Final

from dyknow.kpl.introspection.svg import BLACK, document, path, words
from dyknow.runtime.library.pictures.saliency import FoundPerson

WIDE_PX: Final = 900
EDGE_PX: Final = 50
GRID_M: Final = 50.0
SIGMAS: Final = 2.0
LEAST_PX: Final = 3.0
COLOURS: Final = ("#1f77b4", "#d95f02", "#7570b3", "#e7298a", "#66a61e", "#a6761d")
SEVERAL: Final = BLACK
FAINT: Final = "#dddddd"


def saliency_svg(persons: Sequence[FoundPerson]) -> str:
    """Each person a cross in an ellipse of two standard deviations, and its name; black if several platforms found it."""
    if not persons:
        return document(1, 1, ())
    west_m, south_m = (GRID_M * (floor(min(of) / GRID_M - 0.2)) for of in _places(persons))
    east_m, north_m = (GRID_M * (ceil(max(of) / GRID_M + 0.2)) for of in _places(persons))
    scale = (WIDE_PX - 2 * EDGE_PX) / (east_m - west_m)
    high_px = round(scale * (north_m - south_m) + 2 * EDGE_PX + 20)

    def at(x_m: float, y_m: float) -> tuple[float, float]:
        return EDGE_PX + scale * (x_m - west_m), EDGE_PX + scale * (north_m - y_m)

    by = sorted({unit for each in persons for unit in each.by})
    colours = {unit: COLOURS[number % len(COLOURS)] for number, unit in enumerate(by)}
    parts = list[str]()
    for number in range(round((east_m - west_m) / GRID_M) + 1):
        x_m = west_m + number * GRID_M
        (x, low), (_, top) = at(x_m, south_m), at(x_m, north_m)
        parts += [path(f"M{x:.1f} {low:.1f}V{top:.1f}", FAINT), words(x, low + 16, f"{x_m:g} m", "middle")]
    for number in range(round((north_m - south_m) / GRID_M) + 1):
        y_m = south_m + number * GRID_M
        (left, y), (right, _) = at(west_m, y_m), at(east_m, y_m)
        parts += [path(f"M{left:.1f} {y:.1f}H{right:.1f}", FAINT), words(left - 6, y + 4, f"{y_m:g}", "end")]
    for each in persons:
        parts += _person(each, at(each.x_m, each.y_m), scale, SEVERAL if len(each.by) > 1 else colours[each.by[0]])
    legend = [(f"found by {unit}", colours[unit]) for unit in by] + [("found by several", SEVERAL)]
    for number, (text, colour) in enumerate(legend):
        parts.append(words(EDGE_PX + 130 * number, high_px - 8, text, "start", colour))
    return document(WIDE_PX, high_px, parts)


def _places(persons: Sequence[FoundPerson]) -> tuple[list[float], list[float]]:
    return [each.x_m for each in persons], [each.y_m for each in persons]


def _person(each: FoundPerson, at: tuple[float, float], scale: float, colour: str) -> Iterator[str]:
    x, y = at
    xx, xy, yy = each.covariance
    mean, half = (xx + yy) / 2.0, hypot((xx - yy) / 2.0, xy)
    long_px, short_px = (max(LEAST_PX, SIGMAS * scale * sqrt(max(0.0, of))) for of in (mean + half, mean - half))
    turned = -degrees(0.5 * atan2(2.0 * xy, xx - yy))
    yield (
        f'<ellipse cx="{x:.1f}" cy="{y:.1f}" rx="{long_px:.1f}" ry="{short_px:.1f}" '
        f'transform="rotate({turned:.1f} {x:.1f} {y:.1f})" fill="none" stroke="{colour}"/>'
    )
    yield path(f"M{x - 4:.1f} {y:.1f}h8M{x:.1f} {y - 4:.1f}v8", colour)
    yield words(x, y - 9, f"{each.name}, {each.observed_s:.0f} s", "middle", colour)
