"""Beliefs of all instances about one discrete attribute, or about their type: categorical distributions, batched.

p <- (1 - a) p + a / K,  a = 1 - exp(-dt / tau)                        (ageing: entropy grows)
L_j = sum_v p(v) C[v][y_j]                                             (C: confusion of the sensor)
p' = (1 - sum_j w_j) p + sum_j w_j p_j,  p_j(v) ~ p(v) C[v][y_j]       (the exact marginal)
"""

from math import expm1

import numpy as np

from dyknow.anchoring.belief.arrays import Flags, Floats, Indices
from dyknow.anchoring.belief.description import CategoricalAttribute


class CategoricalBeliefs:
    """Of N instances.

    Attributes:
        shares: (N, K) probabilities of the values.
        present: (N,) whether the attribute has been created.
    """

    def __init__(self, attribute: CategoricalAttribute) -> None:
        self.attribute = attribute
        self.shares = np.zeros((0, len(attribute.values)))
        self.present = np.zeros(0, dtype=np.bool_)

    def predict(self, seconds: float) -> None:
        """Grow older."""
        aged = -expm1(-seconds / self.attribute.ageing_s)
        if aged:
            self.shares = self.shares * (1.0 - aged) + aged / self.shares.shape[1]

    def likelihood(self, rows: Indices, cols: Indices, likelihoods: Floats) -> Floats:
        """(E,) of pairs, given that of each observation for each value, (M, K)."""
        return np.asarray((self.shares[rows] * likelihoods[cols]).sum(axis=1))

    def update(self, rows: Indices, cols: Indices, weights: Floats, likelihoods: Floats) -> None:
        """Update with observations, each with its probability given existence; `rows` ascend.

        An observation that no value explains changes nothing.
        """
        if not len(rows):
            return
        before = self.shares[rows]
        after = before * likelihoods[cols]
        total = after.sum(axis=1, keepdims=True)
        after = np.divide(after, total, out=before.copy(), where=total > 0.0)
        change = weights[:, None] * (after - before)
        starts = np.flatnonzero(np.concatenate(([True], rows[1:] != rows[:-1])))
        shares = self.shares[rows[starts]] + np.add.reduceat(change, starts)
        shares = np.maximum(shares, 0.0)
        self.shares[rows[starts]] = shares / shares.sum(axis=1, keepdims=True)

    def born(self, likelihood: Floats | None) -> Floats:
        """(K,) of a new instance, given the likelihood of its observation for each value, or None."""
        prior = self.attribute.prior
        if likelihood is None:
            return prior.copy()
        after = prior * likelihood
        total = after.sum()
        return after / total if total > 0.0 else prior.copy()

    def append(self, shares: Floats) -> None:
        """New instances, (new, K)."""
        self.shares = np.concatenate((self.shares, shares))
        self.present = np.concatenate((self.present, np.full(len(shares), not self.attribute.is_optional)))

    def keep(self, which: Flags) -> None:
        self.shares, self.present = self.shares[which], self.present[which]

    def decide(self) -> tuple[Indices, Indices]:
        """Instances that have the attribute from now on, and those that have it no longer; these know nothing of it."""
        attribute, most = self.attribute, self.shares.max(axis=1)
        created = np.flatnonzero(~self.present & (most > attribute.create))
        dropped = np.flatnonzero(self.present & (most < attribute.drop))
        self.present[created] = True
        if len(dropped):
            self.present[dropped] = False
            self.shares[dropped] = attribute.prior
        return created, dropped
