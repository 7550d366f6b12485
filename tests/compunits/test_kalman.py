"""Against the textbook's equations, written out with inverses, one after the other."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dyknow import NO_VALUE, Quality, Sample
from dyknow.navigation import LocalFrame, distance_m
from dyknow.navigation.geodesy import metres_per_degree
from tests.compunits.test_motion import HERE, moved
from tests.compunits.units import outputs, process, stream, values, variances

FEW = settings(max_examples=settings.default.max_examples // 3)
S = 1_000_000


class Textbook:
    """x = F x; P = F P F' + Q; K = P H' (H P H' + R)^-1; x = x + K (z - H x); P = (I - K H) P."""

    def __init__(self, count: int, noise: float, rate_deviation: float | None) -> None:
        self.count, self.noise, self.rate = count, noise, rate_deviation
        self.x = self.p = self.at = None

    def predict(self, at: float) -> None:
        n, dt = self.count, at - self.at
        eye = np.eye(n)
        if self.rate is None:
            self.p = self.p + self.noise * dt * eye
        else:
            f = np.block([[eye, dt * eye], [0 * eye, eye]])
            q = self.noise * np.block([[dt**3 / 3 * eye, dt**2 / 2 * eye], [dt**2 / 2 * eye, dt * eye]])
            self.x, self.p = f @ self.x, f @ self.p @ f.T + q
        self.at = at

    def measure(self, at: float, z, r) -> None:
        n = self.count
        rates = 0 if self.rate is None else n
        if self.at is None:
            self.x = np.concatenate([z, np.zeros(rates)])
            self.p = np.diag([0.0] * n + [(self.rate or 0.0) ** 2] * rates)
            self.p[:n, :n] = r
            self.at = at
            return
        self.predict(at)
        h = np.eye(n, n + rates)
        k = self.p @ h.T @ np.linalg.inv(h @ self.p @ h.T + r)
        self.x = self.x + k @ (z - h @ self.x)
        self.p = (np.eye(n + rates) - k @ h) @ self.p


READINGS = st.lists(
    st.tuples(
        st.integers(0, 3_000),
        st.none() | st.tuples(st.floats(-100, 100), st.floats(-100, 100)),
        st.none() | st.floats(0.1, 9.0),
    ),
    min_size=1,
    max_size=15,
)


@FEW
@given(READINGS, st.sampled_from(["KalmanConstant", "KalmanMoving"]), st.floats(0.01, 5.0), st.floats(0.2, 4.0))
def test_it_is_the_filter_of_the_textbook(readings, name, noise, deviation) -> None:
    filter_ = Textbook(2, noise, 10.0 if name == "KalmanMoving" else None)
    at_ms, measured, samples, expected = 0, 0.0, [], []
    for step_ms, value, variance in readings:
        at_ms += step_ms
        at = at_ms / 1e3
        quality = Quality() if variance is None else variances(variance, 2)
        samples.append(Sample(at_ms * 1000, at_ms * 1000, NO_VALUE if value is None else value, quality))
        if filter_.at is not None and at - measured > 10.0:
            filter_.at = None
        if value is not None:
            r = np.eye(2) * (deviation**2 if variance is None else variance)
            filter_.measure(at, np.array(value), r)
            measured = at
        elif filter_.at is not None:
            filter_.predict(at)
        expected.append(None if filter_.at is None else (filter_.x[:2].copy(), filter_.p[:2, :2].copy()))
    for made, sample, wanted in zip(
        outputs(name, samples, noise=noise, deviation=deviation), samples, expected, strict=True
    ):
        assert made.valid_us == sample.valid_us
        if wanted is None:
            assert made.value is NO_VALUE
        else:
            assert made.value == pytest.approx(wanted[0].tolist(), rel=1e-6, abs=1e-6)
            assert np.array(made.quality.covariance) == pytest.approx(wanted[1], rel=1e-6, abs=1e-9)


def test_predicting_in_many_steps_gives_the_same_as_in_one() -> None:
    start = stream((0, 5.0), (1, 7.0))
    one = outputs("KalmanMoving", [*start, *stream((5, NO_VALUE))])[-1]
    many = outputs("KalmanMoving", [*start, *stream(*[(1 + i / 10, NO_VALUE) for i in range(1, 41)])])[-1]
    assert one.value == pytest.approx(many.value)
    assert one.quality.covariance[0] == pytest.approx(many.quality.covariance[0])


def test_late_samples_give_nothing_and_change_nothing() -> None:
    samples = stream((0, 1.0), (2, 2.0), (1, 50.0), (3, 3.0))
    found = values(outputs("KalmanMoving", samples))
    assert found[2] is None
    assert [*found[:2], found[3]] == values(outputs("KalmanMoving", [*samples[:2], samples[3]]))


def test_after_silence_there_is_no_value_and_then_a_new_beginning() -> None:
    samples = stream((0, 1.0), (9, NO_VALUE), (11, NO_VALUE), (12, 400.0))
    found = outputs("KalmanConstant", samples, silence_s=10.0)
    assert values(found) == [1.0, 1.0, NO_VALUE, 400.0]
    assert found[1].quality.deviation > found[0].quality.deviation
    assert found[3].quality == found[0].quality


def test_a_value_of_another_width_is_a_new_beginning() -> None:
    samples = stream((0, (1.0, 2.0)), (1, (3.0, 4.0, 5.0)))
    assert values(outputs("KalmanMoving", samples)) == [(1.0, 2.0), (3.0, 4.0, 5.0)]


@pytest.mark.parametrize("name", ["KalmanMoving", "KalmanPosition"])
def test_errors_are_as_large_as_the_covariance_says(name) -> None:
    """Mean normalised squared error over many seeded runs; 2 for two axes, if the filter is consistent."""
    generator = np.random.default_rng(7)
    scale = np.array(metres_per_degree(HERE[0])) if name == "KalmanPosition" else np.ones(2)
    frame = LocalFrame(*HERE, 0.0)
    squares = []
    for _ in range(20):
        place, rate, samples, truth = np.zeros(2), generator.normal(0, 10, 2), [], []
        for i in range(30):
            measured = place + generator.normal(0, 1, 2)
            value = frame.from_ned(*measured, 0.0)[:2] if name == "KalmanPosition" else tuple(measured.tolist())
            samples.append(Sample(i * S // 5, i * S // 5, value))
            truth.append(frame.from_ned(*place, 0.0)[:2] if name == "KalmanPosition" else place.copy())
            push = generator.multivariate_normal([0, 0], [[0.2**3 / 3, 0.2**2 / 2], [0.2**2 / 2, 0.2]], 2)
            place, rate = place + rate * 0.2 + push[:, 0], rate + push[:, 1]
        for made, true in list(zip(outputs(name, samples), truth, strict=True))[10:]:
            error = (np.array(made.value) - true) * scale
            covariance = np.array(made.quality.covariance) * np.outer(scale, scale)
            squares.append(error @ np.linalg.solve(covariance, error))
    assert np.mean(squares) == pytest.approx(2.0, rel=0.15)


@given(st.floats(-75, 75), st.floats(-179, 179))
def test_metres_per_degree_are_those_of_the_ellipsoid(latitude, longitude) -> None:
    north, east = metres_per_degree(latitude)
    assert 1e-3 * north == pytest.approx(distance_m(latitude - 5e-4, longitude, latitude + 5e-4, longitude), rel=1e-6)
    assert 1e-3 * east == pytest.approx(distance_m(latitude, longitude, latitude, longitude + 1e-3), rel=1e-6)


def test_positions_are_followed_far_away_from_where_they_began() -> None:
    place = HERE
    path = [(0, place)]
    for t in range(1, 61):
        place = moved(place, 100.0, 50.0)
        path.append((t, place))
    found = outputs("KalmanPosition", stream(*path))
    assert distance_m(*found[-1].value, *place) < 0.05
    assert found[-1].quality.deviation * metres_per_degree(HERE[0])[1] < 1.5


def test_after_silence_positions_begin_anew_wherever_they_are() -> None:
    far = (-33.9, 151.2)
    found = outputs("KalmanPosition", stream((0, HERE), (1, HERE), (100, far), (101, far)))
    assert [distance_m(*made.value, *far) for made in found[2:]] == pytest.approx([0, 0], abs=1e-3)


def test_a_position_that_says_how_good_it_is_is_weighed_by_that() -> None:
    there = moved(HERE, 100.0, 0.0)
    degrees = variances((1000.0 / metres_per_degree(HERE[0])[0]) ** 2, 2)
    bad = Sample(S, S, there, degrees)
    found = outputs("KalmanPosition", [*stream((0, HERE)), bad])[-1]
    assert distance_m(*found.value, *HERE) < 1.0


def test_velocity_comes_from_positions_and_altitudes_that_come_at_different_times() -> None:
    """Steady motion: 10 m/s north, -5 east, 2 down; altitudes are ahead of positions and neither is left out."""
    unit = process("KalmanVelocity")
    made = []
    for i in range(100):
        t = i / 10
        position = Sample(i * S // 10 + 60_000, i * S // 10, moved(HERE, 10 * t, -5 * t))
        altitude_s = t + 0.05
        altitude = Sample(i * S // 10 + 55_000, i * S // 10 + 50_000, (100.0 - 2 * altitude_s,))
        made.append(unit.on_sample(1, altitude, altitude.available_us))
        made.append(unit.on_sample(0, position, position.available_us))
    assert made[0] is None
    assert None not in made[1:]
    assert made[-1].value == pytest.approx((10, -5, 2), abs=0.05)
    assert made[-1].valid_us == 99 * S // 10 + 50_000
    covariance = np.array(made[-1].quality.covariance)
    assert covariance.shape == (3, 3)
    assert (np.linalg.eigvalsh(covariance) > 0).all()


def test_without_one_of_the_two_for_long_there_is_no_velocity() -> None:
    unit = process("KalmanVelocity", silence_s=2.0)
    unit.on_sample(0, Sample(0, 0, HERE), 0)
    assert unit.on_sample(1, Sample(0, 0, (5.0,)), 0).value == (0.0, 0.0, 0.0)
    assert unit.on_sample(1, Sample(3 * S, 3 * S, (5.0,)), 3 * S).value is NO_VALUE
    assert unit.on_sample(0, Sample(3 * S, 3 * S, HERE), 3 * S).value is not NO_VALUE


@pytest.mark.parametrize("setting", ["noise", "deviation", "rate_deviation", "silence_s"])
@pytest.mark.parametrize("wrong", [0.0, -1.0, math.nan, math.inf])
def test_settings_that_make_no_filter_are_refused(setting, wrong) -> None:
    with pytest.raises(ValueError, match=setting):
        process("KalmanMoving", **{setting: wrong})
