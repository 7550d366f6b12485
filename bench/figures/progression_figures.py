"""Figures 7.14 to 7.17 of the thesis from the newest result of b06: what progression costs, and how that develops.

The left panel has everything on a logarithmic axis, beside what the text of 7.10 says; the right one shows one way alone:
objects over the number of formulas, deadlines (nothing is remembered, as in the thesis) state by state.
"""

from collections.abc import Mapping, Sequence
from statistics import median, quantiles
from typing import Any

from bench.figures.plots import Curve, Panel, Point, drawn
from bench.formulas.b06 import points
from bench.formulas.progressions import EXPERIMENTS, Experiment, States
from bench.rows import Figures

COLOURS = ("#1d7a3c", "#1f5fa8", "#8e44ad", "#d35400")
RED, FAINT_RED = "#c0392b", "#e6a69f"
SAID_US: Mapping[str, tuple[float, float]] = {"7.10.1": (30.0, 47.0), "7.10.2": (32.0, 72.0)}
"""What the text of the thesis says a formula and state cost, at least and at most."""


def curve(rounds: Sequence[Figures], figure: str, sequence: States, way: str, colour: str) -> Curve:
    """Median and quartiles over the rounds."""
    found = [points(each, figure, sequence.said, way) for each in rounds]
    middle: list[Point] = []
    for column in zip(*found, strict=True):
        values = [us for _, us in column]
        low, _, high = quantiles(values, n=4, method="inclusive") if len(values) > 1 else (values[0],) * 3
        middle.append(Point(column[0][0], median(values), low, high))
    return Curve(f"{way}, {sequence.said}", colour, tuple(middle))


def average(one: Experiment, rounds: Sequence[Figures]) -> str:
    """The time of a state over the number of formulas."""
    pairs = list(zip(one.sequences, COLOURS, strict=False))
    objects = [curve(rounds, one.average, sequence, "object", colour) for sequence, colour in pairs]
    counts = [point.x for point in objects[0].points]
    thesis = [
        Curve(f"thesis: {us:.0f} us per formula", colour, tuple(Point.sure(n, us * n) for n in counts), is_line=True)
        for us, colour in zip(SAID_US[one.section], (FAINT_RED, RED), strict=True)
    ]
    return drawn(
        f"Figure {one.average}: average time to progress a state, {one.text}",
        "number of formulas",
        (
            Panel("beside the thesis (logarithmic)", (*thesis, *objects), is_log=True),
            Panel("object", tuple(objects), is_log=False),
        ),
    )


def state_by_state(one: Experiment, rounds: Sequence[Figures]) -> str:
    """The time of each state, 1000 formulas."""
    pairs = [(one.sequences[at], colour) for at, colour in zip(one.shown, COLOURS, strict=False)]
    slow = [curve(rounds, one.state_by_state, sequence, "deadlines", colour) for sequence, colour in pairs]
    fast = curve(rounds, one.state_by_state, one.worst, "object", COLOURS[1])
    last = fast.points[-1].x
    thesis = [
        Curve(
            f"thesis: {us:.0f} us per formula", colour, tuple(Point.sure(n, us * 1000) for n in (1, last)), is_line=True
        )
        for us, colour in zip(SAID_US[one.section], (FAINT_RED, RED), strict=True)
    ]
    return drawn(
        f"Figure {one.state_by_state}: time to progress a state with 1000 formulas, {one.text}",
        "number of the state",
        (
            Panel(
                "beside the thesis (logarithmic)", (*thesis, slow[-1]._replace(colour=COLOURS[3]), fast), is_log=True
            ),
            Panel("deadlines", tuple(slow), is_log=False),
        ),
    )


def pictures(row: Mapping[str, Any]) -> dict[str, str]:
    """Figure -> picture, from the result of b06."""
    rounds = row["figures"]["figures"]
    return {
        figure: draw(one, rounds)
        for one in EXPERIMENTS
        for figure, draw in ((one.average, average), (one.state_by_state, state_by_state))
    }
