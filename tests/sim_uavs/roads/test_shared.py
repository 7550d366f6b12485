"""Cars that are a function of the seed and of the time."""

from collections.abc import Iterable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dyknow.sim_uavs.dynamics.scenarios import ORIGIN, scenario
from dyknow.sim_uavs.roads.drivers import RoadState
from dyknow.sim_uavs.roads.layouts import blocks
from dyknow.sim_uavs.roads.shared import ROUND_US, STRIDE_US, SharedTraffic
from dyknow.sim_uavs.streets import roads_of, traffic_of

BEGINS_US = 2_833_333 * ROUND_US
SOON_US = BEGINS_US + 1_000_000


def states(times_us: Iterable[int], seed: int = 5) -> list[RoadState]:
    traffic = SharedTraffic(blocks(), seed, 4)
    found: list[RoadState] | None = None
    for now_us in times_us:
        while (found := traffic.at(now_us)) is None:
            pass
    return found or []


@settings(max_examples=10, deadline=None)
@given(st.lists(st.integers(0, 1_500), min_size=1, max_size=6), st.integers(0, 1_000))
def test_whenever_it_was_asked_before_it_gives_the_same_cars(before: list[int], at: int) -> None:
    now_us = BEGINS_US + at * 20_000
    earlier = sorted(BEGINS_US + each * 20_000 for each in before if each <= at)
    assert states([*earlier, now_us]) == states([now_us])


def test_other_seeds_and_other_rounds_have_other_cars() -> None:
    assert states([SOON_US]) != states([SOON_US], seed=6)
    assert states([SOON_US, SOON_US + ROUND_US]) == states([SOON_US + ROUND_US])
    assert states([SOON_US]) != states([SOON_US + ROUND_US])


def test_who_comes_late_catches_up_in_steps_and_sees_nothing_until_then() -> None:
    traffic, late_us = SharedTraffic(blocks(), 5, 2), 40 * 1_000_000
    misses = 0
    while traffic.at(BEGINS_US + late_us) is None:
        misses += 1
    assert misses == late_us // STRIDE_US - 1


def test_traffic_never_ends_and_never_stands_still() -> None:
    traffic = traffic_of(scenario("traffic"), 2)
    seen: dict[str, set[str]] = {}
    for second in range(180):
        for state in traffic.at(BEGINS_US + second * 1_000_000) or []:
            seen.setdefault(state.name, set()).add(state.link or state.crossing or "")
    assert len(seen) == 18
    assert min(map(len, seen.values())) >= 6


def test_streets_have_their_place_on_earth_and_units_hover_over_crossings() -> None:
    situation = scenario("traffic", 5)
    network = traffic_of(situation, 1).network
    assert roads_of(situation)["origin"] == [ORIGIN.longitude_deg, ORIGIN.latitude_deg]
    for unit in situation.units:
        x_m, y_m = network.to_local(unit.home.latitude_deg, unit.home.longitude_deg)
        assert min(abs(x_m - each.x_m) + abs(y_m - each.y_m) for each in network.crossings.values()) < 0.1
        assert unit.height_m == pytest.approx(65.0, abs=0.01)
    assert len({unit.home for unit in situation.units}) == 5
