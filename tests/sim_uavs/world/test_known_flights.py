"""Flights that once came nearer than ten metres, or stood for ever: three at one point, a lost link before the warning, a landing
above another, a low ceiling, a common waypoint. Each with every autopilot, judged by the true positions.
"""

from math import cos, radians, sin

import pytest

from bench.campaign.running import CampaignRun, run
from bench.campaign.situations import (
    AUTO_LEAVE,
    GOTO,
    HOVER,
    LAND,
    PLAN,
    RTL,
    RTL_LEAVE,
    STATION,
    DrawnVehicle,
    Situation,
    Trouble,
    Way,
)
from dyknow.agents.places import FlightLimits
from dyknow.sim_uavs.dynamics.quadcopter import AirframeLimits, Vector, Wind
from dyknow.sim_uavs.dynamics.settings import PersonaName, VehicleSettings

AUTOPILOTS = [pytest.param(None, id="simulated"), "ardupilot", "px4"]
MOST = [AUTOPILOTS[0], *(pytest.param(persona, marks=pytest.mark.full) for persona in ("ardupilot", "px4"))]
"""Those of the parameters that are many: `make test` flies them with the simulated autopilot alone."""
LOW_M, REACH_M = 20.0, 120.0


def vehicle(
    way: Way, persona: PersonaName | None, *, ceiling_m: float = 120.0, fence_m: float | None = None
) -> DrawnVehicle:
    settings = VehicleSettings(cruise_m_s=way.speed_m_s)
    if fence_m is not None:
        settings.fence_on, settings.fence_kinds, settings.fence_highest_m = 1.0, 1.0, fence_m
    if way.kind in {RTL, RTL_LEAVE}:
        settings.return_m = way.highest_m
    return DrawnVehicle(
        way,
        AirframeLimits(acceleration_m_s2=2.5),
        settings,
        FlightLimits(ceiling_m=ceiling_m),
        persona=persona or "ardupilot",
    )


def through(bearing_deg: float, kind: str, speed_m_s: float, up_m: float = LOW_M, reach_m: float = REACH_M) -> Way:
    """A straight way through the point above the origin."""
    north, east = reach_m * cos(radians(bearing_deg)), reach_m * sin(radians(bearing_deg))
    return Way(kind, (Vector(-north, -east, -up_m), Vector(north, east, -up_m)), speed_m_s)


def flown(
    ways: list[Way], persona: PersonaName | None, *troubles: Trouble, seed: int = 0, **bounds: float
) -> CampaignRun:
    vehicles = tuple(vehicle(way, persona, **bounds) for way in ways)
    found = run(seed, Situation(seed, "known", vehicles, troubles, Wind(), is_wired=persona is not None))
    assert (found.breaches, found.untold, found.stuck, found.violations) == ([], [], [], [])
    return found


@pytest.mark.parametrize("persona", MOST)
@pytest.mark.parametrize("speed_m_s", [5.0, 10.0])
@pytest.mark.parametrize("seed", range(3))
def test_three_at_one_point_low_over_the_ground(seed: int, speed_m_s: float, persona: PersonaName | None) -> None:
    found = flown([through(120.0 * at, STATION, speed_m_s) for at in range(3)], persona, seed=seed)
    assert found.least_m > 10.0
    assert len(found.factors) == 3
    assert max(found.factors) < 1.6


@pytest.mark.parametrize("persona", AUTOPILOTS)
@pytest.mark.parametrize("speed_m_s", [5.0, 10.0])
def test_two_head_on_and_one_across(speed_m_s: float, persona: PersonaName | None) -> None:
    found = flown([through(bearing, STATION, speed_m_s) for bearing in (0.0, 180.0, 90.0)], persona)
    assert found.least_m > 10.0
    assert max(found.factors) < 1.6


