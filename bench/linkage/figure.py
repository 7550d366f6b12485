"""`python -m bench.linkage.figure`: a run like that of Figure 5 of the paper on object linkage, drawn to docs/figures/.

Red circles are percepts, with the error that they have; blue squares the on-road object, filled where a percept shows it,
hollow where it is predicted along its most likely route; the line is where the car really was.
"""

import argparse
from collections.abc import Iterable, Iterator, Sequence
from html import escape
from pathlib import Path
from typing import Any

from bench.linkage.ours import link_lines
from dyknow.anchoring.roads.network import RoadNetwork
from dyknow.sim_uavs.roads.layouts import network_of
from dyknow.sim_uavs.roads.scenes import RoadRecording, recorded

OUT = Path(__file__).parents[2] / "docs" / "figures" / "linkage.svg"
_SCALE, _MARGIN_M = 5.0, 6.0
_RED, _BLUE, _ROAD, _LINE = "#c0392b", "#1f5fa8", "#dddddd", "#555555"


def drawing(recording: RoadRecording) -> str:
    """The picture, SVG; its frame is where the car was."""
    truth = [(state.x_m, state.y_m) for look in recording.looks for state in look.truth]
    west, east = min(x for x, _ in truth) - _MARGIN_M, max(x for x, _ in truth) + 2.0 * _MARGIN_M
    south, north = min(y for _, y in truth) - _MARGIN_M, max(y for _, y in truth) + 2.0 * _MARGIN_M
    wide, high = (east - west) * _SCALE, (north - south) * _SCALE

    def at(x_m: float, y_m: float) -> str:
        return f"{(x_m - west) * _SCALE:.1f},{(north - y_m) * _SCALE:.1f}"

    def line(points: Iterable[tuple[float, float]], colour: str, width: float) -> str:
        path = " ".join(at(*point) for point in points)
        return f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="{width:.1f}"/>'

    parts = [
        (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {wide:.0f} {high:.0f}" width="{wide:.0f}" '
            f'height="{high:.0f}" font-family="Helvetica, Arial, sans-serif" font-size="13" fill="#222222">'
        ),
        f'<rect width="{wide:.0f}" height="{high:.0f}" fill="#ffffff"/>',
        *_roads(network_of(recording.scene.roads), line, at),
        line(truth, _LINE, 1.0),
        *_percepts(recording, at),
        *_objects(recording, at),
        *_legend(recording),
    ]
    return "\n".join((*parts, "</svg>", ""))


def _roads(network: RoadNetwork, line: Any, at: Any) -> Iterator[str]:
    for link in network.links.values():
        yield line(link.line.points, _ROAD, link.width_m * _SCALE)
    for link in network.links.values():
        yield line(link.line.points, "#ffffff", 1.5)
    for crossing in network.crossings.values():
        x, y = at(crossing.x_m, crossing.y_m).split(",")
        yield f'<circle cx="{x}" cy="{y}" r="{crossing.radius_m * _SCALE:.1f}" fill="{_ROAD}"/>'


def _percepts(recording: RoadRecording, at: Any) -> Iterator[str]:
    for percept in (percept for look in recording.looks for percept in look.percepts if not percept.end):
        x, y = at(percept.x_m, percept.y_m).split(",")
        yield f'<circle cx="{x}" cy="{y}" r="3.2" fill="none" stroke="{_RED}"/>'


def _objects(recording: RoadRecording, at: Any) -> Iterator[str]:
    """On-road objects; a symbol is written where it begins."""
    seen = {look.t_us // 1000 for look in recording.looks for percept in look.percepts if not percept.end}
    named: set[str] = set()
    for each in link_lines(recording):
        if each.get("type") != "on_road":
            continue
        x, y = (float(value) for value in at(each["x_m"], each["y_m"]).split(","))
        fill = _BLUE if each["t_ms"] in seen else "#ffffff"
        yield f'<rect x="{x - 3:.1f}" y="{y - 3:.1f}" width="6" height="6" fill="{fill}" stroke="{_BLUE}"/>'
        if each["symbol"] not in named:
            named.add(each["symbol"])
            yield f'<text x="{x:.1f}" y="{y + 24:.1f}">{escape(each["symbol"])}</text>'


def _legend(recording: RoadRecording) -> Iterator[str]:
    count = len({percept.percept for look in recording.looks for percept in look.percepts})
    said: Sequence[tuple[str, str]] = (
        (f'<circle cx="18" cy="{{y}}" r="3.2" fill="none" stroke="{_RED}"/>', f"percepts, {count} one after the other"),
        (f'<rect x="15" y="{{top}}" width="6" height="6" fill="{_BLUE}"/>', "on-road object, linked"),
        (
            f'<rect x="15" y="{{top}}" width="6" height="6" fill="#ffffff" stroke="{_BLUE}"/>',
            "predicted along the road",
        ),
    )
    for number, (mark, text) in enumerate(said):
        y = 20 + 18 * number
        yield mark.format(y=y, top=y - 3)
        yield f'<text x="32" y="{y + 4}">{escape(text)}</text>'


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m bench.linkage.figure", description=(__doc__ or "").partition("\n")[0]
    )
    parser.add_argument("--seed", type=int, default=3, help="of the run (3)")
    parser.add_argument("--out", type=Path, default=OUT, help="where the picture is kept")
    asked = parser.parse_args()
    asked.out.write_text(drawing(recorded("one", asked.seed)), encoding="utf-8")
    print(asked.out)


if __name__ == "__main__":
    main()
