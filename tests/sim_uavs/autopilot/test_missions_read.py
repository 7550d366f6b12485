"""Missions that another station uploads: served by both personas, read by the platform, and the way of its intent."""

import pytest
from pymavlink.dialects.v20 import all as mavlink

from dyknow.agents.capabilities.separation.own.own_intent import OwnIntent
from dyknow.navigation.intents.intent import IntentEnding, IntentSource
from dyknow.navigation.mission_plans import MissionStep
from dyknow.sim_uavs.dynamics.flight import Mode
from dyknow.sim_uavs.dynamics.settings import PersonaName
from tests.sim_uavs.piloted import HOME, NORTH_DEG, Piloted

BOTH = pytest.mark.parametrize("persona", ["ardupilot", "px4"])
OTHER = ("127.0.0.1", 14600)


def uploaded(flown: Piloted, *items: tuple[int, float, float]) -> None:
    """Another station uploads items: command, metres north of home, metres above it."""
    codec = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
    messages = [mavlink.MAVLink_mission_count_message(1, 1, len(items), 0)] + [
        mavlink.MAVLink_mission_item_int_message(
            1, 1, seq, 6, command, 0, 1, 0.0, 0.0, 0.0, 0.0, round((HOME.latitude_deg + north_m * NORTH_DEG) * 1e7),
            round(HOME.longitude_deg * 1e7), up_m, 0,
        )
        for seq, (command, north_m, up_m) in enumerate(items)
    ]  # fmt: skip
    for message in messages:
        flown.vehicle.autopilot.on_bytes(bytes(message.pack(codec)), OTHER, flown.now_us)


@BOTH
def test_a_mission_is_read_from_both_and_its_places_are_the_intent(persona: PersonaName) -> None:
    flown = Piloted(persona)
    first = int(persona == "ardupilot")
    home = [(16, 0.0, 0.0)] if first else []
    uploaded(flown, *home, (16, 60.0, 50.0), (178, 0.0, 0.0), (16, 120.0, 40.0), (21, 120.0, 0.0))
    flown.run(3.0)
    steps = [(each.item - first, each.step) for each in flown.pilot.loaded]
    assert steps == [(0, MissionStep.FLY_TO), (2, MissionStep.FLY_TO), (3, MissionStep.LAND)]
    assert flown.flight.set_mode(Mode.AUTO).value == "accepted"
    flown.run(3.0)
    intent = OwnIntent(flown.pilot, may_avoid=True).now(None)
    assert intent is not None
    assert (intent.source, intent.ending) == (IntentSource.MISSION, IntentEnding.LAND)
    assert [round((leg.latitude_deg - HOME.latitude_deg) / NORTH_DEG) for leg in intent.legs] == [60, 120, 120]
    assert [leg.altitude_m for leg in intent.legs] == pytest.approx([100.0, 90.0, 50.0], abs=1.0)
    flown.until(lambda: flown.flight.progress.item > first, 90.0)
    flown.run(2.0)
    intent = OwnIntent(flown.pilot, may_avoid=True).now(None)
    assert intent is not None
    assert len(intent.legs) == 2
    assert intent.ending is IntentEnding.LAND
