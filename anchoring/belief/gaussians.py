"""Beliefs of all instances about one continuous attribute: Gaussians, batched.

The state of one instance has d = axes x order numbers: the places on all axes, then their rates, then accelerations. White
noise of density q drives the highest of these on each axis; an observation y shows the places with noise R:

    L = N(y - m; 0, S),  S = P + R,  K = P H^T S^-1                       (predictive likelihood)
    m' = m + d,  d = sum_j w_j K_j v_j                                     (equation (8), moments matched)
    P' = (1 - sum_j w_j) (P + d d^T) + sum_j w_j (P - K_j S_j K_j^T + (K_j v_j - d) (K_j v_j - d)^T)
"""

from functools import lru_cache
from math import factorial, inf, log, pi
from typing import NamedTuple

import numpy as np

from dyknow.anchoring.belief.arrays import Flags, Floats, Indices
from dyknow.anchoring.belief.description import GaussianAttribute

_SHARP = 1e-6
"""An observation that leaves less of the volume of a belief is taken in with care for its digits."""


class Innovations(NamedTuple):
    """The innovations of E pairs of instance and observation.

    Attributes:
        difference: (E, m) v = y - H m.
        inverse: (E, m, m) S^-1.
        noise: (E, m, m) R.
        distance: (E,) v^T S^-1 v.
        log_likelihood: (E,).
    """

    difference: Floats
    inverse: Floats
    noise: Floats
    distance: Floats
    log_likelihood: Floats

    def chosen(self, which: Flags | Indices) -> "Innovations":
        return Innovations(*(each[which] for each in self))


class GaussianBeliefs:
    """Of N instances.

    Attributes:
        mean: (N, d).
        covariance: (N, d, d).
        present: (N,) whether the attribute has been created.
    """

    def __init__(self, attribute: GaussianAttribute) -> None:
        self.attribute = attribute
        size = attribute.axes * attribute.order
        self.mean, self.covariance = np.zeros((0, size)), np.zeros((0, size, size))
        self.present = np.zeros(0, dtype=np.bool_)

    def predict(self, seconds: float) -> None:
        """Equation (7)."""
        attribute = self.attribute
        transition, both, noise = _motion(attribute.axes, attribute.order, seconds)
        count, size = self.mean.shape
        if attribute.order > 1:
            self.mean = self.mean @ transition
            self.covariance = (self.covariance.reshape(count, size * size) @ both).reshape(count, size, size)
        self.covariance = self.covariance + attribute.noise * noise
        if attribute.is_angle:
            self.mean = _wrapped(self.mean)

    def spread(self) -> Floats:
        """(N, m, m) covariance of the places."""
        axes = self.attribute.axes
        return self.covariance[:, :axes, :axes]

    def innovations(self, rows: Indices, cols: Indices, values: Floats, noise: Floats) -> Innovations:
        """Of pairs, given all observations (M, m) and their covariances (M, m, m)."""
        axes = self.attribute.axes
        difference = values[cols] - self.mean[rows, :axes]
        if self.attribute.is_angle:
            difference = _wrapped(difference)
        noise = noise[cols]
        spread = self.spread()[rows] + noise
        inverse, determinant = inverted(spread)
        if axes == 2:  # written out: the general form takes longer
            one, two = difference[:, 0], difference[:, 1]
            distance = inverse[:, 0, 0] * one * one + 2.0 * inverse[:, 0, 1] * one * two + inverse[:, 1, 1] * two * two
        else:
            distance = np.einsum("ei,eij,ej->e", difference, inverse, difference)
        log_likelihood = -0.5 * (distance + np.log(determinant) + axes * log(2.0 * pi))
        return Innovations(difference, inverse, noise, distance, log_likelihood)

    def update(self, rows: Indices, weights: Floats, innovations: Innovations) -> None:
        """Update with observations, each with its probability given existence; `rows` ascend."""
        if not len(rows):
            return
        axes = self.attribute.axes
        before = self.covariance[rows]
        cross = before[:, :, :axes]
        gain = cross @ innovations.inverse
        shift = (gain @ innovations.difference[:, :, None])[:, :, 0]
        after = before - gain @ cross.transpose(0, 2, 1)
        sharp = np.flatnonzero(determinants(innovations.inverse) * determinants(innovations.noise) < _SHARP)
        if len(sharp):
            after[sharp] = _joseph(before[sharp], gain[sharp], innovations.noise[sharp])
        starts = np.flatnonzero(np.concatenate(([True], rows[1:] != rows[:-1])))
        which = rows[starts]
        moved = np.add.reduceat(weights[:, None] * shift, starts)
        rest = np.maximum(1.0 - np.add.reduceat(weights, starts), 0.0)[:, None, None]
        apart = shift - np.repeat(moved, np.diff(np.append(starts, len(rows))), axis=0)
        each = weights[:, None, None] * (after + apart[:, :, None] * apart[:, None, :])
        prior = self.covariance[which] + moved[:, :, None] * moved[:, None, :]
        covariance = np.add.reduceat(each, starts) + rest * prior
        self.covariance[which] = 0.5 * (covariance + covariance.transpose(0, 2, 1))
        self.mean[which] += moved
        if self.attribute.is_angle:
            self.mean[which] = _wrapped(self.mean[which])

    def born(self, value: Floats | None, noise: Floats | None) -> tuple[Floats, Floats]:
        """Mean (d,) and covariance (d, d) of a new instance, given an observed `value` (m,) with its `noise`, or None."""
        attribute = self.attribute
        mean, covariance = attribute.prior_mean.copy(), attribute.prior_covariance.copy()
        if value is None or noise is None:
            return mean, covariance
        axes = attribute.axes
        if attribute.volume is not None:
            mean[:axes], covariance[:axes, :axes] = value, noise
            return mean, covariance
        difference = value - mean[:axes]
        gain = covariance[:, :axes] @ np.linalg.inv(covariance[:axes, :axes] + noise)
        mean += gain @ (_wrapped(difference) if attribute.is_angle else difference)
        covariance -= gain @ covariance[:axes]
        return mean, 0.5 * (covariance + covariance.T)

    def log_birth(self, values: Floats, noise: Floats) -> Floats:
        """(M,) log density of observations of something new: 1 / V, or as the prior belief predicts."""
        attribute = self.attribute
        if attribute.volume is not None:
            inside = ((values >= attribute.low) & (values <= attribute.high)).all(axis=1)
            return np.where(inside, -log(attribute.volume), -inf)
        axes = attribute.axes
        difference = values - attribute.prior_mean[:axes]
        if attribute.is_angle:
            difference = _wrapped(difference)
        inverse, determinant = inverted(attribute.prior_covariance[:axes, :axes] + noise)
        distance = np.einsum("ei,eij,ej->e", difference, inverse, difference)
        return np.asarray(-0.5 * (distance + np.log(determinant) + axes * log(2.0 * pi)))

    def append(self, means: Floats, covariances: Floats) -> None:
        """K new instances: (K, d), (K, d, d)."""
        self.mean = np.concatenate((self.mean, means))
        self.covariance = np.concatenate((self.covariance, covariances))
        self.present = np.concatenate((self.present, np.full(len(means), not self.attribute.is_optional)))

    def keep(self, which: Flags) -> None:
        self.mean, self.covariance, self.present = self.mean[which], self.covariance[which], self.present[which]

    def decide(self) -> tuple[Indices, Indices]:
        """Instances that have the attribute from now on, and those that have it no longer; these know nothing of it."""
        attribute, axes = self.attribute, self.attribute.axes
        widest = self.covariance[:, range(axes), range(axes)].max(axis=1)
        created = np.flatnonzero(~self.present & (widest < attribute.create_sd**2))
        dropped = np.flatnonzero(self.present & (widest > attribute.drop_sd**2))
        self.present[created] = True
        if len(dropped):
            self.present[dropped] = False
            self.mean[dropped], self.covariance[dropped] = attribute.prior_mean, attribute.prior_covariance
        return created, dropped


