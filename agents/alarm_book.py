"""The alarms of a platform: the last thousand, which are open, and who wants to hear of them."""

from collections import deque
from collections.abc import Callable

from reasoning import AlarmEvent

KEPT = 1000


class AlarmBook:
    """Alarm events as the platform's monitors raise them."""

    def __init__(self) -> None:
        self.events: deque[AlarmEvent] = deque(maxlen=KEPT)
        self.open: dict[str, AlarmEvent] = {}
        self.listeners: dict[str, Callable[[AlarmEvent, int], None]] = {}

    def raise_(self, event: AlarmEvent, now_us: int) -> None:
        """Note one opening or closing and tell the listeners (`now_us`: node clock)."""
        self.events.append(event)
        if event.event == "opened":
            self.open[event.id] = event
        else:
            self.open.pop(event.id, None)
        for listener in list(self.listeners.values()):
            listener(event, now_us)
