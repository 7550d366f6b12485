"""The map of monitoring.kpl, town.geojson: a unit that puts positions on roads, and sources with the turns at crossings."""

import math
from collections.abc import Iterator
from pathlib import Path

from anchoring.roads.files.geojson import read_roads
from anchoring.roads.snapping import RoadPlace, snap
from compunits import NO_CROSSING, NO_LINK, SEEN_CAR
from dyknow import Sample, computational_unit, source

ROADS = read_roads((Path(__file__).parent / "town.geojson").read_bytes(), "town.geojson")
Ways = tuple[tuple[str, str, str], ...]


@computational_unit(SEEN_CAR, "car-object")
class OnMap:
    """The link or the crossing of an object and the direction of the road there; nothing while it is off the roads."""

    def __init__(self) -> None:
        self._place: RoadPlace | None = None
        self._road_deg = 0.0

    def __call__(self, _now_us: int, seen: Sample) -> tuple[str, float, float, float, str, str] | None:
        symbol, x_m, y_m = seen.value[:3]
        place = snap(ROADS, x_m, y_m, previous=self._place)
        if place is None:
            return None
        self._place = place
        if place.link is not None:
            line = ROADS.links[place.link].line
            self._road_deg = 90.0 - math.degrees(line.at(place.offset_m, 0.0)[2])
        return symbol, x_m, y_m, self._road_deg, place.link or NO_LINK, place.crossing or NO_CROSSING


def ways(turn: str) -> Ways:
    """(link, crossing, link) of all turns of one kind."""
    return tuple((link, *way) for link in ROADS.links for way in ROADS.turns.attributes(link)[turn])


@source("ways")
def left_turns(from_us: int) -> Iterator[tuple[int, Ways]]:
    yield from_us, ways("left")


@source("ways")
def right_turns(from_us: int) -> Iterator[tuple[int, Ways]]:
    yield from_us, ways("right")


@source("ways")
def straights(from_us: int) -> Iterator[tuple[int, Ways]]:
    yield from_us, ways("straight")


@source("ways")
def uturns(from_us: int) -> Iterator[tuple[int, Ways]]:
    yield from_us, ways("uturn")


@source("bool")
def yes(from_us: int) -> Iterator[tuple[int, bool]]:
    """What is so, and stays."""
    yield from_us, True
