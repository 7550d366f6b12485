"""Vehicles that would meet, flown by personas of real autopilots: how each flies, and what is wrong with it, from one seed."""

from collections.abc import Callable, Sequence
from itertools import combinations
from math import cos, dist, radians, sin
from random import Random
from typing import Final, NamedTuple

from dyknow.agents.capabilities.separation.giving_way import GivingWay
from dyknow.agents.config import PlatformConfig
from dyknow.agents.places import FlightPlan, Waypoint
from dyknow.federation.messages.contents import MonitorProximity
from dyknow.federation.messages.dialogue import Dialogue
from dyknow.navigation.geodesy import LocalFrame
from dyknow.sim_uavs.dynamics.faults import parse_fault
from dyknow.sim_uavs.dynamics.flight import Mode
from dyknow.sim_uavs.dynamics.missions import Item, MissionAction
from dyknow.sim_uavs.dynamics.quadcopter import AirframeLimits, Vector
from dyknow.sim_uavs.dynamics.scenarios import ORIGIN
from dyknow.sim_uavs.dynamics.settings import HomePlace, PersonaName, VehicleConfig, VehicleSettings
from dyknow.sim_uavs.world.world import World
from tests.sim_uavs.wired import WiredVehicle
from tests.sim_uavs.worlds import FRAME, place

S: Final = 1_000_000
BEGIN_S: Final = 4.0
"""When, after the world began, the vehicles set out."""
MEET_S: Final = 13.0
"""How long after that they would meet."""
LONGEST_S: Final = 30.0
"""How long after that the world is looked at, at most."""
APART_M: Final = 70.0
"""How far apart they are at least when they set out."""
PERSONAS: Final[tuple[PersonaName, ...]] = ("ardupilot", "ardupilot", "ardupilot-3.3", "px4")
WAYS: Final = ("plan", "plan", "station", "station", "streaming", "mission", "mission, may be interrupted")
"""Who sends a vehicle: the platform by its plan, a ground station once or at 1 Hz, or its own mission (AUTO)."""


class Trouble(NamedTuple):
    """A fault of one vehicle, from when after setting out, and for how long; None: for good."""

    fault: str
    from_s: float
    for_s: float | None = None


class Flown(NamedTuple):
    """How one vehicle flies."""

    persona: PersonaName
    way: str
    start: Vector
    end: Vector
    speed_m_s: float
    limits: AirframeLimits
    settings: VehicleSettings
    troubles: tuple[Trouble, ...]

    def __str__(self) -> str:
        wrong = ", ".join(f"{t.fault} at {t.from_s:.1f} s for {t.for_s}" for t in self.troubles)
        fence = f", fence {self.settings.fence_highest_m:.0f} m" if self.settings.fence_on else ""
        return f"{self.persona} by {self.way} at {self.speed_m_s:.1f} m/s{fence}: {wrong or 'nothing wrong'}"


_TROUBLES: Final[dict[str, Callable[[Random], Trouble]]] = {
    "refuse": lambda r: Trouble(f"refuse={r.choice((1, 2, 3, 4))}", 0.0),
    "refuses for a while": lambda r: Trouble(f"refuse={r.choice((1, 2, 4))}", r.uniform(0, 20), r.uniform(1, 8)),
    "forget": lambda r: Trouble("forget", r.uniform(0, 15)),
    "late": lambda r: Trouble(f"ack-delay={r.uniform(0.1, 1.5):.2f}", 0.0),
    "lost": lambda r: Trouble(f"ack-loss={r.choice((30, 30, 60, 100))}", 0.0),
    "lossy": lambda r: Trouble("packet-loss=20", 0.0),
    "takeover": lambda r: Trouble("takeover", r.uniform(2, 25), r.uniform(2, 20)),
    "killed": lambda r: Trouble("killed", r.uniform(2, 25)),
}
TROUBLES: Final = tuple(_TROUBLES)


def draw(seed: int) -> tuple[Flown, ...]:
    """Two or three vehicles that are at one place at nearly one time, from directions and at speeds by chance."""
    random = Random(f"meeting {seed}")
    count = 3 if seed % 4 == 3 else 2
    heading_deg, height_m = random.uniform(0, 360), random.uniform(35, 60)
    found = [_drawn(random, heading_deg, height_m)]
    while len(found) < count:
        turn_deg = random.choice((180, 180, 90, -90, random.uniform(20, 340), random.uniform(-5, 5)))
        other = _drawn(random, heading_deg + turn_deg, height_m)
        if all(other.start.minus(each.start).horizontal >= APART_M for each in found):
            found.append(other)
    return tuple(found)


def _drawn(random: Random, heading_deg: float, height_m: float) -> Flown:
    speed_m_s = random.uniform(3.0, 10.0)
    limits = AirframeLimits(acceleration_m_s2=random.choice((4.0, 2.5, 1.6)))
    settings = VehicleSettings(
        cruise_m_s=speed_m_s, climb_m_s=random.choice((1.5, 2.5, 3.0)), descent_m_s=random.choice((1.0, 1.5, 2.0))
    )
    up_m = height_m + random.choice((0.0, random.uniform(-8, 8)))
    if random.random() < 0.15:
        settings.fence_on, settings.fence_kinds, settings.fence_highest_m = 1.0, 1.0, up_m + random.uniform(3, 22)
    before_m = speed_m_s * (MEET_S + random.uniform(-1, 1)) - speed_m_s**2 / 2 / limits.acceleration_m_s2
    course = Vector(cos(radians(heading_deg)), sin(radians(heading_deg)), 0.0)
    aside = Vector(-course.east, course.north, 0.0)
    middle = Vector(0.0, 0.0, -up_m).plus(aside, random.uniform(-6, 6))
    start, end = middle.plus(course, -before_m), middle.plus(course, speed_m_s * random.uniform(12, 20))
    kinds = random.sample(TROUBLES, random.choice((0, 0, 1, 1, 2)))
    return Flown(
        random.choice(PERSONAS), random.choice(WAYS), start, end, speed_m_s, limits, settings,
        tuple(_TROUBLES[kind](random) for kind in kinds),
    )  # fmt: skip


