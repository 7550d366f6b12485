"""Positions, altitudes and velocities of objects, so that features are derived of them as of units.

An object state bears a position in fields `latitude_deg` and `longitude_deg`, or in `x_m` (east) and `y_m` (north) of the
frame of all objects; an altitude in `altitude_m`; a velocity in `vx_m_s`, `vy_m_s` (east, north) and, if there is one, `vz_m_s` (up).
"""

from collections.abc import Callable, Mapping
from typing import Final

from dyknow.model.sample import Value
from dyknow.model.values import NO_VALUE, Field, Sort
from dyknow.navigation.geodesy import metres_per_degree
from dyknow.objects.object_streams import View, ViewOf
from dyknow.reasoning.features.derivation import ALTITUDE, POSITION, VELOCITY
from dyknow.reasoning.features.derived_streams import UNPLACED

_POSITION = Sort("position", (Field("latitude_deg", "deg"), Field("longitude_deg", "deg")))
_UNPLACED = Sort(UNPLACED, _POSITION.fields)
"""As if the frame were at 0, 0: right for objects among themselves."""
_ALTITUDE = Sort("altitude", (Field("altitude_m", "m"),))
_VELOCITY = Sort("velocity", (Field("north_m_s", "m/s"), Field("east_m_s", "m/s"), Field("down_m_s", "m/s")))
BORNE: Final[Mapping[str, str]] = {
    POSITION: "x_m and y_m, or latitude_deg and longitude_deg",
    ALTITUDE: "altitude_m",
    VELOCITY: "vx_m_s and vy_m_s",
}
"""The fields of object states that make what features are derived from."""


def quantities(origin: Callable[[], tuple[float, float] | None] = lambda: None) -> Mapping[str, ViewOf]:
    """The quantities of objects that features need; `origin` (latitude, longitude, degrees) is that of their frame."""
    return {POSITION: lambda sort: _position(sort, origin()), ALTITUDE: _altitude, VELOCITY: _velocity}


def lacks(sort: Sort, needs: tuple[str, ...]) -> str:
    """The fields that a feature needs and objects of this sort do not have; empty if it can be derived of them."""
    known = quantities()
    missing = (each for each in needs if each not in known or known[each](sort) is None)
    return "; ".join(BORNE.get(each, each) for each in missing)


def _places(sort: Sort, *names: str) -> tuple[int, ...] | None:
    places = {each.name: at for at, each in enumerate(sort.fields)}
    return tuple(places[name] for name in names) if all(name in places for name in names) else None


def _position(sort: Sort, origin: tuple[float, float] | None) -> tuple[Sort, View] | None:
    geodetic = _places(sort, "latitude_deg", "longitude_deg")
    if geodetic is not None:
        return _POSITION, _of_known(_record, *geodetic)
    local = _places(sort, "x_m", "y_m")
    if local is None:
        return None
    (x, y), (latitude_deg, longitude_deg) = local, origin or (0.0, 0.0)
    north_m, east_m = metres_per_degree(latitude_deg)

    def placed(east: float, north: float) -> Value:
        return latitude_deg + north / north_m, longitude_deg + east / east_m

    return _UNPLACED if origin is None else _POSITION, _of_known(placed, x, y)


def _altitude(sort: Sort) -> tuple[Sort, View] | None:
    found = _places(sort, "altitude_m")
    return None if found is None else (_ALTITUDE, _of_known(_record, *found))


def _velocity(sort: Sort) -> tuple[Sort, View] | None:
    found = _places(sort, "vx_m_s", "vy_m_s")
    if found is None:
        return None
    up = _places(sort, "vz_m_s") or ()
    return _VELOCITY, _of_known(lambda east, north, up=0.0: (north, east, -up), *found, *up)


def _record(*numbers: float) -> Value:
    return numbers


def _of_known(make: Callable[..., Value], *places: int) -> View:
    """A value of the numbers in these places of a state, if they are known."""

    def view(state: Value) -> Value:
        numbers = [state[at] for at in places]
        is_known = all(one is not NO_VALUE and one == one for one in numbers)  # noqa: PLR0124 - a NaN differs from itself
        return make(*numbers) if is_known else NO_VALUE

    return view
