"""Simulated detectors in the images of a colour and of a thermal camera. Pure; the generator is an argument."""

from collections.abc import Iterable, Sequence
from math import exp, radians
from typing import NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.random import Generator

from dyknow.navigation.cameras.channels import PERSON, Detection
from dyknow.navigation.cameras.pinhole import CameraPose, FloatArray, Intrinsics, Pixel
from dyknow.sim_uavs.roads.drivers import COLOURS

COLOUR, THERMAL = "colour", "thermal"
SCORE_SD = 0.12
"""How much the score of one thing differs from image to image."""


class Visible(Protocol):
    """Something on the ground, or above it: metres east and north, of its middle, and upwards."""

    @property
    def x_m(self) -> float: ...
    @property
    def y_m(self) -> float: ...
    @property
    def bottom_m(self) -> float: ...
    @property
    def length_m(self) -> float: ...
    @property
    def height_m(self) -> float: ...
    @property
    def colour(self) -> str: ...


SeenT = TypeVar("SeenT", bound=Visible)


class DetectorNoise(NamedTuple):
    """How a detector errs.

    Attributes:
        pixel_px: standard deviation of the place in the image, on each axis.
        found: the largest share of images in which something in view is found, if it is large enough.
        half_px: at this length in the image it is found in half of them.
        false_per_image: detections of nothing, on the average; each in one image only.
        colour_right: the share of colours that are the right ones; 0: it sees no colours.
    """

    pixel_px: float
    found: float
    half_px: float
    false_per_image: float
    colour_right: float = 0.0


class CameraModel(NamedTuple):
    intrinsics: Intrinsics
    noise: DetectorNoise


COLOUR_CAMERA = CameraModel(
    Intrinsics.of_view(768, 576, radians(48.0)), DetectorNoise(1.2, 0.92, 8.0, 0.15, colour_right=0.9)
)
THERMAL_CAMERA = CameraModel(Intrinsics.of_view(384, 288, radians(48.0)), DetectorNoise(0.8, 0.88, 4.0, 0.1))


class Obstacle(NamedTuple):
    """A box that hides what is behind or below it: a building, a bridge (`bottom_m` above the ground), a tree."""

    west_m: float
    south_m: float
    east_m: float
    north_m: float
    top_m: float
    bottom_m: float = 0.0

    def hides(self, from_m: FloatArray, place_m: FloatArray) -> bool:
        """Whether the straight line between two places, (3,) NED, passes through the box."""
        low = np.array([self.south_m, self.west_m, -self.top_m])
        high = np.array([self.north_m, self.east_m, -self.bottom_m])
        along = place_m - from_m
        with np.errstate(divide="ignore", invalid="ignore"):
            one, other = (low - from_m) / along, (high - from_m) / along
        parallel = along == 0.0
        if (parallel & ((from_m < low) | (from_m > high))).any():
            return False
        enters = np.where(parallel, -np.inf, np.minimum(one, other)).max()
        leaves = np.where(parallel, np.inf, np.maximum(one, other)).min()
        return bool(max(enters, 0.0) < min(leaves, 1.0 - 1e-6))


def in_view(
    camera: Intrinsics, pose: CameraPose, states: Iterable[SeenT], obstacles: Sequence[Obstacle]
) -> list[tuple[SeenT, Pixel, float]]:
    """The objects in the camera's view: the pixel of the middle of the lower side, and the length in pixels."""
    seen = []
    for state in states:
        place = np.array([state.y_m, state.x_m, -state.bottom_m])
        pixel = pose.pixel(camera, place)
        if pixel is None:
            continue
        middle = place - np.array([0.0, 0.0, state.height_m / 2.0])
        if any(each.hides(pose.position_m, middle) for each in obstacles):
            continue
        range_m = float(np.linalg.norm(place - pose.position_m))
        seen.append((state, pixel, state.length_m * camera.focal_px / range_m))
    return seen


def detect(
    channel: str,
    camera: CameraModel,
    pose: CameraPose,
    states: Iterable[Visible],
    obstacles: Sequence[Obstacle],
    rng: Generator,
) -> list[Detection]:
    """The detections of one camera in one image, true and false, in random order."""
    intrinsics, noise = camera
    width_px, height_px = intrinsics[:2]
    found = []
    for state, pixel, long_px in in_view(intrinsics, pose, states, obstacles):
        likeness = state.likeness(channel) if hasattr(state, "likeness") else None
        if likeness == 0.0:
            continue
        if rng.random() < noise.found * (1.0 - exp(-0.693 * (long_px / noise.half_px) ** 2)):
            right, down = rng.normal(0.0, noise.pixel_px, 2).tolist()
            attributes = _attributes(state, likeness, noise, rng)
            u, v = min(max(pixel.u_px + right, 0.0), width_px), min(max(pixel.v_px + down, 0.0), height_px)
            found.append(Detection(channel, Pixel(u, v), attributes))
    for _ in range(int(rng.poisson(noise.false_per_image))):
        u, v = rng.uniform((0.0, 0.0), (width_px, height_px)).tolist()
        attributes = {"colour": _colour("", noise, rng)} if noise.colour_right else {}
        found.append(Detection(channel, Pixel(u, v), attributes))
    return [found[index] for index in rng.permutation(len(found))]


def _attributes(state: Visible, likeness: float | None, noise: DetectorNoise, rng: Generator) -> dict[str, str | float]:
    """The colour, if the camera sees colours, and the score of a body that may look like a person."""
    found: dict[str, str | float] = {"colour": _colour(state.colour, noise, rng)} if noise.colour_right else {}
    if likeness is not None:
        found[PERSON] = min(max(likeness + SCORE_SD * float(rng.standard_normal()), 0.0), 1.0)
    return found


def _colour(right: str, noise: DetectorNoise, rng: Generator) -> str:
    if right and rng.random() < noise.colour_right:
        return right
    return COLOURS[int(rng.integers(len(COLOURS)))]
