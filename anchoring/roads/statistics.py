"""Traffic on each link: flow, speed and density over a window of time, by Edie's definitions.

Over a link of length L and a window T, with s_i the metres and t_i the seconds that vehicle i spends there:

    flow q = sum s_i / (L T)    density k = sum t_i / (L T)    speed v = sum s_i / sum t_i    so that q = k v
"""

import math
from collections import deque
from collections.abc import Iterable, Mapping
from typing import Final, NamedTuple

from dyknow import US_PER_S
from dyknow.anchoring.roads.elements import DirectedLink
from dyknow.anchoring.roads.network import RoadNetwork
from dyknow.anchoring.roads.snapping import RoadPlace

LONGEST_GAP_US: Final = 5 * US_PER_S
"""Between two places of a vehicle that are farther apart in time it was not on the roads that are watched."""
_LEAST_PART: Final = 0.1
"""At least this part of a link counts as outside its crossings."""


class LinkTraffic(NamedTuple):
    """Traffic on a link in one direction.

    Attributes:
        flow_per_s: vehicles a second that pass a point of it.
        speed_m_s: mean over the vehicles and the time they are there.
        density_per_m: vehicles on a metre of it.
        vehicles: how many different ones were there.
    """

    flow_per_s: float
    speed_m_s: float
    density_per_m: float
    vehicles: int


class _Stretch(NamedTuple):
    """The motion of one vehicle on a link from one place to the next."""

    from_us: int
    to_us: int
    metres: float
    vehicle: str


class RoadTraffic:
    """Collects the places of vehicles; the figures are over the last `window_us`.

    The length of a link is what lies outside its crossings. Places of a vehicle that go back in time are left out.
    """

    def __init__(self, network: RoadNetwork, window_us: int = 60 * US_PER_S) -> None:
        self._network, self._window_us = network, window_us
        self._last: dict[str, tuple[int, RoadPlace]] = {}
        self._stretches: dict[DirectedLink, deque[_Stretch]] = {}
        self._first_us: int | None = None

    def on_place(self, vehicle: str, valid_us: int, place: RoadPlace | None) -> None:
        """Where a vehicle is; None: off the roads."""
        before = self._last.get(vehicle)
        if before is not None and valid_us <= before[0]:
            return
        self._first_us = valid_us if self._first_us is None else min(valid_us, self._first_us)
        if before is not None and place is not None and valid_us - before[0] <= LONGEST_GAP_US:
            self._extend(vehicle, before[0], before[1], valid_us, place)
        if place is None:
            self._last.pop(vehicle, None)
        else:
            self._last[vehicle] = (valid_us, place)

    def _extend(self, vehicle: str, from_us: int, before: RoadPlace, to_us: int, place: RoadPlace) -> None:
        """The way between two places is that of the first one."""
        if before.link is None or not before.direction:
            return
        if place.link == before.link:
            metres = (place.offset_m - before.offset_m) * before.direction
        else:
            metres = math.hypot(place.x_m - before.x_m, place.y_m - before.y_m)
        way = DirectedLink(before.link, before.direction)
        kept = self._stretches.setdefault(way, deque())
        kept.append(_Stretch(from_us, to_us, metres, vehicle))
        while kept[0].to_us <= to_us - self._window_us:
            kept.popleft()

    def on_time(self, now_us: int) -> None:
        """Forget what is older than the window."""
        horizon_us = now_us - self._window_us
        for way, kept in list(self._stretches.items()):
            while kept and kept[0].to_us <= horizon_us:
                kept.popleft()
            if not kept:
                del self._stretches[way]
        oldest_us = now_us - LONGEST_GAP_US
        self._last = {vehicle: last for vehicle, last in self._last.items() if last[0] >= oldest_us}

    def figures(self, now_us: int) -> Mapping[DirectedLink, LinkTraffic]:
        """The traffic of every link on which there was some, in the window that ends now."""
        if self._first_us is None:
            return {}
        window_us = min(self._window_us, now_us - self._first_us)
        if window_us <= 0:
            return {}
        every = ((way, self._figure(way, kept, now_us - window_us, now_us)) for way, kept in self._stretches.items())
        return {way: figure for way, figure in every if figure is not None}

    def speeds(self, now_us: int) -> Mapping[DirectedLink, float]:
        """Measured speeds, as routes take them."""
        return {way: figure.speed_m_s for way, figure in self.figures(now_us).items()}

    def _figure(self, way: DirectedLink, kept: Iterable[_Stretch], from_us: int, to_us: int) -> LinkTraffic | None:
        metres = seconds = 0.0
        vehicles: set[str] = set()
        for one in kept:
            inside_us = min(one.to_us, to_us) - max(one.from_us, from_us)
            if inside_us > 0:
                metres += one.metres * inside_us / (one.to_us - one.from_us)
                seconds += inside_us / US_PER_S
                vehicles.add(one.vehicle)
        if not vehicles:
            return None
        metres = max(0.0, metres)
        extent = self._open_length_m(way.link) * (to_us - from_us) / US_PER_S
        return LinkTraffic(metres / extent, metres / seconds, seconds / extent, len(vehicles))

    def _open_length_m(self, name: str) -> float:
        """The length of a link outside its crossings."""
        link, crossings = self._network.links[name], self._network.crossings
        covered_m = sum(crossings[end].radius_m for end in (link.start, link.end) if end is not None)
        return max(link.length_m - covered_m, _LEAST_PART * link.length_m)
