"""The beliefs of a mission: values from states, and without them the effects of its actions."""

from collections.abc import Callable, Iterable, Mapping
from typing import NamedTuple

from dyknow.model.sample import Value
from dyknow.model.values import NO_VALUE
from dyknow.reasoning.formulas.evaluation import is_missing


class _Known(NamedTuple):
    at_us: int
    value: Value


class Beliefs:
    """Values by label.

    Args:
        initial: values of the problem.
        now_us: when the mission begins.
        fresh_us: a label that was in a state before counts for so long as it is.
        default: the value of a label without an initial value.
    """

    def __init__(
        self, initial: Mapping[str, Value], now_us: int, fresh_us: int, default: Callable[[str], Value]
    ) -> None:
        self._believed = {label: _Known(now_us, value) for label, value in initial.items()}
        self._sensed: dict[str, _Known] = {}
        self._fresh_us, self._default = fresh_us, default

    def on_state(self, valid_us: int, values: Mapping[str, Value]) -> None:
        for label, value in values.items():
            known = self._sensed.get(label)
            if known is None or known.at_us <= valid_us:
                self._sensed[label] = _Known(valid_us, value)

    def change(self, now_us: int, changes: Iterable[tuple[str, Value]]) -> None:
        """Note effects of an action, or assumptions from now on."""
        for label, value in changes:
            self._believed[label] = _Known(now_us, value)

    def shown(self, label: str, valid_us: int) -> Value:
        """The value for monitors at the time of a state: a label that states have shown must be in a fresh one."""
        sensed = self._sensed.get(label)
        if sensed is not None:
            return sensed.value if sensed.at_us >= valid_us - self._fresh_us else NO_VALUE
        believed = self._believed.get(label)
        return self._default(label) if believed is None else believed.value

    def seen_since(self, label: str, since_us: int) -> bool:
        sensed = self._sensed.get(label)
        return sensed is not None and sensed.at_us >= since_us and not is_missing(sensed.value)

    def values(self) -> dict[str, Value]:
        """The newest of each label, shown or believed; labels without a value are left out."""
        found = {label: known.value for label, known in self._believed.items()}
        for label, known in self._sensed.items():
            believed = self._believed.get(label)
            if not is_missing(known.value) and (believed is None or believed.at_us < known.at_us):
                found[label] = known.value
        return {label: value for label, value in found.items() if not is_missing(value)}

    def forget(self, labels: Iterable[str]) -> None:
        """Forget the values of labels that are to be seen again."""
        for label in labels:
            self._believed.pop(label, None)
            self._sensed.pop(label, None)

    def settle(self, labels: Iterable[str]) -> None:
        """Keep the last sensed values: they hold until an action changes them or states show them again."""
        self._believed |= {label: self._sensed.pop(label) for label in labels if label in self._sensed}
