"""The ready specification: vision percepts, world objects and, with roads, on-road objects.

The conditions are those of section V of the paper: a percept is a known object that is expected near it within a second, else
after a second a new one; an object that is seen on a road for a second is on the road, until it was off it for ten.
"""

from collections.abc import Mapping
from typing import Final

from dyknow import US_PER_S
from dyknow.anchoring.links.motion import MotionPredictor
from dyknow.anchoring.links.prediction import Predictor
from dyknow.anchoring.links.specification import (
    ALWAYS_TRUE,
    FROM,
    THRESHOLD,
    TO,
    USUAL,
    Lasting,
    LinkSpecification,
    Threshold,
    unlikelihood,
)
from dyknow.anchoring.roads.network import RoadNetwork
from dyknow.anchoring.roads.objects import OnRoad
from dyknow.anchoring.roads.prediction import AlongRoads
from dyknow.reasoning.formulas.tree import Always, Compare, Const, Eventually, Feature, Formula

VISION: Final = "vision_percept"
WORLD: Final = "world"
ON_ROAD: Final = "on_road"

NEAR: Final = Eventually(Compare("<", Feature("xy_dist", (FROM, TO)), Feature(THRESHOLD)), 0, US_PER_S)
NEW: Final = Eventually(Const(value=True), US_PER_S, None)
ROAD_SEEN: Final = Always(Feature("on_road", (FROM,)), 0, US_PER_S)
ON_A_ROAD: Final = Eventually(ROAD_SEEN, US_PER_S, None)
STAYS_ON_ROADS: Final = Always(Eventually(ROAD_SEEN, 0, 10 * US_PER_S))
CANDIDATES: Final = 3
"""Known objects that a percept may be, until it is certain which."""
READY_CONDITIONS: Final[Mapping[str, tuple[Formula, ...]]] = {
    "WorldObject": (NEW, NEAR, ALWAYS_TRUE),
    "OnRoad": (ON_A_ROAD, NEAR, STAYS_ON_ROADS),
}
"""Establish, reestablish and maintain, by the name of the unit of a link."""
ANYWHERE: Final = Lasting()
ALONG_ROADS: Final = Lasting(predicted=1.0)
"""Objects that roads lead are expected at their predicted place for longer."""
SLACK_M: Final = 3.0
"""Tolerance for errors of sensors: a position this far beyond the edge of a road counts as on it."""
ROAD_NOISE: Final = 4.0
"""Of predictions along roads, m^2/s^3: so much drivers change their speed while they are not seen."""


def ready_specification(
    roads: RoadNetwork | None = None, predictor: Predictor | None = None, threshold: Threshold = USUAL
) -> tuple[LinkSpecification, ...]:
    """Vision percepts to world objects, and with roads to on-road objects; `predictor` is of the latter."""
    world = LinkSpecification(
        VISION,
        WORLD,
        NEW,
        NEAR,
        predictor=MotionPredictor(),
        lasting=ANYWHERE if roads is None else ALONG_ROADS,
        is_adaptive=True,
        threshold=threshold,
        score=unlikelihood,
        candidates=CANDIDATES,
    )
    if roads is None:
        return (world,)
    on_road = LinkSpecification(
        WORLD,
        ON_ROAD,
        ON_A_ROAD,
        NEAR,
        STAYS_ON_ROADS,
        unit=OnRoad(roads),
        predictor=predictor or AlongRoads(roads, noise=ROAD_NOISE),
        lasting=ALONG_ROADS,
        is_adaptive=True,
        threshold=threshold,
        score=unlikelihood,
        features={"on_road": lambda state: roads.on_road(state.x_m, state.y_m, SLACK_M)},
    )
    return world, on_road
