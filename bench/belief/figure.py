"""`python -m bench.belief.figure`: existence over time, as in Figure 5 of the paper on world models, drawn to docs/figures/.

What `dyknow world` believes of the observations in examples/world/left.jsonl, and between them.
"""

from collections import defaultdict
from itertools import pairwise
from pathlib import Path

from dyknow.anchoring.belief.environment import EnvironmentModel
from dyknow.anchoring.belief.files.lines import ObservationReader
from dyknow.anchoring.belief.files.models import read_world_model
from dyknow.anchoring.belief.reports import UpdateReport

ROOT = Path(__file__).parents[2]
OUT = ROOT / "docs" / "figures" / "existence.svg"
_LAST_S, _WIDE, _HIGH, _LEFT, _TOP = 42.0, 560, 200, 44, 16
_COLOURS = ("#c0392b", "#1f5fa8")
_STEP_US = 250_000

Course = dict[str, list[tuple[float, float]]]


def courses() -> Course:
    """(time in seconds, existence) of each instance."""
    world = ROOT / "examples" / "world"
    model = read_world_model((world / "yard.toml").read_text(encoding="utf-8"))
    environment, found = EnvironmentModel(model), defaultdict[str, list[tuple[float, float]]](list)

    def note(report: UpdateReport) -> None:
        for event in report.events:
            if event.kind == "deleted":
                found[event.instance].append((event.valid_us / 1e6, event.existence))
        for each in environment.query():
            found[each.name].append((report.valid_us / 1e6, each.existence))

    def wrong(error: Exception) -> None:
        raise error

    lines = (world / "left.jsonl").read_text(encoding="utf-8").splitlines()
    looks = [*ObservationReader("left.jsonl", model, wrong).looks(lines)]
    for look, after in pairwise([*looks, looks[-1]]):
        note(environment.on_look(*look))
        for now_us in range(look.valid_us + _STEP_US, after.valid_us, _STEP_US):
            note(environment.predict_to(now_us))
        if after.valid_us > look.valid_us:
            note(environment.predict_to(after.valid_us))
    return found


def drawing(found: Course) -> str:
    """The picture, SVG."""

    def at(t_s: float, existence: float) -> str:
        return f"{_LEFT + t_s / _LAST_S * _WIDE:.1f},{_TOP + (1.0 - existence) * _HIGH:.1f}"

    def across(existence: float, text: str) -> str:
        (x, y), end = at(0.0, existence).split(","), at(_LAST_S, existence).split(",")[0]
        line = f'<line x1="{x}" y1="{y}" x2="{end}" y2="{y}" stroke="#999999" stroke-dasharray="4 3"/>'
        return f'{line}<text x="{float(end) - 4:.1f}" y="{float(y) - 4:.1f}" text-anchor="end" fill="#777777">{text}</text>'

    parts = [
        (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDE + _LEFT + 20} {_HIGH + 56}" '
            f'width="{_WIDE + _LEFT + 20}" height="{_HIGH + 56}" font-family="Helvetica, Arial, sans-serif" '
            'font-size="12" fill="#222222">'
        ),
        f'<rect width="{_WIDE + _LEFT + 20}" height="{_HIGH + 56}" fill="#ffffff"/>',
        across(0.9, "confirm"),
        across(0.05, "delete"),
        f'<polyline points="{at(0, 1)} {at(0, 0)} {at(_LAST_S, 0)}" fill="none" stroke="#222222"/>',
    ]
    for t_s in range(0, 41, 10):
        x, y = at(t_s, 0.0).split(",")
        parts.append(f'<text x="{x}" y="{float(y) + 16:.1f}" text-anchor="middle">{t_s} s</text>')
    for existence in (0.0, 0.5, 1.0):
        x, y = at(0.0, existence).split(",")
        parts.append(f'<text x="{float(x) - 6:.1f}" y="{float(y) + 4:.1f}" text-anchor="end">{existence:g}</text>')
    for (name, course), colour in zip(found.items(), _COLOURS, strict=False):
        points = " ".join(at(*point) for point in course if point[0] <= _LAST_S)
        parts.append(f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="1.8"/>')
        x, y = at(9.0 + 4.0 * list(found).index(name), 0.0).split(",")
        parts.append(f'<text x="{x}" y="{float(y) + 34:.1f}" fill="{colour}">{name}</text>')
    return "\n".join((*parts, "</svg>", ""))


def main() -> None:
    OUT.write_text(drawing(courses()), encoding="utf-8")
    print(OUT)


if __name__ == "__main__":
    main()
