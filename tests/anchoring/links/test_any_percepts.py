"""Whatever percepts do, a linkage keeps what holds of it: they appear, end, cross, split, merge, stop and fall silent, drawn from a seed."""

import os
from collections.abc import Callable, Iterator
from math import cos, sin
from random import Random
from typing import Final

import pytest

from dyknow.anchoring.links.composites import CompositeSpecification
from dyknow.anchoring.links.motion import MotionPredictor
from dyknow.anchoring.links.prediction import ConstantVelocity
from dyknow.anchoring.links.specification import LinkSpecification, Threshold, filtered, unlikelihood
from dyknow.anchoring.links.states import ObjectState, diagonal
from dyknow.anchoring.links.structures import ObjectLinkage, Percept
from dyknow.anchoring.ready import NEAR, NEW, VISION, WORLD, ready_specification
from dyknow.kpl import parse_formula
from tests.anchoring.links import invariants

IS_FULL: Final = bool(os.environ.get("DYKNOW_FULL"))
TICKS: Final = 38_000 if IS_FULL else 150
"""Of each setting: all together 10^6."""
THERMAL: Final = "thermal-percept"
CLOSE = parse_formula("eventually [0, 1000] xy_dist[from, to] < thresh")
WIDE = parse_formula("eventually [0, 1000] xy_dist[from, to] < 4.0")
SOON = parse_formula("eventually [300, oo] true")
STAYS = parse_formula("always eventually [0, 1000] xy_dist[from, to] < 6")
NEVER_FAR = parse_formula("xy_dist[from, to] < 0.8")
RED = parse_formula("eventually [0, 1000] (xy_dist[from, to] < 8 and (colour[from] = colour[to] or speed[from] < 1))")
SLOW, FAST = (
    parse_formula("eventually [500, oo] speed[from] < 3"),
    parse_formula("eventually [500, oo] speed[from] >= 3"),
)
SAME = parse_formula("eventually [0, 1000] xy_dist[from, to] < 10")
IS_SLOW, IS_FAST = (parse_formula(f"always eventually [0, 2000] speed[from] {how}") for how in ("< 4", ">= 2"))
GROUP = parse_formula("always [0, 600] xy_dist[from, to] < 6")
PARTED = parse_formula("always eventually [0, 1000] xy_dist[from, to] < 12")


def copied(state: ObjectState, _before: ObjectState | None) -> ObjectState:
    return state


def first(state: ObjectState, _before: ObjectState | None) -> ObjectState:
    return filtered(state, None)


def world(candidates: int, source: str = VISION, reestablish=WIDE, **more) -> LinkSpecification:  # type: ignore[no-untyped-def]
    given = {"score": unlikelihood, "forget_us": 8_000_000, "threshold": Threshold(3.0, 1.0, 8.0), **more}
    return LinkSpecification(source, WORLD, given.pop("establish", SOON), reestablish, candidates=candidates, **given)


CLASSES = (
    LinkSpecification(WORLD, "walker", SLOW, SAME, IS_SLOW, unit=copied, exclusive="class"),
    LinkSpecification(WORLD, "car", FAST, SAME, IS_FAST, unit=copied, exclusive="class"),
)
CONVOY = CompositeSpecification(WORLD, "convoy", GROUP, PARTED)
SETTINGS: Final[dict[str, Callable[[], list[LinkSpecification | CompositeSpecification]]]] = {
    **{f"candidates {number}": (lambda number=number: [world(number)]) for number in range(1, 6)},  # type: ignore[misc]
    **{f"maintain, {number}": (lambda number=number: [world(number, maintain=STAYS)]) for number in (1, 2, 3)},  # type: ignore[misc]
    **{f"maintain at once, {number}": (lambda number=number: [world(number, maintain=NEVER_FAR)]) for number in (2, 4)},  # type: ignore[misc]
    "a second, 3": lambda: [world(3, reestablish=CLOSE, establish=NEW)],
    "near, 2": lambda: [world(2, reestablish=NEAR)],
    "not recursive, 3": lambda: [world(3, unit=first, is_recursive=False)],
    "predicted, 3": lambda: [world(3, predictor=ConstantVelocity(noise=1.0))],
    "attributes, 1": lambda: [world(1, reestablish=RED)],
    "attributes, 4": lambda: [world(4, reestablish=RED)],
    "two sensors": lambda: [world(1), world(1, THERMAL)],
    "two sensors, 3": lambda: [world(3), world(3, THERMAL, maintain=STAYS)],
    "correlated, 2": lambda: [world(2, correlated=True), world(2, THERMAL, correlated=True)],
    "classes, 1": lambda: [world(1), *CLASSES],
    "classes, 3": lambda: [world(3, maintain=STAYS), *CLASSES],
    "convoys, 1": lambda: [world(1), CONVOY],
    "convoys, 4": lambda: [world(4), CONVOY],
    "ready": lambda: list(ready_specification()),
    "adaptive, 1": lambda: [world(1, THERMAL, is_adaptive=True, reestablish=NEAR, maintain=STAYS)],
    "adaptive, all": lambda: [
        *(world(3, of, is_adaptive=True, reestablish=NEAR, predictor=MotionPredictor()) for of in (VISION, THERMAL)),
        *CLASSES,
        CONVOY,
    ],
    "all, 5": lambda: [world(5, maintain=STAYS), world(2, THERMAL), *CLASSES, CONVOY],
}  # fmt: skip


