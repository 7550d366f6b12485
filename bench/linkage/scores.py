"""Scores of one run: IDF1 and identity switches as py-motmetrics counts them, and how well gaps are bridged.

IDF1 is counted over what is seen (vehicles that have a percept at the instant; objects that a percept shows then) and over
everything (all vehicles since they were first seen, all objects that are there, predicted ones included).
"""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from math import hypot
from typing import NamedTuple

import motmetrics
import numpy as np
from scipy.optimize import linear_sum_assignment

from dyknow.sim_uavs.roads.scenes import Look

NEAR_M = 5.0
BRIDGED_M = 15.0


class Shown(NamedTuple):
    """Where an object is said to be; `seen`: a percept shows it now, it is not predicted."""

    x_m: float
    y_m: float
    seen: bool


Track = Mapping[str, Shown]
"""All objects of an instant, by symbol."""


class Score(NamedTuple):
    """Of one run, or the mean of several; `objects` are symbols, `gap` the share of hidden car-seconds within 15 m."""

    idf1: float
    idf1_all: float
    switches: float
    gap: float
    objects: float


def score(looks: Sequence[Look], tracks: Sequence[Track]) -> Score:
    """Score the objects of every look, `tracks[n]` being those after `looks[n]`."""
    numbers: dict[str, int] = {}
    seen, everything = (motmetrics.MOTAccumulator(auto_id=True) for _ in range(2))
    last: dict[str, str] = {}
    hidden = bridged = 0
    known: set[str] = set()
    for look, track in zip(looks, tracks, strict=True):
        visible = {percept.of for percept in look.percepts if percept.of is not None and not percept.end}
        known |= visible
        truth = {state.name: (state.x_m, state.y_m) for state in look.truth if state.name in known}
        shown = {symbol: place for symbol, place in track.items() if place.seen}
        _update(seen, {name: at for name, at in truth.items() if name in visible}, shown, numbers)
        _update(everything, truth, track, numbers)
        _remember(seen, last, numbers)
        for name in truth.keys() - visible:
            hidden += 1
            place = track.get(last.get(name, ""))
            x_m, y_m = truth[name]
            bridged += place is not None and hypot(place.x_m - x_m, place.y_m - y_m) <= BRIDGED_M
    metrics = motmetrics.metrics.create()
    strict = metrics.compute(seen, metrics=["idf1", "num_switches"], return_dataframe=False)
    loose = metrics.compute(everything, metrics=["idf1"], return_dataframe=False)
    objects = len({symbol for track in tracks for symbol in track})
    gap = bridged / hidden if hidden else 1.0
    return Score(strict["idf1"], loose["idf1"], float(strict["num_switches"]), gap, float(objects))


def quick_idf1(looks: Sequence[Look], tracks: Sequence[Track], *, everything: bool = False) -> float:
    """The first figure of `score`, or the second, by its definition and much faster: 2 IDTP / (vehicles + objects), over looks.

    IDTP is the largest number of looks at which vehicles and objects, paired for the whole run, are within 5 m.
    """
    together: Counter[tuple[str, str]] = Counter()
    count = 0
    known: set[str | None] = set()
    for look, track in zip(looks, tracks, strict=True):
        visible = {percept.of for percept in look.percepts if percept.of is not None and not percept.end}
        known |= visible
        truth = [state for state in look.truth if state.name in (known if everything else visible)]
        shown = [(symbol, place) for symbol, place in track.items() if place.seen or everything]
        count += len(truth) + len(shown)
        together.update(
            (state.name, symbol)
            for state in truth
            for symbol, place in shown
            if hypot(place.x_m - state.x_m, place.y_m - state.y_m) <= NEAR_M
        )
    vehicles, symbols = (list(dict.fromkeys(pair[side] for pair in together)) for side in (0, 1))
    table = np.array([[together[vehicle, symbol] for symbol in symbols] for vehicle in vehicles])
    if not together:
        return 0.0
    rows, chosen = linear_sum_assignment(table, maximize=True)
    return 2.0 * float(table[rows, chosen].sum()) / count


def mean(scores: Sequence[Score]) -> Score:
    return Score(*(float(np.mean(values)) for values in zip(*scores, strict=True)))


def _update(
    accumulator: motmetrics.MOTAccumulator,
    truth: Mapping[str, tuple[float, float]],
    track: Track,
    numbers: dict[str, int],
) -> None:
    """Numbers instead of names, which recent releases of pandas do not take."""
    distances = np.array(
        [[_within(x_m, y_m, place) for place in track.values()] for x_m, y_m in truth.values()], dtype=float
    ).reshape(len(truth), len(track))
    accumulator.update(_numbered(truth, numbers), _numbered(track, numbers), distances)


def _within(x_m: float, y_m: float, place: Shown) -> float:
    distance_m = hypot(place.x_m - x_m, place.y_m - y_m)
    return distance_m if distance_m <= NEAR_M else float("nan")


def _numbered(names: Iterable[str], numbers: dict[str, int]) -> list[int]:
    return [numbers.setdefault(name, len(numbers)) for name in names]


def _remember(accumulator: motmetrics.MOTAccumulator, last: dict[str, str], numbers: Mapping[str, int]) -> None:
    """Which symbol each vehicle was matched with last."""
    names = {number: name for name, number in numbers.items()}
    for vehicle, symbol in accumulator.m.items():
        last[names[vehicle]] = names[symbol]
