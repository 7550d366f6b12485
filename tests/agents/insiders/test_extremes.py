"""The last number that is understood is borne by whoever counts on from there; the fuzz notices who is moved."""

import pytest

from dyknow.agents.capabilities.areas.assignment import AreaAssignment
from dyknow.agents.capabilities.areas.division import AreaDivision
from dyknow.agents.capabilities.flight.arbiter import Commander
from dyknow.federation.messages import contents
from dyknow.federation.messages.contents.parts import LAST_GENERATION, next_generation
from dyknow.navigation.vehicle import HoldOrder
from tests.agents.insiders.federations import HostileFederation, OrderGiven

AREA = ("58.40 15.60", "58.40 15.61", "58.41 15.61", "58.41 15.60")


def test_a_generation_is_counted_on_until_the_last_one():
    assert next_generation(0) == 1
    assert next_generation(LAST_GENERATION) == LAST_GENERATION


@pytest.mark.parametrize("generation", [1, LAST_GENERATION - 1, LAST_GENERATION])
def test_a_successor_divides_whatever_its_leader_had_counted(wire, generation):
    """The delegate counts as far as acts can, and is gone: others lead on, with a number that acts can carry."""
    for unit in "012":
        wire.fly(unit, 0.0, 500.0 * int(unit))
    wire.centre("cc")
    wire.run(1.5)
    task = wire.asked("cc", "2", contents.DivideArea(area=AREA)).conversation
    wire.run(1.0)
    evidence = wire.evidence(task)
    piece = contents.AssignArea(
        task=task, generation=generation, rings=(contents.AreaRing(corners=AREA[:3]),), share=1.0, units=("0", "1", "2")
    )
    for unit in "01":
        wire.speak("2", lambda member, now_us, unit=unit: member.acts.tell(unit, piece, now_us, evidence=evidence))
    wire.run(0.5)
    pieces = [wire.platform(unit).part(AreaAssignment).pieces[task] for unit in "01"]
    assert all(each.content.generation >= generation for each in pieces)
    wire.kill("2")
    wire.run(12.0)
    led = [area for unit in "01" for area in wire.platform(unit).part(AreaDivision).areas.values()]
    assert led
    assert all(area.generation <= LAST_GENERATION for area in led)


@pytest.mark.parametrize("generation", [10, LAST_GENERATION])
def test_a_coordinator_may_not_count_far_ahead(wire, generation):
    for unit in "012":
        wire.fly(unit, 0.0, 500.0 * int(unit))
    wire.centre("cc")
    wire.run(1.5)
    task = wire.asked("cc", "2", contents.MonitorProximity()).conversation
    wire.run(1.0)
    monitor = contents.CreateMonitor(name="proximity", task=task, generation=generation)
    asked = wire.shown("2", "0", monitor, wire.evidence(task))
    assert [each.value for each in asked.performatives] == ["refuse"]


def test_an_order_that_no_member_may_give_is_noticed():
    """The command centre speaks where it is taken to be silent."""
    federation = HostileFederation("hover", 1)
    federation.world.ask("cc", "0", contents.Hold())
    federation.world.run_for(0.5)
    with pytest.raises(AssertionError, match="HoldOrder"):
        federation.check()
    assert federation.orders == [OrderGiven("0", HoldOrder(), Commander.ORDER, "")]
