"""Rules over beliefs: how probably one is violated, and the belief given that it holds.

With s the probability that an instance is of the class of a rule and q that its attribute obeys it, the rule is violated with
probability s (1 - q). Given that it holds, Z = 1 - s (1 - q):

    p'(t) = p(t) q / Z for types of the class, p(t) / Z for the others
    p'(a) = ((1 - s) p(a) + s q p(a | obeys)) / Z, as its marginal, moments matched

An instance that cannot be repaired is refused. Both cite the rule.
"""

from collections import defaultdict
from collections.abc import Mapping
from math import exp, pi, sqrt
from typing import NamedTuple, TypeAlias

import numpy as np

from dyknow.anchoring.belief.arrays import Floats, Indices
from dyknow.anchoring.belief.instances import InstanceTable
from dyknow.anchoring.belief.knowledge.ontology import ClassRule
from dyknow.anchoring.belief.observations import TYPE

_LEAST = 1e-9
Relation: TypeAlias = tuple[str, str, str]
"""Its name, the instance that has it, and the other one."""


class RuleCheck(NamedTuple):
    """How a rule stands with N instances.

    Attributes:
        of_class: (N,) s.
        obeys: (N,) q.
    """

    of_class: Floats
    obeys: Floats

    @property
    def violated(self) -> Floats:
        """(N,) probability."""
        return self.of_class * (1.0 - self.obeys)


def check(table: InstanceTable, rule: ClassRule, types: Indices) -> RuleCheck:
    """Of a rule about an attribute; `types` are those of its class."""
    of_class = table.categorical[TYPE].shares[:, types].sum(axis=1)
    if rule.values is not None:
        beliefs = table.categorical[rule.attribute]
        obeys = beliefs.shares @ rule.values
        return RuleCheck(of_class, np.where(beliefs.present, obeys, 1.0))
    gaussian = table.gaussian[rule.attribute]
    obeys = np.ones(len(table))
    for axis, (low, high) in enumerate(_bounds(rule)):
        mean, sd = gaussian.mean[:, axis], np.sqrt(gaussian.covariance[:, axis, axis])
        obeys *= _below((high - mean) / sd) - _below((low - mean) / sd)
    return RuleCheck(of_class, np.where(gaussian.present, obeys, 1.0))


def repair(table: InstanceTable, rule: ClassRule, types: Indices, row: int, checked: RuleCheck) -> bool:
    """Believe of one instance what follows if the rule holds; False where nothing remains."""
    s, q = float(checked.of_class[row]), float(checked.obeys[row])
    whole = 1.0 - s * (1.0 - q)
    if whole < _LEAST:
        return False
    shares = table.categorical[TYPE].shares[row]
    shares[types] *= q
    shares /= whole
    if rule.values is not None:
        values = table.categorical[rule.attribute].shares[row]
        values *= (1.0 - s + s * rule.values) / whole
        return True
    gaussian = table.gaussian[rule.attribute]
    for axis, (low, high) in enumerate(_bounds(rule)):
        mean, variance = float(gaussian.mean[row, axis]), float(gaussian.covariance[row, axis, axis])
        inside = _truncated(mean, sqrt(variance), low, high)
        if inside is None:
            continue
        weight = s * q / whole
        after = (1.0 - weight) * mean + weight * inside[0]
        spread = (1.0 - weight) * (variance + (mean - after) ** 2) + weight * (inside[1] + (inside[0] - after) ** 2)
        gaussian.mean[row, axis] = after
        _rescale(gaussian.covariance[row], axis, sqrt(spread / variance))
    return True


def of_relations(
    table: InstanceTable, rule: ClassRule, types: Indices, others: Indices | None, relations: Mapping[Relation, float]
) -> dict[Relation, float]:
    """The probabilities of relations, given that a rule about them holds; unchanged relations are left out."""
    rows, shares = table.rows(), table.categorical[TYPE].shares
    mine = {
        key: value
        for key, value in relations.items()
        if key[0] == rule.relation and shares[rows[key[1]], types].sum() > rule.tolerance
    }
    found: dict[Relation, float] = {}
    if others is not None:
        for key, value in mine.items():
            wrong = float(shares[rows[key[1]], types].sum() * (1.0 - shares[rows[key[2]], others].sum()))
            if value * wrong > rule.tolerance:
                found[key] = value * (1.0 - wrong) / max(1.0 - value * wrong, _LEAST)
    if rule.at_most:
        by_instance = defaultdict[str, dict[Relation, float]](dict)
        for key, value in mine.items():
            by_instance[key[1]][key] = min(found.get(key, value), 1.0 - _LEAST)
        for held in by_instance.values():
            if sum(held.values()) - rule.at_most > rule.tolerance:
                found |= _at_most(held, rule.at_most)
    return found


def _at_most(held: Mapping[Relation, float], most: int) -> dict[Relation, float]:
    """Probabilities of independent relations, given that at most that many hold: by sums over their number."""
    keys = list(held)

    def sums(without: Relation | None) -> list[float]:
        by_number = [1.0] + [0.0] * most
        for key in keys:
            if key != without:
                p = held[key]
                by_number = [
                    value * (1.0 - p) + (by_number[number - 1] * p if number else 0.0)
                    for number, value in enumerate(by_number)
                ]
        return by_number

    whole = max(sum(sums(None)), 1e-300)
    return {key: held[key] * sum(sums(key)[:most]) / whole for key in keys}


def _bounds(rule: ClassRule) -> list[tuple[float, float]]:
    low, high = rule.low, rule.high
    return [] if low is None or high is None else list(zip(low.tolist(), high.tolist(), strict=True))


def _rescale(covariance: Floats, axis: int, factor: float) -> None:
    """Change one deviation and keep correlations, so that it stays positive definite."""
    covariance[axis, :] *= factor
    covariance[:, axis] *= factor


def _truncated(mean: float, sd: float, low: float, high: float) -> tuple[float, float] | None:
    """Mean and variance of a Gaussian given that it is within bounds; None where that is too improbable to say."""
    a, b = (low - mean) / sd, (high - mean) / sd
    inside = float(_below(np.array(b)) - _below(np.array(a)))
    if inside < _LEAST:
        return None
    at_a, at_b = _density(a), _density(b)
    shift = (at_a - at_b) / inside
    edge = (a * at_a if np.isfinite(a) else 0.0) - (b * at_b if np.isfinite(b) else 0.0)
    return mean + sd * shift, sd * sd * max(1.0 + edge / inside - shift * shift, 1e-6)


def _density(x: float) -> float:
    return exp(-0.5 * x * x) / sqrt(2.0 * pi)


def _below(x: Floats) -> Floats:
    from scipy.special import ndtr

    return np.asarray(ndtr(x), np.float64)
