"""Giving way next to a hill whose elevation is given: no level and no way is below it."""

import pytest

from dyknow.agents.capabilities.flight.flight import FlightAgent
from dyknow.agents.capabilities.separation.situation_view import may_fly_to
from dyknow.agents.places import FlightLimits
from dyknow.navigation.intents.path import FlatOrigin, FlatPlace
from dyknow.navigation.terrain.elevation import Elevation
from dyknow.navigation.vehicle import GoToOrder
from tests.agents.capabilities.separation.meetings import meeting, orders
from tests.box import Box
from tests.navigation.terrain.ground import grid_of, ridge


def hill(height_m: float) -> Elevation:
    """A ridge across the way of both, so high at 15 E, 350 m wide."""
    surface = ridge(15.0, 20.0 * (height_m - 50.0), 0.06)
    return Elevation(
        [grid_of(lambda *degrees: surface(*degrees).clip(max=height_m), north_deg=58.01, west_deg=14.99, posts=73)]
    )


def altitudes(wire: Box, altitude_m: float, elevation: Elevation | None) -> list[float]:
    """What 1, which hovers in the way of 0 at 102 m, orders until they have passed."""
    limits = FlightLimits(elevation=elevation)
    meeting(wire, {"control": False}, {"limits": limits}, altitude_m=altitude_m, east_m=0.0, east_m_s=0.0)
    wire.run(24.0)
    found = [order.altitude_m for order in orders(wire, "1") if isinstance(order, GoToOrder)]
    assert found
    return found


def test_without_a_hill_it_sinks(wire: Box) -> None:
    assert min(altitudes(wire, 98.0, None)) == pytest.approx(84.0, abs=0.5)


@pytest.mark.parametrize("height_m", [76.0, 85.0, 95.0])
@pytest.mark.parametrize("altitude_m", [98.0, 102.0])
def test_next_to_a_hill_it_stays_above_it(wire: Box, altitude_m: float, height_m: float) -> None:
    lowest_m = min(altitudes(wire, altitude_m, hill(height_m)))
    assert lowest_m >= min(height_m + 10.0, altitude_m) - 0.1, "one that is too low already climbs or stops"


def test_a_later_place_is_judged_from_the_one_before_it(wire: Box) -> None:
    wire.join("1", control=True, limits=FlightLimits(elevation=hill(85.0)))
    wire.run(1.0)
    pilot, origin = wire.platform("1").part(FlightAgent).pilot, FlatOrigin.at(58.0, 14.992)
    low, high = FlatPlace(0.0, 0.0, 70.0), FlatPlace(0.0, 0.0, 96.0)
    over = FlatPlace(0.0, 900.0, 96.0)
    assert not may_fly_to(pilot, origin, over, low)
    assert may_fly_to(pilot, origin, over, high)
    assert may_fly_to(pilot, origin, over)
