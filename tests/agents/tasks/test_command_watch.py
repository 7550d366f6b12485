"""A user knows within two seconds whom a vehicle obeys that is not the delegate, and who tried to be obeyed; and ends any of it."""

from collections.abc import Sequence
from random import Random

import pytest

from dyknow.agents.capabilities.areas.assignment import AreaAssignment
from dyknow.agents.capabilities.missions.performing import Performing
from dyknow.agents.monitoring.alarm_log import AlarmLog
from dyknow.agents.tasks.command_watch import COMMANDER, MOST, QUIET_US, REFUSED, SETTLED_US, CommandWatch
from dyknow.federation.messages.acts import AgentName, Performative
from dyknow.federation.messages.contents import (
    AssignArea,
    CommandEntry,
    Content,
    CreateMonitor,
    DivideArea,
    Goto,
    Hold,
    JoinMission,
    MonitorProximity,
    PerformCommands,
    PermitMission,
    Reason,
    TaskOver,
)
from dyknow.model.errors import Refused
from tests.agents.rosters import trust
from tests.box import Box, Vehicle

P = Performative
AREA = ("58.40 15.60", "58.40 15.61", "58.41 15.61", "58.41 15.60")


@pytest.fixture
def three(wire: Box) -> Box:
    """Platforms 0, 1, 2 and a command centre of one roster, each vehicle permitted for mission m of leaders 0, 1."""
    for unit in "012":
        wire.join(unit, Vehicle(north_m=3000.0 * int(unit)), trust=trust(unit), control=True)
    wire.centre("cc", trust=trust("cc"))
    wire.run(1.5)
    for unit in "012":
        wire.asked("cc", unit, PermitMission(mission="m", leaders=("0", "1"), vehicles=("0", "1", "2")))
    return wire


def shown(wire: Box, unit: str) -> list[str]:
    """What the command centre is shown of a platform."""
    entry = wire.member("cc").directory.entry(unit)
    assert entry is not None
    return [each.text for each in entry.conditions]


def alarms(wire: Box, unit: str, monitor: str) -> list[tuple[str, tuple[str, ...]]]:
    return [(each.event, each.units) for each in wire.platform(unit).part(AlarmLog).events if each.monitor == monitor]


def obeys(wire: Box, unit: str) -> str:
    return wire.platform(unit).part(Performing).leader


def join(wire: Box, leader: str, unit: str) -> Sequence[Performative]:
    return wire.asked(leader, unit, JoinMission(mission="m")).performatives


def test_a_vehicle_shows_who_commands_it_and_by_whose_word(three: Box) -> None:
    assert join(three, "0", "2") == [P.AGREE, P.INFORM]
    three.run(1.0)
    assert shown(three, "2") == ["mission m, of platform 0, delegated by cc: is idle"]
    assert alarms(three, "2", COMMANDER) == []


def test_a_successor_that_is_obeyed_is_an_alarm_and_news_for_the_delegator_until_it_is_not(three: Box) -> None:
    three.asked("cc", "2", PermitMission(mission="m2", leaders=("0", "1"), vehicles=("2",)))
    three.end("0")
    three.run(2.0)
    assert three.asked("1", "2", JoinMission(mission="m2")).performatives == [P.AGREE, P.INFORM]
    three.run(1.9)
    assert alarms(three, "2", COMMANDER) == [("opened", ("2", "1"))]
    assert "mission m2, of platform 1, delegated by cc: is idle" in shown(three, "2")
    told = [each.content for each in three.acts("2", "cc", "progress")]
    assert [str(each.arguments["step"]) for each in told if each is not None] == [
        "leads: the vehicle obeys 1 in m2, and cc delegated it to 0"
    ]
    three.run(1.0)
    three.end("1")
    three.run(2.0)
    assert alarms(three, "2", COMMANDER)[-1] == ("closed", ("2", "1"))


def test_a_scan_that_a_successor_leads_is_an_alarm_where_vehicles_fly_it(three: Box) -> None:
    watch, word = three.platform("2").part(CommandWatch), DivideArea(area=AREA, scan_m=45.0)
    asked = three.asked("cc", "0", word)
    three.run(2.0)
    piece = three.platform("2").part(AreaAssignment).known[asked.conversation]
    watch.obeys(piece.evidence, "0", three.now_us)
    assert alarms(three, "2", COMMANDER) == []
    watch.obeys(piece.evidence, "1", three.now_us)
    watch.obeys(piece.evidence, "1", three.now_us)
    assert alarms(three, "2", COMMANDER) == [("opened", ("2", "1"))]
    watch.obeys(piece.evidence, "0", three.now_us)
    assert alarms(three, "2", COMMANDER)[-1] == ("closed", ("2", "1"))
    three.settle("2")
    three.run(0.1)


def attempts() -> list[tuple[Performative, Content]]:
    """What commands vehicles, of a platform that may not."""
    return [
        (P.REQUEST, JoinMission(mission="m")),
        (P.REQUEST, JoinMission(mission="other")),
        (P.REQUEST, PerformCommands(mission="m", step=1, action="flies", commands=(CommandEntry(name="land"),))),
        (P.REQUEST, PermitMission(mission="m", leaders=("2",), vehicles=("0",))),
        (P.REQUEST, Goto(latitude_deg=58.0, longitude_deg=15.0, altitude_m=50.0)),
        (P.REQUEST, Hold()),
        (P.INFORM, AssignArea(task="cc-1.0", generation=1)),
        (P.INFORM, TaskOver(task="m")),
    ]


def say(wire: Box, performative: Performative, content: Content) -> None:
    """Platform 2 says it to 0."""
    if performative is P.INFORM:
        wire.speak("2", lambda member, now_us: member.acts.tell("0", content, now_us))
        wire.run(0.1)
    else:
        assert wire.asked("2", "0", content, performative).performatives == [P.REFUSE]


