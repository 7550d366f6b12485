"""The inputs of a progression from states: when features last changed, and which have no value."""

from collections.abc import Collection, Mapping

from dyknow.model.sample import Value
from dyknow.model.values import NO_VALUE
from dyknow.reasoning.formulas.evaluation import is_missing
from dyknow.reasoning.formulas.tree import Formula, Since, walk


def lacking(labels: Collection[str], values: Mapping[str, Value]) -> tuple[str, ...]:
    """The labels that have no value."""
    return tuple(label for label in labels if is_missing(values.get(label, NO_VALUE)))


class Changes:
    """When each feature under a `since` last changed; its first value is a change."""

    def __init__(self, formula: Formula) -> None:
        self._stems = {node.feature.stem for node in walk(formula) if isinstance(node, Since)}
        self._last: dict[str, Value] = {}
        self._changed_us: dict[str, int] = {}

    def after(self, valid_us: int, values: Mapping[str, Value]) -> Mapping[str, int]:
        if self._stems:
            for label, value in values.items():
                if is_missing(value) or label.partition("[")[0] not in self._stems:
                    continue
                if label not in self._last or self._last[label] != value:
                    self._last[label], self._changed_us[label] = value, valid_us
        return self._changed_us
