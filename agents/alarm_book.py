"""The alarms of a platform: the last thousand, and who wants to hear of them."""

from collections import deque
from collections.abc import Callable
from typing import TypeAlias

from reasoning import AlarmEvent

KEPT = 1000
Subscriber: TypeAlias = tuple[str, str]
"""A unit, and the conversation in which it subscribed."""


class AlarmBook:
    """Alarm events as the platform's monitors raise them."""

    def __init__(self) -> None:
        self.events: deque[AlarmEvent] = deque(maxlen=KEPT)
        self.listeners: dict[Subscriber, Callable[[AlarmEvent, int], None]] = {}

    def raise_(self, event: AlarmEvent, now_us: int) -> None:
        """Note one opening or closing and tell the listeners (`now_us`: node clock)."""
        self.events.append(event)
        for listener in list(self.listeners.values()):
            listener(event, now_us)
