"""Each rule of commanding aircraft, in which giving way is refused too."""

import pytest

from dyknow.agents.capabilities.flight.pilot import Pilot
from dyknow.agents.places import Fix, FlightLimits, FlightPlan, Waypoint
from dyknow.model.errors import Refused
from dyknow.navigation.vehicle import GoToOrder, HoldOrder, HomeReport, StatusReport

S = 1_000_000


def fix(altitude_m, east_m=0.0, *, at_us=0, east_m_s=0.0, down_m_s=0.0):
    return Fix(at_us, 0.0, east_m / 111_319.49, altitude_m, 0.0, east_m_s, down_m_s)


# -- the rules of commanding aircraft --------------------------------------------------------------------------------


def pilot(*, control=True, armed=True, airborne=True, guided=True, home=True):
    found = Pilot(control, FlightPlan((Waypoint(0.0, 0.001, 50.0),)), FlightLimits(10.0, 120.0))
    found.on_report(StatusReport(0, armed, guided, airborne, "GUIDED" if guided else "LOITER"), 0)
    if home:
        found.on_report(HomeReport(0, 0.0, 0.0, 20.0), 0)
    found.fix = fix(60.0)
    return found


@pytest.mark.parametrize(
    ("state", "rule"),
    [
        ({"control": False}, "not given control"),
        ({"armed": False}, "not armed"),
        ({"airborne": False}, "not airborne"),
        ({"guided": False}, "guided mode"),
    ],
)
def test_nothing_is_commanded_without_control_arms_air_and_a_guided_mode(state, rule):
    found = pilot(**state)
    for do in (lambda: found.divert(75.0), lambda: found.divert(None), lambda: found.order(HoldOrder())):
        with pytest.raises(Refused, match=rule):
            do()


def test_nothing_is_commanded_of_a_vehicle_that_has_not_said_its_state():
    with pytest.raises(Refused, match="has not reported"):
        Pilot(control=True).order(HoldOrder())


@pytest.mark.parametrize(("altitude_m", "rule"), [(29.9, "floor"), (140.1, "ceiling")])
def test_never_below_the_floor_nor_above_the_ceiling(altitude_m, rule):
    with pytest.raises(Refused, match=rule):
        pilot().divert(altitude_m)
    with pytest.raises(Refused, match=rule):
        pilot().order(GoToOrder(0.0, 0.0, altitude_m))


def test_without_a_home_there_is_neither_floor_nor_ceiling_and_so_no_height():
    with pytest.raises(Refused, match="home is not known"):
        pilot(home=False).divert(75.0)


def test_while_it_gives_way_a_vehicle_takes_no_other_place_to_go():
    found = pilot()
    found.divert(75.0)
    with pytest.raises(Refused, match="giving way"):
        found.order(GoToOrder(0.0, 0.0, 60.0))


def test_after_giving_way_a_vehicle_returns_to_the_level_of_its_route():
    found = pilot()
    found.divert(90.0)
    (command,) = found.resume()
    assert isinstance(command.order, GoToOrder)
    assert command.order.altitude_m == 50.0