@pytest.mark.parametrize("number", range(8))
def test_a_refused_attempt_to_command_is_an_alarm_and_shown_within_two_seconds(three: Box, number: int) -> None:
    performative, content = attempts()[number]
    say(three, performative, content)
    three.run(1.9)
    (text,) = shown(three, "0")
    assert text.startswith(f"refused to 2, once: ({content.head} ...): ")
    assert alarms(three, "0", REFUSED) == [("opened", ("0", "2"))]


def test_however_much_one_sends_there_is_one_alarm_of_it_and_a_minute_of_quiet_closes_it(three: Box) -> None:
    random = Random(5)
    changes, before = 0, shown(three, "0")
    for _ in range(300):
        performative, content = random.choice(attempts())
        say(three, performative, content)
        changes += shown(three, "0") != before
        before = shown(three, "0")
    assert changes <= 4
    assert before[-1].startswith("refused to 2, 100 times or more: ")
    assert alarms(three, "0", REFUSED) == [("opened", ("0", "2"))]
    assert obeys(three, "0") == ""
    three.run(QUIET_US / 1e6 + 1.5)
    assert shown(three, "0") == []
    assert alarms(three, "0", REFUSED)[-1] == ("closed", ("0", "2"))


def claim(wire: Box, task: str) -> Reason | None:
    """Platform 2 claims the monitors of 0 in a task, with evidence; why not."""
    content = CreateMonitor(name="proximity", task=task, coordinator="2", generation=2)
    refused = wire.shown("2", "0", content, wire.evidence(task)).contents[-1]
    return refused if isinstance(refused, Reason) else None


def test_a_claim_to_monitors_out_of_turn_is_shown_and_an_alarm_unless_a_platform_has_just_appeared(three: Box) -> None:
    task = three.asked("cc", "0", MonitorProximity()).conversation
    three.run(SETTLED_US / 1e6)
    assert three.cancel_task("2", "1", task).failed is None
    three.end("1")
    three.run(1.0)
    three.join("1", Vehicle(north_m=3000.0), trust=trust("1"), control=True)
    three.run(2.0)
    for since, events in (("just now", []), ("for a while", [("opened", ("0", "2"))])):
        refused = claim(three, task)
        assert refused is not None, since
        assert refused.code == "led-by"
        assert alarms(three, "0", REFUSED) == events, since
        three.run(SETTLED_US / 1e6)
        assert any(text.startswith("refused to 2, ") for text in shown(three, "0"))


@pytest.mark.parametrize("alone", ["0", "2"])
def test_after_a_cut_the_honest_successors_are_no_alarm(three: Box, alone: str) -> None:
    for content in (MonitorProximity(), DivideArea(area=AREA)):
        three.asked("cc", "0", content)
    three.run(3.0)
    three.cut({alone}, set("012") - {alone})
    three.run(8.0)
    assert three.platform(alone).built.tasks.coordinated.keys() == three.platform("1").built.tasks.coordinated.keys()
    three.wire.mend_all()
    three.run(10.0)
    assert [alarms(three, unit, REFUSED) for unit in "012"] == [[], [], []]


def test_of_many_platforms_the_last_ones_are_remembered(wire: Box) -> None:
    watch = wire.join("0").part(CommandWatch)
    wire.run(1.0)
    wire.join("1", trust=None)
    wire.run(1.0)
    wire.asked("1", "0", Hold())
    (act,) = wire.acts("1", "0", "hold")
    for number in range(3 * MOST):
        sender = AgentName("interface", f"u{number}")
        watch.refuse(act._replace(sender=sender), Refused("no", "role"), wire.now_us)
    assert len(watch.refused) == MOST
    events = alarms(wire, "0", REFUSED)
    assert sum(event == "closed" for event, _ in events) == 2 * MOST


def test_a_command_centre_ends_a_mission_at_the_vehicle_without_its_leader(three: Box) -> None:
    permit = PermitMission(mission="n", leaders=("0", "1"), vehicles=("0", "1", "2"))
    evidence = three.evidence(three.asked("cc", "0", permit).conversation)
    assert three.shown("0", "2", JoinMission(mission="n"), evidence).performatives == [P.AGREE, P.INFORM]
    three.freeze("0")
    over = three.asked("cc", "2", TaskOver(task="n"))
    assert over.performatives[-1] is P.INFORM
    assert obeys(three, "2") == ""
    three.thaw("0")
    three.run(0.3)
    again = three.shown("0", "2", JoinMission(mission="n"), evidence)
    assert (again.performatives, again.contents[0].code) == ([P.REFUSE], "cancelled")  # type: ignore[union-attr]
    assert three.asked("cc", "2", permit).performatives[-1] is P.INFORM
    assert three.shown("0", "2", JoinMission(mission="n"), evidence).performatives == [P.AGREE, P.INFORM]


def test_only_a_command_centre_ends_it_so(three: Box) -> None:
    assert join(three, "0", "2") == [P.AGREE, P.INFORM]
    assert three.asked("1", "2", TaskOver(task="m")).performatives == [P.REFUSE]
    assert obeys(three, "2") == "0"


def test_a_command_centre_ends_a_division_at_each_platform(three: Box) -> None:
    asked = three.asked("cc", "0", DivideArea(area=AREA))
    three.run(2.0)
    assert asked.conversation in three.platform("1").part(AreaAssignment).known
    for unit in "012":
        assert three.asked("cc", unit, TaskOver(task=asked.conversation)).performatives[-1] is P.INFORM
    three.run(5.0)
    for unit in "012":
        assert three.platform(unit).part(AreaAssignment).known == {}
