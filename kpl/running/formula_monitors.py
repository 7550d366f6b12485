"""A monitor over streams of one instance: its states are made of the streams its formula names (7.5, 7.8)."""

from collections.abc import Callable

from dyknow import Label, Network, earlier
from dyknow.kpl.checking.symbols import MARGIN
from dyknow.kpl.running.formula_states import FormulaState, FormulaStates, timing
from dyknow.kpl.syntax.specification import MonitorDeclaration
from dyknow.reasoning import AlarmEvent, Monitor
from dyknow.reasoning.formulas.tree import Formula


class FormulaMonitor:
    """Hands every state of its formula to a `Monitor`.

    Args:
        formula: over streams only, without free variables.
        on_alarm: called with every opening, closing and end.

    Attributes:
        listeners: called with every state, too.
        margin: the label of its margin, a stream while it is wanted.
    """

    def __init__(
        self,
        network: Network,
        declaration: MonitorDeclaration,
        formula: Formula,
        unit: str,
        on_alarm: Callable[[AlarmEvent], None],
        since_us: int,
    ) -> None:
        self.margin = Label(MARGIN, (declaration.name,))
        self.listeners: list[Callable[[FormulaState], None]] = []
        self._network, self._on_alarm = network, on_alarm
        self._failing: set[str] = set()
        period_us, max_delay_us = timing(declaration.policy)
        self.monitor = Monitor(
            declaration.name,
            formula,
            (unit,),
            period_us,
            max_delay_us - (declaration.policy.predict_us or 0),
            declaration.no_value,
            declaration.close_after,
            inputs=(),
            since_us=since_us,
        )
        self.states = FormulaStates(
            network,
            formula,
            declaration.policy,
            self._on_state,
            self._on_domain,
            since_us=since_us,
        )
        network.step(self)

    @property
    def deadline_us(self) -> int | None:
        due_us = self.states.deadline_us
        return None if due_us is None else earlier(due_us, self.monitor.deadline_us)

    def on_time(self, now_us: int) -> None:
        self.states.on_time(now_us)
        for event in self.monitor.on_time(now_us):
            self._on_alarm(event)

    def cancel(self) -> None:
        """Take no more streams; an alarm that is open ends."""
        for event in self.monitor.end(self._network.now_us):
            self._on_alarm(event)
        if self._network.has(self.margin):
            self._network.remove(self.margin)
        self.states.cancel()
        self._network.unstep(self)

    def _on_state(self, state: FormulaState) -> None:
        found = self.monitor.on_state(
            state.valid_us,
            state.now_us,
            state.values,
            domains=state.domains,
            events=state.events,
            samples_us=state.samples_us,
        )
        for event in found:
            self._on_alarm(event if state.made_us is None else event._replace(made_us=state.made_us))
        for listener in tuple(self.listeners):
            listener(state)

    def _on_domain(self, name: str, wrong: str) -> None:
        """An error is reported once; until it is right again what holds is not known."""
        now_us = self._network.now_us
        if not wrong:
            self._failing.discard(name)
            self.monitor.mark_present(name, now_us)
        elif name not in self._failing:
            self._failing.add(name)
            self._network.on_fault(Label(name), f"monitor {self.monitor.name}: {wrong}")
            self.monitor.mark_missing(name, now_us, "too many")
