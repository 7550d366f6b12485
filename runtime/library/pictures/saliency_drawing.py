"""The saliency map as SVG: where persons were found, metres east and north, and by which platforms."""

from collections.abc import Iterator, Sequence
from html import escape
from math import atan2, ceil, degrees, floor, hypot, sqrt
from typing import Final

from runtime.library.pictures.saliency import FoundPerson

WIDE_PX: Final = 900
EDGE_PX: Final = 50
GRID_M: Final = 50.0
SIGMAS: Final = 2.0
LEAST_PX: Final = 3.0
COLOURS: Final = ("#1f77b4", "#d95f02", "#7570b3", "#e7298a", "#66a61e", "#a6761d")
SEVERAL: Final = "#222222"
FAINT: Final = "#dddddd"


def saliency_svg(persons: Sequence[FoundPerson]) -> str:
    """Each person a cross in an ellipse of two standard deviations, and its name; black if several platforms found it."""
    if not persons:
        return '<svg xmlns="http://www.w3.org/2000/svg" width="1" height="1"/>\n'
    west_m, south_m = (GRID_M * (floor(min(of) / GRID_M - 0.2)) for of in _places(persons))
    east_m, north_m = (GRID_M * (ceil(max(of) / GRID_M + 0.2)) for of in _places(persons))
    scale = (WIDE_PX - 2 * EDGE_PX) / (east_m - west_m)
    high_px = round(scale * (north_m - south_m) + 2 * EDGE_PX + 20)

    def at(x_m: float, y_m: float) -> tuple[float, float]:
        return EDGE_PX + scale * (x_m - west_m), EDGE_PX + scale * (north_m - y_m)

    by = sorted({unit for each in persons for unit in each.by})
    colours = {unit: COLOURS[number % len(COLOURS)] for number, unit in enumerate(by)}
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDE_PX} {high_px}" font-family="Helvetica, Arial, sans-serif" font-size="12">',
        f'<rect width="{WIDE_PX}" height="{high_px}" fill="#ffffff"/>',
    ]
    for number in range(round((east_m - west_m) / GRID_M) + 1):
        x_m = west_m + number * GRID_M
        (x, low), (_, top) = at(x_m, south_m), at(x_m, north_m)
        parts += [_line(x, low, x, top), _text(x, low + 16, f"{x_m:g} m", "middle")]
    for number in range(round((north_m - south_m) / GRID_M) + 1):
        y_m = south_m + number * GRID_M
        (left, y), (right, _) = at(west_m, y_m), at(east_m, y_m)
        parts += [_line(left, y, right, y), _text(left - 6, y + 4, f"{y_m:g}", "end")]
    for each in persons:
        parts += _person(each, at(each.x_m, each.y_m), scale, SEVERAL if len(each.by) > 1 else colours[each.by[0]])
    legend = [(f"found by {unit}", colours[unit]) for unit in by] + [("found by several", SEVERAL)]
    for number, (text, colour) in enumerate(legend):
        parts.append(_text(EDGE_PX + 130 * number, high_px - 8, text, "start", colour))
    return "\n".join((*parts, "</svg>", ""))


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
    yield f'<path d="M{x - 4:.1f} {y:.1f}h8M{x:.1f} {y - 4:.1f}v8" stroke="{colour}"/>'
    yield _text(x, y - 9, f"{each.name}, {each.observed_s:.0f} s", "middle", colour)


def _line(x1: float, y1: float, x2: float, y2: float) -> str:
    return f'<line x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}" stroke="{FAINT}"/>'


def _text(x: float, y: float, text: str, anchor: str, colour: str = SEVERAL) -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" fill="{colour}">{escape(text)}</text>'