class Meeting:
    """A world in which they fly, each with a platform, and a task that wants them to give way.

    Attributes:
        modes: in which mode each vehicle was, ten times a second.
    """

    def __init__(self, seed: int, flown: Sequence[Flown]) -> None:
        self.flown = flown
        self.world = World(seed)
        self.vehicles: list[WiredVehicle] = []
        self.begin_us = self.world.start_us + round(BEGIN_S * S)
        for number, each in enumerate(flown):
            self._add(number, each, seed)
        self.world.add_command_centre()
        self.modes: list[list[tuple[int, Mode]]] = [[] for _ in flown]
        self._note_modes()
        self.world.run_for(2)
        self.task: Dialogue = self.world.ask("cc", "0", MonitorProximity())

    def _add(self, number: int, flown: Flown, seed: int) -> None:
        latitude_deg, longitude_deg, altitude_m = FRAME.from_ned(*flown.start)
        home = HomePlace(latitude_deg, longitude_deg, ORIGIN.altitude_m)
        config = VehicleConfig(
            number + 1, home, flown.persona, airborne_m=altitude_m - home.altitude_m, seed=seed,
            limits=flown.limits, settings=flown.settings,
        )  # fmt: skip
        world = self.world
        vehicle = WiredVehicle(config, world.now_us, phase_us=world.random.randrange(100_000))
        self.vehicles.append(vehicle)
        there = FRAME.from_ned(*flown.end)
        plan = FlightPlan((Waypoint(*there),), flown.speed_m_s, self.begin_us) if flown.way == "plan" else None
        missions = flown.way == "mission, may be interrupted"
        settings = PlatformConfig(str(number), 0, control=True, simulated=True, plan=plan, missions=missions)
        world.add(str(number), settings, vehicle)
        end = Vector(*LocalFrame(*home).to_ned(*there))
        if flown.way != "plan":
            world.at(self.begin_us, _set_out, vehicle, flown.way, end)
        for trouble in flown.troubles:
            at_us = self.begin_us + round(trouble.from_s * S)
            for_us = None if trouble.for_s is None else round(trouble.for_s * S)
            world.at(at_us, world.inject, str(number), trouble.fault, for_us)
        if flown.way == "streaming":
            world.at(self.begin_us, vehicle.inject, parse_fault("stream-target=1"), self.begin_us)

    def seconds(self, at_us: int) -> float:
        """After setting out."""
        return (at_us - self.begin_us) / S

    def killed_us(self, number: int) -> int:
        """When its autopilot ends; or never."""
        ends = (trouble.from_s for trouble in self.flown[number].troubles if trouble.fault == "killed")
        return self.begin_us + round(min(ends, default=1e6) * S)

    def mode_since_us(self, number: int, at_us: int, ours: set[Mode]) -> int:
        """Since when without a break, before `at_us`, its mode was none of `ours`."""
        since_us = at_us
        for noted_us, mode in reversed(self.modes[number]):
            if noted_us > at_us:
                continue
            if mode in ours:
                break
            since_us = noted_us
        return since_us

    def _note_modes(self) -> None:
        for noted, vehicle in zip(self.modes, self.vehicles, strict=True):
            noted.append((self.world.now_us, vehicle.flight.mode))
        self.world.at(self.world.now_us + 100_000, self._note_modes)

    def run(self) -> None:
        """Until they have met and nobody avoids anybody, or it has taken too long."""
        world = self.world
        world.run_until(self.begin_us + round((MEET_S + 5.0) * S))
        while world.now_us < self.begin_us + (MEET_S + LONGEST_S) * S and not self._is_over:
            world.run_for(1.0)

    @property
    def _is_over(self) -> bool:
        """Whether they are apart, none comes nearer to another, and no platform avoids one."""
        units = [str(number) for number in range(len(self.flown))]
        if any(self.world.platform(unit).part(GivingWay).encounters for unit in units):
            return False
        before, now = ([place(self.world.nodes[unit].truth[back]) for unit in units] for back in (-11, -1))
        pairs = combinations(range(len(units)), 2)
        return all(dist(now[a], now[b]) > max(30.0, dist(before[a], before[b]) - 0.1) for a, b in pairs)


def _set_out(vehicle: WiredVehicle, way: str, end: Vector) -> None:
    flight = vehicle.flight
    if way.startswith("mission"):
        flight.items = tuple(Item(MissionAction.FLY_TO, point) for point in (Vector(0, 0, 0), end, end))
        flight.items = (*flight.items[:2], Item(MissionAction.FLY_TO, end, stay_us=None))
        flight.first_item = 1
        flight.set_item(1)
        flight.set_mode(Mode.AUTO)
    else:
        flight.go_to(end)
