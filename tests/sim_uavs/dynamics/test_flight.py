from math import nan

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dyknow.sim_uavs.dynamics.flight import Flight, FlightAnswer, Mode, Reached, StatusText
from dyknow.sim_uavs.dynamics.missions import Item, MissionAction
from dyknow.sim_uavs.dynamics.quadcopter import Vector, Wind
from dyknow.sim_uavs.dynamics.settings import HomePlace, VehicleConfig, VehicleSettings

S = 1_000_000
HOME = HomePlace(55.7240, 13.4600, 20.0)
T0 = 1_700_000_000 * S


class Clocked:
    """A flight and the time it has reached."""

    def __init__(self, **config) -> None:
        self.flight, self.now_us = Flight(VehicleConfig(1, HOME, **config), T0), T0

    def run(self, seconds):
        end_us = self.now_us + round(seconds * S)
        while self.now_us < end_us:
            self.now_us = min(end_us, self.now_us + S)
            self.flight.on_time(self.now_us)
        return self.flight

    def aloft(self, height_m=30.0):
        flight = self.flight
        assert flight.set_mode(Mode.GUIDED) is FlightAnswer.ACCEPTED
        assert flight.arm() is FlightAnswer.ACCEPTED
        assert flight.take_off(height_m) is FlightAnswer.ACCEPTED
        return self.run(5 + height_m / 2.0)


def test_it_takes_off_flies_there_and_lands() -> None:
    clocked = Clocked()
    flight = clocked.aloft()
    assert flight.body.height_m == pytest.approx(30.0, abs=0.1)
    assert flight.go_to(Vector(60.0, -20.0, -40.0)) is FlightAnswer.ACCEPTED
    clocked.run(25)
    assert flight.body.position.is_close_to(Vector(60.0, -20.0, -40.0), 0.1)
    assert flight.set_mode(Mode.LAND) is FlightAnswer.ACCEPTED
    clocked.run(35)
    assert flight.body.on_ground
    assert not flight.armed
    assert flight.body.position.is_close_to(Vector(60.0, -20.0, 0.0), 0.5)


def test_it_returns_home_at_the_return_height_and_lands_there() -> None:
    clocked = Clocked(settings=VehicleSettings(return_m=35.0))
    flight = clocked.aloft(10.0)
    flight.go_to(Vector(80.0, 0.0, -10.0))
    clocked.run(20)
    flight.set_mode(Mode.RTL)
    highest_m = 0.0
    for _ in range(900):
        clocked.run(0.1)
        highest_m = max(highest_m, flight.body.height_m)
        if flight.body.position.horizontal > 75.0:
            continue
        assert flight.body.height_m > 34.0 or flight.body.position.horizontal < 5.0
    assert highest_m == pytest.approx(35.0, abs=0.6)
    assert not flight.armed
    assert flight.body.position.horizontal < 1.0


def test_orders_are_refused_with_the_reason_where_they_do_not_fit() -> None:
    flight = Clocked().flight
    assert flight.take_off(10.0) is FlightAnswer.NOT_ARMED
    assert flight.go_to(Vector(0.0, 0.0, -10.0)) is FlightAnswer.NOT_ARMED
    assert flight.set_mode(Mode.AUTO) is FlightAnswer.NO_MISSION
    flight.arm()
    assert flight.take_off(10.0) is FlightAnswer.NOT_GUIDED
    flight.set_mode(Mode.GUIDED)
    assert flight.go_to(Vector(0.0, 0.0, -10.0)) is FlightAnswer.ON_GROUND
    assert flight.take_off(-3.0) is FlightAnswer.OUT_OF_RANGE
    assert flight.take_off(nan) is FlightAnswer.OUT_OF_RANGE
    assert flight.change_speed(nan) is FlightAnswer.OUT_OF_RANGE
    assert flight.change_speed(-1.0) is FlightAnswer.OUT_OF_RANGE


def test_it_does_not_arm_without_a_fix_or_with_an_empty_battery_or_while_landing() -> None:
    flight = Clocked().flight
    flight.position_ok = False
    assert flight.arm() is FlightAnswer.NO_POSITION
    assert Clocked(charge=0.05).flight.arm() is FlightAnswer.NO_CHARGE
    landing = Clocked().flight
    landing.set_mode(Mode.LAND)
    assert landing.arm() is FlightAnswer.MODE_NOT_ARMABLE


def test_it_is_not_disarmed_in_the_air_unless_forced_and_then_falls() -> None:
    clocked = Clocked()
    flight = clocked.aloft()
    assert flight.disarm() is FlightAnswer.AIRBORNE
    assert flight.armed
    assert flight.disarm(force=True) is FlightAnswer.ACCEPTED
    assert clocked.run(5).body.on_ground


def test_an_order_heard_twice_changes_nothing() -> None:
    once, twice = Clocked(), Clocked()
    for clocked in (once, twice):
        for order in (
            lambda f: f.set_mode(Mode.GUIDED),
            lambda f: f.arm(),
            lambda f: f.take_off(15.0),
        ):
            assert order(clocked.flight) is FlightAnswer.ACCEPTED
            clocked.run(0.7)
            if clocked is twice:
                assert order(clocked.flight) is FlightAnswer.ACCEPTED
        clocked.run(12)
        clocked.flight.go_to(Vector(50.0, 0.0, -15.0))
        clocked.run(2)
        if clocked is twice:
            assert clocked.flight.take_off(15.0) is FlightAnswer.ACCEPTED, "the height it flies at: nothing to do"
            clocked.flight.go_to(Vector(50.0, 0.0, -15.0))
        clocked.run(10)
    assert once.flight.body == twice.flight.body


