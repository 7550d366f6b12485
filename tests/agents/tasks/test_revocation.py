"""A member is revoked while platforms act by its word: what it has permitted, delegated and asked for ends at each of them."""

from dataclasses import replace

import pytest

from dyknow.agents.actions import Role
from dyknow.agents.capabilities.areas.assignment import AreaAssignment
from dyknow.agents.capabilities.areas.division import AreaDivision
from dyknow.agents.capabilities.missions.performing import Performing
from dyknow.agents.tasks.command_watch import REVOKED, REVOKED_US, CommandWatch
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import (
    Alarm,
    Alarms,
    CommandEntry,
    CreateMonitor,
    CreateMulticast,
    DivideArea,
    Hold,
    JoinMission,
    MonitorProximity,
    PerformCommands,
    PermitMission,
    Reason,
)
from dyknow.federation.security.trust import Roster, Trust
from dyknow.federation.transport import RosterRead
from tests.agents.rosters import MEMBERS, ROLES, SEEDS
from tests.box import EPOCH, Box, Question, Vehicle

P = Performative
ROSTER = Roster(MEMBERS, "default", "ab" * 8, 1)
AREA = ("58.0 15.0", "58.01 15.0", "58.01 15.02", "58.0 15.02")
GO = PerformCommands(
    mission="m", step=1, action="flies", commands=(CommandEntry(name="goto", numbers=(58.001, 15.0, 60.0)),)
)


def trust(unit: str) -> Trust:
    return Trust.of(ROSTER, SEEDS[unit], "default", EPOCH - 1_000_000)


@pytest.fixture
def fed(wire: Box) -> Box:
    for number in range(3):
        vehicle = Vehicle(north_m=500.0 * number, battery=0.9)
        wire.join(str(number), vehicle, trust=trust(str(number)), control=True)
    for centre in ("cc", "cd", "obs"):
        wire.centre(centre, trust=trust(centre))
    wire.run(1.0)
    return wire


def read(fed: Box, roster: Roster, units: str = "012") -> None:
    """These platforms read that roster."""
    for unit in units:
        fed.happens(unit, RosterRead(str(roster), fed.now_us))
    fed.run(0.5)


def code(question: Question) -> str | None:
    said = question.contents[-1]
    return said.code if isinstance(said, Reason) else None


def permitted(fed: Box, by: str = "cd", *leaders: str) -> bytes:
    """The evidence of mission m, permitted at 0 and 1, with 0 in it led by 1."""
    permit = PermitMission(mission="m", leaders=leaders or ("1",), vehicles=("0", "1", "2"))
    asked = [fed.asked(by, unit, permit) for unit in "01"]
    assert fed.asked("1", "0", JoinMission(mission="m")).performatives == [P.AGREE, P.INFORM]
    return fed.evidence(asked[1].conversation)


def test_a_mission_that_a_revoked_centre_permitted_ends_and_its_evidence_is_worth_nothing(fed: Box) -> None:
    evidence = permitted(fed)
    join = fed.shown("1", "2", JoinMission(mission="m"), evidence)
    assert join.performatives == [P.AGREE, P.INFORM]
    fed.cancel("1", "2", join.conversation)
    read(fed, ROSTER.revoked("cd"))
    for unit in "02":
        performing = fed.platform(unit).part(Performing)
        assert (performing.leader, performing.permits.of("m", fed.now_us)) == ("", None)
        assert code(fed.shown("1", unit, JoinMission(mission="m"), evidence)) == "unproven"
    assert any("cd is revoked, and its tasks and permits end: m" in text for text in fed.nodes["0"].notes)
    before = len(fed.vehicle("0").commands)
    assert code(fed.asked("1", "0", GO)) == "mission"
    fed.run(1.0)
    assert fed.vehicle("0").commands[before:] == []


