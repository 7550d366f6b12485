"""Two platforms that fly towards each other: each refusal is an act, and whoever is left alone manoeuvres alone."""

from typing import Any

import pytest

from dyknow.agents.capabilities.flight.options import AvoidanceOptions
from dyknow.agents.capabilities.separation.giving_way import GivingWay
from dyknow.agents.capabilities.separation.neighbourhood import Neighbourhood
from dyknow.agents.monitoring.alarm_log import AlarmLog
from dyknow.agents.options import Chosen
from dyknow.agents.places import FlightPlan, Waypoint
from dyknow.federation.messages.contents import Goto, Hold
from dyknow.navigation.intents.intent import IntentSource
from dyknow.navigation.vehicle import GoToOrder, HoldOrder, LandOrder, ReturnHomeOrder
from dyknow.reasoning import NEITHER_CAN_AVOID
from tests.agents.capabilities.separation.meetings import deaf_to_acts, meeting, notes, orders, refusals
from tests.box import METRE_DEG, Box

BROKEN: list[tuple[dict[str, Any], str]] = [
    ({"guided": False, "mode": "LOITER"}, "mode LOITER"),
    ({"guided": False, "mode": "AUTO"}, "mode AUTO"),
]


def alarms(wire: Box, unit: str, monitor: str) -> list[Any]:
    return [e for e in wire.platform(unit).part(AlarmLog).events if e.monitor == monitor]


def test_the_later_by_name_proposes_the_other_agrees_and_it_is_flown(wire: Box) -> None:
    meeting(wire)
    while not orders(wire, "1"):
        wire.run(0.1)
    wire.run(0.6)
    assert orders(wire, "0") == []
    assert wire.acts("1", "0", "avoid")
    assert any(line.startswith("0 agrees with 1: 1 makes room") for line in notes(wire, "0"))
    assert wire.platform("1").part(GivingWay).encounters == ("0",)
    intent = wire.platform("1").part(Neighbourhood).intent()
    assert intent is not None
    assert intent.source is IntentSource.MANOEUVRE
    heard = wire.platform("0").part(Neighbourhood).others.by_unit["1"].intent
    assert heard.source is IntentSource.MANOEUVRE


@pytest.mark.parametrize(("state", "words"), BROKEN)
def test_one_that_may_not_be_commanded_is_avoided_by_the_other(wire: Box, state: dict[str, Any], words: str) -> None:
    meeting(wire, **state)
    wire.run(18.0)
    assert orders(wire, "0")
    assert orders(wire, "1") == []
    assert f"1 does not avoid 0, which is to do all of it: {words}" in notes(wire, "1")
    assert any(line.startswith("0 agrees with 1: leaves all of it to 0") for line in notes(wire, "0"))


@pytest.mark.parametrize("one", [{"control": False}, {"options": Chosen(AvoidanceOptions(avoidance=False))}])
def test_one_without_leave_is_avoided_by_the_other(wire: Box, one: dict[str, Any]) -> None:
    meeting(wire, one=one)
    wire.run(18.0)
    assert orders(wire, "0")
    assert orders(wire, "1") == []


@pytest.mark.parametrize("state", [{"armed": False}, {"airborne": False}])
def test_one_on_the_ground_is_no_traffic(wire: Box, state: dict[str, Any]) -> None:
    meeting(wire, **state, east_m_s=0.0, east_m=20.0)
    wire.run(30.0)
    assert orders(wire, "0") == orders(wire, "1") == []
    assert not wire.platform("0").part(GivingWay).encounters


def test_where_neither_can_both_are_told_with_the_seconds_left_and_it_closes(wire: Box) -> None:
    meeting(wire, zero={"control": False}, one={"control": False})
    wire.run(18.0)
    for unit in "01":
        (opened,) = alarms(wire, unit, "neither-can-avoid")
        assert opened.values["seconds"] > 5.0
        assert set(opened.units) == {"0", "1"}
    wire.run(30.0)
    assert [e.event for e in alarms(wire, "0", "neither-can-avoid")] == ["opened", "closed"]


