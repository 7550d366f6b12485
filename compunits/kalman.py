"""Kalman filters whose estimates state their errors: `quality.covariance` of the output.

A measurement is weighed by the covariance its sample carries; where it carries none, by `deviation`. Where a sample has
no value the estimate is predicted to its time, for at most `silence_s` beyond the last measurement; after that there is
no value, and the next measurement restarts it. Samples that are late give nothing. Each axis has white noise of its own:

    constant: x' = x + w,                 Q = q dt
    moving:   x' = x + v dt, v' = v + w,  Q = q [[dt^3 / 3, dt^2 / 2], [dt^2 / 2, dt]]

so predicting in one step or in several gives the same. filterpy does the arithmetic; it is imported when the first
process is made, which takes half a second: make it before flying.
"""

from typing import Any

import numpy as np

from dyknow import NO_VALUE, US_PER_S, Sample, Value, computational_unit
from dyknow.compunits.covariances import Matrix, covariance_in, quality_with
from dyknow.compunits.motion import Position, position_of
from dyknow.compunits.numeric import Numbers, in_shape_of, numbers_of, positive
from dyknow.navigation import LocalFrame
from dyknow.navigation.geodesy import metres_per_degree

_REANCHOR_M = 2_000.0


class Axes:
    """Some axes with the same model: their places and, if they move, their rates.

    Args:
        count: number of axes.
        noise: density q, squared units per second (constant) or per second cubed (moving).
        rate_deviation: of the rates at first, units per second; None is the constant model.
        silence_s: the longest prediction.
    """

    def __init__(self, count: int, noise: float, rate_deviation: float | None, silence_s: float) -> None:
        from filterpy.kalman import KalmanFilter

        self.count = count
        self._orders = 1 if rate_deviation is None else 2
        self._noise, self._rate_variance = noise, (rate_deviation or 0.0) ** 2
        self._silence_us = round(silence_s * US_PER_S)
        self._kalman: Any = KalmanFilter(dim_x=count * self._orders, dim_z=count)
        self._kalman.H = np.eye(count, count * self._orders)
        self.valid_us: int | None = None
        self._measured_us = 0

    @property
    def mean(self) -> Matrix:
        """The places, then the rates: (count,) or (2 count,)."""
        return self._kalman.x[:, 0]  # type: ignore[no-any-return]

    @property
    def covariance(self) -> Matrix:
        return self._kalman.P  # type: ignore[no-any-return]

    def goes_on_at(self, valid_us: int) -> bool:
        """Whether there is an estimate that may be predicted so far."""
        return self.valid_us is not None and valid_us - self._measured_us <= self._silence_us

    def rates_at(self, valid_us: int) -> tuple[Matrix, Matrix] | None:
        """The rates predicted to an instant, and their covariance; None where there is no estimate."""
        if self.valid_us is None or not self.goes_on_at(valid_us):
            return None
        grown = max(0, valid_us - self.valid_us) / US_PER_S * self._noise * np.eye(self.count)
        return self.mean[self.count :], self.covariance[self.count :, self.count :] + grown

    def is_late(self, valid_us: int) -> bool:
        return self.valid_us is not None and valid_us < self.valid_us

    def step(self, valid_us: int, measured: Numbers | None, variances: Matrix | None) -> bool:
        """Predict to `valid_us`, which is not late, and take in a measurement; whether there is an estimate then."""
        with np.errstate(all="ignore"):
            if self.valid_us is None or not self.goes_on_at(valid_us):
                self.valid_us = None
            else:
                self._predict((valid_us - self.valid_us) / US_PER_S)
                self.valid_us = valid_us
            if measured is not None and variances is not None:
                self._take_in(valid_us, np.array(measured)[:, None], variances)
            if self.valid_us is not None and not self._is_finite():
                self.valid_us = None
        return self.valid_us is not None

    def shift(self, offset: Numbers) -> None:
        """Count the places from a point `offset` away."""
        self._kalman.x[: self.count, 0] -= offset

    def _predict(self, dt: float) -> None:
        if self._orders == 1:
            transition, noise = np.eye(1), np.array([[dt]])
        else:
            transition = np.array([[1.0, dt], [0.0, 1.0]])
            noise = np.array([[dt**3 / 3.0, dt * dt / 2.0], [dt * dt / 2.0, dt]])
        each = np.eye(self.count)
        self._kalman.predict(F=np.kron(transition, each), Q=np.kron(self._noise * noise, each))

    def _take_in(self, valid_us: int, measured: Matrix, variances: Matrix) -> None:
        kalman, count = self._kalman, self.count
        if self.valid_us is None:
            kalman.x = np.zeros((count * self._orders, 1))
            kalman.x[:count] = measured
            kalman.P = np.eye(count * self._orders) * self._rate_variance
            kalman.P[:count, :count] = variances
        else:
            try:
                kalman.update(measured, R=variances)
            except np.linalg.LinAlgError:
                kalman.x[:] = np.nan
        self.valid_us = self._measured_us = valid_us

    def _is_finite(self) -> bool:
        return bool(np.isfinite(self._kalman.x).all() and np.isfinite(self._kalman.P).all())


