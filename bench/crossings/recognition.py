"""From percepts through anchoring on the roads to turns.

Percepts of a car, with errors of up to 2 m in x and in y, are linked to a world object and that to an object on the
road; what its link and its crossing are, once they have been stable for half a second, are events of chronicles. Cars that
are hidden in the crossing are not anchored, since that is a matter of prediction: their track is known to be one.
"""

from collections import Counter
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import Final, TypeAlias

import numpy as np

from bench.crossings.passes import Pass, car_passes
from dyknow import Label, Sample
from dyknow.anchoring.links.states import ObjectState, diagonal
from dyknow.anchoring.links.structures import ObjectLinkage, Percept
from dyknow.anchoring.ready import ON_ROAD, VISION, ready_specification
from dyknow.anchoring.roads.network import RoadNetwork
from dyknow.anchoring.roads.snapping import RoadPlace, snap
from dyknow.compunits import NO_CROSSING, NO_LINK, StableFields
from dyknow.kpl import parse_chronicles
from dyknow.reasoning.chronicles import ChangeEvents, ChronicleFile, Recogniser

CHRONICLES: Final = Path(__file__).parents[2] / "examples" / "traffic" / "turns.chr"
PERIOD_US: Final = 100_000
ERROR_M: Final = 2.0
"""The largest error of a coordinate."""
HIDDEN_M: Final = 18.0
"""Where cars are not seen in the crossing: so near its middle."""
CHRONICLE_OF: Final = {
    "left": "turn_left_in_crossing",
    "right": "turn_right_in_crossing",
    "straight": "straight_through_crossing",
    "uturn": "turn_back_in_crossing",
}

Seen: TypeAlias = tuple[int, str, tuple[str, str]]
"""Valid time, the car, and the link and the crossing that it is in."""


@cache
def chronicles() -> ChronicleFile:
    return parse_chronicles(CHRONICLES.read_text(encoding="utf-8"))


def counted(runs: int, *, straight: bool, hidden: bool = False) -> Counter[str]:
    """In how many of the runs the right turn is recognised, is predicted, and a wrong one is recognised; seeds 0, 1, ...

    Hidden cars do not turn back: they are on one link before and after, so that there is no change.
    """
    found = Counter[str]()
    for number in range(runs):
        rng = np.random.default_rng((number, straight, hidden))
        driven = car_passes(rng, straight=straight, back=not hidden)
        made = recognised(driven, rng, hidden=hidden)
        right = {way for way in made if way[1:] == (driven.turn, driven.source, driven.target)}
        found["right"] += bool(right)
        found["predicted"] += any(way[0] for way in right)
        found["wrong"] += bool(made - right)
    return found


def recognised(driven: Pass, rng: np.random.Generator, *, hidden: bool) -> set[tuple[bool, str, str, str]]:
    """(is predicted, turn, link, link) of what is recognised of a car, which in the crossing is seen or hidden."""
    recogniser = Recogniser.of(chronicles())
    events = ChangeEvents(recogniser)
    for label in links(driven.roads):
        events.on_sample(label, 0, value=True)
    found = [
        one
        for valid_us, symbol, areas in areas_of(driven, rng, hidden=hidden)
        for name, value in zip(("link", "crossing"), areas, strict=True)
        for one in events.on_sample(Label(f"cars.{name}", (symbol,)), valid_us, value)
    ]
    turns = {name: way for way, name in CHRONICLE_OF.items()}
    return {
        (one.chronicle.endswith("_predicted"), turn, one.bindings["?l1"], one.bindings["?l2"])
        for one in found
        if (turn := turns.get(one.chronicle.removesuffix("_predicted"))) is not None
    }


def areas_of(driven: Pass, rng: np.random.Generator, *, hidden: bool) -> Iterator[Seen]:
    """The link and the crossing that the car is in, filtered."""
    yield from stable((snapped if hidden else anchored)(driven.roads, *seen(driven, rng, hidden=hidden)))


def stable(areas: Iterable[Seen]) -> Iterator[Seen]:
    """What of that has lasted for half a second."""
    filters: dict[str, StableFields] = {}
    for valid_us, symbol, areas_then in areas:
        made = filters.setdefault(symbol, StableFields())(valid_us, Sample(valid_us, valid_us, areas_then))
        if made is not None:
            yield valid_us, symbol, made.value


def seen(driven: Pass, rng: np.random.Generator, *, hidden: bool) -> tuple[list[int], list[tuple[float, float]]]:
    """Valid times and positions of the car; a hidden one has none near the middle of the crossing."""
    at_s = np.arange(driven.at_s[0], driven.at_s[-1], PERIOD_US / 1e6)
    true = np.stack([np.interp(at_s, driven.at_s, axis) for axis in driven.places.T], axis=1)
    noisy = true + rng.uniform(-ERROR_M, ERROR_M, true.shape)
    shown = np.flatnonzero(np.hypot(*true.T) > (HIDDEN_M if hidden else 0.0))
    return [(int(i) + 1) * PERIOD_US for i in shown], [(x, y) for x, y in noisy[shown].tolist()]


def anchored(roads: RoadNetwork, times_us: list[int], places: list[tuple[float, float]]) -> Iterator[Seen]:
    """By a vision percept, a world object and an object on the road."""
    linkage = ObjectLinkage(ready_specification(roads), PERIOD_US)
    for valid_us, place in zip(times_us, places, strict=True):
        percept = ObjectState(valid_us, *place, 0.0, 0.0, diagonal(ERROR_M / 3**0.5))
        for record in linkage.on_percepts(valid_us, [Percept("vp1", VISION, percept)]).states:
            if record.type == ON_ROAD and record.prediction is None:
                about = record.state.attributes
                yield valid_us, record.symbol, (about.get("link") or NO_LINK, about.get("crossing") or NO_CROSSING)


def snapped(roads: RoadNetwork, times_us: list[int], places: list[tuple[float, float]]) -> Iterator[Seen]:
    """A tracker that knows the car again when it comes out: its positions, put on the roads."""
    place: RoadPlace | None = None
    for valid_us, (x_m, y_m) in zip(times_us, places, strict=True):
        place = snap(roads, x_m, y_m, previous=place) or place
        if place is not None:
            yield valid_us, "c1", (place.link or NO_LINK, place.crossing or NO_CROSSING)


def links(roads: RoadNetwork) -> Iterator[Label]:
    """The turns that the map has: `links.left[l1, x1, l2]` and so on."""
    for link in roads.links:
        for turn, ways in roads.turns.attributes(link).items():
            for crossing, other in ways:
                yield Label(f"links.{turn}", (link, crossing, other))
