"""A task that ends without a cancel of its delegator is reported to it, whichever platform ended it."""

import pytest

from dyknow.federation.messages.contents import DivideArea, MonitorProximity, Progress
from tests.agents.rosters import trust
from tests.box import Box, Vehicle

AREA = ("58.40 15.60", "58.40 15.61", "58.41 15.61", "58.41 15.60")


def fleet() -> Box:
    wire = Box(1)
    for unit in "012":
        wire.join(unit, Vehicle(north_m=3000.0 * int(unit), altitude_m=100.0), trust=trust(unit), control=True)
    wire.centre("cc", trust=trust("cc"))
    wire.run(2)
    return wire


def end(wire: Box, unit: str, conversation: str) -> None:
    """The platform ends a task that it leads, as one does that turned hostile."""

    def ended(platform, now_us):
        tasks = platform.built.tasks
        assert tasks.cancel(conversation, now_us) is not None

    platform = wire.platform(unit)
    ended(platform, wire.now_us)
    wire.run(0.1)


@pytest.mark.parametrize("content", [MonitorProximity(), DivideArea(area=AREA)], ids=["monitors", "division"])
@pytest.mark.parametrize("by", ["0", "1"])
def test_the_delegator_hears_within_two_seconds_by_whom_its_task_was_ended(content, by):
    wire = fleet()
    asked = wire.asked("cc", "0", content)
    wire.run(3)
    if by == "1":
        wire.kill("0")
        wire.run(8)
    before = len(asked.contents)
    end(wire, by, asked.conversation)
    wire.run(2)
    steps = [each.step for each in asked.contents[before:] if isinstance(each, Progress)]
    assert any(step.endswith(f"ended by {by}") for step in steps), asked.contents


def test_a_cancel_of_the_delegator_is_no_news_for_it():
    wire = fleet()
    asked = wire.asked("cc", "0", MonitorProximity())
    wire.run(3)
    before = len(asked.contents)
    wire.cancel("cc", "0", asked.conversation)
    wire.run(2)
    assert not [each for each in asked.contents[before:] if isinstance(each, Progress)]
