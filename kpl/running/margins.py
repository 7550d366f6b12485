"""How far the formula of a monitor is from violation, as a stream `margin[MONITOR]`: made on demand."""

from collections import deque
from math import isfinite
from typing import TYPE_CHECKING

from dyknow import NO_VALUE, Sample
from dyknow.model.errors import TextError
from dyknow.network.processes import OnDemand
from dyknow.reasoning import Margins
from dyknow.reasoning.formulas.tree import Formula
from dyknow.reasoning.monitoring.margins import check_windows

if TYPE_CHECKING:
    from dyknow.kpl.running.formula_monitors import FormulaMonitor
    from dyknow.kpl.running.formula_states import FormulaState


class MarginStream(OnDemand):
    """One sample per state of a monitor, valid at its time, as soon as every window that begins there is over.

    It has no value where one that it is made of lacks, where no comparison of numbers decides, and for states whose windows were open when the members of a
    domain changed.
    """

    def __init__(self, monitor: "FormulaMonitor") -> None:
        super().__init__()
        self._monitor = monitor
        self._margins: Margins | None = None
        self._domains: object = None
        self._waiting: deque[int] = deque()

    def begin(self) -> None:
        self._margins, self._domains = None, None
        self._monitor.listeners.append(self._on_state)

    def since_us(self) -> int:
        """Nothing was computed before."""
        return super().since_us() if self.running or self._network is None else self._network.now_us

    def end(self) -> None:
        self._monitor.listeners.remove(self._on_state)
        self._waiting.clear()

    def _on_state(self, state: "FormulaState") -> None:
        if state.domains != self._domains:
            self._domains = state.domains
            self._unknown_up_to(None, state.now_us)
            self._margins = self._make(state)
        self._waiting.append(state.valid_us)
        if self._margins is None:
            self._unknown_up_to(None, state.now_us)
            return
        for found in self._margins.progress(state.valid_us, state.values, state.events):
            self._unknown_up_to(found.valid_us, state.now_us)
            self._waiting.popleft()
            known = found.value is not None and isfinite(found.value)
            self.emit(Sample(state.now_us, found.valid_us, found.value if known else NO_VALUE))

    def _make(self, state: "FormulaState") -> Margins | None:
        try:
            return Margins(self._monitor.monitor.formula, state.domains, self._monitor.states.period_us)
        except TextError as wrong:
            self.fault(wrong.message)
            return None

    def _unknown_up_to(self, valid_us: int | None, now_us: int) -> None:
        """States before one, or all, whose margins are not known."""
        while self._waiting and (valid_us is None or self._waiting[0] < valid_us):
            self.emit(Sample(now_us, self._waiting.popleft(), NO_VALUE))


def has_margins(formula: Formula) -> bool:
    """Whether its windows end."""
    try:
        check_windows(formula)
    except TextError:
        return False
    return True