def test_what_a_revoked_centre_has_delegated_ends_at_its_delegate_and_at_each_participant(fed: Box) -> None:
    monitored = fed.asked("cd", "0", MonitorProximity())
    divided = fed.asked("cd", "1", DivideArea(area=AREA))
    exported = fed.asked(
        "cd", "2", CreateMulticast(semantic_labels=("battery",), sample_period_s=1.0, delay_s=1.0, to_units=("0",))
    )
    others = fed.asked("cc", "2", MonitorProximity(profile="proximity"))
    fed.run(3.0)
    platforms = [fed.platform(unit) for unit in "012"]
    assert all(monitored.conversation in each.built.tasks.coordinated for each in platforms)
    assert all(divided.conversation in each.part(AreaAssignment).known for each in platforms)
    read(fed, ROSTER.revoked("cd"))
    for each in platforms:
        assert monitored.conversation not in each.built.tasks.coordinated
        assert not each.part(AreaAssignment).known
        assert not each.part(AreaDivision).areas
        assert not each.built.tasks.of("cd")
    fed.run(30.0)
    for each in platforms:
        assert list(each.built.tasks.coordinated) == [others.conversation]
        assert not each.part(AreaDivision).areas
    assert exported.conversation not in [each.conversation for each in platforms[2].built.tasks.all()]


def test_a_monitor_of_a_revoked_delegator_is_not_set_up_with_evidence_that_was_verified(fed: Box) -> None:
    asked = fed.asked("cd", "1", MonitorProximity())
    fed.run(3.0)
    evidence = fed.evidence(asked.conversation)
    read(fed, ROSTER.revoked("cd"), "0")
    create = CreateMonitor(name="proximity-warn", task=asked.conversation, coordinator="1", generation=1)
    assert code(fed.shown("1", "0", create, evidence)) == "unproven"
    assert asked.conversation not in fed.platform("0").built.tasks.coordinated


def test_a_revoked_leader_is_succeeded_by_the_next_of_the_permit(fed: Box) -> None:
    permitted(fed, "cc", "1", "2")
    read(fed, ROSTER.revoked("1"), "02")
    performing = fed.platform("0").part(Performing)
    assert performing.leader == ""
    assert performing.permits.of("m", fed.now_us) is not None
    fed.run(1.0)
    assert fed.asked("2", "0", JoinMission(mission="m")).performatives == [P.AGREE, P.INFORM]


def test_a_revoked_member_may_nothing_and_does_not_come_back_into_the_directory(fed: Box) -> None:
    later = ROSTER.revoked("cd")
    read(fed, later)
    fed.run(5.0)
    ports = fed.platform("0").ports
    assert [ports.role_of(unit) for unit in ("cc", "cd", "cd-4711", "99")] == [
        Role.COMMAND_CENTRE,
        Role.REVOKED,
        Role.REVOKED,
        Role.REVOKED,
    ]
    assert Role.REVOKED < Role.OBSERVER
    assert not ports.directory.is_present("cd"), "its heartbeats come, and are not taken"
    assert fed.asked("cd", "0", Hold()).answers == []
    assert ports.agent.audit_log.refused["revoked"] > 0
    assert not fed.vehicle("0").commands
    without = replace(later, members={unit: MEMBERS[unit] for unit in ROLES if unit != "obs"}, generation=9)
    read(fed, without)
    assert not ports.directory.is_present("obs"), "one that is taken out of the roster is no member, either"


@pytest.mark.parametrize("what", ["permit", "monitors", "division"])
def test_what_ended_with_a_revocation_is_shown_and_an_alarm_within_two_seconds(fed: Box, what: str) -> None:
    """At the other command centre, which sees the conditions of each platform, and subscribes to alarms."""
    if what == "permit":
        permitted(fed)
        name = "m"
    else:
        name = fed.asked("cd", "0", MonitorProximity() if what == "monitors" else DivideArea(area=AREA)).conversation
    fed.run(3.0)
    told = fed.asked("cc", "0", Alarms(), P.SUBSCRIBE)
    read(fed, ROSTER.revoked("cd"))
    fed.run(1.4)

    def shown() -> list[str]:
        entry = fed.member("cc").directory.entry("0")
        assert entry is not None
        return [each.text for each in entry.conditions]

    text = f"cd is revoked, and its tasks and permits end: {name}"
    assert text in shown()
    heard = [each for each in told.contents if isinstance(each, Alarm) and each.monitor == REVOKED]
    assert [(each.event, each.units, each.values["tasks"]) for each in heard] == [("opened", ("0", "cd"), name)]
    watch = fed.platform("0").part(CommandWatch)
    watch.on_time(fed.now_us + REVOKED_US)
    fed.settle("0")
    fed.run(1.0)
    assert text not in shown()
    heard = [each for each in told.contents if isinstance(each, Alarm) and each.monitor == REVOKED]
    assert [each.event for each in heard] == ["opened", "closed"]
