"""stop-multicast and remove-monitor end what create-multicast and create-monitor set up, for whom it belongs to."""

import pytest

from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import (
    CreateMonitor,
    CreateMulticast,
    MonitorProximity,
    Reason,
    RemoveMonitor,
    StopMulticast,
)
from tests.agents.admission.test_hostile import trust
from tests.box import Box, Question, Vehicle

P = Performative
DONE = [P.AGREE, P.INFORM]
BOTH = ("heli-position", "heli-altitude")


@pytest.fixture
def signed(wire: Box) -> Box:
    """0 and 1 are platforms of a roster, cc and eye a command centre and an observer."""
    for unit in "01":
        wire.join(unit, Vehicle(north_m=500.0 * int(unit)), trust=trust(unit))
    for unit in ("cc", "eye"):
        wire.centre(unit, trust=trust(unit))
    wire.run(1.5)
    return wire


def exported(wire: Box) -> dict[str, tuple[str, ...]]:
    exports = wire.platform("0").built.gateway.exporter.exports
    return {stream.label: receivers for stream, receivers in exports.streams()}


def export(wire: Box, by: str, *to: str) -> Question:
    content = CreateMulticast(semantic_labels=BOTH, sample_period_s=0.1, delay_s=0.5, to_units=to)
    question = wire.asked(by, "0", content)
    assert question.performatives == DONE
    return question


def code(question: Question) -> str | None:
    content = question.contents[-1]
    return content.code if isinstance(content, Reason) else None


def test_an_export_ends_label_by_label_and_its_task_with_the_last(signed: Box) -> None:
    task = export(signed, "cc", "1")
    assert signed.asked("cc", "0", StopMulticast(semantic_labels=BOTH[:1])).performatives == DONE
    assert exported(signed) == {"heli-altitude": ("1",)}
    assert [t.conversation for t in signed.platform("0").built.tasks.all()] == [task.conversation]
    assert signed.asked("cc", "0", StopMulticast(semantic_labels=BOTH)).performatives == DONE
    signed.run(0.5)
    assert exported(signed) == {}
    assert signed.platform("0").built.tasks.all() == []
    assert signed.platform("1").built.gateway.importer.imports.streams == {}
    assert (task.performatives[-1], task.reason) == (P.FAILURE, "cancelled by cc")


def test_an_export_ends_for_some_of_its_receivers_or_in_one_conversation(signed: Box) -> None:
    first, second = export(signed, "cc", "1", "cc"), export(signed, "cc", "1")
    stop = StopMulticast(semantic_labels=BOTH, to_units=("cc",), task=first.conversation)
    assert signed.asked("cc", "0", stop).performatives == DONE
    assert set(exported(signed).values()) == {("1",)}
    stop = StopMulticast(semantic_labels=BOTH, task=first.conversation)
    assert signed.asked("cc", "0", stop).performatives == DONE
    assert [t.conversation for t in signed.platform("0").built.tasks.all()] == [second.conversation]


def test_what_another_set_up_only_a_command_centre_ends(signed: Box) -> None:
    export(signed, "cc", "1")
    signed.asked("cc", "0", CreateMonitor(name="proximity"))
    for content in (StopMulticast(semantic_labels=BOTH), RemoveMonitor(name="proximity")):
        refused = signed.asked("1", "0", content)
        assert (refused.performatives, code(refused)) == ([P.REFUSE], "role")
    refused = signed.asked("cc", "0", RemoveMonitor(name="energy"))
    assert (refused.performatives, code(refused)) == ([P.REFUSE], "unknown-task")
    assert len(exported(signed)) == 2


def test_a_monitor_is_removed_and_its_inputs_with_it(signed: Box) -> None:
    monitor = signed.asked("cc", "0", CreateMonitor(name="proximity"))
    signed.run(1.0)
    assert signed.asked("cc", "0", RemoveMonitor(name="proximity")).performatives == DONE
    signed.run(2.0)
    assert signed.platform("0").built.monitors.named == {}
    assert signed.platform("1").built.gateway.exporter.exports.streams() == []
    assert monitor.performatives[-1] is P.FAILURE


def test_the_part_of_a_task_is_ended_with_its_task(signed: Box) -> None:
    task = signed.asked("cc", "0", MonitorProximity())
    signed.run(1.0)
    refused = signed.asked("cc", "1", RemoveMonitor(name="proximity"))
    assert (refused.performatives, code(refused)) == ([P.REFUSE], "role")
    assert "cancel the task" in refused.reason
    signed.cancel("cc", "0", task.conversation)
    signed.run(2.0)
    assert signed.platform("1").built.monitors.named == {}
