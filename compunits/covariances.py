"""Covariances of samples as matrices and back."""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from dyknow import Quality

Matrix: TypeAlias = NDArray[np.float64]
_ASYMMETRY = 1e-6


def covariance_in(quality: Quality, count: int) -> Matrix | None:
    """The covariance of `count` numbers; None unless it is given, finite, symmetric and positive definite."""
    try:
        matrix = np.array(quality.covariance, dtype=np.float64)
        if matrix.shape != (count, count) or not np.isfinite(matrix).all():
            return None
        if np.abs(matrix - matrix.T).max() > _ASYMMETRY * np.abs(matrix).max():
            return None
        np.linalg.cholesky(matrix)
    except (TypeError, ValueError, OverflowError):
        return None
    return matrix / 2.0 + matrix.T / 2.0


def quality_with(covariance: Matrix, certainty: float) -> Quality:
    symmetric = covariance / 2.0 + covariance.T / 2.0
    return Quality(certainty, tuple([tuple(row) for row in symmetric.tolist()]))
