"""Computational units and sources of one road network, as specifications name them.

Objects are states whose first fields are `symbol`, `x_m` and `y_m`, in the frame of the network. Figures of traffic and
states of routes are made once a second of the source `seconds`, and are valid half a second before, so that states of objects
may be that late.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any, Final, NamedTuple, TypeAlias

from dyknow import (
    NO_VALUE,
    US_PER_S,
    Field,
    Prototype,
    Sample,
    Sort,
    SourcePrototype,
    UnitFunction,
    UnitPrototype,
    Value,
)
from dyknow.anchoring.ready import SLACK_M
from dyknow.anchoring.roads.elements import DirectedLink
from dyknow.anchoring.roads.names import way_name
from dyknow.anchoring.roads.network import RoadNetwork
from dyknow.anchoring.roads.snapping import RoadPlace, SnapSettings, snap
from dyknow.anchoring.roads.statistics import LONGEST_GAP_US, LinkTraffic, RoadTraffic
from dyknow.anchoring.traffic.obstacles import Narrowest, SlowVehicles, narrowest
from dyknow.anchoring.traffic.pairs import FollowingOnMap, RelationsOnMap
from dyknow.anchoring.traffic.passability import Passability, RouteState, WantedRoute, obstructed
from dyknow.anchoring.traffic.travel import Travel
from dyknow.compunits import CAR, FOLLOWING, NO_CROSSING, NO_LINK, ROAD_RELATIONS, SEEN_CAR
from dyknow.model.errors import SortError
from dyknow.model.members import MAX_MEMBERS
from dyknow.network.prototypes import of_samples

INSTANT: Final = Sort("instant", unit="s")
OBJECT: Final = "?object"
WAYS: Final = "ways"
LINK_TRAFFIC: Final = Sort(
    "link-traffic",
    (
        Field("symbol", "text"), Field("flow", "vehicles/h"), Field("speed_m_s", "m/s"), Field("density", "vehicles/km"),
        Field("vehicles", "1"), Field("open_m", "m"), Field("obstacles", "text"),
    ),
)  # fmt: skip
"""Of a link in one direction; `open_m` is how wide it is where vehicles that stand leave least of it."""
WANTED_ROUTE: Final = Sort(
    "wanted-route", (Field("symbol", "text"), Field("start", "text"), Field("goal", "text"), Field("width_m", "m"))
)
"""The route that a vehicle of this width wants; `symbol` names the vehicle, or its destination."""
ROUTE_STATE: Final = Sort(
    "route-state",
    (
        Field("symbol", "text"), Field("passable", "bool"), Field("links", "text"), Field("length_m", "m"),
        Field("time_s", "s"), Field("because", "text"),
    ),
)  # fmt: skip
SLOW_M_S: Final = 2.0
"""A slower vehicle closes its lane for an emergency vehicle."""
LATE_US: Final = US_PER_S // 2
AGAIN_US: Final = 10 * US_PER_S
MOST_ROUTES: Final = 64

BY_LANE: Final = SnapSettings(heading_sd_rad=1.5)
"""The direction of travel decides between lanes that lead opposite ways, not between those of a fork."""

_Ways: TypeAlias = tuple[tuple[str, str, str], ...]


class _Placed(NamedTuple):
    valid_us: int
    place: RoadPlace
    travel: Travel


class PlacesOnRoads:
    """Puts objects on roads, with hysteresis for each, and what goes the one way not on the lane that leads the other way."""

    def __init__(self, network: RoadNetwork) -> None:
        self.network = network
        self._places: dict[str, _Placed] = {}

    def place(self, sample: Sample) -> tuple[str, RoadPlace | None] | None:
        """The symbol and the place of an object; None if it is nothing of that kind.

        Raises:
            SortError: there are too many.
        """
        value = sample.value
        if not isinstance(value, tuple) or len(value) < len(("symbol", "x_m", "y_m")):
            return None
        symbol, x_m, y_m = value[:3]
        if not isinstance(symbol, str) or not (_is_finite(x_m) and _is_finite(y_m)):
            return None
        before = self._places.get(symbol)
        if before is None and len(self._places) >= MAX_MEMBERS:
            raise SortError(f"more than {MAX_MEMBERS} objects at once; others are left out")
        travel = Travel(sample.valid_us, x_m, y_m) if before is None else before.travel.to(sample.valid_us, x_m, y_m)
        previous = None if before is None else before.place
        place = snap(self.network, x_m, y_m, travel.velocity_m_s, previous, BY_LANE)
        if travel.velocity_m_s is not None and (place is None or self._is_off(place)):
            place = snap(self.network, x_m, y_m, previous=previous)  # against the direction of its lane
        if place is None or self._is_off(place):
            self._places.pop(symbol, None)
            return symbol, None
        self._places[symbol] = _Placed(sample.valid_us, place, travel)
        return symbol, place

    def _is_off(self, place: RoadPlace) -> bool:
        """Whether it is put on a link from too far, such as from beyond its end."""
        return place.link is not None and abs(place.across_m) > self.network.links[place.link].width_m / 2 + SLACK_M

    def forget(self, before_us: int) -> None:
        """Forget the places last seen before that time."""
        self._places = {name: each for name, each in self._places.items() if each.valid_us >= before_us}


class OnMap:
    """The link or the crossing of an object and the direction of its lane there; no output while it is off the roads.

    Where a lane leads both ways the direction is that of the link, from its start to its end.
    """

    def __init__(self, network: RoadNetwork) -> None:
        self._places = PlacesOnRoads(network)
        self._road_deg = 0.0

    def __call__(self, _now_us: int, seen: Sample) -> Value:
        found = self._places.place(seen)
        if found is None or found[1] is None:
            return None
        symbol, place = found[0], found[1]
        if place.link is not None:
            link = self._places.network.links[place.link]
            back_deg = 180.0 if place.lane is not None and link.lanes[place.lane].direction < 0 else 0.0
            self._road_deg = 90.0 + back_deg - math.degrees(link.line.at(place.offset_m, 0.0)[2])
        _, x_m, y_m = seen.value[:3]
        names = self._places.network.names
        name = NO_LINK if place.link is None else names[place.link]
        return symbol, x_m, y_m, self._road_deg, name, NO_CROSSING if place.crossing is None else names[place.crossing]


class _OnceASecond:
    """What units have in common that take objects, and make something of them once a second."""

    def __init__(self, network: RoadNetwork, window_us: int) -> None:
        self.network = network
        self._places = PlacesOnRoads(network)
        self.traffic, self.slow = RoadTraffic(network, window_us), SlowVehicles()
        self._seen: Sample | None = None
        self._second: Sample | None = None

    def take(self, seen: Sample | None, second: Sample | None) -> int | None:
        """The valid time for which figures are due now, if they are."""
        valid_us = self._due(second)
        if seen is not None and seen is not self._seen:
            self._seen = seen
            found = self._places.place(seen)
            if found is not None:
                self.traffic.on_place(found[0], seen.valid_us, found[1])
                self.slow.on_place(found[0], seen.valid_us, found[1])
        return valid_us

    def _due(self, second: Sample | None) -> int | None:
        """A first second only says that time begins."""
        if second is None or second is self._second:
            return None
        is_first, self._second = self._second is None, second
        if is_first:
            return None
        valid_us = second.valid_us - LATE_US
        self.traffic.on_time(valid_us)
        self.slow.on_time(valid_us)
        self._places.forget(valid_us - LONGEST_GAP_US)
        return valid_us

    def narrow(self) -> dict[str, Narrowest]:
        """The narrowest place of each link on which something stands."""
        slow = self.slow.slower_than(SLOW_M_S)
        return {name: narrowest(self.network.links[name], each) for name, each in slow.items()}


class TrafficOnLinks:
    """Traffic on each link in each direction over the last `window_s`: flow, mean speed, density, and standing
    vehicles.

    A link has a state each second while vehicles are, or were, on it within the window, and one more with none.
    """

    def __init__(self, network: RoadNetwork, window_s: float = 60.0) -> None:
        self._second = _OnceASecond(network, round(window_s * US_PER_S))
        self._had = set[DirectedLink]()

    def __call__(self, now_us: int, seen: Sample | None, second: Sample | None) -> list[Sample] | None:
        valid_us = self._second.take(seen, second)
        if valid_us is None:
            return None
        figures, narrow = self._second.traffic.figures(valid_us), self._second.narrow()
        ways = [*figures, *sorted(self._had - figures.keys())]
        self._had = set(figures)
        return [Sample(now_us, valid_us, self._record(way, figures.get(way), narrow.get(way.link))) for way in ways]

    def _record(self, way: DirectedLink, found: LinkTraffic | None, place: Narrowest | None) -> Value:
        flow, speed, density, vehicles = found or (0.0, NO_VALUE, 0.0, 0)
        open_m = self._second.network.links[way.link].width_m if place is None else place.open_m
        closing = "" if place is None else obstructed(way.link, place)
        return (
            self._second.network.names[way_name(way)],
            flow * 3600.0,
            speed,
            density * 1000.0,
            float(vehicles),
            open_m,
            closing,
        )


class PassableRoutes:
    """Whether each wanted route can be passed: the fastest that is open, or why there is none; when that changes, and every 10 s.

    A route is no longer wanted when its width is no longer known, or 0; there are 64 at most.
    """

    def __init__(self, network: RoadNetwork) -> None:
        self._second = _OnceASecond(network, 60 * US_PER_S)
        self._passability = Passability(network)
        self._wanted: dict[str, WantedRoute] = {}
        self._told: dict[str, tuple[int, RouteState]] = {}

    def __call__(
        self, now_us: int, seen: Sample | None, wanted: Sample | None, second: Sample | None
    ) -> list[Sample] | None:
        if wanted is not None:
            self._want(wanted.value)
        valid_us = self._second.take(seen, second)
        if valid_us is None:
            return None
        narrow, speeds = self._second.narrow(), self._second.traffic.speeds(valid_us)
        return [
            Sample(now_us, valid_us, _state(symbol, found))
            for symbol, route in self._wanted.items()
            if self._is_new(symbol, valid_us, found := self._passability.state(route, narrow, speeds))
        ]

    def _is_new(self, symbol: str, valid_us: int, found: RouteState) -> bool:
        """Another way, another reason, or the last report is old."""
        told_us, before = self._told.get(symbol, (None, None))
        is_same = before is not None and _ways_of(found) == _ways_of(before)
        if told_us is not None and is_same and valid_us < told_us + AGAIN_US:
            return False
        self._told[symbol] = valid_us, found
        return True

    def _want(self, value: Value) -> None:
        if not isinstance(value, tuple) or len(value) != len(WANTED_ROUTE.fields):
            return
        symbol, start, goal, width_m = value
        if not _is_finite(width_m) or width_m <= 0.0:
            self._wanted.pop(symbol, None)
            self._told.pop(symbol, None)
        elif symbol in self._wanted or len(self._wanted) < MOST_ROUTES:
            self._wanted[symbol] = WantedRoute(str(start), str(goal), float(width_m))


def _ways_of(found: RouteState) -> tuple[object, str]:
    return None if found.route is None else found.route.links, found.because


def _state(symbol: str, found: RouteState) -> Value:
    if found.route is None:
        return symbol, False, "", NO_VALUE, NO_VALUE, found.because
    links = " ".join(map(way_name, found.route.links))
    return symbol, True, links, found.route.length_m, found.route.time_s, found.because


def _is_finite(number: Any) -> bool:
    return isinstance(number, int | float) and math.isfinite(number)


def seconds(from_us: int) -> Iterator[tuple[int, float]]:
    """Each full second, and how many there were since the beginning of time."""
    valid_us = -(-from_us // US_PER_S) * US_PER_S
    while True:
        yield valid_us, valid_us / US_PER_S
        valid_us += US_PER_S


def yes(from_us: int) -> Iterator[tuple[int, bool]]:
    """A value that becomes true and stays so."""
    yield from_us, True


def _turns(network: RoadNetwork, turn: str, from_us: int) -> Iterator[tuple[int, _Ways]]:
    """(link, crossing, link) of all turns of one kind, by their names."""
    name = network.names
    ways = ((link, *way) for link in network.links for way in network.turns.attributes(link)[turn])
    yield from_us, tuple((name[arrived], name[crossing], name[departed]) for arrived, crossing, departed in ways)


TURNS: Final = {"left_turns": "left", "right_turns": "right", "straights": "straight", "uturns": "uturn"}


def road_units(network: RoadNetwork) -> tuple[Prototype, ...]:
    """Units of the map, `OnMap` ...; sources `seconds`, `yes`, and the turns of 8.7.4, `left_turns` ..."""

    def unit(
        name: str, made: Callable[..., Any], sort: Sort, *inputs: str | Sort, needs_all: bool = False
    ) -> UnitPrototype:
        checked = tuple(each for each in (sort, *inputs) if isinstance(each, Sort) and not each.is_open)
        names = tuple(each.name if isinstance(each, Sort) else each for each in inputs)
        make = partial(_unit, made, network, needs_all)
        return UnitPrototype(name, sort.name, names, make, checked_sorts=checked)

    turns = (SourcePrototype(name, WAYS, partial(_turns, network, turn)) for name, turn in TURNS.items())
    return (
        unit("OnMap", OnMap, replace(SEEN_CAR, is_open=False), OBJECT),
        unit("RelationsOnMap", RelationsOnMap, ROAD_RELATIONS, CAR, CAR, needs_all=True),
        unit("FollowingOnMap", FollowingOnMap, FOLLOWING, CAR, CAR, needs_all=True),
        unit("LinkTraffic", TrafficOnLinks, LINK_TRAFFIC, OBJECT, INSTANT),
        unit("PassableRoutes", PassableRoutes, ROUTE_STATE, OBJECT, WANTED_ROUTE, INSTANT),
        SourcePrototype("seconds", INSTANT.name, seconds, checked_sorts=(INSTANT,)),
        SourcePrototype("yes", "bool", yes),
        *turns,
    )


def _unit(made: Callable[..., Any], network: RoadNetwork, needs_all: bool, **settings: Any) -> UnitFunction:
    return of_samples(made(network, **settings), needs_all=needs_all)