def _joseph(before: Floats, gain: Floats, noise: Floats) -> Floats:
    """Covariances (E, d, d) after an update, (1 - K H) P (1 - K H)^T + K R K^T: positive however much that takes away."""
    kept = np.broadcast_to(np.eye(before.shape[-1]), before.shape).copy()
    kept[:, :, : gain.shape[-1]] -= gain
    return np.asarray(kept @ before @ kept.transpose(0, 2, 1) + gain @ noise @ gain.transpose(0, 2, 1))


def inverted(matrices: Floats) -> tuple[Floats, Floats]:
    """Inverses (E, m, m) of symmetric matrices, and determinants (E,)."""
    size = matrices.shape[-1]
    if size == 1:
        return 1.0 / matrices, matrices[:, 0, 0]
    if size > 2:
        return np.asarray(np.linalg.inv(matrices), np.float64), np.asarray(np.linalg.det(matrices), np.float64)
    a, b, d = matrices[:, 0, 0], matrices[:, 0, 1], matrices[:, 1, 1]
    determinant = a * d - b * b
    inverse = np.empty_like(matrices)
    inverse[:, 0, 0], inverse[:, 1, 1] = d / determinant, a / determinant
    inverse[:, 0, 1] = inverse[:, 1, 0] = -b / determinant
    return inverse, determinant


def log_normal(difference: Floats, covariance: Floats) -> float:
    """Log density of one vector (m,), log N(difference; 0, covariance)."""
    _, log_determinant = np.linalg.slogdet(2.0 * pi * covariance)
    return float(-0.5 * (difference @ np.linalg.solve(covariance, difference) + log_determinant))


def determinants(matrices: Floats) -> Floats:
    """(E,) of symmetric matrices (E, m, m)."""
    if matrices.shape[-1] == 2:
        return matrices[:, 0, 0] * matrices[:, 1, 1] - matrices[:, 0, 1] ** 2
    return np.asarray(np.linalg.det(matrices), np.float64)


def _wrapped(angles: Floats) -> Floats:
    """To [-pi, pi), radians."""
    return (angles + pi) % (2.0 * pi) - pi


@lru_cache(maxsize=1024)
def _motion(axes: int, order: int, seconds: float) -> tuple[Floats, Floats, Floats]:
    """F^T (d, d), which maps row vectors; F x F (d^2, d^2), which maps covariances as rows; Q / q (d, d)."""
    each = np.eye(axes)
    block = np.array(
        [[seconds ** (k - i) / factorial(k - i) if k >= i else 0.0 for k in range(order)] for i in range(order)]
    )
    transition = np.kron(block, each)
    left = [order - 1 - i for i in range(order)]
    noise = np.array(
        [[seconds ** (i + j + 1) / ((i + j + 1) * factorial(i) * factorial(j)) for j in left] for i in left]
    )
    both = np.asarray(np.kron(transition, transition).T, np.float64)
    return np.asarray(transition.T, np.float64), both, np.asarray(np.kron(noise, each), np.float64)
