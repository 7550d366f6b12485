"""To stop, to land and to return from every mode; take-offs that are modes; targets of ground stations: what a pilot makes of them."""

import pytest

from dyknow.agents.capabilities.flight.arbiter import Commander
from dyknow.agents.capabilities.flight.errand import OrderProgress
from dyknow.agents.places import FlightPlan, Waypoint
from dyknow.model.errors import Refused
from dyknow.navigation.vehicle import (
    Arm,
    GoToOrder,
    HoldOrder,
    LandOrder,
    Order,
    ReturnHomeOrder,
    SetGuided,
    TakeOffOrder,
)
from dyknow.sim_uavs.dynamics.flight import Mode
from dyknow.sim_uavs.dynamics.missions import Item, MissionAction
from dyknow.sim_uavs.dynamics.quadcopter import Vector
from dyknow.sim_uavs.dynamics.settings import PersonaName
from tests.sim_uavs.piloted import HOME, NORTH_DEG, Piloted

P = OrderProgress
BOTH = pytest.mark.parametrize("persona", ["ardupilot", "px4"])
AWAY = (Item(MissionAction.FLY_TO, Vector(0.0, 0.0, -50.0)), Item(MissionAction.FLY_TO, Vector(300.0, 0.0, -50.0)))


def at(north_m: float, height_m: float = 50.0) -> GoToOrder:
    return GoToOrder(HOME.latitude_deg + north_m * NORTH_DEG, HOME.longitude_deg, HOME.altitude_m + height_m)


def asked(flown: Piloted, order: Order) -> None:
    """A user asks for it in person."""
    flown.command(flown.pilot.command(order))


def under_way(persona: PersonaName, mode: Mode) -> Piloted:
    """A vehicle that flies north in this mode, 50 m high."""
    flown = Piloted(persona)
    flown.flight.items = AWAY
    flown.goto(300.0)
    flown.until(lambda: flown.flight.body.position.north > 30.0)
    if mode is not Mode.GUIDED:
        assert flown.flight.set_mode(mode).value == "accepted"
    flown.run(1.5)
    return flown


@BOTH
@pytest.mark.parametrize("mode", [Mode.GUIDED, Mode.AUTO, Mode.RTL, Mode.LAND, Mode.LOITER, Mode.OFFBOARD])
def test_hold_stops_it_from_every_mode_and_it_is_known_that_it_does(persona: PersonaName, mode: Mode) -> None:
    if (persona, mode) == ("ardupilot", Mode.OFFBOARD):
        mode = Mode.BRAKE
    flown = under_way(persona, mode)
    asked(flown, HoldOrder())
    errand = flown.pilot.errand
    flown.until(lambda: errand is not None and errand.is_taken, within_s=2.5)
    flown.until(lambda: flown.flight.body.velocity.horizontal < 0.3, within_s=6.0)
    flown.run(3.0)
    stood = flown.flight.body.position
    flown.run(10.0)
    now = flown.flight.body.position
    assert now.minus(stood).horizontal < 0.5
    assert abs(now.down - stood.down) < 0.5
    assert errand is not None and errand.progress is P.FLOWN, errand.reason
    assert flown.pilot.flying == "order"
    assert flown.flight.mode is Mode.GUIDED


@BOTH
@pytest.mark.parametrize("order", [LandOrder(), ReturnHomeOrder()])
@pytest.mark.parametrize("mode", [Mode.GUIDED, Mode.AUTO, Mode.RTL, Mode.LAND, Mode.LOITER])
def test_land_and_return_home_are_obeyed_from_every_mode(persona: PersonaName, order: Order, mode: Mode) -> None:
    flown = under_way(persona, mode)
    asked(flown, order)
    errand = flown.pilot.errand
    flown.until(lambda: errand is not None and errand.is_taken, within_s=2.5)
    flown.run(2.0)
    assert flown.flight.mode is (Mode.LAND if isinstance(order, LandOrder) else Mode.RTL)
    assert flown.pilot.flying == "order"
    assert errand is not None and errand.progress is P.FLOWN


@BOTH
@pytest.mark.parametrize("order", [HoldOrder(), LandOrder(), ReturnHomeOrder(), at(10.0)])
def test_only_a_user_takes_it_out_of_a_mode_that_its_pilot_chose(persona: PersonaName, order: Order) -> None:
    flown = under_way(persona, Mode.LOITER)
    with pytest.raises(Refused, match="takes no positions"):
        flown.pilot.order(order)
    if isinstance(order, GoToOrder):
        with pytest.raises(Refused, match="takes no positions"):
            flown.pilot.command(order)
    assert flown.sent[-1].get_type() == "COMMAND_INT", "the goto of before"


