"""`python -m bench.overtakes.figure`: the recorded overtake of docs/traffic.md drawn, relations over time and what they come to.

A bar lasts while a relation of the first car to the second holds, after both filters; a line is where a chronicle is
recognised.
"""

import argparse
import json
from collections.abc import Iterator
from html import escape
from pathlib import Path
from typing import Any, Final

from bench.overtakes.recognition import CHRONICLES, chronicles
from dyknow import Label
from dyknow.reasoning.chronicles import ChangeEvents, ChronicleInstance, Recogniser

OUT: Final = Path(__file__).parents[2] / "docs" / "figures" / "overtake.svg"
EVENTS: Final = CHRONICLES.parent / "relations.jsonl"
ROWS: Final = ("behind[a, b]", "left[a, b]", "in_front[a, b]", "behind[a, c]", "close[a, c]", "oncoming[a, c]")
SHOWN: Final = ("passes", "oncoming_too_near")
_LEFT, _TOP, _HIGH, _SECOND = 120.0, 46.0, 26.0, 34.0
"""Pixels: where the bars begin, a row, a second."""
_BAR, _MARK, _GRID = "#1f5fa8", "#c0392b", "#dddddd"


def drawing(events: list[dict[str, Any]]) -> str:
    """The picture, SVG."""
    last_ms = max(each["t_ms"] for each in events) + 1000
    wide, high = _LEFT + last_ms / 1000 * _SECOND + 20.0, _TOP + _HIGH * len(ROWS) + 30.0
    parts = [
        (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {wide:.0f} {high:.0f}" width="{wide:.0f}" '
            f'height="{high:.0f}" font-family="Helvetica, Arial, sans-serif" font-size="12" fill="#222222">'
        ),
        f'<rect width="{wide:.0f}" height="{high:.0f}" fill="#ffffff"/>',
        *_axis(last_ms),
        *(part for number, row in enumerate(ROWS) for part in _bars(number, row, events, last_ms)),
        *_marks(recognised(events)),
    ]
    return "\n".join((*parts, "</svg>", ""))


def recognised(events: list[dict[str, Any]]) -> list[ChronicleInstance]:
    """What of the chronicles shown is recognised, as it is found."""
    changes = ChangeEvents(Recogniser.of(chronicles(), SHOWN))
    found = (changes.on_sample(Label.parse(each["attribute"]), each["t_ms"] * 1000, each["to"]) for each in events)
    return [one for ones in found for one in ones if one.chronicle in SHOWN]


def _x(t_ms: float) -> float:
    return _LEFT + t_ms / 1000 * _SECOND


def _axis(last_ms: int) -> Iterator[str]:
    bottom = _TOP + _HIGH * len(ROWS)
    for second in range(0, last_ms // 1000 + 1, 2):
        x = _x(second * 1000)
        yield f'<line x1="{x:.0f}" y1="{_TOP:.0f}" x2="{x:.0f}" y2="{bottom:.0f}" stroke="{_GRID}"/>'
        yield f'<text x="{x:.0f}" y="{bottom + 18:.0f}" text-anchor="middle">{second} s</text>'


def _bars(number: int, row: str, events: list[dict[str, Any]], last_ms: int) -> Iterator[str]:
    y = _TOP + _HIGH * number
    yield f'<text x="{_LEFT - 8:.0f}" y="{y + 17:.0f}" text-anchor="end">{escape(row)}</text>'
    begin_ms: int | None = None
    changes = [(each["t_ms"], each["to"]) for each in events if each["attribute"] == f"car_relations.{row}"]
    for t_ms, value in (*changes, (last_ms, False)):
        if value and begin_ms is None:
            begin_ms = t_ms
        elif not value and begin_ms is not None:
            x, wide = _x(begin_ms), _x(t_ms) - _x(begin_ms)
            yield f'<rect x="{x:.1f}" y="{y + 6:.0f}" width="{wide:.1f}" height="14" fill="{_BAR}"/>'
            begin_ms = None


def _marks(found: list[ChronicleInstance]) -> Iterator[str]:
    """One under the other where they come at one time."""
    bottom = _TOP + _HIGH * len(ROWS)
    for number, one in enumerate(found):
        x = _x(one.recognised_ms)
        said = f"{one.chronicle}[{', '.join(one.bindings.values())}]"
        yield f'<line x1="{x:.1f}" y1="{_TOP - 4:.0f}" x2="{x:.1f}" y2="{bottom:.0f}" stroke="{_MARK}"/>'
        yield f'<text x="{x:.1f}" y="{14 + 15 * number}" text-anchor="middle" fill="{_MARK}">{escape(said)}</text>'


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m bench.overtakes.figure", description=(__doc__ or "").partition("\n")[0]
    )
    parser.add_argument("--out", type=Path, default=OUT, help="where the picture is kept")
    chosen = parser.parse_args()
    events = [json.loads(line) for line in EVENTS.read_text(encoding="utf-8").splitlines()]
    chosen.out.write_text(drawing(events), encoding="utf-8")
    print(chosen.out)


if __name__ == "__main__":
    main()
