"""How well cars are kept track of that are out of sight, and found again.

Gap coverage is the share of hidden car-seconds, of cars that were seen before, whose object is said to be within 15 m of it, as
in `bench.linkage.scores`. Reacquisition: of all times that a car went out of sight for `LEAST_US` or longer and
was found again, or stayed on the roads for `WITHIN_US`, the share after which it was seen again in that time under the same symbol.
"""

from collections.abc import Collection, Iterable, Sequence
from math import hypot
from typing import NamedTuple

import numpy as np

from bench.attention.flights import Instant
from bench.linkage.scores import BRIDGED_M, NEAR_M, Shown, Track
from dyknow.sim_uavs.roads.drivers import RoadState

WITHIN_US = 15_000_000
LEAST_US = 1_000_000
"""What is out of sight for less is not lost."""


class AttentionScore(NamedTuple):
    """Of one run, or the mean of several.

    Attributes:
        gap: gap coverage.
        reacquired: share of losses.
        known: share of all car-seconds, seen before or not, in which an object is said to be within 15 m of the car.
        losses, switches: how many; a switch is a car that is seen under another symbol than before.
    """

    gap: float
    reacquired: float
    known: float
    losses: float
    switches: float


def score(instants: Sequence[Instant]) -> AttentionScore:
    symbols: dict[str, str] = {}
    lost_us: dict[str, int] = {}
    hidden = bridged = cars = known = losses = reacquired = switches = 0
    for now_us, truth, visible, track, _ in instants:
        shown = _matched(truth, visible, track)
        for state in truth:
            cars += 1
            known += _within(state.x_m, state.y_m, track.values(), BRIDGED_M)
            name, symbol = state.name, shown.get(state.name)
            if symbol is not None:
                hidden_us = now_us - lost_us.pop(name, now_us)
                if hidden_us >= LEAST_US:
                    losses += 1
                    reacquired += symbol == symbols[name] and hidden_us <= WITHIN_US
                switches += symbols.get(name, symbol) != symbol
                symbols[name] = symbol
            elif name in symbols and name not in visible:
                lost_us.setdefault(name, now_us)
            if name in symbols and name not in visible:
                hidden += 1
                place = track.get(symbols[name])
                bridged += place is not None and hypot(place.x_m - state.x_m, place.y_m - state.y_m) <= BRIDGED_M
    last = instants[-1]
    there = {state.name for state in last.truth}
    losses += sum(name in there and last.now_us - since_us > WITHIN_US for name, since_us in lost_us.items())
    return AttentionScore(
        bridged / hidden if hidden else 1.0, reacquired / losses if losses else 1.0, known / max(cars, 1),
        float(losses), float(switches),
    )  # fmt: skip


def mean(scores: Sequence[AttentionScore]) -> AttentionScore:
    return AttentionScore(*(float(np.mean(values)) for values in zip(*scores, strict=True)))


def _matched(truth: Sequence[RoadState], visible: Collection[str], track: Track) -> dict[str, str]:
    """The symbol that a percept shows now at each visible car, one to one, the nearest first."""
    pairs = sorted(
        (hypot(place.x_m - state.x_m, place.y_m - state.y_m), state.name, symbol)
        for state in truth
        if state.name in visible
        for symbol, place in track.items()
        if place.seen
    )
    found: dict[str, str] = {}
    for distance_m, name, symbol in pairs:
        if distance_m <= NEAR_M and name not in found and symbol not in found.values():
            found[name] = symbol
    return found


def _within(x_m: float, y_m: float, places: Iterable[Shown], most_m: float) -> bool:
    return any(hypot(place.x_m - x_m, place.y_m - y_m) <= most_m for place in places)
