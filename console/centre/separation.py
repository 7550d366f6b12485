"""How far two platforms are from each other, from their federated streams."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import combinations
from typing import Any

from dyknow.federation.messages.contents import Query, Samples
from dyknow.navigation.geodesy import distance_m
from dyknow.runtime.client import Client
from dyknow.runtime.library.jobs import lists

POSITION, ALTITUDE = "heli-position", "heli-altitude"
_KEPT = 200


def closest(client: Client) -> tuple[str, str, float] | None:
    """The two platforms that are nearest to each other by their newest positions, and their distance in metres."""
    places: dict[str, tuple[float, float, float]] = {}
    values: dict[tuple[str, str], Mapping[str, Any]] = {}
    units = [seen.unit for seen in client.centre.platforms() if POSITION in seen.labels]
    for label in (POSITION, ALTITUDE):
        for unit, said in client.run(lists(client, units, Query(semantic_label=label), Samples)):
            for each in said.samples:
                if isinstance(each.value, dict):
                    values[unit, label] = each.value
    for unit in units:
        where, height = values.get((unit, POSITION)), values.get((unit, ALTITUDE))
        if where and height:
            places[unit] = float(where["latitude_deg"]), float(where["longitude_deg"]), float(height["altitude_m"])
    pairs = (
        (one, other, distance_m(*here[:2], *there[:2], here[2] - there[2]))
        for (one, here), (other, there) in combinations(places.items(), 2)
    )
    return min(pairs, key=lambda pair: pair[2], default=None)


@dataclass(slots=True)
class Separation:
    """3-D distance in metres of two units, at every valid time for which both have a position."""

    units: tuple[str, str]
    smallest_m: float | None = None
    latest_m: float | None = None
    latest_us: int = 0
    _seen: dict[int, dict[tuple[str, str], tuple[float, ...]]] = field(default_factory=dict)

    def on_sample(self, unit: str, label: str, valid_us: int, value: tuple[float, ...]) -> None:
        """Take a sample; late ones count, too."""
        if unit not in self.units or label not in {POSITION, ALTITUDE}:
            return
        known = self._seen.setdefault(valid_us, {})
        known[unit, label] = value
        if len(known) == 4:
            del self._seen[valid_us]
            self._measured(valid_us, known)
        while len(self._seen) > _KEPT:
            del self._seen[min(self._seen)]

    def _measured(self, valid_us: int, known: dict[tuple[str, str], tuple[float, ...]]) -> None:
        one, other = self.units
        (latitude_a, longitude_a), (latitude_b, longitude_b) = known[one, POSITION], known[other, POSITION]
        up_m = known[one, ALTITUDE][0] - known[other, ALTITUDE][0]
        apart_m = distance_m(latitude_a, longitude_a, latitude_b, longitude_b, up_m)
        if valid_us > self.latest_us:
            self.latest_us, self.latest_m = valid_us, apart_m
        if self.smallest_m is None or apart_m < self.smallest_m:
            self.smallest_m = apart_m
