"""On-road objects: states of world objects, put on the roads (Heintz, Rudol and Doherty, section V)."""

from typing import Final

from dyknow.anchoring.links.states import ObjectState
from dyknow.anchoring.roads.fluents import ROAD_ATTRIBUTES, attributes_of, place_of, turn_attributes
from dyknow.anchoring.roads.network import RoadNetwork
from dyknow.anchoring.roads.snapping import DEFAULTS, SnapSettings, snap

MEASURED: Final = 100.0
"""A velocity whose variances sum to more than this, m^2/s^2, tells nothing."""


class OnRoad:
    """The unit of a link from world objects to on-road objects: the position on the centre of the lane, and where that is.

    The original position stays as the attributes `world_x_m`, `world_y_m`. An object that left the roads stays at the
    place where it left them, so that it is not put on the road again where it goes.
    """

    def __init__(self, network: RoadNetwork, settings: SnapSettings = DEFAULTS) -> None:
        self._network, self._settings = network, settings

    def __call__(self, state: ObjectState, before: ObjectState | None) -> ObjectState:
        previous = None if before is None else place_of(before)
        place = snap(self._network, state.x_m, state.y_m, velocity_of(state), previous, self._settings)
        kept = {name: value for name, value in state.attributes.items() if name not in ROAD_ATTRIBUTES}
        turn = turn_attributes(self._network, before, previous, place, state.valid_us)
        attributes = kept | {"world_x_m": state.x_m, "world_y_m": state.y_m} | attributes_of(place) | turn
        if place is not None:
            return state._replace(x_m=place.x_m, y_m=place.y_m, attributes=attributes)
        if before is None:
            return state._replace(attributes=attributes)
        return state._replace(x_m=before.x_m, y_m=before.y_m, vx_m_s=0.0, vy_m_s=0.0, attributes=attributes)


def velocity_of(state: ObjectState) -> tuple[float, float] | None:
    """The velocity of a state, if it is known well enough to tell a direction."""
    if state.covariance[2, 2] + state.covariance[3, 3] > MEASURED:
        return None
    return state.vx_m_s, state.vy_m_s
