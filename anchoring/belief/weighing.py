"""Association probabilities as weights of links: which known object an object could be, by a world model.

A known object i that exists with probability r_i weighs r_i p_E L_i, as in an association: L_i is the likelihood of the position
where the object is expected, over all hypotheses, times that of each attribute. A symbol that was reported of it before is
evidence for its value v, p(v) C[v][symbol], and so is the one that is reported now.
"""

from collections.abc import Mapping
from math import exp, inf, log
from typing import Any, Final

import numpy as np

from dyknow.anchoring.belief.arrays import Floats
from dyknow.anchoring.belief.description import CategoricalAttribute, WorldModel
from dyknow.anchoring.belief.gaussians import log_normal
from dyknow.anchoring.links.prediction import ObjectPrediction
from dyknow.anchoring.links.states import ObjectState

EXISTENCE: Final = "existence"
_LEAST: Final = 1e-300


class AssociationWeights:
    """Scores and weights of a link by a world model.

    Args:
        model: the world model.
        sensor: that reported the attributes.
    """

    def __init__(self, model: WorldModel, sensor: str) -> None:
        self._detects = model.sensors[sensor].detects
        confusion = model.sensors[sensor].confusion
        self._attributes: dict[str, tuple[Floats, dict[str, Floats]]] = {}
        for name, each in model.attributes.items():
            if isinstance(each, CategoricalAttribute):
                known = confusion.get(name)
                symbols = each.values if known is None else known.symbols
                matrix = np.eye(len(symbols)) if known is None else known.matrix
                self._attributes[name] = each.prior, dict(zip(symbols, matrix.T, strict=True))

    def score(self, state: ObjectState, expected: ObjectPrediction) -> float:
        """Twice the negative logarithm of the weight; the least wins."""
        return -2.0 * self._log_weight(state, expected)

    def weigh(self, state: ObjectState, candidates: Mapping[str, ObjectPrediction]) -> dict[str, float]:
        """Of each candidate, by symbol, the probability that it is the one; they sum to 1."""
        logs = {symbol: self._log_weight(state, each) for symbol, each in candidates.items()}
        most = max(logs.values(), default=0.0)
        weights = {symbol: exp(each - most) for symbol, each in logs.items()}
        return {symbol: weight / sum(weights.values()) for symbol, weight in weights.items()}

    def _log_weight(self, state: ObjectState, expected: ObjectPrediction) -> float:
        place = np.array([state.x_m, state.y_m])
        position = -inf
        for one, share in expected.hypotheses:
            off = place - np.array([one.x_m, one.y_m])
            near = log_normal(off, state.covariance[:2, :2] + one.covariance[:2, :2])
            position = float(np.logaddexp(position, near + log(max(share, _LEAST))))
        known = expected.likely
        found = position + log(max(_existence(known), _LEAST)) + log(self._detects)
        for name, (prior, likelihood) in self._attributes.items():
            found += _log_symbol(prior, likelihood, known.attributes.get(name), state.attributes.get(name))
        return found


def _existence(known: ObjectState) -> float:
    """Its existence as last believed; 1 without a belief about it."""
    existence = known.attributes.get(EXISTENCE)
    if isinstance(existence, int | float) and 0.0 <= existence <= 1.0:
        return float(existence)
    return 1.0


def _log_symbol(prior: Floats, likelihood: Mapping[str, Floats], before: Any, now: Any) -> float:
    """Log p(now | before); 0 where nothing is reported now."""
    if not isinstance(now, str) or now not in likelihood:
        return 0.0
    known = prior if not isinstance(before, str) or before not in likelihood else prior * likelihood[before]
    total = float(known.sum())
    return log(max(float(known @ likelihood[now]) / total if total > 0.0 else 0.0, _LEAST))