def test_a_take_off_heard_late_does_not_call_a_flying_vehicle_back() -> None:
    clocked = Clocked()
    flight = clocked.aloft(15.0)
    flight.go_to(Vector(50.0, 0.0, -40.0))
    clocked.run(1)
    assert flight.take_off(15.0) is FlightAnswer.AIRBORNE
    assert clocked.run(25).body.position.is_close_to(Vector(50.0, 0.0, -40.0), 0.2)


def test_a_velocity_that_is_not_renewed_ends_in_a_hover() -> None:
    clocked = Clocked()
    flight = clocked.aloft()
    assert flight.drift(Vector(5.0, 0.0, 0.0)) is FlightAnswer.ACCEPTED
    assert clocked.run(2.5).body.velocity.north == pytest.approx(5.0, abs=0.1)
    assert clocked.run(8).body.velocity.horizontal < 0.05


def test_idle_motors_stop_after_the_disarm_delay() -> None:
    clocked = Clocked()
    clocked.flight.arm()
    assert clocked.run(9.5).armed
    assert not clocked.run(1).armed


def test_a_mission_is_flown_item_by_item_and_each_is_reported() -> None:
    clocked = Clocked()
    flight = clocked.flight
    flight.items = (
        Item(MissionAction.TAKE_OFF, Vector(0.0, 0.0, -20.0)),
        Item(MissionAction.SET_SPEED, speed_m_s=3.0),
        Item(MissionAction.FLY_TO, Vector(30.0, 0.0, -20.0), stay_us=2 * S),
        Item(MissionAction.FLY_TO, Vector(30.0, 30.0, -25.0)),
        Item(MissionAction.LAND, Vector(0.0, 30.0, 0.0)),
    )
    flight.arm()
    assert flight.set_mode(Mode.AUTO) is FlightAnswer.ACCEPTED
    fastest = 0.0
    for _ in range(1200):
        clocked.run(0.1)
        fastest = max(fastest, flight.body.velocity.horizontal)
    reached = [event.item for event in flight.take_events() if isinstance(event, Reached)]
    assert reached == [0, 1, 2, 3, 4]
    assert fastest <= 3.01
    assert not flight.armed
    assert flight.body.position.is_close_to(Vector(0.0, 30.0, 0.0), 2.0)


def test_after_the_last_item_it_holds_in_a_guided_mode() -> None:
    clocked = Clocked()
    flight = clocked.aloft()
    flight.items = (Item(MissionAction.FLY_TO, Vector(20.0, 0.0, -30.0)),)
    flight.set_mode(Mode.AUTO)
    clocked.run(20)
    assert flight.mode is Mode.GUIDED
    assert flight.body.position.is_close_to(Vector(20.0, 0.0, -30.0), 2.0)
    assert flight.body.velocity.horizontal < 0.05


def test_a_low_battery_is_said_once_and_a_critical_one_lands() -> None:
    clocked = Clocked()
    flight = clocked.aloft(10.0)
    flight.take_events()
    flight.body = flight.body._replace(charge=0.2)
    clocked.run(2)
    assert [event.text for event in flight.take_events() if isinstance(event, StatusText)] == ["Battery low: 20%"]
    flight.body = flight.body._replace(charge=0.07)
    clocked.run(40)
    assert not flight.armed
    assert flight.body.on_ground


@pytest.mark.parametrize(("action", "mode"), [(0.0, Mode.GUIDED), (1.0, Mode.LAND), (2.0, Mode.RTL)])
def test_a_low_battery_lands_or_returns_as_its_parameter_says_and_once_only(action: float, mode: Mode) -> None:
    clocked = Clocked()
    flight = clocked.aloft(10.0)
    flight.settings.battery_low_action = action
    flight.body = flight.body._replace(charge=0.2)
    clocked.run(1)
    assert flight.mode is mode
    flight.set_mode(Mode.GUIDED)
    clocked.run(1)
    assert flight.mode is Mode.GUIDED


def test_a_vehicle_may_begin_in_the_air() -> None:
    flight = Clocked(airborne_m=40.0).run(5)
    assert flight.armed
    assert flight.mode is Mode.GUIDED
    assert flight.body.position.is_close_to(Vector(0.0, 0.0, -40.0), 0.05)


@settings(max_examples=15, deadline=None)
@given(st.lists(st.integers(1, 400_000), min_size=1, max_size=40))
def test_how_often_time_is_told_does_not_matter(steps_us) -> None:
    config = {"airborne_m": 30.0, "wind": Wind(3.0, 1.0, 1.0), "seed": 5}
    often, once = Clocked(**config), Clocked(**config)
    for clocked in (often, once):
        clocked.flight.go_to(Vector(40.0, 5.0, -35.0))
    for step_us in steps_us:
        often.run(step_us / S)
    once.run(sum(steps_us) / S)
    assert often.flight.body == once.flight.body


def test_a_process_that_was_stopped_resumes_where_it_stood_instead_of_catching_up_for_hours() -> None:
    clocked = Clocked(airborne_m=30.0)
    clocked.flight.go_to(Vector(5000.0, 0.0, -30.0))
    clocked.run(2)
    before = clocked.flight.body.position
    clocked.flight.on_time(clocked.now_us + 3600 * S)
    assert clocked.flight.body.position.is_close_to(before, 1.0)


def test_one_seed_gives_one_flight() -> None:
    def flown(seed):
        clocked = Clocked(airborne_m=30.0, wind=Wind(gust_sd_m_s=4.0), seed=seed)
        return clocked.run(8).body

    assert flown(1) == flown(1) != flown(2)
