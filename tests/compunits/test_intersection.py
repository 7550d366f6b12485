"""Covariance intersection: never more certain than is right, and as certain as it can be."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dyknow import NO_VALUE, Quality, Sample
from dyknow.compunits import intersect
from tests.compunits.units import process, variances

SEEDS = st.integers(0, 2**32 - 1)
COUNTS = st.integers(1, 5)
CRITERIA = st.sampled_from(["trace", "determinant"])


def covariance(generator, count):
    root = generator.normal(size=(count, count)) * generator.uniform(0.1, 5, count)
    return root @ root.T + 1e-3 * np.eye(count)


def root_of(matrix):
    return np.linalg.cholesky(matrix)


def textbook(a, cov_a, b, cov_b, w):
    """P = (w A^-1 + (1-w) B^-1)^-1, x = P (w A^-1 a + (1-w) B^-1 b)."""
    inv_a, inv_b = np.linalg.inv(cov_a), np.linalg.inv(cov_b)
    p = np.linalg.inv(w * inv_a + (1 - w) * inv_b)
    return p @ (w * inv_a @ a + (1 - w) * inv_b @ b), p


def cost(p, minimise):
    return np.trace(p) if minimise == "trace" else np.log(np.linalg.det(p))


@given(SEEDS, COUNTS, CRITERIA)
def test_it_is_the_textbooks_and_no_other_weight_is_better(seed, count, minimise) -> None:
    generator = np.random.default_rng(seed)
    a, b = generator.normal(size=count), generator.normal(size=count)
    cov_a, cov_b = covariance(generator, count), covariance(generator, count)
    mean, p, w = intersect(a, cov_a, b, cov_b, minimise)
    expected_mean, expected_p = textbook(a, cov_a, b, cov_b, w)
    assert mean == pytest.approx(expected_mean, rel=1e-5, abs=1e-5)
    assert p == pytest.approx(expected_p, rel=1e-5, abs=1e-6)
    least = min(cost(textbook(a, cov_a, b, cov_b, each)[1], minimise) for each in np.linspace(0, 1, 101))
    assert cost(p, minimise) <= least + 1e-6 * (1 + abs(least))


@given(SEEDS, COUNTS, CRITERIA)
def test_it_is_never_over_confident_whatever_the_correlation(seed, count, minimise) -> None:
    """The true covariance of the error, for sampled cross-correlations, some of them complete, is within what is said."""
    generator = np.random.default_rng(seed)
    cov_a, cov_b = covariance(generator, count), covariance(generator, count)
    _, p, w = intersect(np.zeros(count), cov_a, np.zeros(count), cov_b, minimise)
    gain_a, gain_b = w * p @ np.linalg.inv(cov_a), (1 - w) * p @ np.linalg.inv(cov_b)
    assert gain_a + gain_b == pytest.approx(np.eye(count), abs=1e-4), "it adds no bias"
    for strength in (0.0, 0.5, 1.0, 1.0, 1.0):
        turn = np.linalg.svd(generator.normal(size=(count, count)))
        cross = root_of(cov_a) @ (strength * turn[0] @ turn[2]) @ root_of(cov_b).T
        true = gain_a @ cov_a @ gain_a.T + gain_b @ cov_b @ gain_b.T + gain_a @ cross @ gain_b.T
        true += gain_b @ cross.T @ gain_a.T
        assert np.linalg.eigvalsh(p - true).min() > -1e-5 * np.trace(p)


def test_an_estimate_that_is_worse_in_every_direction_has_no_weight() -> None:
    a, b = np.array([1.0, 2.0]), np.array([9.0, 9.0])
    for minimise in ("trace", "determinant"):
        found = intersect(a, np.eye(2), b, 4 * np.eye(2), minimise)
        assert (found.weight, found.mean.tolist()) == (1.0, [1.0, 2.0])
        assert intersect(b, 4 * np.eye(2), a, np.eye(2), minimise).mean == pytest.approx(a)


def test_a_known_case() -> None:
    """Each knows one direction well: both are believed where they are good, each at half its information."""
    found = intersect(np.array([1.0, 0.0]), np.diag([1.0, 9.0]), np.array([0.0, 1.0]), np.diag([9.0, 1.0]))
    assert found.weight == pytest.approx(0.5, abs=1e-6)
    assert found.covariance == pytest.approx(np.diag([1.8, 1.8]))
    assert found.mean == pytest.approx([0.9, 0.9])


def fused(one: Sample, other: Sample, **settings):
    unit = process("CovarianceIntersection", **settings)
    assert unit.on_sample(0, one, 10) is None
    return unit.on_sample(1, other, 20)


def test_the_unit_propagates_covariance_certainty_and_time() -> None:
    one = Sample(5, 3, (1.0, 0.0), Quality(0.9, ((0.9, 0.0), (0.0, 8.1))))
    other = Sample(6, 4, (0.0, 1.0), Quality(0.8, ((7.2, 0.0), (0.0, 0.8))))
    made = fused(one, other)
    assert (made.available_us, made.valid_us) == (20, 4)
    assert made.value == pytest.approx((0.9, 0.9))
    assert made.quality.certainty == pytest.approx(0.72)
    assert np.array(made.quality.covariance) == pytest.approx(np.diag([1.8, 1.8]))


def test_simple_values_are_fused_too() -> None:
    made = fused(Sample(5, 5, 10.0, variances(4.0, 1)), Sample(5, 5, 12.0, variances(1.0, 1)))
    assert made.value == pytest.approx(12.0)
    assert made.quality.covariance == ((pytest.approx(1.0),),)


def test_who_has_no_value_or_no_covariance_or_is_too_old_has_no_part_in_it() -> None:
    good = Sample(5_000_000, 5_000_000, 1.0, variances(4.0, 1))
    old = Sample(1, 1, 2.0, variances(1.0, 1))
    for other in (
        old,
        good._replace(value=NO_VALUE),
        good._replace(value=math.nan),
        good._replace(quality=Quality()),
        good._replace(quality=Quality(1.0, ((-1.0,),))),
        good._replace(quality=Quality(1.0, ((math.nan,),))),
        good._replace(quality=Quality(1.0, ((1.0, 2.0),))),
    ):
        for pair in ((good, other), (other, good)):
            made = fused(*pair)
            assert (made.value, made.valid_us, made.quality) == (1.0, good.valid_us, good.quality)
        assert fused(other._replace(quality=Quality()), other._replace(quality=Quality())).value is NO_VALUE
    assert fused(good, old, seconds=10.0).value == 2.0


def test_an_older_estimate_counts_less_if_its_variance_drifts() -> None:
    old = Sample(0, 0, 0.0, variances(1.0, 1))
    new = Sample(1_000_000, 1_000_000, 1.0, variances(2.0, 1))
    assert fused(old, new).value == pytest.approx(0.0)
    assert fused(old, new, drift=5.0).value == pytest.approx(1.0)


def test_an_estimate_that_is_less_certain_counts_less() -> None:
    one, other = Quality(1.0, ((1.0, 0.0), (0.0, 9.0))), Quality(1.0, ((9.0, 0.0), (0.0, 1.0)))
    pair = Sample(5, 5, (1.0, 0.0), one), Sample(5, 5, (0.0, 1.0), other)
    trusted, doubted = fused(*pair), fused(pair[0], pair[1]._replace(quality=other._replace(certainty=0.1)))
    assert trusted.value == pytest.approx((0.9, 0.9))
    assert doubted.value[0] > 0.95
    assert doubted.value[1] < 0.6
    assert fused(pair[0], pair[1]._replace(quality=other._replace(certainty=0.0))).value == (1.0, 0.0)


def test_estimates_of_different_width_are_not_fused() -> None:
    one, other = Sample(5, 5, (1.0,), variances(1.0, 1)), Sample(5, 5, (1.0, 2.0), variances(1.0, 2))
    assert fused(one, other).value is NO_VALUE


@pytest.mark.parametrize("wrong", [{"minimise": "volume"}, {"seconds": 0}, {"drift": -1.0}, {"drift": math.nan}])
def test_settings_that_mean_nothing_are_refused(wrong) -> None:
    with pytest.raises(ValueError, match=next(iter(wrong))):
        process("CovarianceIntersection", **wrong)
