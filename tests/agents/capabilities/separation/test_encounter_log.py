"""One record for each encounter: what both sides did, in one order, as a recording has it."""

from pathlib import Path

from dyknow.agents.capabilities.separation.options import EncounterOptions
from dyknow.agents.effects import KeepEncounter
from dyknow.agents.options import Chosen
from dyknow.federation.messages.contents import MonitorProximity
from dyknow.sim_uavs.world.world import World
from tests.sim_uavs.worlds import fly_scenario


def flown(**settings: object) -> World:
    own = {"options": Chosen(EncounterOptions(encounters=Path("kept"))), **settings}
    world = fly_scenario(1, "crossing", 2, settings=dict.fromkeys("01", own))
    world.run_for(2)
    world.ask("cc", "0", MonitorProximity())
    world.run_for(70)
    return world


def test_an_encounter_has_both_sides_intents_acts_and_decisions_in_one_order() -> None:
    world = flown()
    for unit, other in (("0", "1"), ("1", "0")):
        (record,) = world.nodes[unit].encounters
        assert isinstance(record, KeepEncounter)
        assert record.other == other
        topics = {message.topic for message in record.messages}
        assert {f"/{each}/{label}" for each in "01" for label in ("heli-position", "heli-altitude", "intent")} <= topics
        assert {"/acts", "/log"} <= topics
        times = [message.at_us for message in record.messages]
        assert times == sorted(times)
        assert times[-1] - times[0] > 15_000_000
        sources = {
            m.message["value"]["source"] for m in record.messages if m.topic == "/1/intent" and m.message["value"]
        }
        assert {"route", "manoeuvre"} <= sources
        assert any("(avoid" in str(m.message["act"]) for m in record.messages if m.topic == "/acts")
        words = [m.message["message"] for m in record.messages if m.topic == "/log"]
        assert any("makes room" in text or " for 0" in text for text in words)


def test_without_a_directory_nothing_is_kept() -> None:
    world = fly_scenario(1, "crossing", 2)
    world.run_for(2)
    world.ask("cc", "0", MonitorProximity())
    world.run_for(60)
    assert not any(world.nodes[unit].encounters for unit in "01")
