"""Tasks that ended without their delegator: a warning of every command that shows what is monitored."""

from collections.abc import Sequence

from dyknow.console.command import Call
from dyknow.federation.messages.contents import TaskEntry
from dyknow.model.instants import print_span
from dyknow.runtime.client import Client
from dyknow.runtime.library.jobs import listed_tasks


def warn_of_ended(call: Call, client: Client, units: Sequence[str]) -> None:
    """Name on standard error, task by task, which platform ended it, where and when."""
    by_task: dict[tuple[str, str], list[TaskEntry]] = {}
    for _, task in client.run(listed_tasks(client, units)):
        if task.ended_by is not None:
            by_task.setdefault((task.conversation, task.ended_by), []).append(task)
    for (conversation, by), ended in by_task.items():
        where = ", ".join(sorted({task.unit for task in ended}))
        ago = print_span(max(0, client.now_us() - max(task.since_us or 0 for task in ended)) // 1_000_000 * 1_000_000)
        call.out.note(f"task {conversation} was ended by {by} on {where}, {ago} ago: delegate it again", style="red")
