"""Curves as SVG: two panels side by side, one with a logarithmic axis. Values are microseconds."""

from collections.abc import Callable, Iterator, Sequence
from html import escape
from math import ceil, floor, log10
from typing import NamedTuple, Self

WIDE, HIGH = 440, 300
LEFT, TOP, BELOW, GAP = 62, 58, 44, 30
LINE = 17
INK, FAINT = "#222222", "#dddddd"
FONT = f'font-family="Helvetica, Arial, sans-serif" font-size="12" fill="{INK}"'


class Point(NamedTuple):
    """A value and the interval it lies in."""

    x: float
    y: float
    low: float
    high: float

    @classmethod
    def sure(cls, x: float, y: float) -> Self:
        return cls(x, y, y, y)


class Curve(NamedTuple):
    """Points with a bar for each interval and a thin line between them, or a dashed line without marks."""

    name: str
    colour: str
    points: tuple[Point, ...]
    is_line: bool = False


class Panel(NamedTuple):
    title: str
    curves: tuple[Curve, ...]
    is_log: bool


def drawn(title: str, x_title: str, panels: Sequence[Panel]) -> str:
    """The picture."""
    legend = LINE * max(sum(1 for curve in panel.curves if curve.name) for panel in panels)
    wide = GAP + len(panels) * (LEFT + WIDE + GAP)
    high = TOP + HIGH + BELOW + legend + 12
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {wide} {high}" width="{wide}" height="{high}" {FONT}>',
        f'<rect width="{wide}" height="{high}" fill="#ffffff"/>',
        _text(wide / 2, 22, title, "middle", 'font-size="15" font-weight="bold"'),
    ]
    for at, panel in enumerate(panels):
        parts += _panel(panel, x_title, GAP / 2 + LEFT + at * (LEFT + WIDE + GAP))
    return "\n".join((*parts, "</svg>", ""))


def _panel(panel: Panel, x_title: str, left: float) -> Iterator[str]:
    every = [point for curve in panel.curves for point in curve.points]
    right_x = max(point.x for point in every)
    low, high = _range(every, panel.is_log)
    scale: Callable[[float], float] = log10 if panel.is_log else float

    def across(x: float) -> float:
        return left + WIDE * x / (right_x * 1.03)

    def up(y: float) -> float:
        share = (scale(min(max(y, low), high)) - scale(low)) / (scale(high) - scale(low))
        return TOP + HIGH * (1 - share)

    yield _text(left + WIDE / 2, TOP - 12, panel.title, "middle")
    for y in _marks(low, high, panel.is_log):
        yield f'<line x1="{left:.1f}" x2="{left + WIDE:.1f}" y1="{up(y):.1f}" y2="{up(y):.1f}" stroke="{FAINT}"/>'
        yield _text(left - 6, up(y) + 4, _said(y), "end")
    for x in _marks(0, right_x, is_log=False):
        yield _text(across(x), TOP + HIGH + 17, f"{x:g}", "middle")
    yield _text(left + WIDE / 2, TOP + HIGH + 34, x_title, "middle")
    yield f'<rect x="{left:.1f}" y="{TOP}" width="{WIDE}" height="{HIGH}" fill="none" stroke="{INK}"/>'
    for curve in panel.curves:
        yield from _curve(curve, across, up)
    named = [curve for curve in panel.curves if curve.name]
    for at, curve in enumerate(named):
        y = TOP + HIGH + BELOW + 10 + LINE * at
        dash = ' stroke-dasharray="6 4"' if curve.is_line else ""
        yield f'<line x1="{left}" x2="{left + 24}" y1="{y}" y2="{y}" stroke="{curve.colour}" stroke-width="2.5"{dash}/>'
        yield _text(left + 32, y + 4, curve.name)


def _curve(curve: Curve, across: Callable[[float], float], up: Callable[[float], float]) -> Iterator[str]:
    path = " ".join(f"{across(point.x):.1f},{up(point.y):.1f}" for point in curve.points)
    style = 'stroke-width="1.5" stroke-dasharray="6 4"' if curve.is_line else 'stroke-width="1" stroke-opacity="0.5"'
    yield f'<polyline points="{path}" fill="none" stroke="{curve.colour}" {style}/>'
    if curve.is_line:
        return
    for point in curve.points:
        x = across(point.x)
        yield f'<line x1="{x:.1f}" x2="{x:.1f}" y1="{up(point.low):.1f}" y2="{up(point.high):.1f}" stroke="{curve.colour}"/>'
        yield f'<circle cx="{x:.1f}" cy="{up(point.y):.1f}" r="3" fill="{curve.colour}"/>'


def _range(every: Sequence[Point], is_log: bool) -> tuple[float, float]:
    if is_log:
        return 10 ** floor(log10(min(point.y for point in every))), 10 ** ceil(log10(max(point.y for point in every)))
    return 0.0, 1.05 * max(point.high for point in every)


def _marks(low: float, high: float, is_log: bool) -> Iterator[float]:
    if is_log:
        yield from (10.0**power for power in range(round(log10(low)), round(log10(high)) + 1))
        return
    rough = (high - low) / 5
    unit = 10 ** floor(log10(rough))
    step = next(each * unit for each in (1, 2, 5, 10) if each * unit >= rough)
    yield from (low + step * at for at in range(floor((high - low) / step) + 1))


def _said(us: float) -> str:
    return f"{us / 1e6:g} s" if us >= 1e6 else f"{us / 1e3:g} ms" if us >= 1e3 else f"{us:g} us"


def _text(x: float, y: float, said: str, anchor: str = "start", more: str = "") -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" {more}>{escape(said)}</text>'
