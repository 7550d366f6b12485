"""What cameras see as observations: percepts of a tracker, or single detections on the ground, and the field of view."""

from collections.abc import Iterable

import numpy as np

from anchoring.belief.arrays import Floats
from anchoring.belief.description import POSITION, CategoricalAttribute, WorldModel
from anchoring.belief.observations import WorldObservation
from anchoring.links.structures import Percept
from dyknow import Value
from navigation.cameras.channels import GroundDetection
from navigation.cameras.geolocation import geolocate
from navigation.cameras.ground import GroundModel
from navigation.cameras.pinhole import CameraPose, Intrinsics, Pixel


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

    def of_percepts(self, valid_us: int, percepts: Iterable[Percept]) -> list[WorldObservation]:
        """One of each percept that has a state; its symbol is left out, since association is what a model is for."""
        return [
            self._seen(
                valid_us, each.state.x_m, each.state.y_m, each.state.covariance[:2, :2], each.state.attributes.items()
            )
            for each in percepts
            if each.state is not None
        ]

    def of_detections(self, valid_us: int, detections: Iterable[GroundDetection]) -> list[WorldObservation]:
        """One of each."""
        return [
            self._seen(valid_us, each.east_m, each.north_m, each.covariance[::-1, ::-1], each.attributes.items())
            for each in detections
        ]

    def _seen(
        self, valid_us: int, x_m: float, y_m: float, covariance: Floats, attributes: Iterable[tuple[str, Value]]
    ) -> WorldObservation:
        values = {name: value for name, value in attributes if value in self._symbols.get(name, ())}
        return WorldObservation(valid_us, self._sensor, {POSITION: np.array([x_m, y_m]), **values}, covariance)


def camera_view(camera: Intrinsics, pose: CameraPose, ground: GroundModel) -> Floats | None:
    """Corners (4, 2), east and north, of what a camera sees of the ground; None: it sees beyond the horizon."""
    wide, high = float(camera.width_px), float(camera.height_px)
    corners = [
        geolocate(camera, pose, Pixel(u, v), ground) for u, v in ((0.0, 0.0), (wide, 0.0), (wide, high), (0.0, high))
    ]
    seen = [(each.east_m, each.north_m) for each in corners if each is not None]
    return np.array(seen) if len(seen) == len(corners) else None
