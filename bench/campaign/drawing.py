"""A run of the campaign from its seed: all by one generator, so that a seed is a run."""

from collections.abc import Callable
from random import Random

from bench.campaign.bounds import bounded
from bench.campaign.geometries import GEOMETRIES, drawn_ways
from bench.campaign.situations import DrawnVehicle, Situation, Trouble, Way
from dyknow.agents.places import FlightLimits
from dyknow.sim_uavs.dynamics.quadcopter import AirframeLimits, Wind
from dyknow.sim_uavs.dynamics.settings import PersonaName, VehicleSettings

_PERSONAS: tuple[PersonaName, ...] = ("ardupilot", "px4")
_WIRED = 0.5
"""In that share of the situations the vehicles speak MAVLink, which costs more."""
_RETURNS_BY_ITSELF = "battery failsafe"
_Draw = Callable[[Random, int, int], Trouble]
"""Given the generator, a vehicle, and how many there are."""


def situation(seed: int) -> Situation:
    """All that happens in the run of that seed."""
    random = Random(f"campaign {seed}")
    geometry = GEOMETRIES[seed % len(GEOMETRIES)]
    count = random.choice((2, 2, 2, 3, 3, 4, 5, 6))
    found = [way._replace(by_user=random.random() < 0.5) for way in drawn_ways(random, geometry, count)]
    wind = Wind()
    if random.random() < 0.5:
        wind = Wind(random.uniform(-5.0, 5.0), random.uniform(-5.0, 5.0), random.uniform(0.0, 1.5))
    vehicles = [_vehicle(random, way) for way in found]
    troubles: tuple[Trouble, ...] = ()
    if random.random() < 0.5:
        kinds = random.sample(list(_TROUBLES), random.choice((1, 1, 2)))
        troubles = tuple(_TROUBLES[kind](random, random.randrange(len(found)), len(found)) for kind in kinds)
    for trouble in troubles:
        if trouble.kind == "clock lies":
            within_us = random.choice((300_000.0, 5_000_000.0))
            offset_us, drift_ppm = round(random.uniform(-within_us, within_us)), random.uniform(-20_000.0, 20_000.0)
            wrong = random.choice(((offset_us, 0.0), (0, drift_ppm)))
            vehicles[trouble.unit] = vehicles[trouble.unit]._replace(clock=wrong)
        elif trouble.kind == _RETURNS_BY_ITSELF:
            vehicles[trouble.unit].settings.battery_low_action = random.choice((1.0, 2.0, 2.0, 2.0))
    return Situation(seed, geometry, tuple(vehicles), troubles, wind, random.random() < _WIRED)


def _vehicle(random: Random, way: Way) -> DrawnVehicle:
    limits = AirframeLimits(acceleration_m_s2=random.choice((4.0, 2.5, 1.6)))
    settings = VehicleSettings(
        cruise_m_s=way.speed_m_s, climb_m_s=random.choice((1.5, 2.5, 3.0)), descent_m_s=random.choice((1.0, 1.5, 2.0))
    )
    persona = random.choice(_PERSONAS)
    return bounded(random, DrawnVehicle(way, limits, settings, FlightLimits(), persona=persona))


def _at_s(random: Random) -> float:
    return random.uniform(0.0, 30.0)


def _of_vehicle(kind: str, fault: Callable[[Random], str], for_s: tuple[float, float] | None) -> _Draw:
    def draw(random: Random, unit: int, _count: int) -> Trouble:
        lasts_s = None if for_s is None else random.uniform(*for_s)
        return Trouble(kind, unit, _at_s(random), lasts_s, fault=fault(random))

    return draw


def _of_link(kind: str, *, to_all: bool) -> _Draw:
    def draw(random: Random, unit: int, count: int) -> Trouble:
        other = None if to_all else random.choice([each for each in range(count) if each != unit])
        return Trouble(kind, unit, _at_s(random), random.uniform(1.0, 60.0), other)

    return draw


def _process_dies(random: Random, unit: int, _count: int) -> Trouble:
    return Trouble("process dies", unit, _at_s(random), random.choice((None, random.uniform(2.0, 20.0))))


def _clock_begins_to_lie(random: Random, unit: int, _count: int) -> Trouble:
    """It leaps ahead, has stood still, or runs too fast or too slowly."""
    within_us = random.choice((300_000.0, 5_000_000.0))
    step_us, drift_ppm = round(random.uniform(-within_us, within_us)), random.uniform(-20_000.0, 20_000.0)
    clock = random.choice(((step_us, 0.0), (0, drift_ppm)))
    return Trouble("clock begins to lie", unit, _at_s(random), None, clock=clock)


_TROUBLES: dict[str, _Draw] = {
    "process dies": _process_dies,
    "autopilot dies": _of_vehicle("autopilot dies", lambda _random: "killed", None),
    "autopilot is silent": _of_vehicle("autopilot is silent", lambda _random: "silence", (2.0, 30.0)),
    "link is cut": _of_link("link is cut", to_all=False),
    "link is cut one way": _of_link("link is cut one way", to_all=False),
    "platform is cut off": _of_link("platform is cut off", to_all=True),
    "refuses": _of_vehicle("refuses", lambda random: f"refuse={random.choice((1, 2, 4))}", None),
    "refuses for a while": _of_vehicle("refuses", lambda random: f"refuse={random.choice((1, 2, 4))}", (2.0, 15.0)),
    "forgets": _of_vehicle("forgets", lambda _random: "forget", None),
    "pilot's hands": _of_vehicle("pilot's hands", lambda _random: "takeover", (2.0, 20.0)),
    "GPS leaps": _of_vehicle("GPS leaps", lambda random: f"teleport={random.uniform(60.0, 500.0):.0f}", (2.0, 20.0)),
    "GPS is lost": _of_vehicle("GPS is lost", lambda _random: "gps-loss", (2.0, 30.0)),
    "clock lies": lambda _random, unit, _count: Trouble("clock lies", unit, 0.0, None),
    "clock begins to lie": _clock_begins_to_lie,
    "battery is low": _of_vehicle(
        "battery is low", lambda random: f"battery-low={random.uniform(10.0, 15.0):.1f}", None
    ),
    _RETURNS_BY_ITSELF: _of_vehicle(
        _RETURNS_BY_ITSELF, lambda random: f"battery-low={random.uniform(12.0, 24.0):.1f}", None
    ),
    "30 % loss": lambda _random, unit, _count: Trouble("30 % loss", unit, 0.0, None),
}
TROUBLES = tuple(_TROUBLES)