class _Records:
    """A filter over numbers or records of numbers, as many axes as the first of them has components."""

    def __init__(self, noise: float, deviation: float, rate_deviation: float | None, silence_s: float) -> None:
        self._noise, self._variance = positive("noise", noise), positive("deviation", deviation) ** 2
        self._rate_deviation = None if rate_deviation is None else positive("rate_deviation", rate_deviation)
        self._silence_s = positive("silence_s", silence_s)
        self._axes = self._new(1)
        self._shape: Value = 0.0

    def __call__(self, now_us: int, sample: Sample) -> Sample | None:
        if self._axes.is_late(sample.valid_us):
            return None
        measured = numbers_of(sample.value)
        if measured is not None:
            self._shape = sample.value
            if len(measured) != self._axes.count:
                self._axes = self._new(len(measured))
        axes = self._axes
        if not axes.step(sample.valid_us, measured, self._variances(sample, axes.count)):
            return Sample(now_us, sample.valid_us, NO_VALUE, sample.quality)
        count = axes.count
        value = in_shape_of(self._shape, axes.mean[:count].tolist())
        return Sample(
            now_us, sample.valid_us, value, quality_with(axes.covariance[:count, :count], sample.quality.certainty)
        )

    def _new(self, count: int) -> Axes:
        return Axes(count, self._noise, self._rate_deviation, self._silence_s)

    def _variances(self, sample: Sample, count: int) -> Matrix:
        said = covariance_in(sample.quality, count)
        return np.eye(count) * self._variance if said is None else said


@computational_unit("?sort", "?sort", history_us=3 * US_PER_S)
class KalmanConstant(_Records):
    """A quantity that stays nearly constant: a random walk of each component.

    Args:
        noise: how fast it may wander, units^2 / s.
        deviation: standard deviation of a measurement that says none, units.
        silence_s: the longest prediction.
    """

    def __init__(self, noise: float = 0.01, deviation: float = 1.0, silence_s: float = 10.0) -> None:
        super().__init__(noise, deviation, None, silence_s)


@computational_unit("?sort", "?sort", history_us=3 * US_PER_S, cheaper="KalmanConstant")
class KalmanMoving(_Records):
    """A quantity that moves at a nearly constant rate: a random walk of the rate of each component.

    Args:
        noise: how fast the rate may change, units^2 / s^3.
        deviation: standard deviation of a measurement that says none, units.
        rate_deviation: standard deviation of the rate at first, units / s.
        silence_s: the longest prediction.
    """

    def __init__(
        self, noise: float = 1.0, deviation: float = 1.0, rate_deviation: float = 10.0, silence_s: float = 10.0
    ) -> None:
        super().__init__(noise, deviation, rate_deviation, silence_s)


