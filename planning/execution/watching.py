"""The monitors of a plan while it is executed: progressed state by state, taken away when they are decided."""

from collections.abc import Iterable
from dataclasses import dataclass, field

from dyknow.model.sample import Value
from dyknow.planning.execution.beliefs import Beliefs
from dyknow.planning.execution.flags import ExecutionFlags, is_flag
from dyknow.planning.execution.generation import PlanMonitor
from dyknow.reasoning.formulas.evaluation import is_missing
from dyknow.reasoning.progression.engine import Progressing, make_progression


@dataclass(slots=True, eq=False)
class _Watched:
    """A monitor from a valid time on.

    Attributes:
        blind_us: the first state in a row that lacked a label; None if the newest did not.
    """

    monitor: PlanMonitor
    since_us: int
    progression: Progressing
    labels: tuple[str, ...]
    states: int = 0
    blind_us: int | None = None
    is_reported: bool = False
    lacking: tuple[str, ...] = ()


@dataclass(slots=True)
class MonitorSet:
    """Monitors that are active.

    Attributes:
        violated: the monitors that the newest state violated.
    """

    flags: ExecutionFlags
    beliefs: Beliefs
    violated: list[PlanMonitor] = field(default_factory=list)
    _active: list[_Watched] = field(default_factory=list)

    def add(self, monitors: Iterable[PlanMonitor], now_us: int) -> None:
        """Monitor from the first state of `now_us` or later on."""
        for one in monitors:
            self._active.append(_Watched(one, now_us, make_progression(one.formula), tuple(sorted(one.labels))))

    def remove(self, step: int, *, outliving: bool) -> None:
        """Take away those of a step, the ones that outlive it as well or not."""
        self._active = [
            one for one in self._active if one.monitor.step != step or (one.monitor.outlives and not outliving)
        ]

    @property
    def labels(self) -> frozenset[str]:
        """The labels that states have to show, without flags."""
        found = {label for one in self._active for label in one.labels}
        return frozenset(label for label in found if not is_flag(label))

    @property
    def monitors(self) -> tuple[PlanMonitor, ...]:
        return tuple(one.monitor for one in self._active)

    def on_state(self, valid_us: int) -> None:
        """Progress all monitors through the state of this time; decided ones are removed."""
        self.violated = []
        kept = []
        known: dict[str, Value] = {}
        for one in self._active:
            if valid_us < one.since_us:
                kept.append(one)
                continue
            values = {}
            for label in one.labels:
                if label not in known:
                    is_set = is_flag(label) and self.flags.value(label, valid_us)
                    known[label] = is_set if is_flag(label) else self.beliefs.shown(label, valid_us)
                values[label] = known[label]
            one.lacking = tuple(label for label, value in values.items() if is_missing(value))
            if one.lacking:
                one.blind_us = valid_us if one.blind_us is None else one.blind_us
                kept.append(one)
                continue
            one.blind_us, one.states = None, one.states + 1
            one.progression.progress(valid_us, values)
            if one.progression.verdict == "false":
                self.violated.append(one.monitor)
            elif one.progression.verdict == "undecided":
                kept.append(one)
        self._active = kept

    def awaited(self, step: int) -> tuple[str, ...]:
        """Labels whose values the monitors of a step have not had yet; empty once each was progressed."""
        lacking: set[str] = set()
        for one in self._active:
            if one.monitor.step == step and not one.states:
                lacking.update(one.lacking or one.labels)
        return tuple(sorted(label for label in lacking if not is_flag(label)))

    def unsettled(self, step: int) -> tuple[str, ...]:
        """Labels whose missing values leave monitors of a step undecided after its end."""
        lacking = {
            label
            for one in self._active
            if one.monitor.step == step and not one.monitor.outlives
            for label in one.lacking
        }
        return tuple(sorted(lacking))

    def newly_blind(self, valid_us: int, patience_us: int) -> list[tuple[PlanMonitor, tuple[str, ...]]]:
        """Monitors whose labels have had no values for that long, each once until it has seen again."""
        found = []
        for one in self._active:
            if one.blind_us is None:
                one.is_reported = False
            elif valid_us - one.blind_us >= patience_us and not one.is_reported:
                one.is_reported = True
                found.append((one.monitor, one.lacking))
        return found
