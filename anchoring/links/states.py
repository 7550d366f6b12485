"""States of objects on the plane, and the arithmetic of their estimates.

A state is a Gaussian over (x, y, vx, vy) in metres and metres per second: x east, y north, in one frame for all objects.
What a sensor does not measure has a large variance. An estimate moves with constant velocity under white acceleration
noise of density q (m^2/s^3) on each axis; over dt seconds

    F = [[1, dt], [0, 1]],  Q = q [[dt^3 / 3, dt^2 / 2], [dt^2 / 2, dt]]

and two estimates a, b with independent errors are weighed by their covariances: K = A (A + B)^-1, x = a + K (b - a),
P = A - K A. Where it is not known how their errors are correlated, covariance intersection takes the place of that.
"""

from collections.abc import Mapping
from functools import lru_cache
from math import hypot, sqrt
from types import MappingProxyType
from typing import Final, NamedTuple, TypeAlias

import numpy as np

from compunits.covariances import Matrix
from compunits.intersection import intersect
from dyknow import US_PER_S, Value

Attributes: TypeAlias = Mapping[str, Value]
NO_ATTRIBUTES: Final[Attributes] = MappingProxyType({})
UNMEASURED: Final = 1e6
"""Variance of a velocity that is not measured, m^2/s^2."""


class ObjectState(NamedTuple):
    """What is known of an object at one time.

    Attributes:
        valid_us: valid time.
        x_m, y_m: east and north in the frame of all objects.
        vx_m_s, vy_m_s: velocity.
        covariance: (4, 4), of x, y, vx, vy.
        attributes: everything else, by name; those of the levels below are among them.
    """

    valid_us: int
    x_m: float
    y_m: float
    vx_m_s: float
    vy_m_s: float
    covariance: Matrix
    attributes: Attributes = NO_ATTRIBUTES

    @property
    def speed_m_s(self) -> float:
        return hypot(self.vx_m_s, self.vy_m_s)

    @property
    def deviation_m(self) -> float:
        """Square root of the trace of the position's covariance."""
        return sqrt(self.covariance[0, 0] + self.covariance[1, 1])

    def distance_m(self, other: "ObjectState") -> float:
        """Between the two positions."""
        return hypot(self.x_m - other.x_m, self.y_m - other.y_m)


def diagonal(position_sd_m: float, velocity_sd_m_s: float | None = None) -> Matrix:
    """The covariance of independent axes; None: the velocity is not measured."""
    velocity = UNMEASURED if velocity_sd_m_s is None else velocity_sd_m_s * velocity_sd_m_s
    position = position_sd_m * position_sd_m
    return np.diag([position, position, velocity, velocity])


def moved(state: ObjectState, to_us: int, noise: float) -> ObjectState:
    """The state predicted to a later time with constant velocity; `noise` is q in m^2/s^3."""
    if to_us == state.valid_us:
        return state
    seconds = (to_us - state.valid_us) / US_PER_S
    transition, unit_noise = _constant_velocity(seconds)
    _, x_m, y_m, vx_m_s, vy_m_s, covariance, attributes = state
    grown = transition @ covariance @ transition.T + noise * unit_noise
    return ObjectState(to_us, x_m + seconds * vx_m_s, y_m + seconds * vy_m_s, vx_m_s, vy_m_s, grown, attributes)


@lru_cache(maxsize=4096)
def _constant_velocity(seconds: float) -> tuple[Matrix, Matrix]:
    """F and Q / q."""
    transition, noise = np.eye(4), np.zeros((4, 4))
    for axis in (0, 1):
        transition[axis, axis + 2] = seconds
        noise[axis, axis] = seconds**3 / 3
        noise[axis, axis + 2] = noise[axis + 2, axis] = seconds**2 / 2
        noise[axis + 2, axis + 2] = seconds
    return transition, noise


def weighed(prior: ObjectState, measured: ObjectState) -> ObjectState:
    """Both estimates weighed by their covariances; valid when the second is, with its attributes over the first's."""
    gain = np.linalg.solve(prior.covariance + measured.covariance, prior.covariance).T
    mean = np.array(prior[1:5])
    mean += gain @ (np.array(measured[1:5]) - mean)
    covariance = prior.covariance - gain @ prior.covariance
    return _estimate(measured.valid_us, mean, covariance, {**prior.attributes, **measured.attributes})


def intersected(one: ObjectState, other: ObjectState) -> ObjectState:
    """Their covariance intersection: never more certain than is right, however their errors are correlated."""
    found = intersect(np.array(one[1:5]), one.covariance, np.array(other[1:5]), other.covariance, "trace")
    valid_us = max(one.valid_us, other.valid_us)
    return _estimate(valid_us, found.mean, found.covariance, {**one.attributes, **other.attributes})


def _estimate(valid_us: int, mean: Matrix, covariance: Matrix, attributes: Attributes) -> ObjectState:
    x_m, y_m, vx_m_s, vy_m_s = mean.tolist()
    return ObjectState(valid_us, x_m, y_m, vx_m_s, vy_m_s, (covariance + covariance.T) / 2, attributes)
