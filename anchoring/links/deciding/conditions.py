"""The conditions of a link specification, ready to be evaluated over states of two objects."""

from collections.abc import Callable, Mapping
from math import inf
from typing import Final, TypeAlias

from anchoring.links.deciding.gating import gate_of
from anchoring.links.prediction import ObjectPrediction
from anchoring.links.specification import ALWAYS_TRUE, DISTANCES, FROM, THRESHOLD, TO, LinkSpecification, StateFeature
from anchoring.links.states import ObjectState
from dyknow import NO_VALUE, Label, Value
from reasoning import Progressing, make_progression, required_labels
from reasoning.formulas.tree import Formula

Reading: TypeAlias = Callable[[ObjectState, ObjectPrediction | None], Value]
"""The value of one label: of the state of `from` and the whereabouts of `to`, None where there is no `to`."""
Thresh: TypeAlias = Callable[[ObjectState, ObjectPrediction], float]
"""What `thresh` is for a state of `from` and the whereabouts of `to`."""
_STATE_FEATURES: Final[Mapping[str, StateFeature]] = {
    "speed": lambda state: state.speed_m_s,
    "deviation": lambda state: state.deviation_m,
    "x": lambda state: state.x_m,
    "y": lambda state: state.y_m,
}


class PairCondition:
    """One formula over `from` and `to`.

    Args:
        name: what `from` may be called as well.
        thresh: what that is, if it is not as the specification says.

    Attributes:
        is_trivial: it is true whatever happens.
    """

    def __init__(
        self, formula: Formula, specification: LinkSpecification, name: str = FROM, thresh: Thresh | None = None
    ) -> None:
        self.formula = formula
        self.is_trivial = formula == ALWAYS_TRUE
        self.gate = gate_of(formula, specification.threshold.most_m)
        self._readings = {label: _reading(label, specification, name, thresh) for label in required_labels(formula)}
        self._far = {label: inf for label in self._readings if Label.parse(label).feature in DISTANCES}

    def start(self) -> Progressing:
        """A new evaluation, before its first state."""
        return make_progression(self.formula, way="object")

    def step(
        self, evaluation: Progressing, valid_us: int, state: ObjectState, other: ObjectPrediction | None = None
    ) -> None:
        """Progress an evaluation through one state of `from`, and of `to` if there is one."""
        evaluation.progress(valid_us, self.values(state, other))

    def values(self, state: ObjectState, other: ObjectPrediction | None = None) -> dict[str, Value]:
        """What the formula reads of the state of `from`, and of `to` if there is one."""
        return {label: read(state, other) for label, read in self._readings.items()}

    def pass_by(self, evaluation: Progressing, valid_us: int) -> None:
        """Progress it through a state in which both are farther apart than the gate allows."""
        evaluation.progress(valid_us, self._far)


def _reading(text: str, specification: LinkSpecification, name: str, thresh: Thresh | None) -> Reading:
    label = Label.parse(text)
    if label.feature in DISTANCES and set(label.objects) == {FROM, TO}:
        return lambda state, other: NO_VALUE if other is None else state.distance_m(other.nearest(state))
    if label.feature == THRESHOLD and label.objects in {(), (TO,)}:
        threshold = specification.threshold
        if thresh is not None:
            return lambda state, other: NO_VALUE if other is None else thresh(state, other)
        return lambda _state, other: NO_VALUE if other is None else threshold.of(other.likely)
    feature = specification.features.get(label.feature) or _STATE_FEATURES.get(label.feature)
    read = feature or (lambda state: state.attributes.get(label.feature, NO_VALUE))
    if label.objects in {(FROM,), (name,)}:
        return lambda state, _other: read(state)
    if label.objects == (TO,):
        return lambda _state, other: NO_VALUE if other is None else read(other.likely)
    return lambda _state, _other: NO_VALUE
