"""Revocation of a member ends the tasks that it delegated, and those that others lead by its permits or evidence.

Evidence of its acts is refused from then on, though it was verified before. Each platform reads the roster itself, and ends
its own part of those tasks. A task that another has delegated to a revoked platform passes to the next in succession. Times are the node clock.
"""

from collections.abc import Callable

from dyknow.agents.tasks.authority import Authority
from dyknow.agents.tasks.life import TaskLife


def end_revoked(
    unit: str, is_revoked: Callable[[str], bool], authority: Authority, tasks: TaskLife, now_us: int
) -> None:
    """A member, with its commands, is revoked: end its permits, missions, divisions, pieces, monitors and other tasks."""
    ended = dict.fromkeys(authority.end_of(is_revoked, now_us))
    for task in tasks.all():
        if not task.is_part and is_revoked(task.initiator) and tasks.get(task.conversation) is task:
            tasks.end(task, "the revocation of its delegator", now_us)
            ended[task.conversation] = None
    for report in authority.on_revoked if ended else ():
        report(unit, tuple(ended), now_us)
