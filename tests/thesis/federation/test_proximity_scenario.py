"""Thesis 9.4: the proximity monitoring scenario, step by step, as figures 9.4 to 9.6 number the steps."""

import pytest

from dyknow.agents.admission.admission import Admission
from dyknow.agents.monitoring.alarm_log import AlarmLog
from dyknow.federation.messages.acts import Act, Performative
from dyknow.federation.messages.contents import (
    AddDeclarations,
    Alarm,
    CreateMonitor,
    CreateMulticast,
    Done,
    MonitorProximity,
    Progress,
    read,
)
from tests.box import EPOCH, Box, Question, Vehicle

P = Performative
THESIS = "(create-multicast semantic-labels: (sequence heli-position heli-altitude) sample-period: 1.0 delay: 1.0 to-units: (sequence 0))"


def scenario(wire: Box, **asked: object) -> Question:
    """Platforms 0 and 1 fly towards each other, and platform 0 is delegated the task."""
    wire.join("0", Vehicle(east_m=-100.0, east_m_s=4.0), control=True)
    wire.join("1", Vehicle(east_m=100.0, east_m_s=-4.0, altitude_m=102.0), control=True)
    wire.centre()
    wire.run(1.0)
    question = wire.question("cc", "0", MonitorProximity(**asked))  # type: ignore[arg-type]
    wire.run(1.5)
    return question


def said(wire: Box, sender: str, receiver: str, head: str) -> list[Act]:
    return wire.acts(sender, receiver, head)


def inputs(wire: Box, unit: str, monitor: str = "proximity") -> dict[str, str]:
    named = wire.platform(unit).built.monitors.named[monitor]
    return {member: instance.monitor.inputs for member, instance in named.instances.items()}


def test_figure_9_4_the_command_centre_delegates_to_platform_0_which_accepts(wire: Box) -> None:
    question = scenario(wire)
    (request,) = said(wire, "cc", "0", "monitor-proximity")
    assert str(request.content) == "(monitor-proximity)"
    assert (request.performative, str(request.receiver)) == (P.REQUEST, "interface@0")
    assert question.performatives[0] is P.AGREE
    assert wire.platform("0").part(Admission).table.of("monitor-proximity", P.REQUEST)[0].agent == "coordination"
    asked = [task for task in wire.platform("0").built.tasks.all() if task.initiator == "cc"]
    assert [task.name for task in asked] == ["monitor-proximity"]


def test_figure_9_5_step_2_platform_0_has_platform_1_multicast_what_the_formula_needs(wire: Box) -> None:
    scenario(wire, profile="proximity-thesis", sample_period_s=1.0, delay_s=1.0)
    (request,) = said(wire, "0", "1", "create-multicast")
    assert str(request.receiver) == "interface@1", "through the Interface Agents"
    assert str(request.content) == THESIS, "the message as the thesis prints it"


def test_figure_9_5_step_3_platform_0_multicasts_its_own_streams_to_platform_1(wire: Box) -> None:
    scenario(wire)
    streams = {
        (stream.label, receivers) for stream, receivers in wire.platform("0").built.gateway.exporter.exports.streams()
    }
    assert streams == {(label, ("1",)) for label in ("heli-position", "heli-altitude", "heli-velocity", "intent")}
    assert {a.performative for a in said(wire, "0", "1", "stream")} == {P.INFORM}


def test_figure_9_5_steps_4_and_6_the_streams_flow_from_instance_to_instance(wire: Box) -> None:
    scenario(wire)
    for unit, other in (("0", "1"), ("1", "0")):
        platform = wire.platform(unit)
        assert {(owner, label) for owner, label, _ in platform.built.gateway.importer.imports.streams} == {
            (other, label) for label in ("heli-position", "heli-altitude", "heli-velocity", "intent")
        }
        newest = platform.built.gateway.latest("heli-position", other)
        assert wire.now_us - newest.valid_us < 300_000


def test_figure_9_6_steps_1_to_3_a_proximity_monitor_is_delegated_to_each_platform_and_to_itself(wire: Box) -> None:
    scenario(wire)
    asked = [read(act.content) for act in said(wire, "0", "1", "create-monitor") if act.content is not None]
    assert [content.name for content in asked if isinstance(content, CreateMonitor)] == ["proximity", "proximity-warn"]
    assert all(content.coordinator == "0" for content in asked if isinstance(content, CreateMonitor))
    for unit in "01":
        assert set(wire.platform(unit).built.monitors.named) == {"proximity", "proximity-warn"}


def test_figure_9_6_steps_4_and_6_each_platform_monitors_itself_against_each_other(wire: Box) -> None:
    scenario(wire)
    assert inputs(wire, "0") == {"1": "fresh"}
    assert inputs(wire, "1") == {"0": "fresh"}


def test_9_4_1_the_delegator_is_told_of_each_step_that_was_set_up(wire: Box) -> None:
    question = scenario(wire)
    steps = [(c.step, c.unit) for c in question.contents if isinstance(c, Progress)]
    assert steps == [
        ("monitors set up", "0"),
        ("export of heli-position, heli-altitude, heli-velocity", "1"),
        ("monitor proximity", "1"),
        ("monitor proximity-warn", "1"),
    ]


