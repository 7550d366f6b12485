"""A plot as a value, and its picture: panels above one another, curves by platform, bands of time behind them."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal, TypeAlias

from dyknow.console.output.shown import printable
from dyknow.model.errors import WrongCall
from dyknow.model.instants import EPOCH, US_PER_S

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Kind: TypeAlias = Literal["gap", "true", "undecided", "false", "alarm", "unknown"]
FORMATS: Final = (".png", ".svg", ".pdf")
MOST_PANELS, MOST_BANDS = 12, 2000
_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#000000")
"""Okabe and Ito's, which the colour-blind tell apart."""
_BANDS: Final[dict[Kind, tuple[str, str, str]]] = {
    "gap": ("#bbbbbb", "////", "no sample"),
    "true": ("#009e73", "", "holds"),
    "undecided": ("#f0e442", "", "undecided"),
    "false": ("#d55e00", "", "violated"),
    "alarm": ("#d55e00", "", "alarm open"),
    "unknown": ("#999999", "..", "unknown"),
}
"""Colour, hatching and name of a band."""
_LEAST_SPAN, _LONGEST_NAME = 1e-4, 40
_DASHES = ("-", "--", "-.", ":")


@dataclass(frozen=True, slots=True)
class Curve:
    """One line: instants and values; None interrupts it."""

    name: str
    at_us: Sequence[int]
    values: Sequence[float | None]


@dataclass(frozen=True, slots=True)
class Band:
    """A condition that held between two instants."""

    kind: Kind
    from_us: int
    to_us: int


@dataclass(slots=True)
class PlotPanel:
    """Curves of one quantity.

    Attributes:
        steps: whether values hold until the next one.
        levels: names of values, where they are no numbers.
    """

    quantity: str
    curves: list[Curve] = field(default_factory=list)
    bands: list[Band] = field(default_factory=list)
    steps: bool = False
    levels: Mapping[float, str] = field(default_factory=dict)


@dataclass(slots=True)
class Plot:
    """Panels over the same time.

    Attributes:
        marks: instants with words, such as the state that decided a formula.
        is_trace: whether instants count from 0 instead of 1970.
    """

    title: str
    panels: list[PlotPanel] = field(default_factory=list)
    marks: list[tuple[int, str]] = field(default_factory=list)
    is_trace: bool = False


def check_file(path: Path) -> None:
    """Raises WrongCall for a file that is no picture, or cannot be drawn since matplotlib is not installed."""
    if path.suffix.lower() not in FORMATS:
        raise WrongCall(f"{path}: a picture ends in {', '.join(FORMATS)}; write {path.with_suffix('.svg')}.")
    try:
        import matplotlib.figure  # noqa: F401
    except ImportError:
        raise WrongCall(
            "plots are drawn with matplotlib, which is not installed; install the extra: "
            "pip install 'dyknow-federation[plot]'"
        ) from None


def draw(plot: Plot, path: Path) -> None:
    """Draw into a file; texts of others are never markup in it.

    Raises:
        WrongCall: the file cannot be written, or there is nothing to draw.
    """
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    if not plot.panels:
        raise WrongCall(f"{path}: there is no number to be drawn.")
    panels = plot.panels[:MOST_PANELS]
    with rc_context({"text.parse_math": False, "svg.hashsalt": "dyknow", "svg.fonttype": "none", "font.size": 9}):
        figure = Figure(figsize=(9.0, 1.2 + 2.0 * len(panels)), layout="constrained")
        rows: Any = figure.subplots(len(panels), 1, sharex=True, squeeze=False)
        begin_us = _begin_us(plot)
        for (axes,), panel in zip(rows, panels, strict=True):
            _draw_panel(axes, panel, begin_us)
            for at_us, words in plot.marks:
                axes.axvline((at_us - begin_us) / US_PER_S, color="#d55e00", linewidth=1.2)
                axes.annotate(
                    _text(words), ((at_us - begin_us) / US_PER_S, 0.97), xycoords=("data", "axes fraction"),
                    xytext=(3, 0), textcoords="offset points", va="top", fontsize=7, color="#d55e00",
                )  # fmt: skip
        figure.suptitle(_text(plot.title), fontsize=10)
        rows[-1][0].set_xlabel("s" if plot.is_trace else f"s after {_clock(begin_us)} UTC")
        metadata: Any = {"Date": None} if path.suffix.lower() == ".svg" else {}
        try:
            figure.savefig(path, dpi=110, metadata=metadata)
        except OSError as wrong:
            raise WrongCall(f"{path} cannot be written: {wrong.strerror or wrong}; choose another place.") from None


