"""Who coordinates a task: a member with a valid key of its own gets it only by what the others see themselves."""

from hashlib import sha256

import pytest

from dyknow.agents.monitoring.coordination import Coordination
from dyknow.agents.platform import Platform
from dyknow.console.commands.members.delegate import plain
from dyknow.federation.messages.acts import AgentName, Performative
from dyknow.federation.messages.codec import decode_act, encode_act
from dyknow.federation.messages.contents import (
    Alarm,
    CreateMonitor,
    HandOver,
    MonitorProximity,
    Progress,
    Reason,
    TaskList,
    Tasks,
)
from dyknow.federation.security.trust import Role, Roster, RosterMember, Signer, Trust
from tests.box import EPOCH, Box, Question, Vehicle

P = Performative
BOTH = ("proximity", "proximity-warn")
ROLES: dict[str, Role] = {"0": "uav", "1": "uav", "2": "uav", "3": "uav", "cc": "command-centre"}


def seed(unit: str) -> bytes:
    return sha256(unit.encode()).digest()


def trust(unit: str) -> Trust:
    roster = Roster({each: RosterMember(each, Signer(seed(each), "default").public_key, ROLES[each]) for each in ROLES})
    return Trust.of(roster, seed(unit), "default", EPOCH - 1_000_000)


def joined(wire: Box, *units: str) -> None:
    for unit in units:
        wire.join(unit, Vehicle(north_m=1000.0 * int(unit)), trust=trust(unit))


@pytest.fixture
def three(wire: Box) -> Box:
    """Platforms 0, 1, 2 and a command centre of one roster; 2 is the hostile one."""
    joined(wire, "0", "1", "2")
    wire.centre("cc", trust=trust("cc"))
    wire.run(1.0)
    return wire


def delegated(wire: Box) -> Question:
    task = wire.asked("cc", "0", MonitorProximity())
    wire.run(1.5)
    return task


def claimed(
    wire: Box, task: Question, to: str, by: str = "2", evidence: bytes | None = None, **said: object
) -> list[Question]:
    """`by` would coordinate the task at `to`, and shows its evidence; then it cancels what it was given."""
    parts = [CreateMonitor(name=name, task=task.conversation, **said) for name in BOTH]  # type: ignore[arg-type]
    shown = wire.evidence(task.conversation) if evidence is None else evidence
    asked = [wire.shown(by, to, part, shown) for part in parts]
    wire.run(1.0)
    for each in asked:
        wire.cancel(by, to, each.conversation)
    wire.run(2.0)
    return asked


def coordination(wire: Box, unit: str, task: Question) -> tuple[str, int, bool]:
    platform: Platform = wire.platform(unit)
    led = platform.built.tasks.coordinated[task.conversation]
    return led.leader, led.generation, platform.part(Coordination).keeps_apart()


def watched(wire: Box, unit: str) -> set[tuple[str, str, str]]:
    named = wire.platform(unit).built.monitors.named
    return {(name, member, each.monitor.inputs) for name in named for member, each in named[name].instances.items()}


def listed(wire: Box, unit: str) -> list[tuple[str, str | None]]:
    (answer,) = wire.asked("cc", unit, Tasks(), P.QUERY_REF).contents
    assert isinstance(answer, TaskList)
    return [(entry.state, entry.ended_by) for entry in answer.tasks]


@pytest.mark.parametrize("generation", [1, 2**31, pytest.param(10, marks=pytest.mark.full)])
def test_a_coordinator_that_is_here_is_not_deposed(three: Box, generation: int) -> None:
    task = delegated(three)
    said: dict[str, object] = {"generation": generation, "coordinator": "2", "avoidance": False}
    for to, other in (("0", "1"), ("1", "0")):
        before = watched(three, to)
        refused = three.platform(to).ports.agent.audit_log.refused["refused"]
        for question in claimed(three, task, to, **said):
            assert question.performatives == [P.REFUSE]
            (reason,) = question.contents
            assert isinstance(reason, Reason)
            assert (reason.code, reason.leader, reason.generation) == ("led-by", "0", 1)
        assert three.platform(to).ports.agent.audit_log.refused["refused"] == refused + 2
        assert watched(three, to) == before >= {(name, other, "fresh") for name in BOTH}
        assert coordination(three, to, task) == ("0", 1, True)
    assert listed(three, "0") == [("running", None)]


