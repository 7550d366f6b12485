"""SVG written element by element: texts are escaped, and all drawings look alike."""

from collections.abc import Iterable
from html import escape
from typing import Final

BLACK: Final = "#222222"


def document(wide: float, high: float, parts: Iterable[str]) -> str:
    """A picture on white, in pixels: one part a line."""
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {wide:.0f} {high:.0f}" width="{wide:.0f}" '
        f'height="{high:.0f}" font-family="Helvetica, Arial, sans-serif" font-size="11" fill="{BLACK}">'
    )
    return "".join(f"{part}\n" for part in (head, box(0, 0, wide, high, stroke="none"), *parts, "</svg>"))


def box(
    x: float, y: float, wide: float, high: float, *, fill: str = "#ffffff", stroke: str = "#444444", corner: int = 0
) -> str:
    place = f'x="{x:.1f}" y="{y:.1f}" width="{wide:.1f}" height="{high:.1f}"'
    return f'<rect {place} rx="{corner}" fill="{fill}" stroke="{stroke}"/>'


def words(x: float, y: float, text: str, anchor: str = "start", fill: str = BLACK) -> str:
    """A text on one line; `anchor` says which end of it is at x, or `middle`."""
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" fill="{fill}">{escape(text)}</text>'


def path(steps: str, stroke: str = "#8a8a8a") -> str:
    return f'<path d="{steps}" fill="none" stroke="{stroke}"/>'


def curve(x: float, y: float, end_x: float, end_y: float) -> str:
    """From the right end of one thing to the left end of another."""
    bend = abs(end_x - x) / 2
    return path(f"M{x:.1f},{y:.1f} C{x + bend:.1f},{y:.1f} {end_x - bend:.1f},{end_y:.1f} {end_x:.1f},{end_y:.1f}")