def test_9_4_1_a_violation_is_told_to_the_other_platform_and_to_the_command_centre(wire: Box) -> None:
    question = scenario(wire, avoidance=False)
    wire.run(26.0)
    for by, other in (("0", "1"), ("1", "0")):
        told = [read(act.content) for act in said(wire, by, other, "alarm") if act.content is not None]
        assert {(c.monitor, c.event) for c in told if isinstance(c, Alarm)} >= {
            ("proximity", "opened"), ("proximity-warn", "opened"),
        }  # fmt: skip
    heard = {(c.monitor, c.event, c.by) for c in question.contents if isinstance(c, Alarm)}
    assert {(name, "opened", by) for name in ("proximity", "proximity-warn") for by in "01"} <= heard
    assert all(wire.vehicle(unit).commands == [] for unit in "01"), "told not to give way"


def test_9_4_1_a_warning_initiates_a_manoeuvre_that_the_two_agree_on(wire: Box) -> None:
    scenario(wire)
    wire.run(20.0)
    proposals = wire.acts(head="avoid")
    assert proposals
    assert any(
        act.performative is P.AGREE for act in wire.acts() if act.conversation_id == proposals[0].conversation_id
    )
    assert any(wire.vehicle(unit).commands for unit in "01"), "and is flown"
    alarms = {(e.monitor, e.event) for e in wire.platform("0").part(AlarmLog).events}
    assert ("proximity-warn", "opened") in alarms


@pytest.mark.parametrize("options", ["", " with starts avoidance"])
def test_9_4_1_an_alarm_of_any_monitor_initiates_a_manoeuvre_if_it_is_declared_to(wire: Box, options: str) -> None:
    """Not those alone whose profile says so: a formula of one's own, added in KPL to platforms that fly."""
    near = f"monitor near = always forall other in units - {{self}} growing: xy_dist[self, other] >= 90.0{options}"
    for unit, east in (("0", -100.0), ("1", 100.0)):
        vehicle = Vehicle(east_m=east, east_m_s=-east / 25, altitude_m=100.0 + 2 * int(unit))
        wire.join(unit, vehicle, control=True)
    wire.centre()
    wire.run(1.0)
    for unit in "01":
        assert P.INFORM in wire.asked("cc", unit, AddDeclarations(text=near)).performatives
    assert wire.question("cc", "0", MonitorProximity(profile="near")) is not None
    wire.run(20.0)
    assert ("near", "opened") in {(e.monitor, e.event) for e in wire.platform("0").part(AlarmLog).events}
    assert bool(wire.acts(head="avoid")) is bool(options)
    assert any(wire.vehicle(unit).commands for unit in "01") is bool(options)


def test_9_4_1_a_platform_that_registers_later_is_taken_in(wire: Box) -> None:
    scenario(wire)
    wire.join("2", Vehicle(north_m=800.0))
    wire.run(2.0)
    request, *_ = said(wire, "0", "2", "create-multicast")
    content = read(request.content)  # type: ignore[arg-type]
    assert isinstance(content, CreateMulticast)
    assert content.to_units == ("0", "1"), "the newcomer streams to each of the platforms"
    assert len(said(wire, "0", "2", "create-monitor")) == 2
    assert inputs(wire, "2") == {"0": "fresh", "1": "fresh"}
    assert inputs(wire, "0") == {"1": "fresh", "2": "fresh"}
    assert inputs(wire, "1") == {"0": "fresh", "2": "fresh"}


def test_9_4_1_a_platform_that_dies_is_missing_and_one_that_leaves_is_no_member(wire: Box) -> None:
    scenario(wire)
    for unit in "23":
        wire.join(unit, Vehicle(north_m=800.0 * int(unit)))
    wire.run(2.0)
    wire.kill("2")
    wire.leave("3")
    wire.run(4.0)
    assert inputs(wire, "0") == {"1": "fresh", "2": "missing"}
    shown = wire.platform("0").built.monitors.named["proximity"].instances["2"].monitor.shows
    assert shown == "unknown", "never safe"


def test_9_4_2_the_formula_of_the_thesis_is_kept_by_name_and_alarms_as_it_says(wire: Box) -> None:
    """(xy_dist >= 15 and z_dist >= 10) is violated by two at one height, however far apart."""
    scenario(wire, profile="proximity-thesis", avoidance=False)
    wire.run(1.5)
    (opened,) = wire.platform("0").part(AlarmLog).events
    assert (opened.monitor, opened.event, opened.units) == ("proximity-thesis", "opened", ("0", "1"))
    assert opened.values["xy_dist[0, 1]"] > 150.0


def test_9_4_2_the_monitor_opens_at_the_sample_that_shows_the_violation_and_closes_after_it(wire: Box) -> None:
    """They meet at 100 m / 4 m/s = 25 s; within 15 m from 25 s - 15 / 8 s to 25 s + 15 / 8 s."""
    scenario(wire, profile="proximity", avoidance=False)
    wire.run(30.0)
    for unit in "01":
        opened, closed = wire.platform(unit).part(AlarmLog).events
        assert opened.valid_us - EPOCH == pytest.approx(23.1e6, abs=200_000)
        assert closed.valid_us - EPOCH == pytest.approx(27.0e6, abs=300_000)
        assert opened.detected_us - opened.valid_us <= 300_000, "one sample period and 200 ms"
        assert opened.id == closed.id


def test_cancel_takes_down_everything_the_task_set_up(wire: Box) -> None:
    question = scenario(wire)
    wire.join("2", Vehicle(north_m=800.0))
    wire.run(2.0)
    wire.cancel("cc", "0", question.conversation)
    wire.run(2.0)
    assert isinstance(question.contents[-1], Done)
    for unit in "012":
        platform = wire.platform(unit)
        assert platform.built.monitors.named == {}
        assert platform.built.gateway.exporter.exports.streams() == []
        assert platform.built.gateway.importer.imports.streams == {}
        assert platform.built.tasks.all() == []
        assert platform.ports.agent.conversations.conversations() == []
