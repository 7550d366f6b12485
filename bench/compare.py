"""Sides in turn (A B A B), ratios of medians, and how sure they are."""

import random
from collections.abc import Callable, Mapping, Sequence
from statistics import median
from typing import NamedTuple

from bench.rows import Above, Bar, Figures, Limit, Side

_RESAMPLES = 2000


Interval = tuple[float, float]


class Judged(NamedTuple):
    """A bar, the figure it is about, its 95 % bootstrap interval, and whether it is met."""

    what: str
    value: float
    low: float
    high: float
    met: bool


def interleave(sides: Mapping[str, Side], rounds: int, warm: int = 1) -> dict[str, list[Figures]]:
    """Every side once per round, in the same order. The `warm` rounds before do not count."""
    found: dict[str, list[Figures]] = {name: [] for name in sides}
    for number in range(warm + rounds):
        for name, run in sides.items():
            figures = run()
            if number >= warm:
                found[name].append(figures)
    return found


def medians(found: Mapping[str, Sequence[Figures]]) -> dict[str, Figures]:
    return {
        name: {metric: median(column(rounds, metric)) for metric in rounds[0]} if rounds else {}
        for name, rounds in found.items()
    }


def column(rounds: Sequence[Figures], metric: str) -> list[float]:
    return [figures[metric] for figures in rounds]


def judge(bar: Bar, found: Mapping[str, Sequence[Figures]], seed: int = 1) -> Judged | None:
    """Bars are met when the median meets them; None when a side was not measured."""
    ours = column(found.get(bar.ours, ()), bar.metric)
    if isinstance(bar, Limit):
        low, high = _interval([ours], lambda samples: median(samples[0]), seed) if ours else (0.0, 0.0)
        what = f"{bar.metric} {bar.ours} <= {bar.bar:g}"
        return Judged(what, median(ours), low, high, median(ours) <= bar.bar) if ours else None
    peer = column(found.get(bar.peer, ()), bar.metric)
    if not ours or not peer:
        return None
    if isinstance(bar, Above):
        value = median(ours) - median(peer)
        low, high = _interval([ours, peer], lambda both: median(both[0]) - median(both[1]), seed)
        return Judged(f"{bar.metric} {bar.ours} - {bar.peer} <= {bar.bar:g}", value, low, high, value <= bar.bar)
    value = _ratio(ours, peer)
    low, high = _interval([ours, peer], lambda both: _ratio(both[0], both[1]), seed)
    sign = ">=" if bar.at_least else "<="
    met = value >= bar.bar if bar.at_least else value <= bar.bar
    return Judged(f"{bar.metric} {bar.ours} / {bar.peer} {sign} {bar.bar:g}", value, low, high, met)


def _ratio(ours: Sequence[float], peer: Sequence[float]) -> float:
    below = median(peer)
    return median(ours) / below if below else float("inf")


def _interval(columns: list[list[float]], figure: Callable[[list[list[float]]], float], seed: int) -> Interval:
    draw = random.Random(seed)
    found = sorted(figure([draw.choices(values, k=len(values)) for values in columns]) for _ in range(_RESAMPLES))
    return found[round(_RESAMPLES * 0.025)], found[round(_RESAMPLES * 0.975) - 1]
