"""Relations of pairs of cars on a map, where a road is more than one link."""

from dyknow.anchoring.roads.network import RoadNetwork
from dyknow.compunits import StableFollowing, StableRelations


class RelationsOnMap(StableRelations):
    """As `StableRelations`, also of cars on two links where one continues the other, and where a road continues in a crossing."""

    def __init__(self, network: RoadNetwork, **settings: float) -> None:
        super().__init__(**settings)
        self.roads = network.continuations


class FollowingOnMap(StableFollowing):
    """As `StableFollowing`, of the same cars as `RelationsOnMap`."""

    def __init__(self, network: RoadNetwork, **settings: float) -> None:
        super().__init__(**settings)
        self.roads = network.continuations
