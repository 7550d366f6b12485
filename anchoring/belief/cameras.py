"""Observations of cameras: percepts of a tracker, and the field of view."""

from collections.abc import Iterable
from math import hypot
from typing import Any, Final

import numpy as np

from dyknow.anchoring.belief.arrays import Floats
from dyknow.anchoring.belief.description import POSITION, CategoricalAttribute, WorldModel
from dyknow.anchoring.belief.observations import TYPE, WorldObservation
from dyknow.anchoring.links.states import ObjectState
from dyknow.anchoring.links.structures import Percept
from dyknow.navigation.cameras.ground import GroundModel
from dyknow.navigation.cameras.pinhole import CameraPose, Intrinsics, Pixel

FARTHEST: Final = 1e7
"""Numbers beyond it are not believed."""


class CameraSensor:
    """Makes observations for one sensor of a model. Attributes that the model does not have, or symbols that the sensor does not
    report, are left out: a detector may know more than the model.
    """

    def __init__(self, model: WorldModel, sensor: str) -> None:
        self._sensor = sensor
        confusion = model.sensors[sensor].confusion
        self._symbols = {
            name: frozenset(confusion[name].symbols if name in confusion else each.values)
            for name, each in model.attributes.items()
            if isinstance(each, CategoricalAttribute)
        }
        if TYPE in confusion:
            self._symbols[TYPE] = frozenset(confusion[TYPE].symbols)
        self._numbers = {
            each.name for each in model.gaussian if each.axes == 1 and each.name in model.sensors[sensor].noise
        }

    def of_percepts(self, valid_us: int, percepts: Iterable[Percept]) -> list[WorldObservation]:
        """One of each percept that has a state; its symbol is left out, since association is what a model is for."""
        return [self._seen(valid_us, each.state) for each in percepts if each.state is not None]

    def _seen(self, valid_us: int, state: ObjectState) -> WorldObservation:
        values: dict[str, Any] = {POSITION: np.array([state.x_m, state.y_m])}
        for name, value in state.attributes.items():
            if name in self._numbers and isinstance(value, int | float) and abs(value) <= FARTHEST:
                values[name] = np.array([value], dtype=np.float64)
            elif isinstance(value, str) and value in self._symbols.get(name, ()):
                values[name] = value
        return WorldObservation(valid_us, self._sensor, values, state.covariance[:2, :2])


def camera_view(camera: Intrinsics, pose: CameraPose, ground: GroundModel, farthest_m: float = 250.0) -> Floats | None:
    """Corners (4, 2), east and north, of the ground in a camera's view, as far as `farthest_m`; None: no ground is in
    view.

    A corner at the horizon, or beyond `farthest_m`, is replaced by the place at that distance in its direction.
    """
    wide, high = float(camera.width_px), float(camera.height_px)
    corners, meets = [], 0
    for u, v in ((0.0, 0.0), (wide, 0.0), (wide, high), (0.0, high)):
        ray = pose.direction(camera, Pixel(u, v))
        hit = ground.meet(pose.position_m, ray)
        north_m, east_m = ray[:2].tolist() if hit is None else (hit.place_m - pose.position_m)[:2].tolist()
        level_m = hypot(north_m, east_m)
        meets += hit is not None
        if level_m > 0.0 and (hit is None or level_m > farthest_m):
            north_m, east_m = north_m * farthest_m / level_m, east_m * farthest_m / level_m
        corners.append((float(pose.position_m[1]) + east_m, float(pose.position_m[0]) + north_m))
    return np.array(corners) if meets else None
