"""The last number that is understood is borne by whoever counts on from there; the fuzz notices who is moved."""

import pytest

from agents.areas.division import AreaDivision
from agents.flight.arbiter import Commander
from federation.messages import contents
from federation.messages.contents.parts import LAST_GENERATION, next_generation
from navigation.vehicle import HoldOrder
from tests.agents.hostile.federations import HostileFederation, OrderGiven

WHOLE = ("58.40 15.60", "58.40 15.61", "58.41 15.61", "58.41 15.60")


def test_a_generation_is_counted_on_until_the_last_one():
    assert next_generation(0) == 1
    assert next_generation(LAST_GENERATION) == LAST_GENERATION


@pytest.mark.parametrize("generation", [1, LAST_GENERATION - 1, LAST_GENERATION])
def test_a_successor_divides_whatever_its_leader_had_counted(wire, generation):
    """The platform to which a member delegated its own task is gone: others lead on, with a number that acts can carry."""
    for unit in "012":
        wire.fly(unit, 0.0, 500.0 * int(unit))
    wire.run(1.5)
    boot = wire.platform("2").config.boot
    said = contents.AssignArea(
        task="1-x.2", generation=generation, rings=(contents.AreaRing(corners=WHOLE[:3]),), share=1.0, middle=WHOLE[0],
        whole=WHOLE, units=("0", "1", "2"), delegator="1", delegate_boot=boot,
    )  # fmt: skip
    for unit in "01":
        wire.speak("2", lambda member, now_us, unit=unit: member.acts.tell(unit, said, now_us))
    wire.run(0.5)
    wire.kill("2")
    wire.run(12.0)
    led = [area for unit in "01" for area in wire.platform(unit).part(AreaDivision).areas.values()]
    assert led
    assert all(area.generation <= LAST_GENERATION for area in led)


@pytest.mark.parametrize("generation", [1, LAST_GENERATION])
def test_a_successor_coordinates_whatever_its_coordinator_had_counted(wire, generation):
    for unit in "012":
        wire.fly(unit, 0.0, 500.0 * int(unit))
    wire.run(1.5)
    said = contents.CreateMonitor(
        name="proximity", task="1-x.2", coordinator="2", delegator="1", delegate="2", generation=generation
    )
    for unit in "01":
        wire.ask("2", unit, said)
    wire.run(0.5)
    wire.kill("2")
    wire.run(12.0)
    led = [led for unit in "01" for led in wire.platform(unit).ports.tasks.coordinated.values()]
    assert led
    assert all(each.generation <= LAST_GENERATION for each in led)


def test_an_order_that_no_member_may_give_is_noticed():
    """The command centre speaks where it is taken to be silent."""
    federation = HostileFederation("hover", 1)
    federation.world.ask("cc", "0", contents.Hold())
    federation.world.run_for(0.5)
    with pytest.raises(AssertionError, match="HoldOrder"):
        federation.check()
    assert federation.orders == [OrderGiven("0", HoldOrder(), Commander.ORDER, "")]
