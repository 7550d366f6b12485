"""Which platforms take part in a task other than its delegate: they alone may report of it to its delegator.

Monitors and divisions are of all platforms, which succeed each other; a mission is of those that its permits name. Any
other request is between two.
"""

from collections.abc import Callable
from typing import Final

from dyknow.federation.messages.contents import Content, DivideArea, FlyMission, MonitorProximity, PermitMission, When

MOST: Final = 64
"""Missions whose permits are known."""
OF_ALL: Final = frozenset({MonitorProximity.head, DivideArea.head})


class Participants:
    """Of the tasks of one delegator; `is_platform` says of a unit whether it is one, by the roster if there is one."""

    def __init__(self, is_platform: Callable[[str], bool]) -> None:
        self._is_platform = is_platform
        self._permitted: dict[str, frozenset[str]] = {}

    def permit(self, content: Content | None) -> None:
        """Note which platforms a permit names, if it is one."""
        if isinstance(content, PermitMission):
            named = {*content.leaders, *content.vehicles}
            self._permitted[content.mission] = self._permitted.pop(content.mission, frozenset()) | named
            if len(self._permitted) > MOST:
                del self._permitted[next(iter(self._permitted))]

    def includes(self, unit: str, task: Content | None) -> bool:
        """Whether a platform that is not the delegate takes part in a task."""
        if isinstance(task, FlyMission):
            return unit in self._permitted.get(task.mission, ())
        head = task.do.head if isinstance(task, When) else None if task is None else task.head
        return head in OF_ALL and self._is_platform(unit)