@BOTH
def test_a_mission_takes_off_and_flies_whatever_the_take_off_is_called(persona: PersonaName) -> None:
    flown = Piloted(persona, height_m=0.0)
    flown.pilot.begin_mission("survey")
    for order in (SetGuided(), Arm(), TakeOffOrder(20.0)):
        flown.command(flown.pilot.prepare(order))
        flown.run(1.2)
    told = {order.told for order in flown.vehicle.sent}
    flown.until(lambda: flown.height_m > 19.0)
    flown.run(2.0)
    assert flown.pilot.mission.waits == "", told
    flown.command(flown.pilot.order(at(30.0, 20.0), Commander.MISSION))
    flown.until(lambda: flown.flight.body.position.north > 29.0)
    assert flown.pilot.mission.waits == ""


@BOTH
def test_a_pilot_who_takes_it_while_it_takes_off_has_it(persona: PersonaName) -> None:
    flown = Piloted(persona, height_m=0.0)
    flown.pilot.begin_mission("survey")
    for order in (SetGuided(), Arm(), TakeOffOrder(20.0)):
        flown.command(flown.pilot.prepare(order))
        flown.run(1.2)
    flown.flight.set_mode(Mode.LOITER)
    flown.run(1.5)
    assert "mode" in flown.pilot.mission.waits


# -- targets of ground stations --------------------------------------------------------------------------------------


def sent_by_a_station(flown: Piloted, north_m: float, height_m: float = 50.0) -> None:
    """As GUIDED and SET_POSITION_TARGET_GLOBAL_INT, or DO_REPOSITION, of another station do."""
    assert flown.flight.go_to(Vector(north_m, 0.0, -height_m)).value == "accepted"


@BOTH
def test_a_shuttle_between_two_places_returns_to_the_place_it_was_sent_to(persona: PersonaName) -> None:
    flown = Piloted(persona)
    for north_m in (60.0, 0.0, 60.0, 0.0):
        sent_by_a_station(flown, north_m)
        flown.run(4.0)
        flown.divert(72.0)
        flown.until(lambda: flown.height_m > 70.0)
        flown.command(flown.pilot.resume())
        flown.until(lambda to=north_m: abs(flown.flight.body.position.north - to) < 1.5)
        flown.run(3.0)
        assert abs(flown.flight.body.position.north - north_m) < 3.0, "it stays there"


@BOTH
@pytest.mark.parametrize("after_s", [0.1, 0.6, 1.0, 2.5, 8.0])
def test_a_plan_never_overwrites_the_target_of_a_station(persona: PersonaName, after_s: float) -> None:
    flown = Piloted(persona)
    here = Waypoint(HOME.latitude_deg, HOME.longitude_deg, HOME.altitude_m + 50.0)
    flown.pilot.plan = FlightPlan((here,), start_us=flown.now_us + 2_000_000)
    flown.run(after_s)
    sent_by_a_station(flown, 80.0)
    before = len(flown.sent)
    flown.until(lambda: flown.flight.body.position.north > 79.0)
    assert len(flown.sent) == before, "nothing is sent from then on"
    assert any("another ground station" in note for note in flown.notes)
    assert flown.pilot.avoidance_off is None
    flown.divert(72.0)
    flown.until(lambda: flown.height_m > 70.0)
    flown.command(flown.pilot.resume())
    flown.until(lambda: abs(flown.height_m - 50.0) < 1.0)
    assert flown.flight.body.position.north > 75.0, "back to where the station had sent it, not to the plan"


@BOTH
def test_after_a_gap_of_the_link_it_flies_on_to_where_it_was_going(persona: PersonaName) -> None:
    flown = Piloted(persona)
    sent_by_a_station(flown, 150.0)
    flown.run(2.0)
    flown.inject("silence", 4.5)
    flown.run(4.4)
    flown.until(lambda: flown.pilot.heard_us > flown.now_us - 200_000)
    flown.divert(72.0)
    flown.until(lambda: flown.height_m > 70.0)
    flown.command(flown.pilot.resume())
    flown.until(lambda: flown.flight.body.position.north > 148.0)
    assert abs(flown.height_m - 50.0) < 2.0, "at the altitude of that target"


@BOTH
def test_a_pilot_who_had_it_is_asked_before_it_gives_way_again(persona: PersonaName) -> None:
    flown = Piloted(persona)
    flown.flight.set_mode(Mode.LOITER)
    flown.run(2.0)
    flown.flight.set_mode(Mode.GUIDED)
    flown.run(2.0)
    assert flown.pilot.avoidance_off == "its pilot took over"
    asked(flown, HoldOrder())
    assert flown.pilot.avoidance_off is None
