"""The bar of the emergency service: two UAVs, 290 x 185 m, 11 persons, from one seed each."""

import os

import pytest

from dyknow.agents.capabilities.areas.scanning import Scanning
from dyknow.federation.messages.contents import DivideArea
from tests.agents.capabilities.saliency.rescuing import Rescue
from tests.agents.rosters import trust

RUNS = 100 if os.environ.get("DYKNOW_FULL") else 10


def scanned(seed: int) -> tuple[Rescue, float]:
    """And how many seconds the scan took; both are home again."""
    rescue = Rescue(seed, image_us=200_000)
    rescue.world.run_for(2.0)
    rescue.scan()
    scan_s = rescue.until_scanned()
    rescue.world.run_for(45.0)
    return rescue, scan_s


@pytest.mark.full
def test_all_persons_are_in_both_maps_and_hardly_anything_else():
    good = 0
    for seed in range(100, 100 + RUNS):
        rescue, scan_s = scanned(seed)
        found = [rescue.errors_m(unit) for unit in "01"]
        flown_m = max(vehicle.flown_m for vehicle in rescue.vehicles)
        is_good = (
            scan_s < 600.0 and flown_m <= 1100.0 and all(len(errors) == 11 and wrong <= 1 for errors, wrong in found)
        )
        good += is_good
        of_maps = ", ".join(
            f"{len(errors)} of 11 and {wrong} false, {max(errors, default=0):.2f} m off" for errors, wrong in found
        )
        print(
            f"seed {seed}: {'good' if is_good else 'BAD'}; {of_maps}; scan {scan_s:.0f} s; flown {flown_m:.0f} m",
            flush=True,
        )
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


def test_with_a_roster_vehicles_scan_what_a_command_centre_has_asked_for_and_nothing_else():
    rescue = Rescue(3, image_us=200_000, trust=trust)
    world = rescue.world
    world.run_for(2.0)
    by_another = world.ask("1", "0", DivideArea(area=rescue.corners(), scan_m=45.0))
    world.run_for(4.0)
    assert by_another.refusal is not None
    assert by_another.refusal[1] is not None
    assert by_another.refusal[1].code == "role"
    assert not rescue.vehicles[0].orders
    rescue.scan()
    world.run_for(5.0)
    conditions = [each.text for unit in "01" for each in world.platform(unit).part(Scanning).conditions()]
    assert all(each.endswith("of the area was in view for 5 s") for each in conditions), conditions
    assert all(vehicle.orders for vehicle in rescue.vehicles)
