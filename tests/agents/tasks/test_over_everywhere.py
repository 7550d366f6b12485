"""A task that its delegator has ended is begun again nowhere, though its delegate has the evidence."""

import pytest

from dyknow.federation.messages.contents import CreateMonitor, MonitorProximity
from tests.agents.rosters import trust
from tests.box import Box, Vehicle


@pytest.mark.parametrize("name", ["proximity", "proximity-warn"])
def test_the_delegate_of_a_task_that_is_over_begins_it_at_no_platform(wire: Box, name: str) -> None:
    for unit in "012":
        wire.join(unit, Vehicle(north_m=1000.0 * int(unit)), trust=trust(unit))
    wire.centre("cc", trust=trust("cc"))
    wire.run(1.0)
    task = wire.asked("cc", "2", MonitorProximity())
    wire.run(2.0)
    evidence = wire.evidence(task.conversation)
    assert wire.platform("1").built.monitors.named
    wire.cancel("cc", "2", task.conversation)
    wire.run(1.0)
    centre = wire.nodes["cc"].process
    for effect in centre.over(task.conversation, wire.now_us):  # type: ignore[union-attr]
        wire.wire.perform("cc", effect)
    wire.run(1.0)
    again = CreateMonitor(name=name, task=task.conversation, coordinator="2", generation=1)
    refused = wire.shown("2", "1", again, evidence)
    wire.run(5.0)
    assert "cancelled" in refused.reason
    assert not wire.platform("1").built.monitors.named
