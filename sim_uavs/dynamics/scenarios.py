"""Named situations: starting points, routes, and the vehicles that would meet. Pure data, near one fixed origin.

Every vehicle stands below the first place of its route; its route begins at a common instant, when it hovers there.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from dyknow.model.errors import TextError
from dyknow.navigation.geodesy import LocalFrame
from dyknow.sim_uavs.dynamics.quadcopter import AirframeLimits, Vector, Wind
from dyknow.sim_uavs.dynamics.routes import Route, circle, hover, patrol, through
from dyknow.sim_uavs.dynamics.settings import HomePlace, PersonaName, VehicleConfig
from dyknow.sim_uavs.dynamics.slung import Thing

ORIGIN = HomePlace(55.7240, 13.4600, 20.0)  # a training area in southern Sweden, flat enough
HEIGHT_M = 40.0
_SPEED_M_S = 6.0
_ACROSS_M = 120.0  # from the start of a leg to where two of them meet
_APART_M = 600.0  # where those fly that are to meet nobody
_SPACING_M = 150.0
_WATCHING_M = 65.0
_BETWEEN_RNG = 11  # keeps the generator of scenarios apart from those of vehicles


class Unit(NamedTuple):
    """One vehicle of a scenario. `home` is on the ground below `route.waypoints[0]`."""

    number: int
    home: HomePlace
    route: Route
    height_m: float
    seed: int

    def vehicle(self, system_id: int, *, persona: PersonaName = "ardupilot", airborne: bool = False) -> VehicleConfig:
        """The vehicle that flies it: on the ground or, `airborne`, hovering at the first place of its route."""
        start_m = self.height_m if airborne else 0.0
        return VehicleConfig(system_id, self.home, persona, airborne_m=start_m, seed=self.seed)


class Meeting(NamedTuple):
    """Two units that, undisturbed, are at `place` at once, `after_us` from the beginning of their routes."""

    units: tuple[int, int]
    place: HomePlace
    after_us: int


class Streets(NamedTuple):
    """Square blocks of streets with traffic on them, beginning at the origin: crossings to the east and to the north.

    Attributes:
        under_trees: crossings that no camera sees from above, by how many blocks they are to the east and to the north.
    """

    across: int
    down: int
    cars: int
    apart_m: float = 80.0
    under_trees: tuple[tuple[int, int], ...] = ()


class Depot(NamedTuple):
    """Boxes and carriers, and the wind that blows over them; vehicles have a winch, and stand on the ground at first."""

    things: tuple[Thing, ...]
    wind: Wind


class SearchField(NamedTuple):
    """A rectangle, metres east and north of the origin, on which persons lie, and things that look like them."""

    west_m: float
    south_m: float
    east_m: float
    north_m: float
    persons: int
    lookalikes: int


class Scenario(NamedTuple):
    """`streets`, `depot`, `field`: the objects for the vehicles' cameras; without any they carry none."""

    name: str
    units: tuple[Unit, ...]
    meetings: tuple[Meeting, ...] = ()
    streets: Streets | None = None
    depot: Depot | None = None
    field: SearchField | None = None
    origin: HomePlace = ORIGIN


