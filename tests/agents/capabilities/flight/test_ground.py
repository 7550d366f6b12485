"""The floor above the ground, where its elevation is given: orders, the plan, and ground that is not known."""

import numpy as np
import pytest

from dyknow import Sample
from dyknow.agents.capabilities.flight.pilot import Pilot
from dyknow.agents.places import FlightLimits, FlightPlan, Waypoint
from dyknow.model.errors import Refused
from dyknow.navigation.terrain.elevation import Elevation
from dyknow.navigation.terrain.grid import VOID
from dyknow.navigation.vehicle import (
    GoToOrder,
    HoldOrder,
    HomeReport,
    InterruptOrder,
    LandOrder,
    Order,
    ReturnHomeOrder,
    StatusReport,
)
from tests.navigation.terrain.ground import grid_of, ridge

HILL = grid_of(ridge(15.005, 60.0, 0.002), north_deg=58.01, west_deg=14.99, posts=109)
"""Home is at 50 m; 290 m east of it is the top, 110 m."""


def pilot(plan: FlightPlan | None = None, *, elevation: Elevation | None = None) -> Pilot:
    notes: list[str] = []
    found = Pilot(True, plan, FlightLimits(elevation=elevation or Elevation([HILL])), note=notes.append)
    found.on_report(HomeReport(0, 58.0, 15.0, 50.0), 0)
    found.on_report(StatusReport(0, armed=True, guided=True, airborne=True, mode="GUIDED"), 0)
    return found


def fly(flown: Pilot, longitude: float = 15.0, altitude_m: float = 100.0) -> list[Order]:
    commands = flown.on_estimate(Sample(0, 0, (58.0, longitude, altitude_m, 0.0, 0.0, 0.0)))
    return [command.order for command in commands]


def test_no_order_leads_into_the_hill_or_too_near_to_it() -> None:
    flown = pilot()
    fly(flown)
    for behind in (GoToOrder(58.0, 15.009, 100.0), InterruptOrder(58.0, 15.009, 100.0)):
        assert "below the ground on the way there (110.0 m" in (flown.refusal(behind) or "")
    assert "8.0 m above the ground there" in (flown.refusal(GoToOrder(58.0, 15.005, 118.0)) or "")
    with pytest.raises(Refused, match="the floor is 10 m: let the vehicle climb where it is first"):
        flown.command(GoToOrder(58.0, 15.005, 121.0))
    assert flown.refusal(GoToOrder(58.0, 15.0, 121.0)) is None
    for anywhere in (HoldOrder(), LandOrder(), ReturnHomeOrder()):
        assert flown.refusal(anywhere) is None
    fly(flown, altitude_m=121.0)
    assert flown.refusal(GoToOrder(58.0, 15.009, 121.0)) is None


def test_the_floor_above_home_counts_where_the_ground_is_lower() -> None:
    valley = grid_of(ridge(15.005, -40.0, 0.002), north_deg=58.01, west_deg=14.99, posts=109)
    flown = pilot(elevation=Elevation([valley]))
    fly(flown)
    assert "5.0 m above home is below the floor" in (flown.refusal(GoToOrder(58.0, 15.005, 55.0)) or "")


def test_a_leg_of_the_plan_into_the_hill_is_not_flown() -> None:
    assert fly(pilot(FlightPlan((Waypoint(58.0, 15.009, 100.0),)))) == []
    assert fly(pilot(FlightPlan((Waypoint(58.0, 15.001, 100.0),)))) != []


def test_unknown_ground_is_noted_once_and_only_the_floor_above_home_counts_there() -> None:
    holed = grid_of(ridge(15.005, 60.0, 0.002), north_deg=58.01, west_deg=14.99, posts=109)
    holed.heights[:, 44:66] = VOID
    notes: list[str] = []
    flown = pilot(elevation=Elevation([holed]))
    flown.note = notes.append
    fly(flown)
    assert flown.refusal(GoToOrder(58.0, 15.005, 61.0)) is None
    assert "below the floor" in (flown.refusal(GoToOrder(58.0, 15.005, 59.0)) or "")
    holed.heights[:, 44:54] = HILL.heights[:, 44:54]
    assert "on the way there" in (flown.refusal(GoToOrder(58.0, 15.007, 61.0)) or ""), "what is known of the way counts"
    (note,) = notes
    assert note.startswith("the elevation of 58.00000,15.00")
    assert note.endswith(" is not known: the floor is above home alone where it is not")


def test_one_that_hovers_too_low_over_the_ground_stops_and_climbs() -> None:
    flown = pilot()
    fly(flown, longitude=15.005, altitude_m=115.0)
    assert flown.refusal(GoToOrder(58.0, 15.005, 115.0)) is None
    assert flown.refusal(GoToOrder(58.0, 15.005, 125.0)) is None
    assert flown.refusal(GoToOrder(58.0, 15.005, 112.0)) is not None
    assert np.isfinite(HILL.heights).all()
