"""`python -m bench.cooperation.figure FILE`: where the objects of a picture were, and which platforms saw them, drawn to docs/figures/.

FILE has the lines of `dyknow objects --follow --json` on running platforms: of the example `examples/cooperation/`, those of two rounds.
"""

import json
import sys
from collections import defaultdict
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

OUT = Path(__file__).parents[2] / "docs" / "figures" / "cooperation.svg"
_LASTS_S, _FROM_M, _TO_M, _BORDER_M = 30.0, 0.0, 260.0, 100.0
_WIDE, _HIGH, _LEFT, _TOP = 620, 300, 52, 14
_COLOURS = {(0,): "#1f5fa8", (1,): "#c0392b", (0, 1): "#7d3c98"}
_MEANING = {"#1f5fa8": "seen by 0", "#c0392b": "by 1", "#7d3c98": "by both"}


class Seen(NamedTuple):
    """When an object was where, and which platforms saw it there."""

    at_s: float
    x_m: float
    by: tuple[int, ...]


def courses(lines: Iterable[str]) -> dict[str, list[Seen]]:
    """Where each was when it was seen, by name and from the first one on; places that are predicted are left out."""
    found: dict[str, list[Seen]] = defaultdict(list)
    begin_us: int | None = None
    for each in map(json.loads, lines):
        if "symbol" in each and each.get("event") != "vanished":
            begin_us = each["seen_us"] if begin_us is None else begin_us
            seen = Seen((each["seen_us"] - begin_us) / 1e6, each["x_m"], tuple(sorted(each["by"])))
            if each["by"] and (not found[each["symbol"]] or found[each["symbol"]][-1].at_s < seen.at_s):
                found[each["symbol"]].append(seen)
    return found


def _at(t_s: float, x_m: float) -> tuple[float, float]:
    return _LEFT + t_s / _LASTS_S * _WIDE, _TOP + (_TO_M - x_m) / (_TO_M - _FROM_M) * _HIGH


def drawing(found: Mapping[str, list[Seen]]) -> str:
    """The picture, SVG."""
    (left, bottom), (right, top) = _at(0.0, _FROM_M), _at(_LASTS_S, _TO_M)
    border = _at(0.0, _BORDER_M)[1]
    parts = [
        (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDE + _LEFT + 20} {_HIGH + 64}" '
            f'width="{_WIDE + _LEFT + 20}" height="{_HIGH + 64}" font-family="Helvetica, Arial, sans-serif" '
            'font-size="12" fill="#222222">'
        ),
        f'<rect width="{_WIDE + _LEFT + 20}" height="{_HIGH + 64}" fill="#ffffff"/>',
        f'<polyline points="{left},{top} {left},{bottom} {right},{bottom}" fill="none" stroke="#222222"/>',
        f'<line x1="{left}" y1="{border}" x2="{right}" y2="{border}" stroke="#999999" stroke-dasharray="4 3"/>',
        f'<text x="{right - 4}" y="{border - 4}" text-anchor="end" fill="#777777">the areas meet</text>',
    ]
    parts += [
        f'<text x="{_at(t_s, 0)[0]:.0f}" y="{bottom + 16}" text-anchor="middle">{t_s} s</text>'
        for t_s in range(0, round(_LASTS_S) + 1, 5)
    ]
    parts += [
        f'<text x="{left - 6}" y="{_at(0, x_m)[1] + 4:.0f}" text-anchor="end">{x_m} m</text>'
        for x_m in range(round(_FROM_M), round(_TO_M), 50)
    ]
    for name, every in found.items():
        seen = [each for each in every if each.at_s <= _LASTS_S and _FROM_M <= each.x_m <= _TO_M]
        if len({each.by for each in seen}) > 1:
            parts += _course(name, seen)
    for number, (colour, meaning) in enumerate(_MEANING.items()):
        x, y = left + 20 + 110 * number, bottom + 40
        parts.append(f'<circle cx="{x}" cy="{y - 4}" r="4" fill="{colour}" stroke="#555555"/>')
        parts.append(f'<text x="{x + 9}" y="{y}">{meaning}</text>')
    return "\n".join((*parts, "</svg>", ""))


def _course(name: str, seen: list[Seen]) -> Iterable[str]:
    points = [_at(each.at_s, each.x_m) for each in seen]
    yield f'<polyline points="{" ".join(f"{x:.1f},{y:.1f}" for x, y in points)}" fill="none" stroke="#bbbbbb"/>'
    for (x, y), each in zip(points, seen, strict=True):
        colour = _COLOURS.get(each.by, "#7d3c98")
        yield f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3.5" fill="{colour}" stroke="#555555" stroke-width="0.5"/>'
    x, y = points[0]
    yield f'<text x="{x + 4:.0f}" y="{y + 18:.0f}" font-size="11">{name}</text>'


def main() -> None:
    OUT.write_text(drawing(courses(Path(sys.argv[1]).read_text(encoding="utf-8").splitlines())), encoding="utf-8")
    print(OUT)


if __name__ == "__main__":
    main()
