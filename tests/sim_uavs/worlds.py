"""Worlds to test in, and what a test needs to judge them: what each platform believed and when."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from random import Random
from typing import Any

from dyknow.agents.capabilities.flight.options import AvoidanceOptions
from dyknow.agents.config import PlatformConfig
from dyknow.agents.monitoring.alarm_log import AlarmLog
from dyknow.agents.options import Chosen
from dyknow.agents.places import FlightPlan
from dyknow.agents.platform import Platform
from dyknow.federation.messages.contents import Alarm
from dyknow.federation.messages.dialogue import Dialogue
from dyknow.navigation.geodesy import LocalFrame
from dyknow.sim_uavs.dynamics.flight_plans import plan_of
from dyknow.sim_uavs.dynamics.quadcopter import Vector
from dyknow.sim_uavs.dynamics.routes import through
from dyknow.sim_uavs.dynamics.scenarios import ORIGIN, scenario
from dyknow.sim_uavs.dynamics.settings import HomePlace, VehicleConfig
from dyknow.sim_uavs.dynamics.vehicles import SimulatedVehicle
from dyknow.sim_uavs.world.units import WorldNode
from dyknow.sim_uavs.world.wire import Wire
from dyknow.sim_uavs.world.world import World

FRAME = LocalFrame(*ORIGIN)
PLAN_US = 5_000_000
"""When, after the world began, routes begin."""


@dataclass
class Watched:
    """What one monitor table of one life was told: (federation time of the node, what, name or member, why)."""

    platform: Platform
    born_us: int
    calls: list[tuple[int, str, str, str]] = field(default_factory=list)


class WatchedWorld(World):
    """A world that notes what each platform's monitors are told of tasks and of who is there."""

    def __init__(self, seed: int, **options: Any) -> None:
        self.watched: dict[str, list[Watched]] = {}
        super().__init__(seed, **options)

    def _boot(self, node: WorldNode) -> None:
        super()._boot(node)
        unit, platform = node.unit, node.platform
        if platform is None:
            return
        watched = Watched(platform, self.now_us)
        self.watched.setdefault(unit, []).append(watched)
        monitors, calls = platform.built.monitors, watched.calls
        create, remove, join, doubt, leave = (
            monitors.create,
            monitors.remove,
            monitors.join,
            monitors.suspect,
            monitors.leave,
        )

        def now_us() -> int:
            return node.clock.node_us(self.now_us)

        def noting(what: str, do: Any) -> Any:
            def noted(name: Any, *rest: Any) -> None:
                why = rest[0] if rest and isinstance(rest[0], str) else ""
                calls.append((now_us(), what, getattr(name, "name", name), why))
                do(name, *rest)

            return noted

        for what, do in (("create", create), ("remove", remove), ("join", join), ("doubt", doubt), ("leave", leave)):
            setattr(monitors, what, noting(what, do))


def fly_scenario(
    seed: int,
    name: str = "crossing",
    count: int = 2,
    *,
    avoidance: bool = True,
    offsets_us: Sequence[int] = (),
    drifts_ppm: Sequence[float] = (),
    settings: dict[str, dict[str, Any]] | None = None,
    **options: Any,
) -> WatchedWorld:
    """A named scenario, its vehicles hovering, routes from `PLAN_US` on, and a command centre.

    `settings` are fields of `PlatformConfig` by unit; offsets and drifts are of the clocks, by number.
    """
    world = WatchedWorld(seed, **options)
    for unit in scenario(name, count, seed).units:
        number = unit.number
        offset_us = offsets_us[number] if number < len(offsets_us) else 0
        plan = plan_of(unit.route, world.start_us + PLAN_US + offset_us)
        vehicle = SimulatedVehicle(
            unit.vehicle(number + 1, airborne=True), world.now_us, phase_us=world.random.randrange(100_000)
        )
        fields = {
            "control": True,
            "simulated": True,
            "options": Chosen(AvoidanceOptions(avoidance=avoidance)),
            "plan": plan,
        }
        config = PlatformConfig(str(number), 0, **fields | (settings or {}).get(str(number), {}))
        drift_ppm = drifts_ppm[number] if number < len(drifts_ppm) else 0.0
        world.add(str(number), config, vehicle, offset_us=offset_us, drift_ppm=drift_ppm)
    world.add_command_centre()
    return world


