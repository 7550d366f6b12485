"""Two that pass each other harmlessly, drawn by chance, and how often they are ordered to keep apart.

Lanes are 50 m apart or more, a hovering vehicle is 40 m or more from the other's way, one crosses the other's way 8 s or more
behind it, or they are 30 m or more apart in height.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import cos, radians, sin
from random import Random
from time import process_time

from bench.campaign import situations as ways
from bench.campaign.flying import CampaignFlight, S
from bench.campaign.situations import DrawnVehicle, Situation, Way
from bench.campaign.watching import STEP_US, Watch
from dyknow.agents.places import FlightLimits
from dyknow.sim_uavs.dynamics.quadcopter import AirframeLimits, Vector, Wind
from dyknow.sim_uavs.dynamics.settings import VehicleSettings

LANE_M, ASIDE_M, BEHIND_S, ABOVE_M = 50.0, 40.0, 8.0, 30.0
KINDS = (ways.PLAN, ways.PLAN, ways.GOTO, ways.STATION, ways.AUTO_LEAVE)
LONGEST_S = 120.0


@dataclass(slots=True)
class Passing:
    """What came of one flight.

    Attributes:
        orders: how many there were to keep apart.
        flown_s: simulated seconds in the air, of both vehicles together.
    """

    seed: int
    geometry: str
    orders: int = 0
    least_m: float = 1e9
    flown_s: float = 0.0
    cpu_s: float = 0.0


class _Pair:
    """Draws two ways that pass about the place (0, 0), `meets_s` after setting out."""

    def __init__(self, random: Random) -> None:
        self.random = random
        self.up_m = random.uniform(20.0, 70.0)
        self.meets_s = random.uniform(15.0, 25.0)
        self.heading_deg = random.uniform(0.0, 360.0)

    def way(self, turn_deg: float, *, aside_m: float = 0.0, later_s: float = 0.0, above_m: float = 0.0) -> Way:
        """Level, past the place, so far to the right of it, above it, and so much later."""
        speed_m_s = self.random.uniform(4.0, 12.0)
        angle = radians(self.heading_deg + turn_deg)
        course, right = Vector(cos(angle), sin(angle), 0.0), Vector(-sin(angle), cos(angle), 0.0)
        middle = Vector(0.0, 0.0, -self.up_m - above_m).plus(right, aside_m)
        start = middle.plus(course, -speed_m_s * (self.meets_s + later_s))
        return Way(self.random.choice(KINDS), (start, middle.plus(course, speed_m_s * 20.0)), speed_m_s)

    def hover(self, aside_m: float) -> Way:
        """So far to the right of the first way."""
        angle = radians(self.heading_deg + 90.0)
        place = Vector(aside_m * cos(angle), aside_m * sin(angle), -self.up_m)
        return Way(ways.HOVER, (place,), 5.0)


def _opposite(pair: _Pair) -> list[Way]:
    """Each sees the other on the same hand."""
    lane_m = pair.random.uniform(LANE_M, LANE_M + 20.0)
    return [pair.way(0.0), pair.way(180.0, aside_m=lane_m)]


def _same(pair: _Pair) -> list[Way]:
    return [pair.way(0.0), pair.way(0.0, aside_m=pair.random.uniform(LANE_M, LANE_M + 20.0))]


def _hovering(pair: _Pair) -> list[Way]:
    return [pair.way(0.0), pair.hover(pair.random.choice((-1, 1)) * pair.random.uniform(ASIDE_M, ASIDE_M + 20.0))]


def _behind(pair: _Pair) -> list[Way]:
    turn_deg = pair.random.choice((-1, 1)) * pair.random.uniform(60.0, 120.0)
    return [pair.way(0.0), pair.way(turn_deg, later_s=pair.random.uniform(BEHIND_S, BEHIND_S + 4.0))]


def _above(pair: _Pair) -> list[Way]:
    above_m = pair.random.uniform(ABOVE_M, ABOVE_M + 15.0)
    return [pair.way(0.0), pair.way(pair.random.uniform(0.0, 360.0), above_m=above_m)]


_GEOMETRIES: dict[str, Callable[[_Pair], list[Way]]] = {
    "lanes, opposite": _opposite,
    "lanes, same direction": _same,
    "hovering next to the way": _hovering,
    "crossing behind": _behind,
    "above": _above,
}
GEOMETRIES = tuple(_GEOMETRIES)


def drawn(seed: int) -> Situation:
    """The flight of that seed."""
    random = Random(f"needless {seed}")
    geometry = GEOMETRIES[seed % len(GEOMETRIES)]
    found = _GEOMETRIES[geometry](_Pair(random))
    random.shuffle(found)
    vehicles = tuple(
        DrawnVehicle(way, AirframeLimits(), VehicleSettings(cruise_m_s=way.speed_m_s), FlightLimits()) for way in found
    )
    return Situation(seed, geometry, vehicles, (), Wind())


def passed(seed: int) -> Passing:
    """Fly it until both have arrived."""
    situation, began_s = drawn(seed), process_time()
    flight = CampaignFlight(situation)
    watch = Watch(flight)
    flight.world.run_until(flight.begin_us)
    while flight.seconds() < LONGEST_S and not all(unit.arrived_s is not None for unit in watch.units):
        flight.world.run_until(flight.world.now_us + STEP_US)
        watch.step()
    flown_s = len(watch.units) * (flight.world.now_us - flight.world.start_us) / S
    return Passing(seed, situation.geometry, watch.manoeuvres, watch.least_m, flown_s, process_time() - began_s)


def seeds() -> Iterator[int]:
    """One after the other, without end."""
    seed = 0
    while True:
        seed += 1
        yield seed
