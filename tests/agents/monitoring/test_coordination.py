"""The Monitor Coordination Agent when things go wrong: refusals, freezes, deaths, cuts, and more than one task."""

import pytest

from dyknow.agents.monitoring.alarm_log import AlarmLog
from dyknow.agents.monitoring.coordination import Coordination
from dyknow.agents.tasks.life import SUCCESSOR_STEP_US
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import (
    Alarm,
    CreateMonitor,
    CreateMulticast,
    Done,
    MonitorProximity,
    Progress,
    Reason,
    TaskList,
    Tasks,
)
from dyknow.federation.messages.dialogue import Dialogue
from tests.box import EPOCH, Box, Question, Vehicle

P = Performative
BOTH = {"proximity", "proximity-warn"}


@pytest.fixture
def three(wire: Box) -> Box:
    """Platforms 0, 1, 2, a kilometre apart, and a command centre."""
    for unit in "012":
        wire.join(unit, Vehicle(north_m=1000.0 * int(unit)))
    wire.centre()
    wire.run(1.0)
    return wire


def delegated(wire: Box, to: str = "0", by: str = "cc", **asked: object) -> Question:
    question = wire.asked(by, to, MonitorProximity(**asked))  # type: ignore[arg-type]
    wire.run(1.5)
    return question


def shown(wire: Box, unit: str) -> dict[tuple[str, str], str]:
    """(monitor, member) -> state of its inputs."""
    return {
        (name, member): instance.monitor.inputs
        for name, named in wire.platform(unit).built.monitors.named.items()
        for member, instance in named.instances.items()
    }


def all_fresh(wire: Box, *units: str) -> bool:
    pairs = [{(name, other) for name in BOTH for other in units if other != unit} for unit in units]
    return all(
        {key for key, inputs in shown(wire, unit).items() if inputs == "fresh"} >= wanted
        for unit, wanted in zip(units, pairs, strict=True)
    )


def leaders(wire: Box) -> dict[str, str]:
    return {u: led.leader for u, p in wire.platforms.items() for led in p.built.tasks.coordinated.values()}


def nothing_left(wire: Box) -> bool:
    return all(
        p.built.monitors.named == {}
        and p.built.tasks.all() == []
        and p.built.gateway.exporter.exports.streams() == []
        and p.built.tasks.coordinated == {}
        for p in wire.platforms.values()
    )


def cancelled(wire: Box, question: Question, at: str, by: str = "cc") -> list[Performative]:
    """Cancel a task as a command centre that did not delegate it does; the answers."""
    before = len(wire.acts(at, by))
    wire.cancel_task(by, at, question.conversation)
    wire.run(2.0)
    answers = [said for said in wire.acts(at, by)[before:] if said.conversation_id == question.conversation]
    return [said.performative for said in answers]


def test_a_second_task_with_another_period_is_refused_and_sets_nothing_up(three: Box) -> None:
    first = delegated(three)
    three.run(1.0)
    exports = three.platform("0").built.gateway.exporter.exports.streams()
    for to in "01":
        second = three.asked("cc", to, MonitorProximity(sample_period_s=1.0))
        three.run(1.0)
        assert second.performatives == [P.REFUSE]
        assert second.reason == "proximity is monitored here already, as sample every 100ms, max delay 500ms"
    of_centre = [task.conversation for task in three.platform("0").built.tasks.all() if task.initiator == "cc"]
    assert of_centre == [first.conversation]
    assert three.platform("0").built.gateway.exporter.exports.streams() == exports
    assert all_fresh(three, "0", "1", "2")


def test_of_two_monitors_that_are_asked_for_together_none_stays_if_one_is_refused(three: Box) -> None:
    own = three.asked("cc", "0", CreateMonitor(name="proximity-warn", sample_period_s=0.5))
    assert own.performatives == [P.AGREE, P.INFORM]
    second = three.asked("cc", "0", MonitorProximity())
    assert second.performatives == [P.REFUSE]
    assert set(three.platform("0").built.monitors.named) == {"proximity-warn"}
    assert three.platform("0").built.tasks.coordinated == {}


def test_a_participant_that_monitors_otherwise_refuses_its_part_and_the_others_go_on(three: Box) -> None:
    three.asked("cc", "1", CreateMonitor(name="proximity", sample_period_s=0.5))
    task = delegated(three)
    steps = [c.step for c in task.contents if isinstance(c, Progress) and "refused" in c.step]
    assert steps == [
        "monitor proximity: refused, proximity is monitored here already, as sample every 500ms, max delay 500ms"
    ]
    assert shown(three, "2")["proximity", "0"] == "fresh"
    assert three.platform("1").built.tasks.coordinated[task.conversation].plans[0].name == "proximity-warn"
    three.cancel("cc", "0", task.conversation)
    three.run(1.5)
    assert set(three.platform("1").built.monitors.named) == {"proximity"}, "what another asked for stays"


