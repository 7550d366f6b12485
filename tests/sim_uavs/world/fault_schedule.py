"""What goes wrong in a simulated world, when and for how long: drawn from a seed, and arranged in the world.

A fault is an interval: it begins at `at_us` and is over at `until_us`.
"""

from collections.abc import Callable, Sequence
from random import Random
from typing import Final, NamedTuple

from dyknow.sim_uavs.world.sessions import SessionLink
from dyknow.sim_uavs.world.world import World

DEAF_US: Final = 9_000_000
"""The longest a deaf pair stays so: a watchdog opens the session again."""

AGAIN_US: Final = 500_000
"""After how long somebody tries again who finds a process standing still."""


class ScheduledFault(NamedTuple):
    """One thing that goes wrong. `units` are those it befalls; of a cut, first who is not heard."""

    kind: str
    at_us: int
    until_us: int
    units: tuple[str, ...]
    vehicle_fault: str = ""


_Draw = Callable[[Random, Sequence[str], Sequence[str]], tuple[tuple[str, ...], str, tuple[int, int]]]
_SHORT: Final = (300_000, 8_000_000)


def _one(random: Random, uavs: Sequence[str], _all: Sequence[str]) -> tuple[tuple[str, ...], str, tuple[int, int]]:
    return (random.choice(uavs),), "", _SHORT


def _two(
    random: Random, _uavs: Sequence[str], everybody: Sequence[str]
) -> tuple[tuple[str, ...], str, tuple[int, int]]:
    return tuple(random.sample(everybody, 2)), "", _SHORT


def _deaf(
    random: Random, _uavs: Sequence[str], everybody: Sequence[str]
) -> tuple[tuple[str, ...], str, tuple[int, int]]:
    return tuple(random.sample(everybody, 2)), "", (DEAF_US, DEAF_US)


def _group(
    random: Random, _uavs: Sequence[str], everybody: Sequence[str]
) -> tuple[tuple[str, ...], str, tuple[int, int]]:
    return tuple(random.sample(everybody, random.randint(1, len(everybody) - 1))), "", _SHORT


def _vehicle(random: Random, uavs: Sequence[str], _all: Sequence[str]) -> tuple[tuple[str, ...], str, tuple[int, int]]:
    fault = random.choice(
        ("gps-loss", "frozen-position", "nan", "silence", "packet-loss=50", "teleport=300", "gps-noise=8")
    )
    return (random.choice(uavs),), fault, (300_000, 5_000_000)


_KINDS: Final[dict[str, _Draw]] = {
    "restart": _one,
    "freeze": _one,
    "leave": _one,
    "partition": _group,
    "cut": _two,
    "deaf": _deaf,
    "lossy": _two,
    "vehicle": _vehicle,
}
KINDS: Final = tuple(_KINDS)


def draw_faults(
    seed: int,
    uavs: Sequence[str],
    others: Sequence[str],
    from_us: int,
    to_us: int,
    count: int,
    kinds: Sequence[str] = KINDS,
) -> tuple[ScheduledFault, ...]:
    """`count` faults that begin between `from_us` and `to_us`, to UAVs and, on the wire, to others; by time."""
    random = Random(f"mishaps {seed}")
    found = []
    for _ in range(count):
        kind = random.choice(kinds)
        units, vehicle_fault, duration = _KINDS[kind](random, uavs, [*uavs, *others])
        at_us = random.randint(from_us, to_us)
        found.append(ScheduledFault(kind, at_us, at_us + random.randint(*duration), units, vehicle_fault))
    return tuple(sorted(found, key=lambda fault: fault.at_us))


def arrange(world: World, faults: Sequence[ScheduledFault]) -> int:
    """Have them happen in the course of the run; returns when the last one is over."""
    for fault in faults:
        _ARRANGE[fault.kind](world, fault)
    return max((fault.until_us for fault in faults), default=world.now_us)


def _restart(world: World, fault: ScheduledFault) -> None:
    (unit,) = fault.units
    world.at(fault.at_us, world.kill, unit)
    world.at(fault.until_us, world.restart, unit)


def _freeze(world: World, fault: ScheduledFault) -> None:
    (unit,) = fault.units
    world.at(fault.at_us, world.freeze, unit)
    world.at(fault.until_us, world.thaw, unit)


def _leave(world: World, fault: ScheduledFault) -> None:
    (unit,) = fault.units

    def back() -> None:
        node = world.nodes[unit]
        if node.frozen:
            world.at(world.now_us + AGAIN_US, back)
        elif node.platform is not None:
            world.rejoin(unit)

    world.at(fault.at_us, world.leave, unit)
    world.at(fault.until_us, back)


def _partition(world: World, fault: ScheduledFault) -> None:
    rest = [unit for unit in world.nodes if unit not in fault.units]
    world.at(fault.at_us, world.partition, fault.units, rest)
    world.at(fault.until_us, world.heal, fault.units, rest)


def _cut(world: World, fault: ScheduledFault) -> None:
    world.at(fault.at_us, world.wire.cut, *fault.units)
    world.at(fault.until_us, world.wire.mend, *fault.units)


def _deafen(world: World, fault: ScheduledFault) -> None:
    world.at(fault.at_us, world.wire.deafen, *fault.units)


def _lossy(world: World, fault: ScheduledFault) -> None:
    one, other = fault.units
    bad = SessionLink(loss=0.2, duplication=0.1, reordering=0.2, jitter_us=20_000)
    for pair in ((one, other), (other, one)):
        world.at(fault.at_us, world.wire.set_link, *pair, bad)
        world.at(fault.until_us, world.wire.set_link, *pair, world.wire.link)


def _fail(world: World, fault: ScheduledFault) -> None:
    world.at(fault.at_us, world.inject, fault.units[0], fault.vehicle_fault, fault.until_us - fault.at_us)


_ARRANGE: Final[dict[str, Callable[[World, ScheduledFault], None]]] = {
    "restart": _restart,
    "freeze": _freeze,
    "leave": _leave,
    "partition": _partition,
    "cut": _cut,
    "deaf": _deafen,
    "lossy": _lossy,
    "vehicle": _fail,
}