_Legs = list[Vector]
_STREETS = Streets(4, 3, 18, under_trees=((2, 1),))
_THINGS = (
    Thing("b1", "box", "red", 0.0, 0.0),
    Thing("b2", "box", "blue", 4.0, 0.0),
    Thing("b3", "box", "yellow", 8.0, 0.0),
    Thing("b4", "box", "green", 12.0, 0.0),
    Thing("c1", "carrier", "white", 0.0, 40.0),
)
_FIELD = SearchField(-145.0, 20.0, 145.0, 205.0, persons=11, lookalikes=12)
"""As large, and with as many persons, as that of thesis 7.1.1."""
_SHADES = ("red", "blue", "yellow", "green")
_SUPPLIES = (
    *(Thing(f"b{at + 1}", "box", _SHADES[at % 4], 4.0 * (at % 6), -6.0 * (at // 6)) for at in range(_FIELD.persons)),
    Thing("c1", "carrier", "white", 32.0, 0.0),
    Thing("c2", "carrier", "white", 32.0, -8.0),
)
_FRAME = LocalFrame(*ORIGIN)
_UP = Vector(0.0, 0.0, -HEIGHT_M)


def scenario(name: str, count: int | None = None, seed: int = 0, origin: HomePlace = ORIGIN) -> Scenario:
    """The situation called `name` with `count` vehicles (None: as many as it is usual with), about `origin`.

    Raises:
        TextError: there is none of that name, or it needs more vehicles.
    """
    found = _SCENARIOS.get(name)
    if found is None:
        raise TextError(f"no scenario is called {name!r}", text=name, width=len(name), repair=", ".join(NAMES))
    build, least, usual = found
    wanted = usual if count is None else count
    if wanted < least:
        raise TextError(
            f"{name} needs {least} vehicles or more, got {wanted}",
            text=name,
            width=len(name),
            repair=f"dyknow up {least} --scenario {name}",
        )
    return _moved(build(name, wanted, seed), origin)


def _moved(found: Scenario, origin: HomePlace) -> Scenario:
    """The same situation elsewhere: every place as far north, east and up of `origin` as it was of ours."""
    if origin == ORIGIN:
        return found
    there = LocalFrame(*origin)

    def moved(place: HomePlace) -> HomePlace:
        return HomePlace(*there.from_ned(*_FRAME.to_ned(*place)))

    units = []
    for unit in found.units:
        route = unit.route._replace(waypoints=tuple(map(moved, unit.route.waypoints)))
        first = route.waypoints[0]
        home = HomePlace(first.latitude_deg, first.longitude_deg, origin.altitude_m)
        units.append(unit._replace(home=home, route=route, height_m=first.altitude_m - origin.altitude_m))
    meetings = tuple(meeting._replace(place=moved(meeting.place)) for meeting in found.meetings)
    return found._replace(units=tuple(units), meetings=meetings, origin=origin)


def _unit(index: int, route: Route, seed: int) -> Unit:
    first = route.waypoints[0]
    home = HomePlace(first.latitude_deg, first.longitude_deg, ORIGIN.altitude_m)
    return Unit(index, home, route, first.altitude_m - ORIGIN.altitude_m, seed)


def _hovering(name: str, count: int, seed: int) -> Scenario:
    """In a row to the east, 150 m apart."""
    points = [_UP.plus(Vector(0.0, index * _SPACING_M, 0.0)) for index in range(count)]
    return Scenario(name, tuple(_unit(i, hover(_FRAME, point), seed) for i, point in enumerate(points)))


def _patrolling(name: str, count: int, seed: int) -> Scenario:
    """Each around a square of its own, 80 m wide, 150 m from the next."""
    corners = [_UP.plus(Vector(0.0, index * _SPACING_M, 0.0)) for index in range(count)]
    routes = [patrol(_FRAME, corner, 80.0, 80.0, _SPEED_M_S) for corner in corners]
    return Scenario(name, tuple(_unit(i, route, seed) for i, route in enumerate(routes)))


def _encountering(name: str, count: int, seed: int) -> Scenario:
    """Two fly towards each other on one line; the others stay apart."""
    north, south = Vector(_ACROSS_M, 0.0, 0.0), Vector(-_ACROSS_M, 0.0, 0.0)
    return _meeting(name, count, seed, ([south, north], [north, south]))


def _crossing(name: str, count: int, seed: int) -> Scenario:
    """One flies north, one flies east, through one point at one height at once; the others stay apart."""
    reach = _ACROSS_M
    northward = [Vector(-reach, 0.0, 0.0), Vector(reach, 0.0, 0.0)]
    eastward = [Vector(0.0, -reach, 0.0), Vector(0.0, reach, 0.0)]
    return _meeting(name, count, seed, (northward, eastward))


def _meeting(name: str, count: int, seed: int, legs: tuple[_Legs, _Legs]) -> Scenario:
    routes = [through(_FRAME, [point.plus(_UP) for point in leg], _SPEED_M_S) for leg in legs]
    for index in range(count - len(legs)):
        corner = _UP.plus(Vector(-40.0, _APART_M + index * _SPACING_M, 0.0))
        routes.append(patrol(_FRAME, corner, 80.0, 80.0, _SPEED_M_S))
    met = Meeting((0, 1), HomePlace(*_FRAME.from_ned(*_UP)), _leg_us(_ACROSS_M, _SPEED_M_S))
    return Scenario(name, tuple(_unit(i, route, seed) for i, route in enumerate(routes)), (met,))


def _watching(name: str, count: int, seed: int) -> Scenario:
    """Each hovers over a crossing, the ones in the middle first; neighbours see some of the same. Those beyond see no streets."""
    across, down, _, apart_m, _ = _STREETS
    columns, rows = max(across, -(-count // down)), range(down)
    middle = (across - 1) / 2.0, (down - 1) / 2.0
    crossings = [(column, row) for column in range(columns) for row in rows]
    crossings.sort(key=lambda each: (max(abs(each[0] - middle[0]), abs(each[1] - middle[1])), each))
    up = Vector(0.0, 0.0, -_WATCHING_M)
    places = [up.plus(Vector(row * apart_m, column * apart_m, 0.0)) for column, row in crossings[:count]]
    units = tuple(_unit(index, hover(_FRAME, place), seed) for index, place in enumerate(places))
    return Scenario(name, units, (), _STREETS)


def _rescuing(name: str, count: int, seed: int) -> Scenario:
    """As for logistics, with a box for each person, next to the field on which the persons lie."""
    found = _delivering(name, count, seed)
    assert found.depot is not None  # noqa: S101 - that is what it is
    return found._replace(depot=found.depot._replace(things=_SUPPLIES), field=_FIELD)


def _delivering(name: str, count: int, seed: int) -> Scenario:
    """In a row to the west of boxes and carriers, 30 m apart; the seed draws the wind."""
    rng = np.random.default_rng((seed, _BETWEEN_RNG))
    angle, speed = rng.uniform(0.0, 6.283), rng.uniform(1.0, 4.0)
    wind = Wind(float(speed * np.cos(angle)), float(speed * np.sin(angle)), 0.4)
    places = [Vector(-10.0, -20.0 - index * 30.0, 0.0) for index in range(count)]
    units = tuple(_unit(index, hover(_FRAME, place), seed) for index, place in enumerate(places))
    return Scenario(name, units, depot=Depot(_THINGS, wind))


def _leg_us(distance_m: float, speed_m_s: float) -> int:
    """How long the beginning of a leg takes from a hover: s / v, and v / 2a + a tau^2 / 2v lost in speeding up."""
    limits = AirframeLimits()
    acceleration = limits.acceleration_m_s2
    lag_s = speed_m_s / (2.0 * acceleration) + acceleration * limits.response_s**2 / (2.0 * speed_m_s)
    return round((distance_m / speed_m_s + lag_s) * 1e6)


def _swarming(name: str, count: int, seed: int) -> Scenario:
    """Each on a circle of its own, in a grid 150 m apart, from a direction and at a speed that the seed draws."""
    rng = np.random.default_rng((seed, _BETWEEN_RNG))
    columns = max(1, round(count**0.5))
    units = []
    for index in range(count):
        row, column = divmod(index, columns)
        centre = _UP.plus(Vector(row * _SPACING_M, column * _SPACING_M, 0.0))
        angle, speed = rng.uniform(0.0, 6.283), rng.uniform(4.0, 8.0)
        route = circle(_FRAME, centre, 40.0, round(speed, 2), from_rad=float(angle))
        units.append(_unit(index, route, seed))
    return Scenario(name, tuple(units))


_SCENARIOS: dict[str, tuple[Callable[[str, int, int], Scenario], int, int]] = {
    "crossing": (_crossing, 2, 3),
    "emergency": (_rescuing, 1, 2),
    "encounter": (_encountering, 2, 3),
    "hover": (_hovering, 1, 3),
    "logistics": (_delivering, 1, 2),
    "patrol": (_patrolling, 1, 3),
    "swarm": (_swarming, 1, 8),
    "traffic": (_watching, 1, 2),
}
NAMES = tuple(_SCENARIOS)
