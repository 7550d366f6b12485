"""Members with valid keys that say on purpose what moves others: each is refused with a code, bounded, counted, reported."""

from typing import Any

import pytest

from dyknow import Sample
from dyknow.agents.capabilities.separation.giving_way import GivingWay
from dyknow.agents.capabilities.separation.neighbourhood import Neighbourhood
from dyknow.agents.capabilities.separation.neighbours import MOST_OWN_M
from dyknow.agents.capabilities.separation.records import intent_value
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import Avoid, MonitorProximity, Progress
from dyknow.navigation.intents.intent import Intent
from dyknow.navigation.vehicle import HoldOrder
from tests.box import Box, Vehicle

P = Performative


def far_member(wire: Box, **one: Any) -> Any:
    """Member 1, 2 km away, with a task of the command centre on both."""
    wire.join("0", Vehicle(altitude_m=100.0), control=True)
    wire.join("1", Vehicle(**{"north_m": 2_000.0, **one}))
    wire.centre()
    wire.run(2.0)
    task = wire.ask("cc", "0", MonitorProximity())
    wire.run(4.0)
    return task


def says(wire: Box, intent: Intent) -> None:
    """Member 1 says that of itself, once."""
    platform = wire.platform("1")
    part = platform.part(Neighbourhood)
    value = part._to_local(intent_value(intent))
    at_us = wire.now_us // 500_000 * 500_000
    part._network.push(part._label, Sample(wire.now_us, at_us, value))


def code_of(said: Any) -> str | None:
    return getattr(said.answers[-1].content, "code", None)


@pytest.mark.parametrize("legs", ["", "58.0000000,15.0000000,100.0"])
def test_no_member_moves_an_aircraft_that_it_does_not_meet(wire: Box, legs: str) -> None:
    task = far_member(wire)
    for _ in range(5):
        said = wire.asked("1", "0", Avoid(units=("0", "1"), because="autopilot: denied", legs=legs))
        assert said.performatives == [P.REFUSE]
        assert code_of(said) == "no-evidence"
        wire.run(4.9)
    assert wire.vehicle("0").commands == []
    assert wire.platform("0").part(GivingWay).refused == {"no-evidence": 5}
    text = "0 refuses to avoid 1: nothing here shows that 1 comes near"
    assert wire.nodes["0"].notes.count(text) == 5
    assert [said.step for said in task.results if isinstance(said, Progress)].count(text) == 5


@pytest.mark.parametrize(
    ("content", "code"),
    [
        (Avoid(units=("0", "2")), "not-a-participant"),
        (Avoid(units=("1",)), "not-a-participant"),
        (Avoid(units=("0", "1"), legs="there"), "no-places"),
        (Avoid(units=("0", "1"), legs="1,2,3;" * 40), "no-places"),
        (Avoid(units=("0", "1"), legs="nan,0,0"), "no-places"),
    ],
)
def test_proposals_that_are_none_are_refused_with_a_code(wire: Box, content: Avoid, code: str) -> None:
    far_member(wire)
    said = wire.asked("1", "0", content)
    assert said.performatives == [P.REFUSE]
    assert code_of(said) == code
    assert wire.vehicle("0").commands == []


def test_a_proposal_moves_nobody_however_often_it_is_made(wire: Box) -> None:
    far_member(wire)
    for _ in range(20):
        wire.asked("1", "0", Avoid(units=("0", "1"), legs="58.0000000,15.0000000,100.0"))
    wire.run(3.0)
    assert wire.vehicle("0").commands == []


def test_a_claim_of_much_room_is_cut_down(wire: Box) -> None:
    far_member(wire)
    part = wire.platform("0").part(Neighbourhood)
    wide = part.others.by_unit["1"].intent._replace(radius_m=100.0, half_height_m=100.0)
    says(wire, wide)
    wire.run(0.3)
    assert part.others.by_unit["1"].intent.radius_m <= MOST_OWN_M
    assert wire.vehicle("0").commands == []


def test_an_intent_that_leaps_is_reported_once_and_moves_nobody(wire: Box) -> None:
    far_member(wire)
    member = wire.vehicle("1")
    member.north_m, member.east_m = 40.0, 10.0
    while not wire.platform("0").part(Neighbourhood).others.left_out.get("leap"):
        wire.run(0.1)
    notes = [line for line in wire.nodes["0"].notes if "has leapt" in line]
    assert len(notes) == 1
    said = wire.asked("1", "0", Avoid(units=("0", "1"), because="because"))
    assert code_of(said) == "implausible"
    assert wire.vehicle("0").commands == []


def test_an_intent_that_is_none_is_counted(wire: Box) -> None:
    far_member(wire)
    part, mine = wire.platform("0").part(Neighbourhood), wire.platform("1").part(Neighbourhood)
    value = ("nobody", *intent_value(part.others.by_unit["1"].intent)[1:])
    for _ in range(3):
        wire.run(0.5 - wire.now_us % 500_000 / 1e6 + 0.45)
        mine._network.push(
            mine._label, Sample(wire.now_us, wire.now_us // 500_000 * 500_000 + 500_000, mine._to_local(value))
        )
        wire.run(0.3)
    assert part.others.left_out["intent"] >= 1
    assert wire.nodes["0"].notes.count("an intent of 1 is left out: it is no intent") == 1
    assert wire.vehicle("0").commands == []


def test_one_that_claims_right_of_way_for_all_its_life_is_given_way_to_and_no_more(wire: Box) -> None:
    """It is traffic: others go round it, and stay within their own limits."""
    far_member(wire, north_m=200.0, north_m_s=-4.0)
    wire.run(45.0)
    orders = [command.order for _, command in wire.vehicle("0").commands]
    assert orders
    for order in orders:
        assert isinstance(order, HoldOrder) or 10.0 <= order.altitude_m <= 220.0
