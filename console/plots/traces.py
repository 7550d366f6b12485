"""A formula over a recorded trace, state by state: its features, their gaps, and where it is violated."""

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Final

from dyknow.console.plots.plot import Band, Curve, Kind, Plot, PlotPanel, joined
from dyknow.model.errors import WrongCall
from dyknow.model.values import NO_VALUE

if TYPE_CHECKING:
    from dyknow.reasoning import Trace
    from dyknow.reasoning.formulas.tree import Domains, Formula
    from dyknow.reasoning.monitoring.traces import Outcome, TraceState

_LEVELS: Final = {0.0: "false", 0.5: "undecided", 1.0: "true"}
MOST_STEPS: Final = 200_000
"""States that are looked at for all verdicts of a trace together; later ones have none."""


def trace_plot(
    text: str, formula: "Formula", trace: "Trace", domains: "Domains", labels: Iterable[str], outcome: "Outcome"
) -> Plot:
    """A panel for each numeric feature of the formula, and the verdict of its operand of `always`, from each state on.

    Raises:
        WrongCall: the trace has no state.
    """
    states = trace.states
    if not states:
        raise WrongCall("the trace has no state that could be drawn.")
    plot = Plot(text, is_trace=True)
    for label in sorted(labels):
        panel = _panel(label, states)
        if panel is not None:
            plot.panels.append(panel)
    plot.panels.append(_verdicts(formula, states, domains))
    without = [at_us for at_us, value in zip(*_first_curve(plot.panels[-1]), strict=True) if value is None]
    if without:
        plot.marks.append((without[0], "no verdicts from here: the trace is too long"))
    verdict, t_ms, index = outcome
    if verdict == "false" and t_ms is not None:
        plot.marks.append((round(t_ms * 1000), f"violated by state {index}"))
    return plot


def _panel(label: str, states: Sequence["TraceState"]) -> PlotPanel | None:
    values = [state.values.get(label, NO_VALUE) for state in states]
    if not any(isinstance(value, bool | int | float) for value in values):
        return None
    numbers = [float(value) if isinstance(value, bool | int | float) else None for value in values]
    times = [state.valid_us for state in states]
    bands = [Band("gap", at_us, _next(times, at)) for at, at_us in enumerate(times) if numbers[at] is None]
    is_bool = all(isinstance(value, bool) or value is NO_VALUE for value in values)
    return PlotPanel(label, [Curve(label, times, numbers)], joined(bands), steps=is_bool)


def _verdicts(formula: "Formula", states: Sequence["TraceState"], domains: "Domains") -> PlotPanel:
    """The verdict of the formula, or of its operand of `always`, begun at each state."""
    from dyknow.reasoning import follow_trace
    from dyknow.reasoning.formulas.tree import Always

    body = formula
    if isinstance(formula, Always) and formula.hi_us is None and formula.lo_us == 0:
        body = formula.operand
    times, bands, left = [state.valid_us for state in states], list[Band](), MOST_STEPS
    heights: list[float | None] = []
    for at in range(len(states)):
        if left <= 0:
            heights.append(None)
            continue
        (verdict, _, index), _ = follow_trace(body, states[at:], domains)
        left -= len(states) - at if index is None else index + 1
        kind: Kind = "true" if verdict == "true" else "false" if verdict == "false" else "undecided"
        heights.append({"true": 1.0, "undecided": 0.5}.get(kind, 0.0))
        bands.append(Band(kind, times[at], _next(times, at)))
    return PlotPanel(
        "verdict\nfrom each state on", [Curve("verdict", times, heights)], joined(bands), steps=True, levels=_LEVELS
    )


def _first_curve(panel: PlotPanel) -> tuple[Sequence[int], Sequence[float | None]]:
    return panel.curves[0].at_us, panel.curves[0].values


def _next(times: Sequence[int], at: int) -> int:
    """When the next state is; of the last one as long after it as it is after the one before."""
    if at + 1 < len(times):
        return times[at + 1]
    return times[at] + (times[at] - times[at - 1] if at else 1_000_000)
