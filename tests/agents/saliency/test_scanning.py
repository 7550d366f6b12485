"""The bar of the emergency service: two UAVs, 290 x 185 m, 11 persons, from one seed each."""

import os

import pytest

from tests.agents.saliency.rescuing import Rescue

RUNS = 100 if os.environ.get("DYKNOW_FULL") else 10


def scanned(seed: int) -> Rescue:
    rescue = Rescue(seed, image_us=200_000)
    rescue.world.run_for(2.0)
    rescue.scan()
    assert rescue.until_scanned() < 600.0
    rescue.world.run_for(45.0)
    return rescue


@pytest.mark.full
def test_all_persons_are_in_both_maps_and_hardly_anything_else():
    good = 0
    for seed in range(100, 100 + RUNS):
        rescue = scanned(seed)
        found = [rescue.errors_m(unit) for unit in "01"]
        is_short = max(vehicle.flown_m for vehicle in rescue.vehicles) <= 1100.0
        good += is_short and all(len(errors) == 11 and wrong <= 1 for errors, wrong in found)
    assert good >= 0.9 * RUNS


@pytest.mark.full
@pytest.mark.parametrize("killed", ["0", "1"])
def test_what_a_killed_platform_has_not_seen_the_other_flies_over(killed):
    rescue = Rescue(3, image_us=200_000)
    rescue.world.run_for(2.0)
    rescue.scan()
    rescue.world.run_for(70.0)
    rescue.world.kill(killed)
    left = "1" if killed == "0" else "0"
    rescue.until_scanned([left])
    errors, wrong = rescue.errors_m(left)
    assert len(errors) == 11
    assert wrong <= 1
    assert any(note == "scan: 100% of this platform's piece was in view for 5 s" for note in rescue.notes(left))
