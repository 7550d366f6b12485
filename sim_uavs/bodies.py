"""Persons on a field and what looks like them: a function of the field and the seed. Pure.

A person is warm and has the form of one. Of the bodies that look like one a third is warm alone (stones in the sun,
hoods of cars), a third has the form alone (clothes, dummies, which are cold), and a third is warm and has a form
somewhat like it (animals).
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.random import Generator

from dyknow.sim_uavs.cameras.detectors import COLOUR, THERMAL, Visible
from dyknow.sim_uavs.cameras.onboard import Scene
from dyknow.sim_uavs.dynamics.scenarios import SearchField
from dyknow.sim_uavs.roads.drivers import COLOURS

APART_M: Final = 8.0
INSIDE_M: Final = 2.0
"""They lie so far from each other, and from the border, at least."""
LIKENESS_SD: Final = 0.06
_LIKENESS: Final = {"person": (0.8, 0.78), "warm": (0.7, 0.2), "shaped": (0.2, 0.68), "animal": (0.72, 0.42)}
"""Mean scores of the thermal and of the colour channel, by kind of body."""
_KINDS: Final = ("warm", "shaped", "animal")
_BODIES_RNG: Final = 57  # keeps this generator apart from others of the same seed
_TRIES: Final = 10_000


class FieldBody(NamedTuple):
    """Something that lies on the field, as cameras see it; `kind`: person, warm, shaped or animal."""

    kind: str
    x_m: float
    y_m: float
    colour: str
    thermal: float
    shape: float
    bottom_m: float = 0.0
    length_m: float = 1.7
    height_m: float = 0.3

    def likeness(self, channel: str) -> float:
        """How much like a person it looks in a channel; nothing else sees it."""
        return {THERMAL: self.thermal, COLOUR: self.shape}.get(channel, 0.0)


def bodies_of(field: SearchField, seed: int) -> tuple[FieldBody, ...]:
    """All bodies on a field, persons first."""
    rng = np.random.default_rng((seed, _BODIES_RNG))
    kinds = ["person"] * field.persons + [_KINDS[at % len(_KINDS)] for at in range(field.lookalikes)]
    places = _places(field, len(kinds), rng)
    return tuple(_body(kind, *place, rng) for kind, place in zip(kinds, places, strict=True))


def _places(field: SearchField, count: int, rng: Generator) -> list[tuple[float, float]]:
    """As many as fit: each apart from all others."""
    low = field.west_m + INSIDE_M, field.south_m + INSIDE_M
    high = field.east_m - INSIDE_M, field.north_m - INSIDE_M
    places: list[tuple[float, float]] = []
    for _ in range(_TRIES):
        if len(places) == count:
            break
        x_m, y_m = rng.uniform(low, high).tolist()
        if all((x_m - x) ** 2 + (y_m - y) ** 2 >= APART_M**2 for x, y in places):
            places.append((x_m, y_m))
    return places


def _body(kind: str, x_m: float, y_m: float, rng: Generator) -> FieldBody:
    thermal, shape = np.clip(rng.normal(_LIKENESS[kind], LIKENESS_SD), 0.02, 0.98).tolist()
    return FieldBody(kind, x_m, y_m, COLOURS[int(rng.integers(len(COLOURS)))], thermal, shape)


class OnField:
    """The bodies on a field, and other objects."""

    def __init__(self, bodies: Sequence[FieldBody], others: Scene) -> None:
        self._bodies, self._others = tuple(bodies), others

    def at(self, now_us: int) -> Sequence[Visible] | None:
        """At a time (federation time); None: it is not known yet."""
        others = self._others.at(now_us)
        return None if others is None else [*self._bodies, *others]
