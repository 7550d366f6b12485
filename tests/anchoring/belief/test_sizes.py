"""Many instances, many updates: work is bounded, beliefs stay beliefs."""

import os

import numpy as np
import pytest

from dyknow.anchoring.belief.description import InitialInstance, LifeThresholds, WorldLimits
from dyknow.anchoring.belief.environment import EnvironmentModel
from dyknow.anchoring.belief.gaussians import GaussianBeliefs, Innovations
from tests.anchoring.belief.worlds import S, position, seen, sensor, world

FULL = bool(os.environ.get("DYKNOW_FULL"))
COUNT = 10_000 if FULL else 1_000


def crowd(count: int, side_m: float, **about: object) -> EnvironmentModel:
    rng = np.random.default_rng(3)
    places = rng.uniform(-side_m / 2.0, side_m / 2.0, (count, 2))
    initial = [
        InitialInstance(f"i{i}", 0.9, {"position_m": (np.array([*place, 0.0, 0.0]), np.diag([1.0, 1.0, 0.1, 0.1]))})
        for i, place in enumerate(places)
    ]
    model = world(
        sensor(births=1.0, clutter=5.0), place=position(2, 0.1, side_m), initial=initial, kept_per_s=0.99,
        thresholds=LifeThresholds(0.1, 0.9, 0.01), **about,
    )  # fmt: skip
    return EnvironmentModel(model, 0)


def test_thousands_of_instances_are_updated_by_a_scan_of_them_all_and_by_one_observation() -> None:
    environment = crowd(COUNT, 20.0 * COUNT**0.5, limits=WorldLimits(instances=COUNT + 5, scan=COUNT))
    before = environment.table.gaussian["position_m"].mean[:, :2]
    report = environment.observe_scan([seen(0.1, *place) for place in before])
    assert len(report.rows) < 40 * COUNT
    observed = min(COUNT, environment.model.limits.scan)
    assert environment.table.existence[:observed].mean() > 0.97
    single = environment.observe(seen(0.2, *before[7]))
    assert single.associations[0]["i7"] > 0.5
    assert len(environment.most_certain(100)) == 100


def test_what_is_seen_in_one_place_by_a_hostile_sensor_is_bounded_and_told() -> None:
    """All instances within one gate, as many observations as are allowed in the same place, again and again."""
    environment = crowd(COUNT, 2.0, limits=WorldLimits(instances=COUNT + 5, scan=200, pairs=20_000))
    for step in range(1, 4):
        report = environment.observe_scan([seen(step / 10.0, 0.0, 0.0) for _ in range(400)])
        assert len(report.rows) <= 20_000
        assert len(report.births) == 200
        assert not report.is_exact
        assert [each.kind for each in report.events].count("limited") >= 2
        assert len(environment.table) <= COUNT + 5
        assert ((environment.table.existence > 0.0) & (environment.table.existence <= 1.0)).all()
    assert environment.counts["limited"] >= 6


def test_new_instances_are_refused_beyond_the_limit_and_the_refusal_is_told() -> None:
    model = world(sensor(births=10.0, clutter=0.1), place=position(1, 0.0, 1e4), limits=WorldLimits(instances=300))
    environment = EnvironmentModel(model)
    rng = np.random.default_rng(1)
    for step in range(5):
        environment.observe_scan([seen(step, *place) for place in rng.uniform(-5e3, 5e3, (200, 2))])
    assert len(environment.table) <= 300
    assert environment.counts["limited"] >= 1


def test_covariances_stay_positive_definite_over_very_many_updates() -> None:
    """Random weights and observations, 100 instances at a time."""
    rng = np.random.default_rng(2)
    beliefs = GaussianBeliefs(position(2, 0.5))
    beliefs.append(np.zeros((100, 4)), np.tile(np.diag([1.0, 1.0, 4.0, 4.0]), (100, 1, 1)))
    rows = np.arange(100)
    for _ in range(1000 if FULL else 100):
        beliefs.predict(float(rng.choice([0.01, 0.1, 1.0, 10.0])))
        noise = np.tile(np.eye(2) * 10.0 ** rng.uniform(-6, 4), (100, 1, 1))
        values = beliefs.mean[:, :2] + rng.normal(0.0, 10.0 ** rng.uniform(-3, 2), (100, 2))
        innovations = beliefs.innovations(rows, rows, values, noise)
        assert isinstance(innovations, Innovations)
        beliefs.update(rows, rng.choice([1e-6, 0.5, 1.0 - 1e-9, 1.0], 100), innovations)
        spread = np.linalg.eigvalsh(beliefs.covariance)
        assert (spread[:, 0] > -1e-9 * spread[:, -1]).all()
        assert np.array_equal(beliefs.covariance, beliefs.covariance.transpose(0, 2, 1))


def test_seconds_of_silence_are_predicted_as_one_or_as_many_steps() -> None:
    one, many = crowd(20, 100.0), crowd(20, 100.0)
    one.predict_to(8 * S)
    for step in range(1, 17):
        many.predict_to(step * S // 2)
    assert many.table.existence == pytest.approx(one.table.existence)
    assert many.table.gaussian["position_m"].covariance == pytest.approx(one.table.gaussian["position_m"].covariance)


@pytest.mark.parametrize("order", [1, 2, 3])
@pytest.mark.parametrize("seconds", [0.04, 1.0, 7.5])
def test_the_noise_of_motion_is_that_of_filterpy(order: int, seconds: float) -> None:
    from filterpy.common import Q_continuous_white_noise

    beliefs = GaussianBeliefs(position(order, 0.7))
    beliefs.append(np.zeros((1, 2 * order)), np.zeros((1, 2 * order, 2 * order)))
    beliefs.predict(seconds)
    expected = np.array([[seconds]]) if order == 1 else Q_continuous_white_noise(order, seconds)
    assert beliefs.covariance[0] == pytest.approx(0.7 * np.kron(expected, np.eye(2)), rel=1e-12)
