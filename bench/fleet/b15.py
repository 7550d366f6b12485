"""B15: the simulated world: a hundred UAVs that all monitor each other, and a thousand with five neighbours each."""

import gc
import resource
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from bench.rows import Figures, Limit, Options, Side
from dyknow.agents.config import PlatformConfig
from dyknow.federation.messages.contents import MonitorProximity
from dyknow.sim_uavs.dynamics.flight_plans import plan_of
from dyknow.sim_uavs.dynamics.scenarios import scenario
from dyknow.sim_uavs.dynamics.vehicles import SimulatedVehicle
from dyknow.sim_uavs.world.sessions import SessionLink
from dyknow.sim_uavs.world.world import World

TITLE = "the simulated world: processor seconds per simulated second, one core"
BARS = (Limit("s_per_s", 1.0, ours="100 UAVs, 1 s"), Limit("rss_gb", 4.0, ours="1000 UAVs, 5 neighbours"))
_JOIN_S, _SET_UP_S = 3.0, 4.0
_SOME, _MANY = 100, 1000

Reach = Callable[[str, str], bool]
"""Whether two units are in radio range of each other."""


def _on_ring(count: int) -> Reach:
    """On a ring, in radio range of the two next on either side and of the one across; the command centre of one."""

    def near(one: str, other: str) -> bool:
        if "cc" in {one, other}:
            return "0" in {one, other}
        apart = abs(int(one) - int(other))
        return min(apart, count - apart) <= 2 or (apart == count // 2)

    return near


def _everywhere(_one: str, _other: str) -> bool:
    return True


def _world(count: int, period_us: int, reach: Reach) -> World:
    world = World(1, truth_us=None, link=SessionLink(jitter_us=0), reach=reach)
    for unit in scenario("swarm", count, 1).units:
        vehicle = SimulatedVehicle(
            unit.vehicle(unit.number % 254 + 1, airborne=True), world.now_us, phase_us=world.random.randrange(100_000)
        )
        plan = plan_of(unit.route, world.start_us)
        name = str(unit.number)
        world.add(name, PlatformConfig(name, 0, control=True, simulated=True, period_us=period_us, plan=plan), vehicle)
    world.add_command_centre()
    world.run_for(_JOIN_S)
    return world


def _run(count: int, period_us: int, seconds: float, reach: Reach = _everywhere) -> Figures:
    gc.collect()
    world = _world(count, period_us, reach)
    profile = "proximity-thesis" if period_us == 1_000_000 else "proximity"
    world.ask("cc", "0", MonitorProximity(profile=profile))
    world.run_for(_SET_UP_S)
    started_s = time.process_time()
    world.run_for(seconds)
    used_s = time.process_time() - started_s
    monitors = [
        instance.monitor
        for node in world.nodes.values()
        if node.platform is not None
        for named in node.platform.built.monitors.named.values()
        for instance in named.instances.values()
    ]
    return {
        "s_per_s": used_s / seconds,
        "monitors": float(len(monitors)),
        "fresh": float(sum(monitor.inputs == "fresh" for monitor in monitors)),
        "rss_gb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6,
    }


@contextmanager
def sides(options: Options) -> Iterator[dict[str, Side]]:
    some, many = options.size(_SOME, 3), options.size(_MANY, 8)
    yield {
        "100 UAVs, 1 s": lambda: _run(some, 1_000_000, 60.0 * options.effort),
        "100 UAVs, 10 Hz": lambda: _run(some, 100_000, 5.0 * options.effort),
        "1000 UAVs, 5 neighbours": lambda: _run(many, 1_000_000, 10.0 * options.effort, _on_ring(many)),
    }
