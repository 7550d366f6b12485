"""Parts of tasks whose asker is out of sight: somebody takes them over, their asker asks anew, or they end.

An asker that comes back lets go of every conversation it believed lost and asks anew for what it still wants. Until
then streams and monitors go on as they are: a cut costs no sample, and an alarm stays the same alarm.
Times are the node clock.
"""

from typing import TYPE_CHECKING

from agents.tasks import Task
from federation.deadlines import Deadlines
from federation.exports import LINGER_US

if TYPE_CHECKING:
    from agents.platform import Platform

ORPHAN_US = 5_000_000
"""How long a part waits for a new leader, or for its asker to ask anew."""


class Orphans:
    """The parts nobody answers for at the moment, by conversation."""

    def __init__(self, platform: "Platform") -> None:
        self._p = platform
        self._due: Deadlines[str] = Deadlines()
        self._until_us: dict[str, int] = {}

    def on_lost(self, conversation: str, now_us: int) -> None:
        """Who asked for an export is gone: a cut may heal as long as its receivers are waited for."""
        task = self._p.tasks.get(conversation)
        if task is not None and task.is_part and task.name == "create-multicast":
            self._until_us[conversation] = now_us + LINGER_US
            self._due.set(conversation, now_us + ORPHAN_US)

    def on_forgotten(self, task: Task, now_us: int) -> None:
        """Who asked for a task had lost sight of this platform, and is back. What a person asked for goes on."""
        if task.is_part:
            self._until_us.pop(task.conversation, None)
            self._due.set(task.conversation, now_us + ORPHAN_US)

    @property
    def deadline_us(self) -> int | None:
        return self._due.next_us

    def on_time(self, now_us: int) -> None:
        """End what was not taken over. While the asker is away its monitors stay for whoever inherits the task."""
        for conversation in self._due.pop_due(now_us):
            task = self._p.tasks.get(conversation)
            until_us = self._until_us.pop(conversation, now_us)
            if task is None:
                continue
            if not self._p.directory.is_present(task.initiator):
                if task.name == "create-monitor":
                    continue
                if now_us < until_us and not self._p.federation.is_taken_over(conversation):
                    self._due.set(conversation, min(until_us, now_us + ORPHAN_US))
                    self._until_us[conversation] = until_us
                    continue
            self._p.tasks.cancel(conversation, now_us)
