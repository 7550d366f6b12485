"""Which thing is which, in scenes of cars, bicycles and people: the ready link, and what `python -m bench.identity` compares it with."""

import pytest

from bench.identity.__main__ import by_link, figures, grid, met, row
from bench.identity.crowds import CROWDS, crowd
from bench.linkage.peers import by_norfair, per_percept

SHORT_S = 8.0


@pytest.mark.parametrize("scene", CROWDS)
def test_the_ready_link_is_better_than_an_object_per_percept(scene: str) -> None:
    looks, near_m = crowd(scene, 1, SHORT_S), CROWDS[scene].near_m
    ours, alone = figures(looks, by_link(looks), near_m), figures(looks, per_percept(looks), near_m)
    assert ours.seen > alone.seen
    assert ours.everything > alone.everything


def test_norfair_is_scored_by_the_same_figures() -> None:
    looks = crowd("queues", 1, SHORT_S)
    best = max(figures(looks, by_norfair(looks, each), CROWDS["queues"].near_m).seen for each in [*grid("queues")][:4])
    assert 0.3 < best <= 1.0


@pytest.mark.full
@pytest.mark.timeout(7200)
@pytest.mark.parametrize("scene", CROWDS)
def test_the_ready_link_is_at_least_the_best_of_norfair(scene: str) -> None:
    assert met([row(scene, seed) for seed in (1, 2, 3)])[scene]