class Walkers:
    """A few things that move at random, at places that they share, and the percepts of them."""

    def __init__(self, random: Random, types: tuple[str, ...]) -> None:
        self._random, self._types = random, types
        self._things = [
            [random.uniform(-15, 15), random.uniform(-15, 15), 0.0, 0.0] for _ in range(random.randint(2, 9))
        ]
        self._names: dict[tuple[str, int], str] = {}
        self._count = 0
        self.t_us = 0

    def ticks(self, count: int) -> Iterator[tuple[int, list[Percept]]]:
        for _ in range(count):
            step_us = self._random.choice((100_000,) * 6 + (200_000, 300_000, 900_000, 2_500_000))
            self.t_us += step_us
            self._move(step_us / 1e6)
            yield self.t_us, self._percepts()

    def _move(self, seconds: float) -> None:
        random = self._random
        for thing in self._things:
            if random.random() < 0.1:
                speed, way = random.choice((0.0, 0.0, 1.5, 4.0, 12.0)), random.uniform(0.0, 6.28)
                thing[2:] = [speed * cos(way), speed * sin(way)]
            if random.random() < 0.02:
                thing[:2] = random.choice(self._things)[:2]
            thing[0], thing[1] = thing[0] + thing[2] * seconds, thing[1] + thing[3] * seconds
            if abs(thing[0]) > 40 or abs(thing[1]) > 40:
                thing[:2] = [random.uniform(-15, 15), random.uniform(-15, 15)]

    def _percepts(self) -> list[Percept]:
        random, found, named = self._random, list[Percept](), set[tuple[str, str]]()
        for type_ in self._types:
            for number, (x_m, y_m, _, _) in enumerate(self._things):
                key, draw = (type_, number), random.random()
                name = self._names.get(key)
                if draw < 0.04 and name is not None:
                    del self._names[key]
                    if draw < 0.025 and (type_, name) not in named:
                        named.add((type_, name))
                        found.append(Percept(name, type_, None))
                    continue
                if draw < 0.2:
                    continue
                if name is None or draw < 0.22:
                    self._count += 1
                    name = self._names[key] = f"p{self._count}"
                if draw > 0.99:
                    name = self._names[key] = self._names.get((type_, random.randrange(len(self._things))), name)
                if (type_, name) not in named:
                    named.add((type_, name))
                    sd_m = random.choice((0.1, 0.3, 1.0))
                    attributes = {"colour": random.choice(("red", "blue", "red"))} if random.random() < 0.8 else {}
                    state = ObjectState(
                        self.t_us, x_m + random.gauss(0, sd_m), y_m + random.gauss(0, sd_m), 0.0, 0.0, diagonal(sd_m)
                    )
                    found.append(Percept(name, type_, state._replace(attributes=attributes)))
        return found


def run(name: str, seed: int, ticks: int) -> int:
    """So many ticks of one setting; how many events there were."""
    random = Random(f"{name} {seed}")
    linkage, events, done = ObjectLinkage(SETTINGS[name]()), 0, 0
    walkers = Walkers(random, linkage.percept_types)
    while done < ticks:
        for t_us, percepts in walkers.ticks(min(ticks - done, 200)):
            if percepts:
                outcome = linkage.on_percepts(t_us, percepts)
                events += len(outcome.events)
                invariants.check(linkage, outcome)
            done += 1
            if random.random() < 0.01:
                _wish(linkage, random)
        walkers = _others(walkers, random, linkage)
    return events


def _others(before: Walkers, random: Random, linkage: ObjectLinkage) -> Walkers:
    """Another crowd, later."""
    found = Walkers(random, linkage.percept_types)
    found.t_us, found._count = before.t_us + random.choice((100_000, 3_000_000)), before._count
    return found


def _wish(linkage: ObjectLinkage, random: Random) -> None:
    """Somebody looks for an object, or no more."""
    if linkage.wanted:
        linkage.unwant(random.choice(linkage.wanted))
    else:
        linkage.want(
            f"mine{random.randrange(10**9)}",
            WORLD,
            parse_formula(random.choice(("speed[from] > 2", "x[from] > 0", 'colour[from] = "red"'))),
        )


@pytest.mark.parametrize("name", SETTINGS)
def test_a_linkage_keeps_what_holds_of_it(name: str) -> None:
    assert run(name, 1, TICKS) > TICKS // 50
