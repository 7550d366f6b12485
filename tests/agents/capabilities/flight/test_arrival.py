"""A goto that is done when the vehicle is there, or fails with the reason why it will not be."""

import pytest

from dyknow.agents.capabilities.flight.arrival import UNHEARD_US, Arrival
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import Done, Goto, Hold, Reason
from dyknow.navigation.vehicle import GoToOrder
from dyknow.sim_uavs.dynamics.flight import Mode
from dyknow.sim_uavs.dynamics.quadcopter import Vector
from tests.agents.capabilities.flight.test_orders import flying
from tests.box import Box
from tests.sim_uavs.piloted import HOME, NORTH_DEG, Piloted

P = Performative
BOTH = pytest.mark.parametrize("persona", ["ardupilot", "px4"])
NORTH = GoToOrder(HOME.latitude_deg + 60 * NORTH_DEG, HOME.longitude_deg, HOME.altitude_m + 50.0)


def sent(persona: str = "ardupilot") -> tuple[Piloted, Arrival]:
    """A vehicle that has taken over the order to fly 60 m north."""
    flown = Piloted(persona)
    flown.command(flown.pilot.command(NORTH))
    errand = flown.pilot.errand
    assert errand is not None
    flown.until(lambda: errand.is_taken, within_s=3.0)
    arrival = Arrival(NORTH, errand)
    arrival.look(flown.pilot)
    assert arrival.words == ""
    return flown, arrival


def ended(flown: Piloted, arrival: Arrival, within_s: float = 60.0) -> str:
    def looked() -> bool:
        arrival.look(flown.pilot)
        return bool(arrival.words)

    flown.until(looked, within_s)
    return arrival.words


@BOTH
def test_a_vehicle_arrives_when_it_is_seen_there(persona: str) -> None:
    flown, arrival = sent(persona)
    assert ended(flown, arrival).startswith("arrived: ")
    assert not arrival.has_failed
    assert 57.0 <= flown.flight.body.position.north <= 62.0


@BOTH
def test_giving_way_is_waited_for(persona: str) -> None:
    flown, arrival = sent(persona)
    flown.divert(72.0)
    for _ in range(100):
        flown.run(0.1)
        arrival.look(flown.pilot)
        assert arrival.words == ""
    flown.command(flown.pilot.resume())
    assert ended(flown, arrival).startswith("arrived: ")


@BOTH
def test_a_pilot_and_another_station_end_it_with_a_reason(persona: str) -> None:
    flown, arrival = sent(persona)
    flown.flight.set_mode(Mode.LOITER)
    assert "it does not arrive: the vehicle was taken over" in ended(flown, arrival, 3.0)
    flown, arrival = sent(persona)
    flown.run(1.5)
    flown.flight.go_to(Vector(-40.0, 0.0, -50.0))
    assert ended(flown, arrival, 3.0) == (
        "it does not arrive: another ground station has given the vehicle another target"
    )


def test_a_vehicle_that_cannot_get_there_is_given_ten_seconds_and_a_silent_one_thirty() -> None:
    flown, arrival = sent()
    flown.inject("late=100")
    assert ended(flown, arrival, 20.0) == "it does not arrive: not seen in the vehicle's motion for 2 s"
    flown, arrival = sent()
    flown.inject("silence")
    before_us = flown.now_us
    assert "no heartbeat for 30 s" in ended(flown, arrival, 40.0)
    assert flown.now_us - before_us <= UNHEARD_US + 2_000_000


def test_a_short_silence_ends_nothing() -> None:
    flown, arrival = sent()
    flown.inject("silence", 6.0)
    assert ended(flown, arrival).startswith("arrived: ")


# -- as an act ---------------------------------------------------------------------------------------------------------


def going(wire: Box, north_m: float) -> Goto:
    return Goto(latitude_deg=58.0 + north_m * NORTH_DEG, longitude_deg=15.0, altitude_m=100.0, until="arrival")


def test_the_act_is_answered_when_the_vehicle_is_there(wire: Box) -> None:
    flying(wire)
    wire.vehicle("0").north_m_s = 5.0
    question = wire.question("cc", "0", going(wire, 60.0))
    wire.run(5.0)
    assert [said.act.performative for said in question.answers] == [P.AGREE], "taken over, and on its way"
    wire.run(8.0)
    done = question.answers[-1]
    assert done.act.performative is P.INFORM
    assert isinstance(done.content, Done) and done.content.text is not None
    assert done.content.text.startswith("arrived: ")


def test_a_newer_order_ends_the_wait(wire: Box) -> None:
    flying(wire)
    wire.vehicle("0").north_m_s = 5.0
    question = wire.question("cc", "0", going(wire, 400.0))
    wire.run(3.0)
    wire.question("cc", "0", Hold())
    wire.run(2.0)
    failed = question.answers[-1]
    assert failed.act.performative is P.FAILURE
    assert isinstance(failed.content, Reason) and failed.content.text == "overtaken by a newer order"
