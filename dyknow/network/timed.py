"""The timers of a network: streams whose policies owe samples, and processes that make some by themselves."""

from dyknow.network.instant import Instant
from dyknow.network.process import FAR_US, TimedProcess

MANY = 64


class TimedProcesses:
    """Each is called at its deadlines; after an exception it is left out for a while if exceptions are contained."""

    __slots__ = ("_enough", "_instant", "_resting", "_timed")

    def __init__(self, instant: Instant) -> None:
        self._instant = instant
        self._timed: dict[TimedProcess, None] = {}
        self._resting: dict[TimedProcess, int] = {}  # until when
        self._enough = MANY

    def __len__(self) -> int:
        return len(self._timed)

    def on_time(self, now_us: int) -> None:
        """Call what is due."""
        resting = self._resting = {each: us for each, us in self._resting.items() if us > now_us}
        for timed in tuple(self._timed):
            if timed in resting:
                continue
            try:
                due_us = timed.deadline_us
                if due_us is None:
                    self._timed.pop(timed, None)
                elif due_us <= now_us:
                    timed.on_time(now_us)
            except Exception as error:  # noqa: BLE001  (contained)
                out_us = self._instant.raised(timed.on_time, getattr(timed, "label", "its inputs"), error)
                resting[timed] = now_us + out_us

    @property
    def deadline_us(self) -> int | None:
        """Next instant at which `on_time` has work, or None."""
        if not self._timed:
            return None
        resting = self._resting
        dues = (
            (s.deadline_us for s in self._timed if s not in resting)
            if resting
            else (s.deadline_us for s in self._timed)
        )
        due_us = min((due_us for due_us in dues if due_us is not None), default=FAR_US)
        due_us = min(due_us, *resting.values()) if resting else due_us
        return None if due_us >= FAR_US else due_us

    def step(self, timed: TimedProcess) -> None:
        """Call it at its deadlines; `FAR_US` is: perhaps later."""
        self._timed[timed] = None
        if len(self._timed) > self._enough:
            self._timed = {each: None for each in self._timed if each is timed or each.deadline_us is not None}
            self._enough = max(MANY, 2 * len(self._timed))

    def unstep(self, timed: TimedProcess) -> None:
        """Call it no more."""
        self._timed.pop(timed, None)
        self._resting.pop(timed, None)