@pytest.mark.parametrize(
    ("asked", "why"),
    [
        (MonitorProximity(profile="nonsense"), "no monitor is called 'nonsense' here"),
        (MonitorProximity(sample_period_s=0.001), "expected a multiple of 100ms"),
        (MonitorProximity(sample_period_s=0.15), "expected a multiple of 100ms"),
        (MonitorProximity(delay_s=3600.0), "expected at most 1min, got 1h"),
        (CreateMonitor(name="proximity", profile="proximity-warn"), "by its name alone"),
        (CreateMonitor(name="proximity", task="t-1", coordinator="2"), "set up by the coordinator 2, not cc"),
    ],
)
def test_what_cannot_be_monitored_is_refused_with_its_reason(three: Box, asked: MonitorProximity, why: str) -> None:
    question = three.asked("cc", "0", asked)
    assert question.performatives == [P.REFUSE]
    assert why in question.reason
    assert nothing_left(three)


def test_two_tasks_share_a_monitor_and_the_one_that_ends_leaves_it_to_the_other(three: Box) -> None:
    three.centre("cc-2")
    three.run(1.0)
    first, second = delegated(three), delegated(three, to="1", by="cc-2")
    assert {t.name for p in "01" for t in three.platform(p).built.tasks.all() if not t.is_part} == {"monitor-proximity"}
    for unit in "012":
        assert three.platform(unit).built.monitors.named["proximity"].owners == {
            first.conversation,
            second.conversation,
        }
    three.cancel("cc", "0", first.conversation)
    three.run(3.0)
    assert first.performatives[-1] is P.INFORM
    assert isinstance(first.contents[-1], Done)
    assert all_fresh(three, "0", "1", "2"), "and no stream was missed for longer than a monitor bears"
    assert leaders(three) == {"0": "1", "1": "1", "2": "1"}
    three.cancel("cc-2", "1", second.conversation)
    three.run(3.0)
    assert nothing_left(three)


def test_an_alarm_of_a_shared_monitor_is_told_to_both_who_delegated(wire: Box) -> None:
    wire.join("0", Vehicle(east_m=-100.0, east_m_s=4.0))
    wire.join("1", Vehicle())
    for centre in ("cc", "cc-2"):
        wire.centre(centre)
    wire.run(1.0)
    tasks = [delegated(wire, avoidance=False), delegated(wire, to="1", by="cc-2", avoidance=False)]
    wire.run(20.0)
    for task in tasks:
        told = {(c.monitor, c.event, c.by) for c in task.contents if isinstance(c, Alarm)}
        assert {(name, "opened", by) for name in BOTH for by in "01"} <= told
    assert len({c.id for c in tasks[0].contents if isinstance(c, Alarm)}) == 4, "each once, under an id of its own"


def test_another_command_centre_than_the_delegator_can_cancel_and_the_delegator_is_told(three: Box) -> None:
    task = delegated(three)
    three.centre("cc-2")
    three.run(1.0)
    assert cancelled(three, task, "0", by="cc-2") == [P.INFORM]
    assert task.performatives[-1] is P.FAILURE
    assert task.reason == "cancelled by cc-2"
    assert nothing_left(three)
    assert three.platform("0").ports.agent.conversations.conversations() == []
    assert three.member("cc").acts.conversations.conversations() == []


def test_cancelling_twice_is_harmless_and_nothing_is_a_failure(three: Box) -> None:
    task = delegated(three)
    three.cancel("cc", "0", task.conversation)
    three.run(1.0)
    three.centre("cc-2")
    three.run(1.0)
    assert cancelled(three, task, "0", by="cc-2") == [P.INFORM]
    assert cancelled(three, Question(Dialogue("0", "cc-1-99")), "0", by="cc-2") == [P.FAILURE]


def test_a_participant_says_where_the_task_is_cancelled(three: Box) -> None:
    task = delegated(three)
    three.centre("cc-2")
    three.run(1.0)
    assert cancelled(three, task, "1", by="cc-2") == [P.REFUSE]
    assert "coordinated by 0 now: cancel it there" in str(three.acts("1", "cc-2")[-1].content)
    assert all_fresh(three, "0", "1", "2")