def test_an_autopilot_that_refuses_leaves_it_to_the_other(wire: Box) -> None:
    meeting(wire, answer="denied")
    wire.run(18.0)
    assert orders(wire, "0")
    assert any("1 does not fly its manoeuvre: " in line for line in notes(wire, "1"))


@pytest.mark.parametrize("pairs", [(("1", "0"),), (("0", "1"),), (("0", "1"), ("1", "0"))])
def test_without_acts_it_is_flown_all_the_same(wire: Box, pairs: tuple[tuple[str, str], ...]) -> None:
    meeting(wire)
    wire.drop = deaf_to_acts(*pairs)
    wire.run(20.0)
    assert orders(wire, "1")


def test_one_that_dies_in_flight_is_told_to_be_silent_and_kept_away_from(wire: Box) -> None:
    meeting(wire)
    wire.run(3.0)
    wire.kill("0")
    wire.run(4.0)
    (silent,) = alarms(wire, "1", "silent-in-the-air")
    assert silent.units == ("1", "0")
    assert silent.values["altitude_m"] == pytest.approx(102.0, abs=0.5)
    assert any("0 is silent, in the air, at about 102 m" in line for line in notes(wire, "1"))
    wire.run(12.0)
    assert orders(wire, "1")


def test_the_alarm_of_one_that_is_silent_closes_when_it_is_heard(wire: Box) -> None:
    meeting(wire)
    wire.partition(["0"], ["1", "cc"])
    wire.run(5.0)
    assert [e.event for e in alarms(wire, "1", "silent-in-the-air")] == ["opened"]
    wire.heal(["0"], ["1", "cc"])
    wire.run(5.0)
    assert [e.event for e in alarms(wire, "1", "silent-in-the-air")] == ["opened", "closed"]


def test_without_a_task_nobody_gives_way(wire: Box) -> None:
    meeting(wire)
    (task,) = [t.conversation for t in wire.platform("0").built.tasks.all() if t.name == "monitor-proximity"]
    wire.cancel("cc", "0", task)
    wire.run(20.0)
    assert orders(wire, "0") == orders(wire, "1") == []


def test_a_users_goto_comes_after_giving_way_and_hold_stops_it_at_once(wire: Box) -> None:
    meeting(wire)
    wire.run(15.0)
    assert orders(wire, "1")
    refused = wire.asked("cc", "1", Goto(latitude_deg=58.0, longitude_deg=15.0, altitude_m=80.0))
    assert "giving way" in (refused.reason or "")
    wire.question("cc", "1", Hold())
    wire.run(0.5)
    assert isinstance(orders(wire, "1")[-1], HoldOrder)
    assert not any(isinstance(order, ReturnHomeOrder | LandOrder) for order in orders(wire, "1"))


@pytest.mark.parametrize("able", [True, False])
def test_one_that_no_longer_knows_where_it_is_says_so_to_those_that_it_meets(wire: Box, *, able: bool) -> None:
    """Its intent flies on: the other is to avoid it, or where that cannot either, both are warned."""
    meeting(wire, zero={"control": able})
    wire.run(2.0)
    wire.vehicle("1").is_lost = True
    wire.run(16.0)
    if able:
        assert orders(wire, "0"), "the other makes room"
        return
    (event,) = [each for each in alarms(wire, "1", NEITHER_CAN_AVOID) if each.event == "opened"]
    assert "its position has not been known" in event.values["reason[1]"]


def test_a_plan_is_what_an_intent_says(wire: Box) -> None:
    there = Waypoint(58.0, 15.0 + 900 * METRE_DEG, 100.0)
    meeting(wire, one={"plan": FlightPlan((there,), 4.0)})
    wire.run(1.0)
    intent = wire.platform("0").part(Neighbourhood).others.by_unit["1"].intent
    assert intent.source is IntentSource.ROUTE
    assert intent.legs[0].longitude_deg == pytest.approx(there.longitude_deg, abs=1e-6)
    assert refusals(wire, "0") == []
    assert isinstance(orders(wire, "1")[0], GoToOrder)