def crowd(seed: int, count: int = 3, *, avoidance: bool = True, **options: Any) -> WatchedWorld:
    """UAVs that cross each other's ways again and again, on loops through one small place."""
    world = WatchedWorld(seed, **options)
    random = Random(f"crowd {seed}")
    for number in range(count):
        points = [
            Vector(random.uniform(-70.0, 70.0), random.uniform(-70.0, 70.0), -40.0 - random.uniform(0.0, 7.0))
            for _ in range(5)
        ]
        route = through(FRAME, points, random.uniform(4.0, 8.0), loop=True)
        start = route.waypoints[0]
        home = HomePlace(start.latitude_deg, start.longitude_deg, ORIGIN.altitude_m)
        airborne_m = start.altitude_m - ORIGIN.altitude_m
        flown = VehicleConfig(number + 1, home, airborne_m=airborne_m, seed=seed)
        vehicle = SimulatedVehicle(flown, world.now_us, phase_us=world.random.randrange(100_000))
        plan: FlightPlan = plan_of(route, world.start_us + PLAN_US)
        config = PlatformConfig(
            str(number),
            0,
            control=True,
            simulated=True,
            options=Chosen(AvoidanceOptions(avoidance=avoidance)),
            plan=plan,
        )
        world.add(str(number), config, vehicle)
    world.add_command_centre()
    return world


def separations_m(world: World, one: str, other: str) -> list[tuple[int, float]]:
    """(time, 3-D distance in metres) of two vehicles, as they really were."""
    return [
        (p.at_us, sum((a - b) ** 2 for a, b in zip(place(p), place(q), strict=True)) ** 0.5)
        for p, q in zip(world.nodes[one].truth, world.nodes[other].truth, strict=False)
    ]


def place(found: Any) -> tuple[float, float, float]:
    """North, east, down in metres from the origin of all scenarios."""
    return FRAME.to_ned(found.latitude_deg, found.longitude_deg, found.altitude_m)


def alarms(dialogue: Dialogue, monitor: str, event: str = "opened") -> list[Alarm]:
    """What the delegator was told of one monitor."""
    return [
        told for told in dialogue.results if isinstance(told, Alarm) and (told.monitor, told.event) == (monitor, event)
    ]


def raised(world: World, unit: str, monitor: str, event: str = "opened") -> list[Any]:
    """The alarms that all lives of a unit raised."""
    return [
        found
        for platform in world.nodes[unit].lives
        if isinstance(platform, Platform)
        for found in platform.part(AlarmLog).events
        if (found.monitor, found.event) == (monitor, event)
    ]


def cancel_task(world: World, by: str, unit: str, conversation: str) -> None:
    """End a task at whoever leads it now, as `dyknow cancel` does."""
    dialogue = Dialogue(unit)
    world.speak(
        by,
        lambda member, now_us: member.acts.cancel_task(
            unit, conversation, now_us, on_reply=dialogue.on_reply, on_silence=dialogue.on_silence
        ),
    )


def leaders(world: World) -> list[str]:
    """Who believes to lead a task."""
    return [
        unit
        for unit, node in world.nodes.items()
        if node.platform is not None
        and any(led.leader == unit for led in node.platform.built.tasks.coordinated.values())
    ]


def is_down(platform: Platform) -> bool:
    """Whether nothing that a task set up stands on it."""
    return not (
        platform.built.monitors.named or platform.built.tasks.all() or platform.built.gateway.exporter.exports.streams()
    )


def kept_by(wire: Wire) -> dict[str, int]:
    """How much a wire keeps, to find leaks: sessions, transports, declared tokens, open questions."""
    sessions = [*wire._sessions.values(), *wire._dying.values()]
    transports = {id(t): t for session in sessions for t in session.transports.values()}.values()
    return {
        "sessions": len(sessions),
        "transports": len(transports),
        "told": sum(len(direction.told) for t in transports for direction in (t.there, t.back)),
        "questions": len(wire._questions),
    }
