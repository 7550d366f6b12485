"""Lasting tasks a platform accepted: what each is, who asked for it, and how to take it down again."""

from collections.abc import Callable
from dataclasses import dataclass

from dyknow.errors import ContentError, Refused

TOMBSTONES = 1000


@dataclass(slots=True)
class Task:
    """One accepted request that lives until it is cancelled.

    Attributes:
        conversation: the conversation in which it was asked for, and in which `cancel` ends it.
        initiator: the unit that asked.
        name: the head of the request, e.g. `monitor-proximity`.
        state: what a person sees: `running`, `led by 1`, ...
        is_part: whether it belongs to a larger task, which people see and cancel.
        streams: how many streams it has this platform export.
        take_down: undoes everything the task set up; told the time (node clock).
    """

    conversation: str
    initiator: str
    name: str
    take_down: Callable[[int], None]
    state: str = "running"
    since_us: int = 0
    is_part: bool = False
    streams: int = 0


class TaskBook:
    """The tasks of one platform by conversation, and which of the last ones were cancelled."""

    def __init__(self) -> None:
        self._tasks: dict[str, Task] = {}
        self._ended: dict[str, str] = {}

    def check_free(self, conversation: str | None) -> str:
        """A lasting task needs a conversation of its own, in which it can be cancelled; returns it.

        Raises:
            ContentError: there is none.
            Refused: it is that of another task.
        """
        if not conversation:
            raise ContentError("what lasts needs a :conversation-id, in which it can be cancelled")
        if conversation in self._tasks:
            raise Refused(f"conversation {conversation} is about another task; open one of your own")
        return conversation

    def add(self, task: Task) -> None:
        self._tasks[task.conversation] = task

    def get(self, conversation: str) -> Task | None:
        return self._tasks.get(conversation)

    def all(self) -> list[Task]:
        return list(self._tasks.values())

    def of(self, initiator: str) -> list[Task]:
        """The tasks `initiator` asked for."""
        return [task for task in self._tasks.values() if task.initiator == initiator]

    def cancel(self, conversation: str, now_us: int) -> bool:
        """Take the task down; whether there was one. Cancelling twice is harmless."""
        task = self._tasks.pop(conversation, None)
        if task is None:
            return conversation in self._ended
        self.bury(conversation, task.initiator)
        task.take_down(now_us)
        return True

    def forget(self, conversation: str) -> None:
        """The task is over, or passed to somebody else: drop it without taking anything down."""
        self._tasks.pop(conversation, None)

    def bury(self, name: str, by: str) -> None:
        """Remember that what went by `name` ended, and whose it was, so that nobody else sets it up again."""
        self._ended[name] = by
        if len(self._ended) > TOMBSTONES:
            del self._ended[next(iter(self._ended))]

    def revive(self, name: str) -> None:
        """What went by `name` is set up anew by who ended it: from now on others may do so, too."""
        self._ended.pop(name, None)

    def was_cancelled(self, name: str, asker: str) -> bool:
        """Whether what goes by `name` ended here, on behalf of another than `asker`, who may set up anew what was its."""
        return self._ended.get(name, asker) != asker
