"""States of objects on the plane, and the arithmetic of their estimates.

A state is a Gaussian over (x, y, vx, vy) in metres and metres per second: x east, y north, in one frame for all
objects. A quantity that a sensor does not measure has a large variance. An estimate moves with constant velocity under
white acceleration noise of density q (m^2/s^3) on each axis; over dt seconds

    F = [[1, dt], [0, 1]],  Q = q [[dt^3 / 3, dt^2 / 2], [dt^2 / 2, dt]]

and two estimates a, b with independent errors are weighed by their covariances: K = A (A + B)^-1, x = a + K (b - a),
P = A - K A. Where it is not known how their errors are correlated, covariance intersection takes the place of that.
"""

from collections.abc import Mapping
from math import hypot, sqrt
from types import MappingProxyType
from typing import Final, NamedTuple, TypeAlias

import numpy as np

from dyknow import US_PER_S, Value
from dyknow.compunits.covariances import Matrix
from dyknow.compunits.intersection import intersect

Attributes: TypeAlias = Mapping[str, Value]
NO_ATTRIBUTES: Final[Attributes] = MappingProxyType({})
UNMEASURED: Final = 1e6
"""Variance of a velocity that is not measured, m^2/s^2."""


class ObjectState(NamedTuple):
    """The state of an object at one time.

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
    covariance = np.zeros((4, 4))
    covariance[0, 0] = covariance[1, 1] = position
    covariance[2, 2] = covariance[3, 3] = velocity
    return covariance


def moved(state: ObjectState, to_us: int, noise: float) -> ObjectState:
    """The state predicted to a later time with constant velocity; `noise` is q in m^2/s^3."""
    if to_us == state.valid_us:
        return state
    seconds = (to_us - state.valid_us) / US_PER_S
    _, x_m, y_m, vx_m_s, vy_m_s, covariance, attributes = state
    grown = _grown(covariance, seconds, noise)
    return ObjectState(to_us, x_m + seconds * vx_m_s, y_m + seconds * vy_m_s, vx_m_s, vy_m_s, grown, attributes)


def _grown(covariance: Matrix, t: float, noise: float) -> Matrix:
    """F P F^T + Q, element by element: numpy takes longer to begin with matrices this small than that does."""
    (xx, xy, xu, xv), (_, yy, yu, yv), (_, _, uu, uv), (_, _, _, vv) = covariance.tolist()
    of_velocity, of_both, of_place = noise * t, noise * t * t / 2.0, noise * t * t * t / 3.0
    place_xy = xy + t * (xv + yu) + t * t * uv
    both_xu, both_xv, both_yu, both_yv = xu + t * uu + of_both, xv + t * uv, yu + t * uv, yv + t * vv + of_both
    return np.array(
        (
            (xx + 2.0 * t * xu + t * t * uu + of_place, place_xy, both_xu, both_xv),
            (place_xy, yy + 2.0 * t * yv + t * t * vv + of_place, both_yu, both_yv),
            (both_xu, both_yu, uu + of_velocity, uv),
            (both_xv, both_yv, uv, vv + of_velocity),
        )
    )


def weighed(prior: ObjectState, measured: ObjectState) -> ObjectState:
    """Both estimates weighed by their covariances; valid when the second is, with its attributes over the first's."""
    if measured.covariance[2, 2] >= UNMEASURED and measured.covariance[3, 3] >= UNMEASURED:
        return _placed(prior, measured)
    gain = np.linalg.solve(prior.covariance + measured.covariance, prior.covariance).T
    mean = np.array(prior[1:5])
    mean += gain @ (np.array(measured[1:5]) - mean)
    covariance = prior.covariance - gain @ prior.covariance
    return _estimate(measured.valid_us, mean, covariance, {**prior.attributes, **measured.attributes})


def _placed(prior: ObjectState, measured: ObjectState) -> ObjectState:
    """The same where the velocity is not measured: K = P H^T (H P H^T + R)^-1 with H = [I 0], element by element."""
    (xx, xy, xu, xv), (_, yy, yu, yv), (_, _, uu, uv), (_, _, _, vv) = prior.covariance.tolist()
    (a, b), (_, c) = measured.covariance[:2, :2].tolist()
    a, b, c = a + xx, b + xy, c + yy
    determinant = a * c - b * b
    a, b, c = a / determinant, b / determinant, c / determinant
    dx, dy = measured.x_m - prior.x_m, measured.y_m - prior.y_m
    x1, x2, y1, y2 = xx * c - xy * b, xy * a - xx * b, xy * c - yy * b, yy * a - xy * b
    u1, u2, v1, v2 = xu * c - yu * b, yu * a - xu * b, xv * c - yv * b, yv * a - xv * b
    new_xy = xy - x1 * xy - x2 * yy
    new_xu, new_xv = xu - x1 * xu - x2 * yu, xv - x1 * xv - x2 * yv
    new_yu, new_yv = yu - y1 * xu - y2 * yu, yv - y1 * xv - y2 * yv
    new_uv = uv - u1 * xv - u2 * yv
    covariance = np.array(
        (
            (xx - x1 * xx - x2 * xy, new_xy, new_xu, new_xv),
            (new_xy, yy - y1 * xy - y2 * yy, new_yu, new_yv),
            (new_xu, new_yu, uu - u1 * xu - u2 * yu, new_uv),
            (new_xv, new_yv, new_uv, vv - v1 * xv - v2 * yv),
        )
    )
    return ObjectState(
        measured.valid_us,
        prior.x_m + x1 * dx + x2 * dy,
        prior.y_m + y1 * dx + y2 * dy,
        prior.vx_m_s + u1 * dx + u2 * dy,
        prior.vy_m_s + v1 * dx + v2 * dy,
        covariance,
        {**prior.attributes, **measured.attributes},
    )


def intersected(one: ObjectState, other: ObjectState) -> ObjectState:
    """Their covariance intersection: never more certain than is right, however their errors are correlated."""
    found = intersect(np.array(one[1:5]), one.covariance, np.array(other[1:5]), other.covariance, "trace")
    valid_us = max(one.valid_us, other.valid_us)
    return _estimate(valid_us, found.mean, found.covariance, {**one.attributes, **other.attributes})


def _estimate(valid_us: int, mean: Matrix, covariance: Matrix, attributes: Attributes) -> ObjectState:
    x_m, y_m, vx_m_s, vy_m_s = mean.tolist()
    return ObjectState(valid_us, x_m, y_m, vx_m_s, vy_m_s, (covariance + covariance.T) / 2, attributes)
