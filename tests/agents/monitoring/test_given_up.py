"""A leader that gives up a question, since its answer is lost, has not cancelled the task: another may lead it on."""

import pytest

from dyknow.agents.monitoring.coordination import Coordination
from dyknow.federation import keys
from dyknow.federation.messages.acts import Performative
from dyknow.federation.messages.contents import MonitorProximity, TaskList, Tasks
from dyknow.federation.transport import Put
from tests.box import Box, Question, Vehicle


@pytest.fixture
def task(wire: Box) -> Question:
    """Platforms 0, 1, 2 and a task that 0 leads; nothing that 2 says to 0 arrives, but its heartbeat."""
    for unit in "01":
        wire.join(unit, Vehicle(north_m=1000.0 * int(unit)))
    wire.centre()
    wire.run(1.0)
    asked = wire.asked("cc", "0", MonitorProximity())
    wire.run(1.5)

    def is_lost(sender: str, receiver: str, put: Put) -> bool:
        return (sender, receiver) == ("2", "0") and isinstance(keys.parse_key(put.key), keys.ActKey)

    wire.wire.drop = is_lost
    wire.join("2", Vehicle(north_m=2000.0))
    wire.run(0.5)
    assert follows(wire, "2") == "0"
    return asked


def follows(wire: Box, unit: str) -> str | None:
    return next((led.leader for led in wire.platform(unit).built.tasks.coordinated.values()), None)


def given_up(wire: Box) -> None:
    """Until 0 has told 2 that it does not wait any more for the answers to its questions."""
    before = len(cancels(wire))
    while len(cancels(wire)) == before:
        wire.run(0.1)
    wire.run(0.1)


def cancels(wire: Box) -> list[str]:
    return [act.conversation_id or "" for act in wire.acts("0", "2") if act.performative is Performative.CANCEL]


def led_on_by_another(wire: Box) -> None:
    wire.wire.drop = lambda _sender, _receiver, _put: False
    wire.kill("0")
    wire.run(8.0)
    assert (follows(wire, "1"), follows(wire, "2")) == ("1", "1")
    for unit, other in ("12", "21"):
        assert {n.instances[other].monitor.inputs for n in wire.platform(unit).built.monitors.named.values()} == {
            "fresh"
        }
    (listed,) = wire.asked("cc", "1", Tasks(), Performative.QUERY_REF).contents
    assert isinstance(listed, TaskList)
    assert ("monitor-proximity", "running") in {(each.task, each.state) for each in listed.tasks}


def test_what_a_dead_leader_had_given_up_another_asks_for_again(wire: Box, task: Question) -> None:
    given_up(wire)
    led_on_by_another(wire)


def test_what_a_leader_gave_up_and_asked_for_anew_another_takes_over(wire: Box, task: Question) -> None:
    given_up(wire)
    while follows(wire, "2") is None:
        wire.run(0.1)
    led_on_by_another(wire)


def test_a_part_that_ends_before_it_is_asked_for_anew_can_be_led_by_another(wire: Box, task: Question) -> None:
    wire.wire.drop = lambda _sender, _receiver, _put: False
    wire.run(4.0)
    leader = wire.platform("0").part(Coordination)
    wire.wire.drop = lambda sender, receiver, put: (
        (sender, receiver) == ("0", "2") and "create-monitor" in str(put.payload)
    )
    leader._ask_again(wire.platform("0").built.tasks.coordinated[task.conversation], "2", wire.now_us)
    wire.settle("0")
    wire.run(0.1)
    assert follows(wire, "2") is None, "the cancel overtook the question"
    wire.wire.drop = lambda _sender, _receiver, _put: False
    wire.run(1.0)
    assert follows(wire, "2") == "0"
    led_on_by_another(wire)
