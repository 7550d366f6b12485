"""The futures of an object that is not seen, as samples: of one time one for each link of the map on which it may be (thesis 12.3)."""

from collections.abc import Iterator
from typing import NamedTuple

from dyknow import SURE, Predicted, Quality
from dyknow.anchoring.links.prediction import ObjectPrediction
from dyknow.anchoring.links.states import ObjectState
from dyknow.anchoring.links.structures import StateRecord
from dyknow.anchoring.roads.fluents import ROUTE
from dyknow.model.sample import MAX_BRANCH

OFF_ROADS = "off the roads"


class LikelyWay(NamedTuple):
    """A link of the map, the most probable state there, and how probable it is that the object is on that link."""

    link: str
    state: ObjectState
    weight: float


def ways(prediction: ObjectPrediction) -> list[LikelyWay]:
    """The links on which an object may be, the most probable first; of equal ones that of the more probable state."""
    found: dict[str, LikelyWay] = {}
    for state, weight in prediction.hypotheses:
        link = str(state.attributes.get(ROUTE, "") or OFF_ROADS)[:MAX_BRANCH]
        known = found.get(link)
        found[link] = LikelyWay(link, state, weight) if known is None else known._replace(weight=known.weight + weight)
    return sorted(found.values(), key=lambda each: -each.weight)


def branches(record: StateRecord, most: int) -> Iterator[tuple[StateRecord, Quality]]:
    """The states of a record with their qualities: `most` branches at most, the state of the record itself last.

    So the newest state of an object is the most probable one. With fewer than two, the record alone.
    """
    quality = SURE if record.weight == 1.0 else Quality(record.weight)
    if record.prediction is None:
        yield record, quality
        return
    found = ways(record.prediction)[:most]
    if len(found) < 2:
        yield record, quality._replace(prediction=Predicted(record.observed_us))
        return
    for way in sorted(found, key=lambda each: each.state is record.state):
        prediction = Predicted(record.observed_us, way.link, min(1.0, way.weight))
        yield record._replace(state=way.state), Quality(min(1.0, record.weight * way.weight), (), prediction)