class _Level:
    """Two moving axes, north and east in metres about a point that follows the positions."""

    def __init__(self, noise: float, deviation_m: float, speed_m_s: float, silence_s: float) -> None:
        self.axes = Axes(
            2, positive("noise", noise), positive("speed_m_s", speed_m_s), positive("silence_s", silence_s)
        )
        self._variance = positive("deviation_m", deviation_m) ** 2
        self._frame: LocalFrame | None = None

    def step(self, sample: Sample) -> bool:
        """Take in a sample that is not late; whether there is an estimate at its time."""
        place = position_of(sample.value)
        if place is None:
            return self.axes.step(sample.valid_us, None, None)
        measured = self._frame_for(place, sample.valid_us).to_ned(*place, 0.0)[:2]
        degrees = covariance_in(sample.quality, 2)
        if degrees is None:
            return self.axes.step(sample.valid_us, measured, np.eye(2) * self._variance)
        scale = np.diag(metres_per_degree(place[0]))
        return self.axes.step(sample.valid_us, measured, scale @ degrees @ scale)

    def position(self) -> tuple[Numbers, Matrix]:
        """(latitude, longitude) in degrees and their covariance in degrees squared, once `step` returned True."""
        assert self._frame is not None  # noqa: S101 - there is one from the first position on
        north_m, east_m = self.axes.mean[:2].tolist()
        latitude_deg, longitude_deg, _ = self._frame.from_ned(north_m, east_m, 0.0)
        scale = np.diag([1.0 / each for each in metres_per_degree(latitude_deg)])
        return (latitude_deg, longitude_deg), scale @ self.axes.covariance[:2, :2] @ scale

    def _frame_for(self, place: Position, valid_us: int) -> LocalFrame:
        """The plane touches the ellipsoid near the place: within 2 km it is right within a millimetre."""
        if self._frame is None or not self.axes.goes_on_at(valid_us):
            self._frame = LocalFrame(*place, 0.0)
            return self._frame
        north_m, east_m = self.axes.mean[:2].tolist()
        if max(abs(north_m), abs(east_m)) > _REANCHOR_M:
            latitude_deg, longitude_deg, _ = self._frame.from_ned(north_m, east_m, 0.0)
            self._frame = LocalFrame(latitude_deg, longitude_deg, 0.0)
            self.axes.shift((north_m, east_m))
        return self._frame


@computational_unit("position", "position", history_us=3 * US_PER_S)
class KalmanPosition:
    """Smoothed positions of what moves at a constant velocity, nearly; covariance in degrees squared.

    Args:
        noise: how fast the velocity may change, m^2 / s^3 on each axis.
        deviation_m: standard deviation of a position that says none, on each axis.
        speed_m_s: standard deviation of the velocity at first, on each axis.
        silence_s: the longest prediction.
    """

    def __init__(
        self, noise: float = 1.0, deviation_m: float = 1.0, speed_m_s: float = 10.0, silence_s: float = 10.0
    ) -> None:
        self._level = _Level(noise, deviation_m, speed_m_s, silence_s)

    def __call__(self, now_us: int, sample: Sample) -> Sample | None:
        if self._level.axes.is_late(sample.valid_us):
            return None
        if not self._level.step(sample):
            return Sample(now_us, sample.valid_us, NO_VALUE, sample.quality)
        place, covariance = self._level.position()
        if not np.isfinite(covariance).all() or position_of(place) is None:
            return Sample(now_us, sample.valid_us, NO_VALUE, sample.quality)
        return Sample(now_us, sample.valid_us, place, quality_with(covariance, sample.quality.certainty))


@computational_unit("velocity", "position", "altitude", history_us=3 * US_PER_S)
class KalmanVelocity:
    """Velocity (north, east, down) from positions and altitudes, m/s; covariance in (m/s)^2.

    Valid at the later of the two; the older one is predicted to it. Arguments as for `KalmanPosition`.
    """

    def __init__(
        self, noise: float = 1.0, deviation_m: float = 1.0, speed_m_s: float = 10.0, silence_s: float = 10.0
    ) -> None:
        self._level = _Level(noise, deviation_m, speed_m_s, silence_s)
        self._upright = Axes(1, noise, speed_m_s, silence_s)
        self._variance = np.eye(1) * deviation_m**2
        self._taken: list[Sample | None] = [None, None]

    def __call__(self, now_us: int, position: Sample, altitude: Sample) -> Sample | None:
        level, upright = self._level.axes, self._upright
        fresh = [
            sample is not taken and not axes.is_late(sample.valid_us)
            for sample, taken, axes in zip((position, altitude), self._taken, (level, upright), strict=True)
        ]
        self._taken = [position, altitude]
        if not any(fresh):
            return None
        if fresh[0]:
            self._level.step(position)
        if fresh[1]:
            said = covariance_in(altitude.quality, 1)
            upright.step(altitude.valid_us, numbers_of(altitude.value, 1), self._variance if said is None else said)
        valid_us = max(position.valid_us, altitude.valid_us)
        horizontal, vertical = level.rates_at(valid_us), upright.rates_at(valid_us)
        if horizontal is None or vertical is None:
            return Sample(now_us, valid_us, NO_VALUE)
        value = (*horizontal[0].tolist(), -float(vertical[0][0]))
        covariance = np.zeros((3, 3))
        covariance[:2, :2], covariance[2:, 2:] = horizontal[1], vertical[1]
        certainty = position.quality.certainty * altitude.quality.certainty
        return Sample(now_us, valid_us, value, quality_with(covariance, certainty))
