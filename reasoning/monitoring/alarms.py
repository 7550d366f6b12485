"""Alarms of `always phi` (F8): opened when phi fails, closed by k states in a row that satisfy it.

When phi fails in some state the alarm opens and phi is monitored again from the next state; the alarm closes at the
first of k consecutive states that satisfy phi. The pending remainders of phi are kept meanwhile, in order while an
alarm is open, since which state satisfied phi first matters then.
"""

from collections import deque
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Final, Literal, NamedTuple

from dyknow.model.sample import Value
from dyknow.reasoning.formulas.evaluation import Moment
from dyknow.reasoning.progression.explaining import Explanation
from dyknow.reasoning.progression.restarting import Startable, is_pending

LONGEST_WAIT: Final = 10_000
"""Runs of undecided states kept in order while an alarm is open; older ones are still obligations, not clean states."""


NEITHER_CAN_AVOID: Final = "neither-can-avoid"
"""The alarm, of no monitor, that neither of two aircraft that make for each other avoids the other."""
SILENT_IN_THE_AIR: Final = "silent-in-the-air"
"""The alarm, of no monitor, that a vehicle was in the air when it was heard last, and is not heard any more."""
NONCONFORMING: Final = "nonconforming"
"""The alarm, of no monitor, that a vehicle does not fly what its intent says (ASTM F3548)."""
OF_SEPARATION: Final = frozenset({NEITHER_CAN_AVOID, SILENT_IN_THE_AIR, NONCONFORMING})


class AlarmEvent(NamedTuple):
    """An alarm opened, closed, or ended with its monitor. The events of one alarm share the id.

    `valid_us` is the state that violated, the first that was clean again, or when the monitor was removed; `detected_us` when this node knew;
    `samples_us` the valid time of each sample that this state was made of, by input; `because` which parts of the
    formula opened it, with their samples; `made_us` when the oldest prediction was made that this state rests on, if any.
    """

    id: str
    event: Literal["opened", "closed", "ended"]
    monitor: str
    units: tuple[str, ...]
    valid_us: int
    detected_us: int
    values: Mapping[str, Value]
    samples_us: Mapping[str, int] = MappingProxyType({})
    because: tuple[Explanation, ...] = ()
    made_us: int | None = None


class Change(NamedTuple):
    """An alarm should open or close, for the state at `valid_us` with these values.

    `samples_us` as in `AlarmEvent`; None: every input brought a sample valid at `valid_us`.
    """

    opens: bool
    valid_us: int
    values: Mapping[str, Value]
    samples_us: Mapping[str, int] | None


def opening(moment: Moment, samples_us: Mapping[str, int] | None) -> Change:
    """An alarm should open for this state."""
    return Change(opens=True, valid_us=moment.valid_us, values=moment.values, samples_us=samples_us)


class _Run(NamedTuple):
    """Consecutive states with equal residuals."""

    residual: Any
    first_us: int
    states: int
    values: Mapping[str, Value]
    samples_us: Mapping[str, int] | None


class Watch:
    """Monitors `always phi` without end: `phi` is started at every state."""

    def __init__(self, phi: Startable, close_after: int = 2) -> None:
        self.open = False
        self.doubtful = False
        self._phi, self._read, self._start = phi, phi.read, phi.start
        self._close_after = close_after
        self._rest: Any = True
        self._runs: deque[_Run] = deque()
        self._clean = 0
        self._first: _Run | None = None
        self._blamed: tuple[Any, Any, Moment] | None = None

    @property
    def is_busy(self) -> bool:
        """Whether a state in which phi holds at once could change something."""
        return self.open or self._rest is not True

    def explain(self) -> tuple[Explanation, ...]:
        """Why the alarm opened last; worked out on demand."""
        return () if self._blamed is None else self._phi.explain(*self._blamed)

    def on_moment(self, moment: Moment, samples_us: Mapping[str, int] | None = None) -> Change | None:
        """Take one state, made of such samples; the change says whether phi is undecided in it for good."""
        reading, rest = self._read(moment), self._rest
        before = rest
        if rest is not True and is_pending(rest):
            rest = self._rest = self._phi.step(rest, reading)
        found = self._start(reading)
        self.doubtful = found is None
        if not self.open and (found is False or rest is False):
            self._blamed = None if found is False else before, reading, moment
        if found is False:
            return self._violated(moment, samples_us)
        if not self.open:
            if found is not True and found is not None:
                rest = self._rest = self._phi.conjoin((rest, found))
            return self._violated(moment, samples_us) if rest is False else None
        self._step_runs(reading)
        self._append(_Run(found, moment.valid_us, 1, moment.values, samples_us))
        if rest is False or any(run.residual is False for run in self._runs):
            return self._violated(moment, samples_us)
        return self._settle()

    def forget_clean(self) -> None:
        """Count clean states from zero; pending remainders stay an obligation."""
        if self._runs:
            self._rest = self._phi.conjoin((self._rest, *(run.residual for run in self._runs)))
        self._runs.clear()
        self._clean, self._first = 0, None

    def _violated(self, moment: Moment, samples_us: Mapping[str, int] | None) -> Change | None:
        was_open, self.open = self.open, True
        self._rest = True
        self._runs.clear()
        self._clean, self._first = 0, None
        return None if was_open else opening(moment, samples_us)

    def _step_runs(self, reading: Any) -> None:
        waiting, self._runs = self._runs, deque()
        for run in waiting:
            left = run.residual
            self._append(run._replace(residual=self._phi.step(left, reading) if is_pending(left) else left))

    def _append(self, run: _Run) -> None:
        last = self._runs[-1] if self._runs else None
        if last is not None and last.residual == run.residual:
            self._runs[-1] = last._replace(states=last.states + run.states)
        else:
            self._runs.append(run)
        if len(self._runs) > LONGEST_WAIT:
            self._rest = self._phi.conjoin((self._rest, self._runs.popleft().residual))
            self._clean, self._first = 0, None

    def _settle(self) -> Change | None:
        """Count the states at the head whose truth is known; close when enough in a row were clean."""
        while self._runs and not is_pending(self._runs[0].residual):
            run = self._runs.popleft()
            if run.residual is not True:
                self._clean, self._first = 0, None
                continue
            self._first = self._first or run
            self._clean += run.states
            if self._clean >= self._close_after:
                first = self._first
                self.open = False
                self.forget_clean()
                return Change(opens=False, valid_us=first.first_us, values=first.values, samples_us=first.samples_us)
        return None
