"""Targets, their detections and clutter, the same for all sides; and how far estimates are off."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

P_D, NOISE_SD_M, ACCELERATION = 0.9, 1.0, 0.1
"""Detection; error of a position on each axis; density of the noise of a velocity, m^2/s^3."""
SPEED_SD_M_S = 2.0
AREA_PER_TARGET_M2 = 400.0
CUTOFF_M = 10.0


class Scan(NamedTuple):
    """Truth (N, 4), x, y and their rates, and detections (M, 2) in no order."""

    truth: NDArray[np.float64]
    detections: NDArray[np.float64]


class TargetScene(NamedTuple):
    """Estimates at the beginning, mean (N, 4) and covariance (4, 4), and a scan each second."""

    side_m: float
    clutter: float
    mean: NDArray[np.float64]
    covariance: NDArray[np.float64]
    scans: list[Scan]


def scene(targets: int, clutter_per_target: float, scans: int, seed: int) -> TargetScene:
    rng = np.random.default_rng(seed)
    side_m = float(np.sqrt(AREA_PER_TARGET_M2 * targets))
    half = side_m / 2.0
    covariance = np.diag([NOISE_SD_M**2, NOISE_SD_M**2, 0.25, 0.25])
    state = np.hstack((rng.uniform(-half, half, (targets, 2)), rng.normal(0.0, SPEED_SD_M_S, (targets, 2))))
    mean = state + rng.multivariate_normal(np.zeros(4), covariance, targets)
    block = np.array([[1 / 3, 1 / 2], [1 / 2, 1.0]]) * ACCELERATION
    noise, transition = np.kron(block, np.eye(2)), np.kron([[1.0, 1.0], [0.0, 1.0]], np.eye(2))
    made = []
    for _ in range(scans):
        state = state @ transition.T + rng.multivariate_normal(np.zeros(4), noise, targets)
        seen = state[rng.random(targets) < P_D, :2]
        false = rng.uniform(-half, half, (rng.poisson(clutter_per_target * targets), 2))
        detections = np.vstack((seen + rng.normal(0.0, NOISE_SD_M, seen.shape), false))
        made.append(Scan(state, rng.permutation(detections)))
    return TargetScene(side_m, clutter_per_target * targets, mean, covariance, made)


def gospa(truth: NDArray[np.float64], estimates: NDArray[np.float64]) -> float:
    """Of positions (N, 2), p = 2, alpha = 2: what is farther than the cutoff is missed, and false."""
    distances = np.minimum(np.linalg.norm(truth[:, None] - estimates[None], axis=2), CUTOFF_M)
    rows, cols = linear_sum_assignment(distances**2)
    matched = distances[rows, cols] ** 2
    unmatched = abs(len(truth) - len(estimates)) * CUTOFF_M**2 / 2.0
    return float(np.sqrt(matched.sum() + unmatched))
