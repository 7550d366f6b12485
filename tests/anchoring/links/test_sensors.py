"""Several link processes into one type: one symbol, better known than by any sensor alone, anchored while one link lives."""

import math
import random

import pytest

from dyknow.anchoring.links.specification import LinkSpecification, Threshold
from dyknow.anchoring.links.states import ObjectState, diagonal
from dyknow.anchoring.links.structures import ObjectLinkage, Percept
from dyknow.anchoring.ready import NEAR, NEW, WORLD

SENSORS = {"camera": (100, 1.5), "radar": (250, 2.0)}
"""Period in milliseconds, standard deviation in metres."""


def linkage(*types: str, correlated: bool = False) -> ObjectLinkage:
    return ObjectLinkage(
        [
            LinkSpecification(type_, WORLD, NEW, NEAR, threshold=Threshold(least_m=8.0), correlated=correlated)
            for type_ in types
        ]
    )


def place(t_ms: float) -> tuple[float, float]:
    t = t_ms / 1000
    return 9.0 * t, 15.0 * math.sin(t / 5)


def run(seed: int, *types: str, correlated: bool = False) -> tuple[float, ObjectLinkage]:
    """The root mean square error of the position over a minute, also where it is predicted; sensors have gaps of their own."""
    noise = {type_: random.Random(f"{seed} {type_}") for type_ in SENSORS}
    found = linkage(*types, correlated=correlated)
    errors = []
    for t in range(0, 60_000, 50):
        percepts = []
        for type_, (period_ms, sd_m) in SENSORS.items():
            x, y = (value + noise[type_].gauss(0, sd_m) for value in place(t))
            window = (t // 1000 + (3 if type_ == "radar" else 0)) % 8
            if type_ in types and t % period_ms == 0 and window < 6:
                state = ObjectState(t * 1000, x, y, 0.0, 0.0, diagonal(sd_m))
                percepts.append(Percept(f"{type_}{t // 8000}", type_, state))
        if percepts:
            outcome = found.on_percepts(t * 1000, percepts)
            errors += [
                math.dist(place(each.valid_us / 1000), each.state[1:3]) ** 2
                for each in outcome.states
                if each.valid_us > 3_000_000 and each.valid_us % 500_000 == 0
            ]
            assert len(found.objects(WORLD)) <= 1, "no object has two symbols"
    return math.sqrt(sum(errors) / len(errors)), found


@pytest.mark.parametrize("correlated", [False, True])
def test_two_sensors_of_other_rate_noise_and_gaps_are_better_than_either_alone(correlated: bool) -> None:
    both, camera, radar = (
        sum(run(seed, *types, correlated=correlated)[0] for seed in range(4)) / 4
        for types in (("camera", "radar"), ("camera",), ("radar",))
    )
    assert both < camera
    assert both < radar


def test_an_object_stays_anchored_while_one_live_link_remains() -> None:
    found = linkage("camera", "radar")

    def seen(t: int, *types: str) -> list[Percept]:
        return [
            Percept(f"{type_}1", type_, ObjectState(t * 1000, 0.0, 0.0, 0.0, 0.0, diagonal(1.0))) for type_ in types
        ]

    for t in range(0, 2000, 100):
        found.on_percepts(t * 1000, seen(t, "camera", "radar"))
    (one,) = found.objects(WORLD).values()
    assert {link.source.symbol for link in one.incoming.values()} == {"camera1", "radar1"}
    found.on_percepts(2_000_000, [Percept("camera1", "camera", None), *seen(2000, "radar")])
    assert found.anchored("wo1")
    found.on_percepts(2_100_000, [Percept("radar1", "radar", None)])
    assert not found.anchored("wo1")


def test_errors_that_may_be_correlated_make_nothing_more_certain_than_the_better_sensor() -> None:
    _, independent = run(1, "camera", "radar")
    _, correlated = run(1, "camera", "radar", correlated=True)
    (one,), (other,) = independent.objects(WORLD).values(), correlated.objects(WORLD).values()
    assert one.state.deviation_m <= other.state.deviation_m