@pytest.mark.parametrize("frozen", ["1", "2"])
@pytest.mark.parametrize("seconds", [2.2, 9.0, *(pytest.param(each, marks=pytest.mark.full) for each in (1.5, 3.5))])
def test_a_platform_that_was_frozen_takes_part_again_and_the_task_lives(
    three: Box, frozen: str, seconds: float
) -> None:
    task = delegated(three)
    three.freeze(frozen)
    three.run(seconds)
    three.thaw(frozen)
    three.run(4.0)
    assert leaders(three) == {"0": "0", "1": "0", "2": "0"}
    assert all_fresh(three, "0", "1", "2")
    three.cancel("cc", "0", task.conversation)
    three.run(3.0)
    assert nothing_left(three)


@pytest.mark.parametrize("seconds", [0.5, 1.9, 2.3, 3.0])
def test_a_platform_that_is_frozen_while_it_is_asked_takes_part_later(three: Box, seconds: float) -> None:
    three.freeze("1")
    task = delegated(three)
    three.run(max(0.0, seconds - 1.6))
    three.thaw("1")
    three.run(6.0)
    assert all_fresh(three, "0", "1", "2")
    three.cancel("cc", "0", task.conversation)
    three.run(3.0)
    assert nothing_left(three)


@pytest.mark.parametrize(
    "seconds", [2.7, 6.0, *(pytest.param(each, marks=pytest.mark.full) for each in (1.5, 3.0, 20.0))]
)
def test_a_leader_that_was_frozen_leads_on_or_steps_down_and_nothing_is_left_over(three: Box, seconds: float) -> None:
    task = delegated(three)
    three.freeze("0")
    three.run(seconds)
    three.thaw("0")
    three.run(6.0)
    (leader,) = set(leaders(three).values())
    assert set(leaders(three)) == {"0", "1", "2"}
    assert all_fresh(three, "0", "1", "2")
    assert cancelled(three, task, leader) == [P.INFORM]
    three.run(3.0)
    assert nothing_left(three)


def test_when_the_leader_dies_the_first_of_the_others_leads_on(three: Box) -> None:
    task = delegated(three)
    three.kill("0")
    three.run(0.5 + 0.2 + 2 * SUCCESSOR_STEP_US / 1e6 + 1.0)
    assert leaders(three) == {"1": "1", "2": "1"}
    three.run(7.0)
    assert {key for key, inputs in shown(three, "1").items() if inputs == "fresh"} == {(name, "2") for name in BOTH}
    listed = three.asked("cc", "1", Tasks(), P.QUERY_REF).contents[0]
    assert isinstance(listed, TaskList)
    assert [(t.conversation, t.task, t.delegator) for t in listed.tasks] == [
        (task.conversation, "monitor-proximity", "interface@cc")
    ]
    assert cancelled(three, task, "1") == [P.INFORM]
    assert nothing_left(three)


def test_alarms_are_raised_by_a_task_that_is_led_by_an_heir(wire: Box) -> None:
    wire.join("0", Vehicle(north_m=5000.0))
    wire.join("1", Vehicle(east_m=-60.0, east_m_s=3.0))
    wire.join("2", Vehicle())
    wire.centre()
    wire.run(1.0)
    delegated(wire, profile="proximity")
    wire.kill("0")
    wire.run(20.0)
    for unit, other in (("1", "2"), ("2", "1")):
        events = [e for e in wire.platform(unit).part(AlarmLog).events if e.monitor == "proximity"]
        assert (events[0].event, events[0].units) == ("opened", (unit, other))
        assert (events[0].valid_us - EPOCH) // 1_000_000 == 15
    assert wire.acts("2", "1", "alarm"), "the participant tells its new leader"


def test_newcomers_are_taken_in_by_the_heir(three: Box) -> None:
    delegated(three)
    three.kill("0")
    three.run(4.0)
    three.join("3")
    three.run(2.5)
    assert all_fresh(three, "1", "2", "3")
    assert leaders(three) == {"1": "1", "2": "1", "3": "1"}


def test_a_leader_that_was_restarted_knows_nothing_and_is_not_taken_for_the_one_that_led(three: Box) -> None:
    task = delegated(three)
    three.kill("0")
    three.run(0.1)
    three.join("0")
    three.run(6.0)
    assert leaders(three) == {"0": "1", "1": "1", "2": "1"}
    assert all_fresh(three, "0", "1", "2")
    assert cancelled(three, task, "1") == [P.INFORM]
    three.run(1.0)
    assert nothing_left(three)


