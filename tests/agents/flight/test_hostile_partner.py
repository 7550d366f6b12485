"""A member that proposes manoeuvres without an encounter: each is refused with a code, counted, and reported."""

import pytest
from agents.flight.evidence import fix_of
from agents.flight.giving_way import GivingWay

from federation.messages.acts import Performative
from federation.messages.contents import Avoid, CreateMulticast, MonitorProximity, Progress
from tests.box import EPOCH, METRE_DEG, Box, Vehicle

P = Performative
STREAMS = ("heli-position", "heli-altitude", "heli-velocity")


def far_member(wire: Box, altitude_m: float = 100.0) -> None:
    """Member 1, 20 km away, whose streams platform 0 gets, with a task of the command centre on both."""
    wire.join("0", Vehicle(altitude_m=100.0), control=True)
    wire.join("1", Vehicle(north_m=20_000.0, altitude_m=altitude_m))
    wire.centre()
    wire.run(2.0)
    streams = CreateMulticast(semantic_labels=STREAMS, sample_period_s=0.2, delay_s=0.2, to_units=("0",))
    wire.asked("cc", "1", streams)
    wire.run(1.0)


@pytest.mark.parametrize("climber", ["0", "1"])
@pytest.mark.parametrize("because", [None, pytest.param("autopilot: denied", marks=pytest.mark.full)])
def test_no_member_moves_an_aircraft_that_it_does_not_meet(wire: Box, climber: str, because: str | None) -> None:
    far_member(wire)
    task = wire.ask("cc", "0", MonitorProximity())
    wire.run(2.0)
    for _ in range(10):
        proposal = Avoid(alarm="none", climber=climber, climb_m=25.0, units=("0", "1"), because=because)
        question = wire.asked("1", "0", proposal)
        assert question.performatives == [P.REFUSE]
        assert getattr(question.answers[-1].content, "code", None) == "no-evidence"
        wire.run(4.9)
    assert wire.vehicle("0").commands == []
    assert wire.platform("0").part(GivingWay).refused == {"no-evidence": 10}
    text = "0 refuses to avoid 1: nothing here shows that 1 comes near"
    assert wire.nodes["0"].notes.count(text) == 10
    assert [said.step for said in task.results if isinstance(said, Progress)].count(text) == 10


def test_a_partner_whose_position_leaps_is_avoided_only_when_it_has_been_credible_for_3_s(wire: Box) -> None:
    far_member(wire)
    task = wire.ask("cc", "0", MonitorProximity())
    wire.run(5.0)
    intruder, own = wire.vehicle("1"), wire.vehicle("0")
    intruder.north_m, intruder.north_m_s = 78.0 + 5.0 * (wire.now_us - EPOCH) / 1e6, -5.0
    while position(wire) > 1_000.0:
        wire.run(0.1)
    seen_us, text = wire.now_us, "0 puts off avoiding 1: the position of 1 has leapt"
    question = wire.asked("1", "0", Avoid(alarm="none", climber="0", climb_m=25.0, units=("0", "1")))
    assert question.performatives == [P.REFUSE]
    assert getattr(question.answers[-1].content, "code", None) == "implausible"
    wire.run(5.0)
    assert own.commands, "it is there, and comes near"
    assert seen_us + 2_800_000 <= own.commands[0][0] <= seen_us + 4_500_000
    assert wire.nodes["0"].notes.count(text) == 1
    assert [said.step for said in task.results if isinstance(said, Progress)].count(text) == 1


def position(wire: Box) -> float:
    """How far north of platform 0 it has platform 1, in metres."""
    fix = fix_of(wire.platform("0").part(GivingWay)._gateway, "1")
    return float("inf") if fix is None else (fix.latitude_deg - 58.0) / METRE_DEG


def test_no_member_leads_an_aircraft_up_by_an_altitude_that_it_makes_up(wire: Box) -> None:
    far_member(wire, altitude_m=140.0)
    question = wire.asked("1", "0", Avoid(alarm="none", climber="0", climb_m=0.0, units=("0", "1")))
    assert question.performatives == [P.REFUSE]
    assert wire.vehicle("0").commands == []
