"""Two estimates of one thing whose errors may have to do with each other, made one.

Covariance intersection (Julier and Uhlmann, "A non-divergent estimation algorithm in the presence of unknown
correlations", 1997): for estimates a, b with covariances A, B and any w in [0, 1]

    P = (w A^-1 + (1 - w) B^-1)^-1,   x = P (w A^-1 a + (1 - w) B^-1 b)

is never more certain than is right, however a and b are correlated, and w is where trace or determinant of P is least.
With A = C C^T, B = G G^T and the singular value decomposition G^-1 C = W diag(s) V^T, the columns of M = C V make both
diagonal: P = M diag(1 / d_i) M^T, d_i = w + (1 - w) s_i^2. Then trace P = sum |m_i|^2 / d_i and
log det P = const - sum log d_i, both convex in w.
"""

import math
from collections.abc import Callable
from typing import Literal, NamedTuple, TypeAlias

import numpy as np

from dyknow import NO_VALUE, US_PER_S, Sample, computational_unit
from dyknow.compunits.covariances import Matrix, covariance_in, quality_with
from dyknow.compunits.numeric import Numbers, in_shape_of, is_number, numbers_of, positive

Criterion: TypeAlias = Literal["determinant", "trace"]
_GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0
_STEPS = 45
_LEAST_CERTAINTY = 1e-9
"""A less certain estimate has no part."""


class Intersection(NamedTuple):
    """The estimate, its covariance, and the weight w of the first."""

    mean: Matrix
    covariance: Matrix
    weight: float


def intersect(a: Matrix, cov_a: Matrix, b: Matrix, cov_b: Matrix, minimise: Criterion = "determinant") -> Intersection:
    """The covariance intersection of two estimates.

    Raises:
        ValueError: a covariance is not positive definite.
    """
    root = np.linalg.cholesky(cov_a)
    _, singular, turned = np.linalg.svd(np.linalg.solve(np.linalg.cholesky(cov_b), root))
    axes = root @ turned.T
    ratios = singular * singular
    lengths = (axes * axes).sum(axis=0)
    pairs: list[tuple[float, float]] = list(zip(lengths.tolist(), ratios.tolist(), strict=True))

    def trace(w: float) -> float:
        return sum(length / (w + (1.0 - w) * ratio) for length, ratio in pairs)

    def log_determinant(w: float) -> float:
        return -sum(math.log(w + (1.0 - w) * ratio) for _, ratio in pairs)

    weight = _least(trace if minimise == "trace" else log_determinant)
    scaled = axes / (weight + (1.0 - weight) * ratios)
    towards = turned @ np.linalg.solve(root, b - a)
    return Intersection(a + scaled @ ((1.0 - weight) * ratios * towards), scaled @ axes.T, weight)


def _least(f: Callable[[float], float]) -> float:
    """Where in [0, 1] a convex function is least, by golden section."""
    low, high = 0.0, 1.0
    one, other = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
    at_one, at_other = f(one), f(other)
    for _ in range(_STEPS):
        if at_one <= at_other:
            high, other, at_other = other, one, at_one
            one = high - _GOLDEN * (high - low)
            at_one = f(one)
        else:
            low, one, at_one = one, other, at_other
            other = low + _GOLDEN * (high - low)
            at_other = f(other)
    return min((0.0, 1.0, (low + high) / 2.0), key=f)


@computational_unit("?sort", "?sort", "?sort")
class CovarianceIntersection:
    """Two estimates of the same numbers, each with a covariance, as one with a covariance; valid when the later is.

    An estimate has a part in it if it is made of finite numbers, carries a covariance that is positive definite, and is
    no more than `seconds` older than the other. If one alone has, it is what comes out; if none has, there is no value.
    Each covariance is divided by the certainty of its sample, so that what is trusted less counts less. The certainty is
    the product of both: both have to be right.

    Args:
        minimise: `determinant`, which is the same in whatever units the components are, or `trace`.
        seconds: how much older one may be.
        drift: how the variance of every component grows while it gets older, units^2 / s.
    """

    def __init__(self, minimise: Criterion = "determinant", seconds: float = 1.0, drift: float = 0.0) -> None:
        if minimise not in {"determinant", "trace"}:
            raise ValueError(f"minimise must be determinant or trace, got {minimise!r}")
        if not (is_number(drift) and 0.0 <= drift < math.inf):
            raise ValueError(f"drift must be a number >= 0, got {drift!r}")
        self._minimise: Criterion = minimise
        self._oldest_us, self._drift = round(positive("seconds", seconds) * US_PER_S), drift

    def __call__(self, now_us: int, one: Sample, other: Sample) -> Sample:
        valid_us = max(one.valid_us, other.valid_us)
        parts = [part for part in (self._part(one, valid_us), self._part(other, valid_us)) if part is not None]
        if len(parts) == 2 and len(parts[0].mean) == len(parts[1].mean):
            return self._both(now_us, valid_us, *parts)
        if len(parts) == 1:
            alone = parts[0].sample
            return Sample(now_us, alone.valid_us, alone.value, alone.quality)
        return Sample(now_us, valid_us, NO_VALUE)

    def _part(self, sample: Sample, valid_us: int) -> "_Part | None":
        mean = numbers_of(sample.value)
        age_us = valid_us - sample.valid_us
        covariance = None if mean is None or age_us > self._oldest_us else covariance_in(sample.quality, len(mean))
        certainty = sample.quality.certainty
        if mean is None or covariance is None or certainty < _LEAST_CERTAINTY:
            return None
        older = np.eye(len(mean)) * (self._drift * age_us / US_PER_S)
        return _Part(sample, mean, (covariance + older) / certainty)

    def _both(self, now_us: int, valid_us: int, one: "_Part", other: "_Part") -> Sample:
        certainty = one.sample.quality.certainty * other.sample.quality.certainty
        try:
            with np.errstate(all="ignore"):
                found = intersect(
                    np.array(one.mean), one.covariance, np.array(other.mean), other.covariance, self._minimise
                )
        except (ValueError, ArithmeticError):
            return Sample(now_us, valid_us, NO_VALUE)
        value = in_shape_of(one.sample.value, found.mean.tolist())
        if value is NO_VALUE or not np.isfinite(found.covariance).all():
            return Sample(now_us, valid_us, NO_VALUE)
        return Sample(now_us, valid_us, value, quality_with(found.covariance, certainty))


class _Part(NamedTuple):
    sample: Sample
    mean: Numbers
    covariance: Matrix
