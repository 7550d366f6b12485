"""Drawn flights that meet, judged by the true positions: the campaign of `bench/campaign`, and harmless ones of `bench/needless`.

Twenty seeds, spread over the thousand that `-m full` takes.
"""

import pytest

from bench.__main__ import measured
from bench.campaign.drawing import TROUBLES, situation
from bench.campaign.geometries import GEOMETRIES
from bench.campaign.running import LEAST_S, run
from bench.campaign.situations import are_apart
from bench.rows import Options

KEEPS_APART = False
"""Whether the rule in the tree keeps vehicles apart in all of them; while it does not, only what holds of any rule is asserted."""
SHORT = 20
SEEDS = [pytest.param(seed, marks=() if seed <= SHORT else pytest.mark.full) for seed in range(1, 1001)]


@pytest.mark.parametrize("seed", SEEDS)
def test_a_drawn_flight_keeps_apart_or_tells_and_arrives_or_tells(seed: int) -> None:
    found = run(seed)
    raised = [violation for violation in found.violations if "raised" in violation or "ended" in violation]
    assert not raised, found.what
    assert found.lasted_s >= LEAST_S
    if KEEPS_APART:
        assert (found.breaches, found.untold, found.stuck, found.violations) == ([], [], [], []), found.what


def test_a_seed_is_a_run() -> None:
    first, again = run(2), run(2)
    assert (first.track, first.least_m, first.factors) == (again.track, again.least_m, again.factors)
    assert run(5).track != first.track


def test_all_geometries_and_all_troubles_are_drawn_and_no_two_set_out_near_each_other() -> None:
    drawn = [situation(seed) for seed in range(1, 401)]
    assert {each.geometry for each in drawn} == set(GEOMETRIES)
    kinds = {trouble.kind for each in drawn for trouble in each.troubles}
    assert len(kinds) == len(TROUBLES) - 1, "those that refuse do so for a while or for good"
    assert 0.4 < sum(bool(each.troubles) for each in drawn) / len(drawn) < 0.6
    for each in drawn:
        assert are_apart([vehicle.way.start for vehicle in each.vehicles])
        assert 2 <= len(each.vehicles) <= 6
        assert all(
            11.0 < -place.down < 120.0 or place == vehicle.way.end
            for vehicle in each.vehicles
            for place in vehicle.way.places
        )


@pytest.mark.parametrize("row", ["b19", "b20"])
def test_its_rows_of_the_benchmark_run(row: str) -> None:
    found = measured(row, Options(rounds=1, effort=0.01))
    assert {bar["what"] for bar in found["bars"]}
