"""Which known objects are near enough to a state: by a specification, or by usual motion."""

from collections.abc import Iterable, Mapping
from math import log, pi
from typing import Final

from dyknow.anchoring.links.deciding.conditions import PairCondition, Thresh
from dyknow.anchoring.links.deciding.gating import Gate, gate_of
from dyknow.anchoring.links.motion import Spacing
from dyknow.anchoring.links.prediction import ObjectPrediction
from dyknow.anchoring.links.specification import LinkSpecification
from dyknow.anchoring.links.states import ObjectState

_ALONE: Final = 0.5
"""The score of being none of the known objects, where that is weighed: an unlikely pair rather than none."""


class Reach:
    """How far a state may be from where an object is expected, and how badly it fits.

    Attributes:
        thresh: its value in conditions, unless the specification gives it.
        alone: the score of being none of the known objects; None: as many as possible are known ones.
    """

    def __init__(self, specification: LinkSpecification) -> None:
        self._specification = specification
        self._spacing = Spacing() if specification.is_adaptive else None
        self.thresh: Thresh | None = None if self._spacing is None else self._reach_m
        self.alone = None if self._spacing is None else _ALONE

    def on_states(self, valid_us: int, seen: Iterable[ObjectState]) -> None:
        """Note all states of one time."""
        if self._spacing is not None:
            self._spacing.on_states(valid_us, [*seen])

    def score(self, state: ObjectState, whereabouts: ObjectPrediction) -> float:
        """How badly a state fits; where being another is weighed, less than 0 if it is more likely this one."""
        score = self._specification.score(state, whereabouts)
        if self._spacing is None:
            return score
        return score + 2.0 * log(2.0 * pi * self._spacing.density(whereabouts.nearest(state)))

    def gate(
        self, condition: PairCondition, seen: Iterable[ObjectState], expected: Mapping[str, ObjectPrediction]
    ) -> Gate | None:
        """Which distance a condition implies between any of these."""
        if self._spacing is None:
            return condition.gate
        places = (hypothesis.state for each in expected.values() for hypothesis in each.hypotheses)
        return gate_of(condition.formula, self._spacing.most_m(seen, places, self._specification.threshold.most_m))

    def _reach_m(self, state: ObjectState, whereabouts: ObjectPrediction) -> float:
        spacing, most_m = self._spacing, self._specification.threshold.most_m
        return most_m if spacing is None else spacing.reach_m(state, whereabouts.nearest(state), most_m)
