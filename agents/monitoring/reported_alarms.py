"""Alarms as participants report them to their coordinator: which of them does another of their units see as well?

Both platforms of a pair watch it, so that an alarm that one of them alone reports for a second is the word of that one.
Of one participant and monitor a limited number is passed on; the number left out is reported. Times are the node clock.
"""

from collections.abc import Iterable
from typing import NamedTuple

from dyknow import earlier
from dyknow.federation.messages.contents import Alarm
from dyknow.federation.shares import ActLimits

CONFIRM_US = 1_000_000
"""How long after an alarm the others of its units may raise theirs."""
KEPT = 512
PER_S, BURST = 0.5, 20.0
"""Alarms that a participant may open with one monitor: as many as it can have neighbours, and then one in 2 s."""
TOLD_US = 5_000_000
"""How often the number left out is reported."""

_Key = tuple[str, str, frozenset[str]]


class LeftOut(NamedTuple):
    """Alarms of one participant that were not passed on."""

    task: str
    unit: str
    monitor: str
    number: int

    @property
    def text(self) -> str:
        return f"{self.number} alarms of {self.monitor} by {self.unit} left out: more than {BURST:g}, then {PER_S:g} a second"


class ReportedAlarms:
    """Alarms that each unit has raised or reported of late, this platform's own included."""

    def __init__(self) -> None:
        self._quota = ActLimits(PER_S, BURST, KEPT)
        self._passed: dict[tuple[str, str], None] = {}
        self._left_out: dict[tuple[str, str, str], int] = {}
        self._told_us, self._tell_us = -TOLD_US, 0
        self._open: dict[_Key, bool] = {}
        self._waiting: dict[tuple[str, str], tuple[int, Alarm]] = {}

    def see(self, by: str, monitor: str, units: Iterable[str], *, is_open: bool) -> None:
        """`by` has raised an alarm over these units, or it has closed."""
        key = by, monitor, frozenset(units)
        self._open.pop(key, None)
        self._open[key] = is_open
        if len(self._open) > KEPT:
            del self._open[next(iter(self._open))]

    def admits(self, task: str, alarm: Alarm, now_us: int) -> bool:
        """Whether this one is passed on; the end of an alarm that was passed on always is."""
        name = alarm.by, alarm.id
        if alarm.event != "opened" and name in self._passed:
            del self._passed[name]
            return True
        if not self._quota.admit(f"{alarm.by} {alarm.monitor}", now_us):
            if not self._left_out:
                self._tell_us = max(now_us, self._told_us + TOLD_US)
            key = task, alarm.by, alarm.monitor
            if key in self._left_out or len(self._left_out) < KEPT:
                self._left_out[key] = self._left_out.get(key, 0) + 1
            return False
        if alarm.event == "opened":
            self._passed[name] = None
            if len(self._passed) > KEPT:
                del self._passed[next(iter(self._passed))]
        return True

    def left_out(self, now_us: int) -> list[LeftOut]:
        """The number left out since the last report, if one is due."""
        if not self._left_out or now_us < self._tell_us:
            return []
        self._told_us = now_us
        found = [LeftOut(*key, number) for key, number in self._left_out.items()]
        self._left_out.clear()
        return found

    def report(self, task: str, alarm: Alarm, now_us: int) -> None:
        """A participant of the task reports an alarm of its own."""
        self.see(alarm.by, alarm.monitor, alarm.units, is_open=alarm.event == "opened")
        if alarm.event == "opened" and len(self._waiting) < KEPT:
            for other in set(alarm.units) - {alarm.by}:  # an alarm closed before this one confirms nothing
                self._forget_closed((other, alarm.monitor, frozenset(alarm.units)))
            self._waiting[task, alarm.id] = now_us + CONFIRM_US, alarm

    def _forget_closed(self, key: _Key) -> None:
        if self._open.get(key) is False:
            del self._open[key]

    @property
    def deadline_us(self) -> int | None:
        due_us = min((due_us for due_us, _ in self._waiting.values()), default=None)
        return earlier(due_us, self._tell_us) if self._left_out else due_us

    def unconfirmed(self, now_us: int) -> list[tuple[str, Alarm]]:
        """The alarms, with their tasks, that no other of their units has raised in time, and which those are; each once."""
        found = []
        for name, (due_us, alarm) in list(self._waiting.items()):
            if due_us <= now_us:
                del self._waiting[name]
                units = frozenset(alarm.units)
                if not any((other, alarm.monitor, units) in self._open for other in units - {alarm.by}):
                    unseen_by = tuple(unit for unit in alarm.units if unit != alarm.by)
                    found.append((name[0], alarm.model_copy(update={"unseen_by": unseen_by})))
        return found
