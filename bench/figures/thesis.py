"""`python -m bench.figures [RESULT.json ...]`: Figures 5.7, 5.9, 5.11 and 7.14 to 7.17 of the thesis, measured here.

Without names the newest results of b03, b04 and b06 are drawn. Each picture has the thesis' delays beside ours on a
logarithmic axis at the left, and ours alone, with the lines through them, at the right.
"""

import argparse
import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from statistics import linear_regression, median, quantiles
from typing import Any, NamedTuple

from bench.figures.plots import Curve, Panel, Point, drawn
from bench.figures.progression_figures import pictures
from bench.streams.experiments import EXPERIMENTS, Experiment
from bench.streams.experiments import points as points_of

_HERE = Path(__file__).parents[1]
OUT = _HERE.parent / "docs" / "figures"
BLUE, LIGHT_BLUE, GREEN, LIGHT_GREEN, RED, GREY = "#1f5fa8", "#7fb0e0", "#1d7a3c", "#80c79a", "#c0392b", "#888888"


class Reference(NamedTuple):
    """What the thesis says of a figure: microseconds at n = 0 and per n."""

    said: str
    base_us: float
    slope_us: float


THESIS: Mapping[str, Reference] = {
    "5.7": Reference("thesis: 2 ms per stream", 0.0, 2000.0),
    "5.9": Reference("thesis: 40 ms and 1 ms per source", 40_000.0, 1000.0),
    "5.11": Reference("thesis: 30 streams of 2 ms (Fig. 5.7); prints no slope here", 60_000.0, 0.0),
}


class Series(NamedTuple):
    """Where a curve comes from: row, side and kind of delay."""

    row: str
    side: str
    kind: str
    said: str
    colour: str
    fitted: bool = False


IN_PROCESS = (
    Series("b04", "ours", "total", "one process, total", BLUE, fitted=True),
    Series("b04", "ours", "channel", "one process, channel", LIGHT_BLUE),
    Series("b04", "calls", "total", "plain calls, total", GREY),
)
SERIES: Mapping[str, Sequence[Series]] = {
    "5.7": (
        Series("b03", "ours", "total", "two processes, total", GREEN, fitted=True),
        Series("b03", "ours", "channel", "two processes, channel", LIGHT_GREEN, fitted=True),
        *IN_PROCESS,
    ),
    "5.9": IN_PROCESS,
    "5.11": IN_PROCESS,
}


def curve(rounds: Sequence[Mapping[str, float]], figure: str, series: Series) -> Curve:
    """Median and quartiles over the rounds, in microseconds."""
    found = [points_of(dict(each), series.kind, figure) for each in rounds]
    middle: list[Point] = []
    for column in zip(*found, strict=True):
        values = [us for _, us in column]
        low, _, high = quantiles(values, n=4, method="inclusive") if len(values) > 1 else (values[0],) * 3
        middle.append(Point(column[0][0], median(values), low, high))
    return Curve(series.said, series.colour, tuple(middle))


def fit(made: Curve) -> tuple[Curve, str]:
    """The line through a curve, and what to write of it."""
    line = linear_regression([p.x for p in made.points], [p.y for p in made.points])
    ends = (made.points[0].x, made.points[-1].x)
    through = tuple(Point.sure(x, line.intercept + line.slope * x) for x in ends)
    return Curve("", made.colour, through, is_line=True), f"{line.intercept:.0f} us + {line.slope:.2f} us"


def picture(experiment: Experiment, rows: Mapping[str, Any]) -> str:
    figure, one = experiment.figure, experiment.varied.removesuffix("s")
    present = [each for each in SERIES[figure] if each.row in rows]
    curves = [curve(rows[each.row]["figures"][each.side], figure, each) for each in present]
    lines, said = [], []
    for each, made in zip(present, curves, strict=True):
        if each.fitted:
            line, text = fit(made)
            lines.append(line)
            said.append(made._replace(name=f"{made.name}: {text} per {one}"))
        else:
            said.append(made)
    reference = THESIS[figure]
    ends = (experiment.points[0], experiment.points[-1])
    thesis = Curve(
        reference.said,
        RED,
        tuple(Point.sure(n, reference.base_us + reference.slope_us * n) for n in range(ends[0], ends[1] + 1)),
        is_line=True,
    )
    return drawn(
        f"Figure {figure}: delay over the number of {experiment.varied}",
        f"number of {experiment.varied}",
        (
            Panel("beside the thesis (logarithmic)", (thesis, *curves), is_log=True),
            Panel("ours", (*lines, *said), is_log=False),
        ),
    )


def newest(results: Path, wanted: Iterable[str] = ("b03", "b04", "b06")) -> list[Path]:
    """For every row the last result that has it."""
    names = sorted(results.glob("*.json"))
    found = (next((path for path in reversed(names) if row in path.stem.split("-")), None) for row in wanted)
    return [path for path in dict.fromkeys(found) if path is not None]


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m bench.figures", description=__doc__.partition("\n")[0])
    parser.add_argument("results", nargs="*", type=Path, help="results of `python -m bench`; default: the newest")
    parser.add_argument("--out", type=Path, default=OUT, help="directory for the pictures")
    asked = parser.parse_args()
    rows: dict[str, Any] = {}
    for path in asked.results or newest(_HERE / "results"):
        for row in json.loads(path.read_text(encoding="utf-8"))["rows"]:
            rows[row["row"]] = row
    if not {"b04", "b06"} & rows.keys():
        parser.error("no result of b04 or b06; measure them with `python -m bench b03 b04 b06`")
    drawings = {each.figure: picture(each, rows) for each in EXPERIMENTS} if "b04" in rows else {}
    drawings |= pictures(rows["b06"]) if "b06" in rows else {}
    asked.out.mkdir(parents=True, exist_ok=True)
    for figure, drawing in drawings.items():
        path = asked.out / f"figure-{figure}.svg"
        path.write_text(drawing, encoding="utf-8")
        print(path)
    return 0