@pytest.mark.parametrize("persona", MOST)
@pytest.mark.parametrize("unit", [0, 1])
@pytest.mark.parametrize("speed_m_s", [5.0, 10.0])
@pytest.mark.parametrize("after_s", [-2.5, 0.4, 2.0])
def test_a_process_that_dies_before_or_during_a_manoeuvre(
    after_s: float, speed_m_s: float, unit: int, persona: PersonaName | None
) -> None:
    """`after_s` counts from when the two see each other 12 s ahead."""
    reach_m = REACH_M if speed_m_s < 10.0 else 220.0
    seen_s = reach_m / speed_m_s - 12.0 + speed_m_s / 5.0
    dies = Trouble("process dies", unit, seen_s + after_s, None)
    ways = [through(bearing, STATION, speed_m_s, reach_m=reach_m) for bearing in (0.0, 180.0)]
    found = flown(ways, persona, dies)
    assert found.least_m > 10.0


@pytest.mark.parametrize("persona", MOST)
@pytest.mark.parametrize("unit", [0, 1])
@pytest.mark.parametrize("for_s", [4.0, 15.0, 60.0])
def test_an_autopilot_that_is_silent_from_before_the_warning(
    for_s: float, unit: int, persona: PersonaName | None
) -> None:
    silent = Trouble("autopilot is silent", unit, REACH_M / 5.0 - 12.0 - 2.5, for_s, fault="silence")
    found = flown([through(0.0, STATION, 5.0), through(180.0, STATION, 5.0)], persona, silent)
    assert found.least_m > 10.0


@pytest.mark.parametrize("persona", AUTOPILOTS)
def test_one_lands_above_another(persona: PersonaName | None) -> None:
    above = Way(LAND, (Vector(0.0, 0.0, -60.0), Vector(0.0, 0.0, -60.0)), 5.0)
    below = Way(HOVER, (Vector(1.0, 1.0, -LOW_M), Vector(1.0, 1.0, -LOW_M)), 5.0)
    assert flown([above, below], persona).least_m > 10.0


@pytest.mark.parametrize("persona", MOST)
@pytest.mark.parametrize("speed_m_s", [5.0, 10.0])
@pytest.mark.parametrize("bounds", [{"ceiling_m": 30.0}, {"fence_m": 28.0}])
def test_without_room_above_or_below_they_pass_and_arrive(
    bounds: dict[str, float], speed_m_s: float, persona: PersonaName | None
) -> None:
    found = flown([through(0.0, STATION, speed_m_s), through(180.0, STATION, speed_m_s)], persona, **bounds)
    assert found.least_m > 10.0
    assert len(found.factors) == 2


@pytest.mark.parametrize("persona", AUTOPILOTS)
@pytest.mark.parametrize("kind", [AUTO_LEAVE, PLAN])
def test_two_with_a_common_waypoint_both_fly_on(kind: str, persona: PersonaName | None) -> None:
    middle, up = Vector(0.0, 0.0, -LOW_M), -LOW_M
    one = Way(kind, (Vector(-100.0, 0.0, up), middle, Vector(0.0, 100.0, up)), 5.0)
    other = Way(kind, (Vector(100.0, 0.0, up), middle, Vector(0.0, -100.0, up)), 5.0)
    found = flown([one, other], persona)
    assert found.least_m > 10.0
    assert len(found.factors) == 2


@pytest.mark.parametrize("persona", AUTOPILOTS)
def test_two_that_return_across_each_other(persona: PersonaName | None) -> None:
    assert flown([through(0.0, RTL_LEAVE, 5.0), through(180.0, RTL_LEAVE, 5.0)], persona).least_m > 10.0


@pytest.mark.parametrize("persona", AUTOPILOTS)
@pytest.mark.parametrize(("slow_m_s", "fast_m_s"), [(3.0, 12.0), (5.0, 15.0)])
def test_unequal_speeds_head_on_and_from_behind(slow_m_s: float, fast_m_s: float, persona: PersonaName | None) -> None:
    head_on = flown([through(0.0, GOTO, slow_m_s), through(180.0, GOTO, fast_m_s)], persona)
    behind = flown([through(0.0, GOTO, slow_m_s, reach_m=60.0), through(0.0, GOTO, fast_m_s, reach_m=150.0)], persona)
    assert min(head_on.least_m, behind.least_m) > 10.0
