"""Alarms about two vehicles that stand, ours of them on the ground: they are no traffic, and not raised.

The monitors see two vehicles parked next to each other as too close. What they open is held back while that is so, and
raised as soon as one of the two moves or ours is airborne; what is open when both have come to stand is closed. That ours is on
the ground is its autopilot's word, that neither moves is our own data: what a partner says of itself holds nothing back.
"""

from collections.abc import Callable

from reasoning import AlarmEvent

SETTLES_US = 3_000_000
"""How long both have to stand until an open alarm is closed."""


class GroundedAlarms:
    """The open alarms of one platform's monitors about pairs. Federation time.

    Args:
        parked: whether, of our vehicle and that of a unit, neither moves and ours is on the ground.
        is_open: whether the monitor that has opened an alarm still has it open.
        on_alarm: takes what is raised.
    """

    def __init__(
        self,
        parked: Callable[[str], bool],
        is_open: Callable[[AlarmEvent], bool],
        on_alarm: Callable[[AlarmEvent], None],
    ) -> None:
        self._parked, self._is_open, self._raise = parked, is_open, on_alarm
        self._opened: dict[str, tuple[AlarmEvent, AlarmEvent | None]] = {}
        self._since_us: dict[str, int] = {}

    def on_alarm(self, event: AlarmEvent) -> None:
        """A monitor has opened or closed an alarm."""
        if event.event == "opened":
            is_held = self._parked(event.units[1])
            self._opened[event.id] = event, None if is_held else event
            if not is_held:
                self._raise(event)
            return
        _, raised = self._opened.pop(event.id, (event, event))
        if raised is not None:
            self._raise(event._replace(id=raised.id))

    def on_moved(self, now_us: int) -> None:
        """Positions have changed: raise what was held back, or close what is no traffic any longer."""
        for key, (event, raised) in list(self._opened.items()):
            if not self._is_open(event):
                del self._opened[key]
            elif not self._parked(event.units[1]):
                self._since_us.pop(key, None)
                if raised is None:
                    again = event._replace(id=f"{event.id} {now_us}", detected_us=now_us)
                    self._opened[key] = event, again
                    self._raise(again)
            elif raised is not None and now_us >= self._since_us.setdefault(key, now_us) + SETTLES_US:
                self._opened[key] = event, None
                self._raise(raised._replace(event="closed", valid_us=now_us, detected_us=now_us))
        for key in self._since_us.keys() - self._opened.keys():
            del self._since_us[key]
