"""The scenario of 9.4 and what may come between, step by step, in the simulated world."""

import pytest

from dyknow.agents.capabilities.flight.options import AvoidanceOptions
from dyknow.agents.options import Chosen
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import Answers, MonitorProximity, Query
from dyknow.federation.sharing.ontology import default_ontology
from dyknow.federation.sharing.translation import Translation
from dyknow.navigation.vehicle import Command, GoToOrder
from tests.sim_uavs.worlds import (
    PLAN_US,
    alarms,
    cancel_task,
    fly_scenario,
    is_down,
    leaders,
    place,
    raised,
    separations_m,
)

S = 1_000_000
LATEST_US = 300_000
"""One sample period and 200 ms."""


def delegated(world, to="0", **content):
    world.run_for(2)
    return world.ask("cc", to, MonitorProximity(**content))


@pytest.mark.parametrize("name", ["crossing", pytest.param("encounter", marks=pytest.mark.full)])
def test_two_that_meet_fly_apart_in_time_and_resume(name):
    world = fly_scenario(1, name, 3)
    task = delegated(world)
    world.run_for(70)
    assert not alarms(task, "proximity")
    assert sum("1 flies on, free of 0" in note for note in world.nodes["1"].notes) == 1, "one manoeuvre"
    assert not any("0 flies on" in note for note in world.nodes["0"].notes), "the other flies its way"
    for unit in ("0", "1"):
        for opened in raised(world, unit, "proximity-warn"):
            assert opened.detected_us - opened.valid_us <= LATEST_US
        plan = world.platform(unit).config.plan
        end = place(plan.waypoints[-1])
        assert max(abs(a - b) for a, b in zip(place(world.nodes[unit].truth[-1]), end, strict=True)) < 3.0
    assert all(not raised(world, unit, "proximity") for unit in "012")
    assert min(metres for _, metres in separations_m(world, "0", "1")) > 10.0
    assert not raised(world, "2", "proximity-warn")


def test_told_not_to_give_way_they_meet_and_both_alarms_open():
    world = fly_scenario(1, "crossing", 2)
    task = delegated(world, avoidance=False)
    world.run_for(45)
    for monitor in ("proximity", "proximity-warn"):
        assert {alarm.by for alarm in alarms(task, monitor)} == {"0", "1"}
    assert min(metres for _, metres in separations_m(world, "0", "1")) < 5.0


@pytest.mark.parametrize("partner", [{"control": False}, {"options": Chosen(AvoidanceOptions(avoidance=False))}])
def test_one_that_cannot_be_commanded_is_avoided_by_the_other(partner):
    world = fly_scenario(2, "crossing", 2, settings={"0": partner})
    node, plan = world.nodes["0"], world.platform("0").config.plan
    goal = GoToOrder(*plan.waypoints[-1][:3], plan.speed_m_s)
    world.at(world.start_us + PLAN_US, node.vehicle.on_command, Command(0, goal), 0, 0)  # somebody else flies it
    delegated(world)
    world.run_for(60)
    assert any(note.startswith("1 ") and note.endswith(" for 0") for note in world.nodes["1"].notes)
    assert not raised(world, "1", "proximity")
    assert min(metres for _, metres in separations_m(world, "0", "1")) > 10.0


def test_when_the_leader_dies_an_heir_leads_on_takes_newcomers_in_and_can_be_cancelled():
    world = fly_scenario(3, "patrol", 4)
    world.kill("3")
    task = delegated(world)
    world.run_for(3)
    world.kill("0")
    world.run_for(6)
    assert leaders(world) == ["1"]
    world.restart("3")
    world.run_for(5)
    over = world.platform("3").built.monitors.named["proximity"].instances
    assert set(over) >= {"1", "2"}
    assert all(over[unit].monitor.inputs == "fresh" for unit in ("1", "2"))
    cancel_task(world, "cc", "1", task.conversation)
    world.run_for(40)  # what the dead leader had asked for lingers half a minute, in case it returns
    assert all(is_down(world.platform(unit)) for unit in "123")


def test_a_partition_with_two_leaders_heals_to_one():
    world = fly_scenario(4, "patrol", 4)
    delegated(world)
    world.run_for(3)
    world.partition(["0", "1", "cc"], ["2", "3"])
    world.run_for(10)
    assert leaders(world) == ["0", "2"]
    world.heal(["0", "1", "cc"], ["2", "3"])
    world.run_for(8)
    assert len(leaders(world)) == 1
    for unit in "0123":
        instances = world.platform(unit).built.monitors.named["proximity"].instances
        assert {u: i.monitor.inputs for u, i in instances.items()} == {u: "fresh" for u in "0123" if u != unit}


def test_who_delegated_and_was_out_of_sight_for_a_while_finds_the_task_going_on():
    world = fly_scenario(5, "patrol", 3)
    task = delegated(world)
    world.run_for(3)
    world.partition(["cc"], "012")
    world.run_for(6)
    world.heal(["cc"], "012")
    world.run_for(8)
    assert leaders(world) == ["0"]
    assert all("proximity" in world.platform(unit).built.monitors.named for unit in "012")
    cancel_task(world, "cc", "0", task.conversation)
    world.run_for(4)
    assert all(is_down(world.platform(unit)) for unit in "012")


def test_a_global_query_names_whom_it_misses():
    world = fly_scenario(6, "patrol", 4)
    world.run_for(3)
    world.freeze("3")
    query = Query(semantic_label="heli-position", op="latest", scope="global")
    asked = world.ask("cc", "0", query, Performative.QUERY_REF, within_us=3 * S)
    world.run_for(3)
    (answers,) = [each for each in asked.results if isinstance(each, Answers)]
    assert {samples.unit for samples in answers.answers} == {"0", "1", "2"}
    assert [missing.unit for missing in answers.missing] == ["3"]


def test_platforms_with_other_labels_and_feet_federate():
    ontology = default_ontology()
    feet = Translation.parse(
        ontology,
        '[heli-altitude]\nlocal = "alt_baro[{unit}]"\nfields = { altitude_m = { name = "alt_ft", unit = "ft" } }\n',
        "feet.toml",
    )
    world = fly_scenario(7, "crossing", 2, settings={"1": {"translation": feet}})
    delegated(world, avoidance=False)
    world.run_for(40)
    here, there = raised(world, "0", "proximity"), raised(world, "1", "proximity")
    assert len(here) == len(there) == 1
    assert here[0].valid_us == there[0].valid_us