@pytest.mark.parametrize("code", ["led-by", "cancelled"])
def test_no_participant_ends_a_task_by_how_it_refuses_its_part(three: Box, code: str) -> None:
    task = delegated(three)
    led = three.platform("0").built.tasks.coordinated[task.conversation]
    reason = Reason(text="led by 2", code=code, leader="2", generation=7)
    three.platform("0").part(Coordination)._declined(led, "2", "monitor", reason, three.now_us)
    three.settle("0")
    three.run(4.0)
    assert coordination(three, "0", task) == coordination(three, "1", task) == ("0", 1, True)
    assert any("refused, led by 2" in c.step for c in task.contents if isinstance(c, Progress)), (
        "its delegator hears it"
    )


def test_after_a_crash_one_successor_leads_and_lowers_no_avoidance(three: Box) -> None:
    joined(three, "3")
    three.run(1.0)
    task = delegated(three)
    three.kill("0")
    three.run(5.0)
    assert {coordination(three, unit, task) for unit in "123"} == {("1", 2, True)}
    refused = claimed(three, task, "3", generation=3, avoidance=False)
    assert [question.performatives for question in refused] == [[P.REFUSE]] * 2
    three.kill("1")
    three.run(1.5)
    said = CreateMonitor(name="proximity", task=task.conversation, generation=3, avoidance=False)
    early = three.shown("2", "3", said, three.evidence(task.conversation))
    assert early.performatives == [P.AGREE, P.INFORM], "the next in turn, when the one before is gone"
    three.run(5.0)
    assert coordination(three, "3", task) == ("2", 3, True)
    assert {("proximity", "2", "fresh"), ("proximity-warn", "2", "fresh")} <= watched(three, "3")


def test_a_successor_that_ends_the_task_is_named_to_its_delegator_and_in_the_list(three: Box) -> None:
    joined(three, "3")
    three.run(1.0)
    task = delegated(three)
    three.cut("0", "23")
    three.cut("1", "23")  # 2 takes over for itself and 3, which the delegator still sees
    three.run(8.0)
    assert coordination(three, "3", task) == ("2", 2, True)
    three.platform("2").built.tasks.cancel(task.conversation, three.now_us)
    three.settle("2")
    three.run(1.0)
    assert watched(three, "3") == set()
    told = [(c.step, c.unit) for c in task.contents if isinstance(c, Progress)]
    assert ("monitoring ended by 2", "3") in told
    assert listed(three, "3") == [("ended by 2", "2")]
    assert coordination(three, "1", task) == ("0", 1, True)
    three.wire.mend_all()
    three.run(8.0)
    assert coordination(three, "3", task) == ("0", 1, True), "it was not ended for its delegate"
    assert {(name, "0", "fresh") for name in BOTH} <= watched(three, "3")
    assert listed(three, "3") == []


def test_of_two_successors_one_hands_over(three: Box) -> None:
    joined(three, "3")
    three.run(1.0)
    task = delegated(three)
    three.kill("0")
    three.cut("1", "23")
    three.run(8.0)
    assert [coordination(three, unit, task)[:2] for unit in "123"] == [("1", 2), ("2", 2), ("2", 2)]
    three.wire.mend_all()
    three.run(10.0)
    assert {coordination(three, unit, task) for unit in "123"} == {("1", 2, True)}
    assert all((name, other, "fresh") in watched(three, "3") for name in BOTH for other in "12")


def told(wire: Box, task: Question, **said: object) -> list[Alarm]:
    """2 tells 0 of an alarm; what the delegator hears."""
    fields: dict[str, object] = {"monitor": "proximity", "by": "2", "units": ("2", "0"), **said}
    alarm = Alarm(id="x/1", event="opened", valid_us=1, detected_us=2, **fields)  # type: ignore[arg-type]
    wire.platform("2").ports.agent.tell("0", alarm, wire.now_us, conversation=task.conversation)
    wire.settle("2")
    wire.run(0.5)
    return [content for content in task.contents if isinstance(content, Alarm)]


@pytest.mark.parametrize("said", [{"units": ("1", "0")}, {"by": "1"}, {"monitor": "battery"}, {"monitor": "x"}])
def test_an_alarm_counts_only_from_its_monitor_in_the_task_and_about_its_sender(
    three: Box, said: dict[str, object]
) -> None:
    task = delegated(three)
    assert told(three, task, **said) == []
    assert three.platform("0").ports.agent.audit_log.refused["refused"] == 1
    assert "refused" in str([entry.outcome for entry in three.platform("0").ports.agent.audit_log.entries][-5:])


