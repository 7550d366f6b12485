import pytest

from dyknow.agents.platform import Platform
from dyknow.agents.tasks.authority import TaskEvidence
from dyknow.agents.tasks.life import TOMBSTONES
from dyknow.agents.tasks.task import Claim, Task
from dyknow.federation.messages.contents import MonitorProximity
from dyknow.model.errors import Refused
from tests.box import Box

TASK = "cc-1-1.1"


def test_a_life_of_tasks_remembers_whose_task_ended_and_forgets_in_the_end(wire: Box, node: Platform) -> None:
    life, ended = node.built.tasks, []
    evidence = TaskEvidence(TASK, "cc", "1", MonitorProximity(), wire.now_us)

    def take_down(now_us: int) -> tuple[str, ...]:
        ended.append(now_us)
        return ("larger",)

    life.add(Task(TASK, "1", "create-monitor", take_down))
    assert life.cancel(TASK, 5) == ("larger",)
    assert life.cancel(TASK, 6) == (), "cancelling twice is harmless"
    assert life.cancel("d", 7) is None
    assert ended == [5]
    with pytest.raises(Refused, match="cancelled") as refused:
        life.check_claim(Claim(evidence, "2", 0, 2), wire.now_us)
    assert refused.value.code == "cancelled"
    life.check_claim(Claim(evidence, "1", 0, 1), wire.now_us)  # it ended on its behalf, so it may set it up again
    for at in range(TOMBSTONES):
        life.set_tombstone(f"t{at}", "1")
    with pytest.raises(Refused, match="only when 0 is gone"):
        life.check_claim(Claim(evidence, "2", 0, 2), wire.now_us)
