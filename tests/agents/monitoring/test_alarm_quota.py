"""Alarms that a participant makes up: a limited number reaches the delegator, which hears how many did not."""

from random import Random

import pytest

from dyknow.agents.monitoring.reported_alarms import BURST, ReportedAlarms
from dyknow.federation.messages.contents import Alarm, MonitorProximity, Progress
from tests.agents.rosters import trust
from tests.box import Box, Vehicle


def alarm(number: int, event: str = "opened", monitor: str = "proximity") -> Alarm:
    return Alarm(
        id=f"x/{number}", event=event, monitor=monitor, by="2", units=("2", "0"), valid_us=number, detected_us=number + 1
    )  # fmt: skip


def test_sixty_alarms_in_three_seconds_become_few_rows_and_a_count() -> None:
    wire = Box(1)
    for unit in ("0", "1", "2"):
        wire.join(unit, Vehicle(east_m=500.0 * int(unit)), trust=trust(unit), control=True)
    wire.centre("cc", trust=trust("cc"))
    wire.run(2)
    task = wire.asked("cc", "0", MonitorProximity())
    wire.run(3)
    before = len(task.contents)
    for number in range(60):
        wire.speak(
            "2",
            lambda member, now_us, n=number: member.acts.tell("0", alarm(n), now_us, conversation=task.conversation),
        )
        wire.run(0.055)
    wire.run(8)
    told = task.contents[before:]
    alarms = [content for content in told if isinstance(content, Alarm) and not content.unseen_by]
    assert BURST <= len(alarms) <= BURST + 2
    assert sum(isinstance(content, Alarm) for content in told) == 2 * len(alarms), "each is marked as unseen by 0"
    texts = [content.step for content in told if isinstance(content, Progress)]
    assert sum(int(text.split()[0]) for text in texts if "left out" in text) == 60 - len(alarms)
    for number in range(60):
        wire.speak(
            "2", lambda member, now_us, n=number: member.acts.tell("0", alarm(n, "closed"), now_us, conversation=task.conversation)
        )  # fmt: skip
        wire.run(0.055)
    closed = {content.id for content in task.contents if isinstance(content, Alarm) and content.event == "closed"}
    assert closed >= {content.id for content in alarms}, "what was opened is closed"


@pytest.mark.parametrize("seed", range(3))
def test_what_is_remembered_of_alarms_is_bounded_and_nothing_is_lost_in_silence(seed: int) -> None:
    random, reported, now_us = Random(seed), ReportedAlarms(), 0
    passed = left_out = asked = 0
    for _ in range(4000):
        now_us += random.randrange(200_000)
        one = alarm(random.randrange(300), random.choice(["opened", "closed"]), random.choice("ab"))
        asked += 1
        if reported.admits("t", one, now_us):
            passed += 1
            reported.report("t", one, now_us)
        left_out += sum(out.number for out in reported.left_out(now_us))
        reported.unconfirmed(now_us)
        assert max(map(len, (reported._passed, reported._open, reported._waiting, reported._left_out))) <= 512
    left_out += sum(out.number for out in reported.left_out(now_us + 10**9))
    assert passed + left_out == asked
