"""Alarms as participants report them to their coordinator: which of them does another of their units see as well?

Both platforms of a pair watch it, so that an alarm that one of them alone reports for a second is the word of that one.
Times are the node clock.
"""

from collections.abc import Iterable

from federation.messages.contents import Alarm

CONFIRM_US = 1_000_000
"""How long after an alarm the others of its units may raise theirs."""
KEPT = 512

_Key = tuple[str, str, frozenset[str]]


class ReportedAlarms:
    """What each unit has raised or reported of late, its own included."""

    def __init__(self) -> None:
        self._open: dict[_Key, bool] = {}
        self._waiting: dict[tuple[str, str], tuple[int, Alarm]] = {}

    def see(self, by: str, monitor: str, units: Iterable[str], *, is_open: bool) -> None:
        """`by` has raised an alarm over these units, or it has closed."""
        key = by, monitor, frozenset(units)
        self._open.pop(key, None)
        self._open[key] = is_open
        if len(self._open) > KEPT:
            del self._open[next(iter(self._open))]

    def report(self, task: str, alarm: Alarm, now_us: int) -> None:
        """A participant of the task reports an alarm of its own."""
        self.see(alarm.by, alarm.monitor, alarm.units, is_open=alarm.event == "opened")
        if alarm.event == "opened" and len(self._waiting) < KEPT:
            for other in set(alarm.units) - {alarm.by}:  # what closed before this alarm confirms nothing
                self._forget_closed((other, alarm.monitor, frozenset(alarm.units)))
            self._waiting[task, alarm.id] = now_us + CONFIRM_US, alarm

    def _forget_closed(self, key: _Key) -> None:
        if self._open.get(key) is False:
            del self._open[key]

    @property
    def deadline_us(self) -> int | None:
        return min((due_us for due_us, _ in self._waiting.values()), default=None)

    def unconfirmed(self, now_us: int) -> list[tuple[str, Alarm]]:
        """The alarms, with their tasks, that no other of their units has raised in time; each once."""
        found = []
        for name, (due_us, alarm) in list(self._waiting.items()):
            if due_us <= now_us:
                del self._waiting[name]
                units = frozenset(alarm.units)
                if not any((other, alarm.monitor, units) in self._open for other in units - {alarm.by}):
                    found.append((name[0], alarm))
        return found
