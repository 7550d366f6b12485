"""Which instances a sensor can see: detection probabilities from fields of view, and from how far it is trusted.

A sensor that is trusted by t detects an instance with probability t `detects`, and a share t of its reports of
something new counts:

    detects' = t detects,  births' = t births,  clutter' = clutter + (1 - t) births
"""

from dataclasses import replace
from typing import Final

import numpy as np

from dyknow.anchoring.belief.arrays import Flags, Floats
from dyknow.anchoring.belief.description import WorldSensor

_OUTSIDE: Final = 1e-9
"""Least probability of detection, also out of view: no certainty follows from one estimate."""


def detection(sensor: WorldSensor, mean: Floats, covariance: Floats) -> tuple[Floats, Floats]:
    """p_E and p_F (N,) of a sensor, for instances at `mean` (N, 2) with `covariance` (N, 2, 2).

    An instance that may be in view or not counts by the share of five points, the mean and four at sqrt(3) deviations.
    """
    seen = np.ones(len(mean)) if sensor.view_m is None else in_view(sensor.view_m, mean, covariance)
    return np.maximum(sensor.detects * seen, _OUTSIDE), sensor.false_alarm * seen


def trusted(sensor: WorldSensor, trust: float) -> WorldSensor:
    """The sensor as far as it is trusted, from 0 to 1."""
    if trust >= 1.0:
        return sensor
    births = trust * sensor.births
    clutter = sensor.clutter + sensor.births - births
    return replace(sensor, detects=max(trust, _OUTSIDE) * sensor.detects, births=births, clutter=clutter)


def in_view(corners: Floats, mean: Floats, covariance: Floats) -> Floats:
    """(N,) share of the belief that is within a polygon with these corners, (V, 2)."""
    if not len(mean):
        return np.zeros(0)
    spread, turned = np.linalg.eigh(covariance)
    steps = turned * np.sqrt(3.0 * np.maximum(spread, 0.0))[:, None, :]
    points = np.concatenate(
        (mean[None], *((mean + sign * steps[:, :, axis])[None] for axis in (0, 1) for sign in (-1, 1)))
    )
    weights = np.array([1.0 / 3.0, 1.0 / 6.0, 1.0 / 6.0, 1.0 / 6.0, 1.0 / 6.0])
    return weights @ inside(corners, points.reshape(-1, 2)).reshape(5, -1)


def inside(corners: Floats, points: Floats) -> Flags:
    """(P,) whether points (P, 2) are within a polygon: a ray from there crosses its border an odd number of times."""
    one, other = corners, np.roll(corners, -1, axis=0)
    x, y = points[:, 0, None], points[:, 1, None]
    spans = (one[:, 1] > y) != (other[:, 1] > y)
    height = other[:, 1] - one[:, 1]
    crossing = one[:, 0] + (y - one[:, 1]) / np.where(height == 0.0, 1.0, height) * (other[:, 0] - one[:, 0])
    return np.asarray((spans & (x < crossing)).sum(axis=1) % 2 == 1)