def _begin_us(plot: Plot) -> int:
    first = [curve.at_us[0] for panel in plot.panels for curve in panel.curves if len(curve.at_us)]
    return 0 if plot.is_trace or not first else min(first) // US_PER_S * US_PER_S


def _draw_panel(axes: "Axes", panel: PlotPanel, begin_us: int) -> None:
    named: dict[str, Any] = {}
    for band in panel.bands[:MOST_BANDS]:
        colour, hatch, name = _BANDS[band.kind]
        named[name] = axes.axvspan(
            (band.from_us - begin_us) / US_PER_S, (band.to_us - begin_us) / US_PER_S,
            facecolor=colour, hatch=hatch, alpha=0.22, edgecolor=colour if hatch else "none", linewidth=0,
        )  # fmt: skip
    for at, curve in enumerate(panel.curves):
        times = [(at_us - begin_us) / US_PER_S for at_us in curve.at_us]
        values = [float("nan") if value is None else value for value in curve.values]
        (line,) = axes.plot(
            times, values, _DASHES[at // len(_COLOURS) % len(_DASHES)], color=_COLOURS[at % len(_COLOURS)], linewidth=1.2,
            marker="." if len(times) < 100 else "", markersize=3, drawstyle="steps-post" if panel.steps else "default",
        )  # fmt: skip
        named[_text(curve.name, _LONGEST_NAME)] = line
    axes.set_ylabel("\n".join(map(_text, panel.quantity.splitlines())), fontsize=8)
    axes.grid(visible=True, linewidth=0.3)
    _scale(axes, panel)
    if named:
        axes.legend([*named.values()], [*named], fontsize=7, loc="center left", bbox_to_anchor=(1.0, 0.5))


def _scale(axes: "Axes", panel: PlotPanel) -> None:
    """The vertical axis: named levels, or numbers over no less than the smallest visible span."""
    if panel.levels:
        axes.set_yticks([*panel.levels], [*panel.levels.values()])
        axes.set_ylim(min(panel.levels) - 0.15, max(panel.levels) + 0.15)
        return
    axes.ticklabel_format(axis="y", useOffset=False)
    low, high = axes.get_ylim()
    if high - low < _LEAST_SPAN:
        axes.set_ylim((low + high - _LEAST_SPAN) / 2, (low + high + _LEAST_SPAN) / 2)


def joined(bands: Iterable[Band]) -> list[Band]:
    """Those of one kind that touch or overlap, as one."""
    found: list[Band] = []
    for band in sorted(bands, key=lambda each: (each.kind, each.from_us)):
        if found and found[-1].kind == band.kind and found[-1].to_us >= band.from_us:
            found[-1] = Band(band.kind, found[-1].from_us, max(band.to_us, found[-1].to_us))
        else:
            found.append(band)
    return found


def _text(text: str, longest: int = 140) -> str:
    """Without control characters, and not longer than there is room."""
    shown = printable(text).replace("\n", " ").replace("\t", " ")
    return shown if len(shown) <= longest else f"{shown[: longest - 1]}…"


def _clock(at_us: int) -> str:
    return (EPOCH + timedelta(microseconds=at_us)).strftime("%Y-%m-%d %H:%M:%S")
