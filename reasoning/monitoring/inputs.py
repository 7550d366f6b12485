"""Whether a monitor's inputs can be trusted: fresh, stale or missing, since when and which (F5).

Stale: the last due state lacks an input although max delay + one period have passed since its time. Missing: an input
never arrived, its source is gone or skewed, or it has been stale for two seconds. Fresh again with the first complete
state. Federation time, microseconds.
"""

from collections.abc import Sequence
from typing import Final, Literal, TypeAlias

from dyknow.model.instants import US_PER_S

Freshness: TypeAlias = Literal["fresh", "stale", "missing"]
STALE_FOR_US: Final = 2 * US_PER_S


class MonitorInputs:
    """The state of one monitor's inputs; `names` are all of them, for when no state at all comes.

    Attributes:
        deadline_us: when the state of the inputs changes by itself; None: only by samples.
    """

    def __init__(self, names: Sequence[str], period_us: int, max_delay_us: int, since_us: int = 0) -> None:
        self.names = tuple(names)
        self.state: Freshness = "missing"
        self.since_us = since_us
        self.which: tuple[str, ...] = self.names
        self.marked: dict[str, str] = {}
        self._grace_us = 2 * period_us + max_delay_us
        self._lacking: tuple[str, ...] = self.names
        self.deadline_us: int | None = None

    def on_state(self, valid_us: int, now_us: int, lacking: tuple[str, ...]) -> None:
        """A state came; `lacking` are the inputs without a value in it, nothing if it is complete."""
        if lacking or self.marked:
            self._lacking = tuple(dict.fromkeys((*self.marked, *lacking)))
            if self.state != "fresh":
                self.which = self._lacking
            return
        self.deadline_us, self._lacking = valid_us + self._grace_us, self.names
        if self.state != "fresh":
            self.state, self.since_us, self.which = "fresh", now_us, ()

    def on_time(self, now_us: int) -> bool:
        """Let time pass; whether the state changed. `since_us` is the instant it became true, not when it was seen."""
        changed = False
        while (due_us := self.deadline_us) is not None and now_us >= due_us:
            changed = True
            if self.state == "fresh":
                self.state, self.deadline_us = "stale", due_us + STALE_FOR_US
            else:
                self.state, self.deadline_us = "missing", None
            self.since_us, self.which = due_us, self._lacking
        return changed

    def mark(self, name: str, now_us: int, reason: str) -> None:
        """The source of `name` is gone, or its clock is skewed."""
        self.marked[name] = reason
        self.which = tuple(self.marked) if self.state == "fresh" else tuple(dict.fromkeys((*self.marked, *self.which)))
        if self.state != "missing":
            self.state, self.since_us, self.deadline_us = "missing", now_us, None

    def unmark(self, name: str) -> None:
        """The source is back; the inputs are fresh with the first complete state."""
        self.marked.pop(name, None)