def test_an_alarm_counts_only_from_a_participant(three: Box) -> None:
    task = delegated(three)
    three.platform("0").built.tasks.coordinated[task.conversation].members.pop("2")
    assert told(three, task) == []
    assert three.platform("0").ports.agent.audit_log.refused["refused"] == 1


@pytest.mark.parametrize("other", ["0", "1"])
def test_an_alarm_that_no_other_of_its_units_sees_is_the_word_of_one(three: Box, other: str) -> None:
    task = delegated(three)
    assert [alarm.unseen_by for alarm in told(three, task, units=("2", other))] == [()], "it is passed on at once"
    three.run(1.0)
    first, second = (content for content in task.contents if isinstance(content, Alarm))
    assert second == first.model_copy(update={"unseen_by": (other,)})
    assert plain(second).endswith(f"(reported by 2, not seen by {other})")


def test_an_alarm_that_both_see_is_passed_on_as_it_is(wire: Box) -> None:
    for unit, east_m in (("0", 3000.0), ("1", -60.0), ("2", 0.0)):
        speed_m_s = 3.0 if unit == "1" else 0.0
        wire.join(unit, Vehicle(east_m=east_m, east_m_s=speed_m_s), trust=trust(unit))
    wire.centre("cc", trust=trust("cc"))
    wire.run(1.0)
    task = wire.asked("cc", "0", MonitorProximity(avoidance=False))
    wire.run(30.0)
    alarms = [content for content in task.contents if isinstance(content, Alarm)]
    assert {(alarm.by, alarm.event) for alarm in alarms} >= {("1", "opened"), ("2", "opened"), ("2", "closed")}
    assert {alarm.unseen_by for alarm in alarms} == {()}


def test_only_who_leads_hands_over(three: Box) -> None:
    task = delegated(three)
    said = HandOver(task=task.conversation, coordinator="2", boot=1, generation=2)
    for to in "01":
        three.platform("2").ports.agent.tell(to, said, three.now_us)
        three.settle("2")
        three.run(0.5)
        assert coordination(three, to, task) == ("0", 1, True)
        assert three.platform(to).ports.agent.audit_log.refused["refused"] == 1


def test_a_coordinator_shows_the_act_that_delegated_the_task(three: Box) -> None:
    task, other = delegated(three), three.asked("2", "1", MonitorProximity(avoidance=False))
    joined(three, "3")
    three.run(0.1)
    genuine = three.evidence(task.conversation)
    act = decode_act(genuine)[0]
    forged = encode_act(
        act._replace(sender=AgentName("interface", "cc"), created_us=act.created_us + 1), Signer(seed("2"), "default")
    )
    for shown in (
        b"",
        b"x",
        forged,
        encode_act(act),
        genuine[:-1] + bytes([genuine[-1] ^ 1]),
        three.evidence(other.conversation),
    ):
        for question in claimed(three, task, "3", evidence=shown):
            (reason,) = question.contents
            assert isinstance(reason, Reason)
            assert reason.code == "unproven", reason
    three.run(3.0)
    assert coordination(three, "3", task) == ("0", 1, True)


@pytest.mark.parametrize("generation", [1, 2])
def test_a_task_that_is_claimed_before_it_is_delegated_goes_to_its_delegate(three: Box, generation: int) -> None:
    """Numbers of tasks can be guessed, so a member may speak of one that there is not yet."""
    asked_before = three.asked("cc", "0", Tasks(), P.QUERY_REF)
    three.run(0.2)
    number = asked_before.conversation.rpartition("-")[0]
    claims = [
        three.asked(
            "2", "1",
            CreateMonitor(name=name, task=f"{number}-{at}.0", coordinator="2", generation=generation, avoidance=False),
        )
        for at in range(2, 5)
        for name in BOTH
    ]  # fmt: skip
    three.run(0.5)
    assert [(claim.performatives, claim.contents[0].code) for claim in claims] == [([P.REFUSE], "unproven")] * 6
    task = delegated(three)
    assert task.conversation.startswith(number) and task.conversation.endswith(".0")
    three.run(4.0)
    assert coordination(three, "1", task) == ("0", 1, True)
    assert {(name, "0", "fresh") for name in BOTH} <= watched(three, "1")