def test_after_a_partition_one_leader_stays_and_cancel_leaves_nothing(wire: Box) -> None:
    for unit in "0123":
        wire.join(unit)
    wire.centre()
    wire.run(1.0)
    task = delegated(wire)
    wire.cut(["0", "3", "cc"], ["1", "2"])
    wire.run(15.0)
    assert leaders(wire) == {"0": "0", "3": "0", "1": "1", "2": "1"}
    wire.wire.mend_all()
    wire.run(8.0)
    assert set(leaders(wire).values()) == {"0"}, "the platform it was delegated to"
    assert all_fresh(wire, "0", "1", "2", "3")
    assert cancelled(wire, task, "0") == [P.INFORM]
    wire.run(3.0)
    assert nothing_left(wire)


def test_a_task_that_was_cancelled_during_a_partition_is_not_brought_back(wire: Box) -> None:
    for unit in "0123":
        wire.join(unit)
    wire.centre()
    wire.run(1.0)
    task = delegated(wire)
    wire.cut(["0", "3", "cc"], ["1", "2"])
    wire.run(10.0)
    wire.cancel("cc", "0", task.conversation)
    wire.run(3.0)
    wire.wire.mend_all()
    wire.run(8.0)
    assert nothing_left(wire)


def test_only_alarms_of_its_own_does_a_participant_tell(three: Box) -> None:
    task = delegated(three)
    forged = Alarm(
        id="proximity/2/2-1/1", event="opened", monitor="proximity", by="2", units=("2", "1"), valid_us=1, detected_us=2
    )
    three.platform("1").ports.agent.tell("0", forged, three.now_us, conversation=task.conversation)
    three.settle("1")
    three.run(0.5)
    assert not any(isinstance(content, Alarm) for content in task.contents)
    assert three.platform("0").ports.agent.audit_log.refused["refused"] == 1


def test_nobody_is_deposed_by_a_leader_that_is_not_there(three: Box, monkeypatch: pytest.MonkeyPatch) -> None:
    task = delegated(three)
    coordination = three.platform("0").part(Coordination)
    reason = Reason(text="the task has another leader", code="led-by", leader="7", generation=9)
    coordination._declined(
        three.platform("0").built.tasks.coordinated[task.conversation], "1", "monitor", reason, three.now_us
    )
    assert leaders(three)["0"] == "0"
    three.settle("0")


@pytest.mark.parametrize("text", ["coordinated by 1 in generation 9", "cancelled: the task was cancelled here"])
def test_the_words_of_a_refusal_steer_nothing(three: Box, text: str) -> None:
    task = delegated(three)
    coordination = three.platform("0").part(Coordination)
    coordination._declined(
        three.platform("0").built.tasks.coordinated[task.conversation], "1", "monitor", Reason(text=text), three.now_us
    )
    assert leaders(three) == {"0": "0", "1": "0", "2": "0"}
    three.settle("0")
    three.run(1.0)
    assert all_fresh(three, "0", "1", "2")


@pytest.mark.parametrize("count", [8, pytest.param(16, marks=pytest.mark.full)])
def test_many_platforms_set_a_task_up_without_meeting_a_limit(wire: Box, count: int) -> None:
    for at in range(count):
        wire.join(str(at), Vehicle(north_m=300.0 * at))
    centre = wire.centre()
    wire.run(1.5)
    task = delegated(wire)
    wire.run(3.0)
    units = [str(at) for at in range(count)]
    assert all_fresh(wire, *units)
    assert [wire.platform(unit).ports.agent.audit_log.refused for unit in units] == [{}] * count
    assert not centre.refused
    wire.cancel("cc", "0", task.conversation)
    wire.run(3.0)
    assert nothing_left(wire)
    assert [wire.platform(unit).ports.agent.audit_log.refused for unit in units] == [{}] * count
    assert not centre.refused


def test_a_multicast_and_a_monitor_asked_for_by_hand_live_until_they_are_cancelled(three: Box) -> None:
    stream = three.asked(
        "cc",
        "1",
        CreateMulticast(semantic_labels=("heli-position",), sample_period_s=1.0, delay_s=1.0, to_units=("0",)),
    )
    monitor = three.asked("cc", "0", CreateMonitor(name="proximity"))
    three.run(2.0)
    assert [t.name for t in three.platform("0").built.tasks.all()] == ["create-monitor"]
    three.cancel("cc", "1", stream.conversation)
    three.cancel("cc", "0", monitor.conversation)
    three.run(2.0)
    assert nothing_left(three)
