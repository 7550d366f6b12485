"""What the model should say, by its definition: sums over all vectors of existence and all associations."""

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np


class Enumerated(NamedTuple):
    instances: np.ndarray
    birth: float
    clutter: float
    existence: np.ndarray
    weights: np.ndarray


def single(
    reading: str, r: Sequence[float], likelihood: Sequence[float], p_e: Sequence[float], p_f: Sequence[float],
    births: float, birth: float, clutters: float, clutter: float,
) -> Enumerated:  # fmt: skip
    """All d and e of one observation. In `event`, births and clutters are odds: p / (1 - p)."""
    count = len(r)
    joint = np.zeros((count + 2, count, 2))
    total = np.zeros(count + 2)
    for e in product((0, 1), repeat=count):
        prior = np.prod([r[i] if e[i] else 1.0 - r[i] for i in range(count)])
        q = [p_e[i] if e[i] else p_f[i] for i in range(count)]
        if reading == "event":
            q += [births / (1.0 + births), clutters / (1.0 + clutters)]
            p_d = [q[d] * np.prod([1.0 - q[j] for j in range(count + 2) if j != d]) for d in range(count + 2)]
        else:
            q += [births, clutters]
            p_d = [each / sum(q) if sum(q) else 0.0 for each in q]
        densities = [likelihood[i] if e[i] else clutter for i in range(count)] + [birth, clutter]
        for d in range(count + 2):
            weight = prior * p_d[d] * densities[d]
            total[d] += weight
            for i in range(count):
                joint[d, i, e[i]] += weight
    pi, joint = total / total.sum(), joint / total.sum()
    existence = joint[:, :, 1].sum(axis=0)
    both = np.array([joint[i, i, 1] for i in range(count)])
    weights = np.divide(both, existence, out=np.zeros(count), where=existence > 0.0)
    return Enumerated(pi[:count], float(pi[count]), float(pi[count + 1]), existence, weights)


def scan(
    r: Sequence[float], detection: Sequence[float], likelihood: np.ndarray, births: np.ndarray, clutters: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """All existences and all one-to-one associations of a scan.

    Args:
        likelihood: (N, M); births, clutters: (M,) intensities.

    Returns:
        (N, M) P(i gave j), (N,) P(e_i), (M,) P(j is a birth).
    """
    count, observed = likelihood.shape
    pairs, existence, born, total = np.zeros((count, observed)), np.zeros(count), np.zeros(observed), 0.0
    for d in product(range(-1, observed), repeat=count):
        used = [j for j in d if j >= 0]
        if len(set(used)) < len(used):
            continue
        for e in product((0, 1), repeat=count):
            weight = 1.0
            for i in range(count):
                weight *= r[i] if e[i] else 1.0 - r[i]
                if d[i] >= 0:
                    weight *= detection[i] * likelihood[i, d[i]] if e[i] else 0.0
                elif e[i]:
                    weight *= 1.0 - detection[i]
            for j in range(observed):
                if j not in used:
                    weight *= births[j] + clutters[j]
            total += weight
            for i in range(count):
                existence[i] += weight * e[i]
                if d[i] >= 0:
                    pairs[i, d[i]] += weight
            for j in range(observed):
                if j not in used and births[j] > 0.0:
                    born[j] += weight * births[j] / (births[j] + clutters[j])
    return pairs / total, existence / total, born / total


def mixture(
    mean: np.ndarray, covariance: np.ndarray, components: Sequence[tuple[float, np.ndarray, np.ndarray]]
) -> tuple[np.ndarray, np.ndarray]:
    """Mean and covariance of a prior Gaussian with the rest of the weight, and of (weight, mean, covariance) each."""
    parts = [(1.0 - sum(each[0] for each in components), mean, covariance), *components]
    centre = sum(w * m for w, m, _ in parts)
    spread = sum(w * (p + np.outer(m - centre, m - centre)) for w, m, p in parts)
    return np.asarray(centre), np.asarray(spread)
