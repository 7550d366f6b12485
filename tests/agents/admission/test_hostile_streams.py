"""What a member with a valid key streams, answers, describes and beats: no part raises anything over it, in any scenario."""

import gc
import os
import resource
from collections.abc import Callable
from dataclasses import replace
from math import cos, sin
from pathlib import Path
from random import Random
from typing import Any

import pytest

from dyknow.agents.capabilities.cooperation.cooperation import Cooperation
from dyknow.agents.config import PlatformConfig
from dyknow.federation.messages.contents import MonitorProximity
from dyknow.sim_uavs.world.world import World
from tests.agents.capabilities.cooperation.federations import SPEC, Federation
from tests.agents.capabilities.missions.flown import Flown
from tests.agents.capabilities.saliency.rescuing import Rescue
from tests.agents.hostile import HostileMember
from tests.agents.rosters import trust
from tests.box import Box, Vehicle

FULL = bool(os.environ.get("DYKNOW_FULL"))
ROUNDS = 1500 if FULL else 60
GROWN_KB = 50 * 1024
HOSTILE = "2"


def hover() -> tuple[World, Callable[[float], None]]:
    """Two platforms that fly and are monitored; signed acts."""
    box = Box(1)
    for unit in "01":
        box.join(unit, Vehicle(north_m=300.0 * int(unit), battery=0.8), control=True, simulated=True)
    box.join(HOSTILE, Vehicle(north_m=900.0, battery=0.5))
    box.centre()
    box.run(2.0)
    for unit in "01":
        box.asked("cc", unit, MonitorProximity())
    return box, lambda seconds: (box.run(seconds), box.wire.log.clear())  # type: ignore[func-returns-value]


def emergency() -> tuple[World, Callable[[float], None]]:
    """Two platforms that scan a field for persons, with cameras."""
    rescue = Rescue(1, 2, over=[(-20.0, 10.0), (30.0, 20.0)], image_us=1_000_000)
    world = rescue.world
    world.add(HOSTILE, PlatformConfig(HOSTILE, 1), Vehicle(north_m=900.0))  # type: ignore[arg-type]
    world.run_for(2.0)
    rescue.scan()
    return world, world.run_for


def traffic() -> tuple[World, Callable[[float], None]]:
    """Two platforms that track cars and share what they see."""
    pair: Any = Federation(SPEC, SPEC)
    world: World = pair.world
    world.add(HOSTILE, PlatformConfig(HOSTILE, 1), Vehicle(north_m=900.0))  # type: ignore[arg-type]

    def seen(t: float) -> dict[str, list[tuple[Any, ...]]]:
        cars = [(f"co{n}", 20.0 * n + 5.0 * t, 10.0 * sin(t + n), 5.0, 10.0 * cos(t + n)) for n in (1, 2)]
        return {"0": cars, "1": cars}

    def run(seconds: float) -> None:
        pair.drive(seconds, seen)

    run(2.0)
    assert world.platform("0").part(Cooperation)
    return world, run


def logistics() -> tuple[World, Callable[[float], None]]:
    """Two platforms on a mission."""
    flown = Flown(2)
    flown.world.add(HOSTILE, PlatformConfig(HOSTILE, 1), Vehicle(north_m=900.0))  # type: ignore[arg-type]
    flown.world.run_for(2.0)
    flown.begin()
    return flown.world, flown.world.run_for


@pytest.mark.timeout(3600)
@pytest.mark.parametrize("seed", [1, *(pytest.param(seed, marks=pytest.mark.full) for seed in (2, 3))])
@pytest.mark.parametrize("scenario", [hover, emergency, traffic, logistics])
def test_nothing_that_a_member_streams_answers_or_says_of_itself_makes_a_part_raise(
    monkeypatch: pytest.MonkeyPatch, scenario: Callable[[], Any], seed: int
) -> None:
    sign_all(monkeypatch)
    monkeypatch.setattr(World, "raises", True)
    monkeypatch.setattr(Box, "raises", True)
    rng = Random(seed)
    world, run = scenario()
    member = HostileMember(world, rng, HOSTILE, ("0", "1"), trust(HOSTILE))
    before_kb = 0
    for number in range(ROUNDS):
        for _ in range(5):
            member.speak()
        run(rng.choice((0.01, 0.05, 0.1)))
        if rng.random() < 0.02:
            come_and_go(world, run, member, rng)
        if number == ROUNDS // 4:
            before_kb = resident_kb()
    assert {"0", "1"} <= {unit for unit, node in world.nodes.items() if node.process is not None}
    assert min(member.said["Arrived"], member.said["Answered"]) > ROUNDS // 10
    assert resident_kb() - before_kb < GROWN_KB


def resident_kb() -> int:
    """How much memory this process has now, without what is garbage."""
    gc.collect()
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize() // 1024


def sign_all(patch: pytest.MonkeyPatch) -> None:
    """Every member of every world has a key, and a roster."""
    add, centre = World.add, World.add_command_centre

    def added(world: World, unit: str, config: PlatformConfig | None = None, vehicle: Any = None, **more: Any) -> Any:
        config = replace(config or PlatformConfig(unit, 0), trust=trust(unit))
        return add(world, unit, config, vehicle, **more)

    patch.setattr(World, "add", added)
    patch.setattr(World, "add_command_centre", lambda world, unit="cc", **_more: centre(world, unit, trust=trust(unit)))


def come_and_go(world: World, run: Callable[[float], None], member: HostileMember, rng: Random) -> None:
    """It leaves or dies, is gone for a while, and is back; or the same with an honest one."""
    unit = rng.choice((HOSTILE, HOSTILE, "1"))
    world.leave(unit) if rng.random() < 0.5 else world.kill(unit)
    for _ in range(10):
        member.speak()
    run(rng.choice((0.5, 4.0, 8.0)))
    world.restart(unit)
    node = world.nodes[unit]
    del node.lives[:-1], node.notes[:-100], node.truth[:]
    run(1.0)
    member.begin()
    if unit == "1" and isinstance(world, Box):
        world.asked("cc", "1", MonitorProximity())
