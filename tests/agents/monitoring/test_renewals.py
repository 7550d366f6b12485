"""A coordinator requests everything anew when another platform claims its task or gives it back: not at each such word."""

import pytest

from dyknow.agents.monitoring.coordination import RENEW_US
from dyknow.federation.messages.contents import CreateMonitor, HandOver, MonitorProximity
from tests.agents.rosters import trust
from tests.box import Box, Vehicle

LASTS_S = 30.0


@pytest.mark.parametrize("how", ["hand-over", "claim"])
def test_a_participant_that_gives_the_task_back_again_and_again_has_it_renewed_seldom(how: str) -> None:
    wire = Box(1)
    for unit in "012":
        wire.join(unit, Vehicle(north_m=3000.0 * int(unit)), trust=trust(unit), control=True)
    wire.centre("cc", trust=trust("cc"))
    wire.run(2)
    task = wire.asked("cc", "0", MonitorProximity()).conversation
    wire.run(3)
    before = len(wire.acts("0", "2", CreateMonitor.head))
    boot = wire.member("0").boot
    evidence = b"" if how == "hand-over" else wire.evidence(task)
    for _ in range(int(LASTS_S / 0.5)):
        if how == "hand-over":
            said = HandOver(task=task, coordinator="0", boot=boot, generation=1)
            wire.speak("1", lambda member, now_us, said=said: member.acts.tell("0", said, now_us))
            wire.run(0.5)
        else:
            wire.shown("1", "0", CreateMonitor(name="proximity", task=task, coordinator="1", generation=2), evidence)
            wire.run(0.4)
    asked = len(wire.acts("0", "2", CreateMonitor.head)) - before
    assert 2 <= asked <= 2 * (2 + LASTS_S * 1e6 / RENEW_US), "two monitors each time"
    assert task in wire.platform("2").built.tasks.coordinated
