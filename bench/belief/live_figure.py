"""`python -m bench.belief.live_figure FILE`: what a running platform believed in, drawn to docs/figures/.

FILE has the lines of `dyknow objects --type beliefs --unit 0 --follow --json`: above existence over time, below the standard deviation
of the place.
"""

import json
import sys
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from math import log10
from pathlib import Path
from typing import NamedTuple

OUT = Path(__file__).parents[2] / "docs" / "figures" / "beliefs-live.svg"
_LASTS_S, _MOST, _LEAST_SD_M, _MOST_SD_M = 70.0, 5, 0.1, 1000.0
_WIDE, _HIGH, _LEFT, _TOP, _BETWEEN = 600, 150, 60, 24, 40
_COLOURS = ("#c0392b", "#1f5fa8", "#1e8449", "#7d3c98", "#b9770e")


class Believed(NamedTuple):
    """What was believed of one instance at a time, and whether a camera saw it."""

    at_s: float
    existence: float
    sd_m: float
    is_seen: bool


Course = Sequence[Believed]


def courses(lines: Iterable[str]) -> dict[str, Course]:
    """The instances that begin in the file and that the camera saw for longest: what is drawn."""
    found, begin_us, first_us = defaultdict[str, list[Believed]](list), dict[str, int](), 0
    for each in map(json.loads, lines):
        first_us = first_us or each["valid_us"]
        begin_us.setdefault(each["symbol"], each["valid_us"])
        said = (each["valid_us"] - first_us) / 1e6, each["existence"], each["sd_m"], bool(each["seen_by"])
        if each.get("event") != "vanished" and begin_us[each["symbol"]] > first_us + 1_000_000:
            found[each["symbol"]].append(Believed(*said))
    longest = sorted(found, key=lambda name: -sum(each.is_seen for each in found[name]))[:_MOST]
    return {name: found[name] for name in found if name in longest}


def _x(at_s: float) -> float:
    return _LEFT + at_s / _LASTS_S * _WIDE


def _existence_y(each: Believed) -> float:
    return _TOP + (1.0 - each.existence) * _HIGH


def _sd_y(each: Believed) -> float:
    share = log10(min(max(each.sd_m, _LEAST_SD_M), _MOST_SD_M) / _LEAST_SD_M) / log10(_MOST_SD_M / _LEAST_SD_M)
    return _TOP + _HIGH + _BETWEEN + (1.0 - share) * _HIGH


def _frame(top: float, ticks: Mapping[str, float], title: str) -> Iterable[str]:
    bottom, right = top + _HIGH, _x(_LASTS_S)
    yield f'<polyline points="{_LEFT},{top} {_LEFT},{bottom} {right},{bottom}" fill="none" stroke="#222222"/>'
    yield f'<text x="{right}" y="{top - 6}" text-anchor="end" fill="#555555">{title}</text>'
    for text, y in ticks.items():
        yield f'<text x="{_LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{text}</text>'


def drawing(found: Mapping[str, Course]) -> str:
    """The picture, SVG."""
    wide, high = _WIDE + _LEFT + 20, _TOP + 2 * _HIGH + _BETWEEN + 58
    second = _TOP + _HIGH + _BETWEEN
    tenfold = {f"{sd_m:g} m": _sd_y(Believed(0.0, 0.0, sd_m, False)) for sd_m in (0.1, 1.0, 10.0, 100.0, 1000.0)}
    parts = [
        (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {wide} {high}" width="{wide}" height="{high}" '
            'font-family="Helvetica, Arial, sans-serif" font-size="12" fill="#222222">'
        ),
        f'<rect width="{wide}" height="{high}" fill="#ffffff"/>',
        *_frame(_TOP, {"0": _TOP + _HIGH, "0.5": _TOP + _HIGH / 2, "1": _TOP}, "existence"),
        *_frame(second, tenfold, "standard deviation of the place"),
    ]
    parts += [
        f'<text x="{_x(at_s):.0f}" y="{second + _HIGH + 16}" text-anchor="middle">{at_s} s</text>'
        for at_s in range(0, round(_LASTS_S) + 1, 10)
    ]
    for number, (name, course) in enumerate(found.items()):
        colour, x, y = _COLOURS[number], _LEFT + 70 * number, high - 12
        for one, other in pairwise(each for each in course if each.at_s <= _LASTS_S):
            dashes = "" if other.is_seen else ' stroke-dasharray="3 3"'
            for place in (_existence_y, _sd_y):
                ends = (
                    f'x1="{_x(one.at_s):.1f}" y1="{place(one):.1f}" x2="{_x(other.at_s):.1f}" y2="{place(other):.1f}"'
                )
                parts.append(f'<line {ends} stroke="{colour}" stroke-width="1.8"{dashes}/>')
        parts.append(f'<text x="{x}" y="{y}" fill="{colour}">{name}</text>')
    parts.append(f'<text x="{_x(_LASTS_S)}" y="{high - 12}" text-anchor="end" fill="#555555">dashed: not seen</text>')
    return "\n".join((*parts, "</svg>", ""))


def main() -> None:
    OUT.write_text(drawing(courses(Path(sys.argv[1]).read_text(encoding="utf-8").splitlines())), encoding="utf-8")
    print(OUT)


if __name__ == "__main__":
    main()
