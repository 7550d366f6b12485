"""Tests in a simulated world: no vehicle, no network, and no waiting; a minute takes what its events take."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from dyknow.testing import (
    HomePlace,
    PlatformConfig,
    SessionLink,
    SimulatedVehicle,
    VehicleConfig,
    World,
    default_ontology,
)
from examples.extension.beacon import LABELS, Beacon, RingBeacon

HIGH = (Path(__file__).parents[1] / "high.kpl").read_text(encoding="utf-8")
HOME = HomePlace(58.4945, 15.1020, 60.0)


def with_uav(seed: int, *, height_m: float) -> World:
    """A world in which UAV 0 hovers at that height, and knows `high.kpl`."""
    world = World(seed)
    vehicle = SimulatedVehicle(VehicleConfig(1, HOME, airborne_m=height_m, seed=seed), world.now_us)
    world.add("0", PlatformConfig("0", 0, simulated=True), vehicle)
    world.specify("0", HIGH, "high.kpl")
    return world


def alarms(world: World, unit: str) -> list[Mapping[str, Any]]:
    return [each for each in world.nodes[unit].results if each["event"] == "alarm-opened"]


def test_a_uav_that_is_too_high_opens_an_alarm_and_one_below_does_not() -> None:
    for height_m, monitors in ((30.0, set()), (60.0, {"high"})):
        world = with_uav(seed=7, height_m=height_m)
        world.run_for(20)
        assert {alarm["monitor"] for alarm in alarms(world, "0")} == monitors


def test_a_fault_of_the_vehicle_shows() -> None:
    world = with_uav(seed=7, height_m=30.0)
    world.at(world.now_us + 10_000_000, world.inject, "0", "battery-low=15")
    world.run_for(20)
    (alarm,) = alarms(world, "0")
    assert alarm["monitor"] == "empty"
    assert alarm["valid_us"] - world.start_us >= 10_000_000


def test_the_same_seed_gives_the_same_events() -> None:
    traces: list[list[str]] = [[], []]
    for trace in traces:
        world = World(7, link=SessionLink(loss=0.1, duplication=0.05), trace=trace.append)
        for unit in "01":
            world.add(unit)
        world.run_for(5)
    assert traces[0] == traces[1]


def test_a_platform_that_is_cut_off_is_missed_until_it_is_back() -> None:
    world = World(7)
    for unit in "012":
        world.add(unit)
    world.run_for(5)
    seen = []
    for change in (world.partition, world.heal):
        change(["0", "2"], ["1"])
        world.run_for(10)
        entry = world.platform("0").ports.directory.entry("1")
        seen.append(entry and entry.state.value)
    assert seen == ["gone", "alive"]


def test_a_part_answers_a_command_centre() -> None:
    world = World(7)
    ontology = default_ontology().extended(LABELS)
    world.add("0", PlatformConfig("0", 0, extensions=(Beacon,), ontology=ontology))
    world.add_command_centre("cc")
    world.run_for(2)
    dialogue = world.ask("cc", "0", RingBeacon(times=2))
    world.run_for(1)
    assert dialogue.agreed
    assert dialogue.trouble is None
    assert world.platform("0").part(Beacon).count == 2
