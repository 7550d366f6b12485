"""Detections of several cameras of one vehicle, put on the ground and fused: one per thing that was seen.

The errors of the vehicle's pose are the same in all its cameras, those of pixels are not. So two detections belong together
if their places differ by no more than their pixels err, and are weighed by that: P = P_pose + (R_1^-1 + R_2^-1)^-1.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from dyknow import Value
from dyknow.navigation.cameras.geolocation import PoseErrors, geolocate
from dyknow.navigation.cameras.ground import GroundModel
from dyknow.navigation.cameras.pinhole import FloatArray, Intrinsics, Pixel
from dyknow.navigation.cameras.state import CameraState

PERSON = "person"
"""The attribute of a detection by a detector of persons: how much like one it looks, from 0 to 1."""
GATE = 9.21
"""The square of the distance, in standard deviations, that 99 of 100 pairs of one thing do not exceed."""


class Detection(NamedTuple):
    """Something that a detector found in an image.

    Attributes:
        channel: the camera's name.
        attributes: what else it found, as a colour.
    """

    channel: str
    pixel: Pixel
    attributes: Mapping[str, Value]


class GroundDetection(NamedTuple):
    """A detection on the ground: metres north and east.

    Attributes:
        covariance: (2, 2), all errors.
        pixel_covariance: (2, 2), the part of it that the pixels bring.
        channels: the cameras that found it.
    """

    north_m: float
    east_m: float
    covariance: FloatArray
    pixel_covariance: FloatArray
    channels: tuple[str, ...]
    attributes: Mapping[str, Value]


def located(
    detections: Iterable[Detection], cameras: Mapping[str, Intrinsics], state: CameraState, ground: GroundModel
) -> list[GroundDetection]:
    """The detections of one instant whose rays meet the ground."""
    own = PoseErrors(0.0, 0.0, 0.0, 0.0, 0.0, state.errors.pixel_px, 0.0)
    places = []
    for channel, pixel, attributes in detections:
        camera = cameras[channel]
        seen = geolocate(camera, state.pose, pixel, ground, state.errors)
        alone = geolocate(camera, state.pose, pixel, ground, own)
        if seen is not None and alone is not None:
            places.append(
                GroundDetection(
                    seen.north_m, seen.east_m, seen.covariance, alone.covariance, (channel,), attributes
                )
            )  # fmt: skip
    return places


def fused(one: Sequence[GroundDetection], other: Sequence[GroundDetection]) -> list[GroundDetection]:
    """Pairs of one thing as one detection, with the attributes of both; after them what only one channel found."""
    from scipy.optimize import linear_sum_assignment

    if not one or not other:
        return [*one, *other]
    costs = np.array([[_distance(a, b) for b in other] for a in one])
    pairs = [
        (row, column)
        for row, column in zip(*linear_sum_assignment(np.minimum(costs, GATE)), strict=True)
        if costs[row, column] < GATE
    ]
    rows, chosen = {row for row, _ in pairs}, {column for _, column in pairs}
    return [
        *(_weighed(one[row], other[column]) for row, column in pairs),
        *(each for row, each in enumerate(one) if row not in rows),
        *(each for column, each in enumerate(other) if column not in chosen),
    ]


def _distance(a: GroundDetection, b: GroundDetection) -> float:
    """The square of the Mahalanobis distance, for the errors of pixels."""
    off = np.array([b.north_m - a.north_m, b.east_m - a.east_m])
    spread = a.pixel_covariance + b.pixel_covariance
    return float(off @ np.linalg.solve(spread, off))


def _weighed(a: GroundDetection, b: GroundDetection) -> GroundDetection:
    gain = a.pixel_covariance @ np.linalg.inv(a.pixel_covariance + b.pixel_covariance)
    north, east = (np.array(a[:2]) + gain @ (np.array(b[:2]) - np.array(a[:2]))).tolist()
    pixel = a.pixel_covariance - gain @ a.pixel_covariance
    pose = a.covariance - a.pixel_covariance
    return GroundDetection(
        north, east, pose + pixel, pixel, (*a.channels, *b.channels), {**b.attributes, **a.attributes}
    )
