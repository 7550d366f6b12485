"""May a member command a vehicle in a mission? A command centre may; another platform only where a command centre says so."""

import pytest

from dyknow.agents.admission.mission_permits import MOST, Permits
from dyknow.agents.capabilities.missions.performing import Performing
from dyknow.agents.tasks.authority import PERMIT_US, TaskEvidence
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import JoinMission, PermitMission, TaskOver
from dyknow.model.errors import Refused
from tests.agents.rosters import trust
from tests.box import Box, Vehicle

P = Performative


@pytest.fixture
def three(wire: Box) -> Box:
    """Platforms 0, 1, 2 and a command centre of one roster."""
    for unit in "012":
        wire.join(unit, Vehicle(north_m=500.0 * int(unit)), trust=trust(unit), control=True)
    wire.centre("cc", trust=trust("cc"))
    wire.run(1.0)
    return wire


def permits_of(wire: Box, unit: str) -> Permits:
    return wire.platform(unit).part(Performing).permits


def permit(wire: Box, *leaders: str, mission: str = "m", vehicles: tuple[str, ...] = ()) -> TaskEvidence:
    return TaskEvidence(
        mission, "cc", leaders[0], PermitMission(mission=mission, leaders=leaders, vehicles=vehicles), wire.now_us
    )


def refusal(wire: Box, unit: str, mission: str, sender: str, now_us: int | None = None) -> str:
    """Why `sender` may not command the vehicle of `unit`; empty: it may."""
    boot = 0 if sender == "cc" else wire.member(sender).boot if sender in wire.running else 0
    try:
        permits_of(wire, unit).check(mission, sender, boot, wire.now_us if now_us is None else now_us)
    except Refused as refused:
        return refused.code
    return ""


def test_a_platform_leads_only_what_a_command_centre_has_permitted_and_for_an_hour(three: Box) -> None:
    permits = permits_of(three, "0")
    assert refusal(three, "0", "m", "cc") == ""
    assert refusal(three, "0", "m", "1") == "role"
    permits.permit(permit(three, "1"), three.now_us)
    assert refusal(three, "0", "m", "1") == ""
    assert refusal(three, "0", "m", "2") == "role"
    assert refusal(three, "0", "other", "1") == "role"
    assert refusal(three, "0", "m", "1", three.now_us + PERMIT_US) == "role"
    permits.end("m")
    assert refusal(three, "0", "m", "1") == "role"


def test_a_successor_is_obeyed_only_when_all_before_it_are_gone_for_a_while(three: Box) -> None:
    permits_of(three, "0").permit(permit(three, "1", "2"), three.now_us)
    assert [refusal(three, "0", "m", unit) for unit in "12"] == ["", "succession"]
    three.end("1")
    three.run(0.2)
    assert refusal(three, "0", "m", "2") == "succession", "it may come back at once"
    three.run(0.5)
    assert refusal(three, "0", "m", "2") == ""
    three.join("1", trust=trust("1"), control=True)
    three.run(1.0)
    assert refusal(three, "0", "m", "2") == "", "in a new life it knows nothing of the mission"
    assert refusal(three, "0", "m", "1") == "succession"


def test_permits_do_not_grow_without_end(three: Box) -> None:
    for number in range(MOST + 1):
        permits_of(three, "0").permit(permit(three, "1", mission=f"m{number}"), three.now_us)
    assert refusal(three, "0", "m0", "1") == "role"
    assert refusal(three, "0", f"m{MOST}", "1") == ""


@pytest.mark.parametrize(("chain", "sender"), [(("cc", "1"), "2"), (("cc", "0", "1"), "1")])
def test_a_chain_ends_with_its_sender_and_has_no_circle(three: Box, chain: tuple[str, ...], sender: str) -> None:
    with pytest.raises(Refused) as why:
        permits_of(three, "0").check_chain(chain, sender)
    assert why.value.code == "chain"


def shown(wire: Box, *vehicles: str) -> bytes:
    """The permit that platform 1 got for mission m."""
    asked = wire.asked("cc", "1", PermitMission(mission="m", leaders=("1", "2"), vehicles=vehicles))
    return wire.evidence(asked.conversation)


def test_a_leader_carries_its_permit_to_a_vehicle_that_the_permit_names(three: Box) -> None:
    evidence = shown(three, "1", "2")
    joins = [three.shown("1", unit, JoinMission(mission="m"), evidence) for unit in "02"]
    assert [each.performatives for each in joins] == [[P.REFUSE], [P.AGREE, P.INFORM]]
    assert joins[0].contents[0].code == "unproven"  # type: ignore[union-attr]
    assert three.platform("2").part(Performing).leader == "1"


def test_a_permit_that_a_platform_makes_up_or_that_is_for_another_mission_is_none(three: Box) -> None:
    genuine = shown(three, "0", "1")
    made_up = three.asked("2", "1", PermitMission(mission="m2", leaders=("2",), vehicles=("0",)))
    for sender, mission, evidence in (
        ("2", "m2", three.evidence(made_up.conversation)),
        ("1", "m2", genuine),
        ("1", "m", genuine[:-1] + bytes([genuine[-1] ^ 1])),
        ("2", "m", genuine),
    ):
        join = three.shown(sender, "0", JoinMission(mission=mission), evidence)
        assert join.performatives == [P.REFUSE], (sender, mission)
    assert three.platform("0").part(Performing).leader == ""


def test_when_a_mission_is_over_its_permit_ends_everywhere_and_its_evidence_with_it(three: Box) -> None:
    evidence = shown(three, "0", "1")
    for unit in "01":
        three.asked("cc", unit, PermitMission(mission="m", leaders=("1", "2"), vehicles=("0", "1")))

    def tell(sender: str) -> None:
        over = TaskOver(task="m")
        three.speak(sender, lambda member, now_us: member.acts.tell("0", over, now_us, evidence=evidence))
        three.run(0.1)

    tell("2")
    assert refusal(three, "0", "m", "1") == "", "2 does not lead it"
    tell("1")
    assert refusal(three, "0", "m", "1") == "role"
    join = three.shown("1", "0", JoinMission(mission="m"), evidence)
    assert (join.performatives, join.contents[0].code) == ([P.REFUSE], "cancelled")  # type: ignore[union-attr]


def test_a_vehicle_holds_and_is_free_when_one_before_its_leader_is_back(three: Box) -> None:
    for unit in "0":
        three.asked("cc", unit, PermitMission(mission="m", leaders=("1", "2"), vehicles=("0",)))
    three.cut("1", "02")
    three.run(4.0)
    assert three.asked("2", "0", JoinMission(mission="m")).performatives == [P.AGREE, P.INFORM]
    assert three.platform("0").part(Performing).leader == "2"
    three.wire.mend_all()
    three.run(4.0)
    assert three.platform("0").part(Performing).leader == ""
    assert three.asked("1", "0", JoinMission(mission="m")).performatives == [P.AGREE, P.INFORM]
