"""Whether another member's vehicle is in the air where a vehicle would land: straight below it, or nearly so.

A member that is known only by its position counts as in the air where it is higher than 3 m above our home, so also on
a roof or a hill; a user looks there before landing anyway.
"""

from collections.abc import Iterable
from typing import Final

from dyknow import NO_VALUE, Value
from dyknow.agents.exchange.gateway import Gateway
from dyknow.agents.places import Fix
from dyknow.model.errors import Refused, UnknownLabel, ValueNotAvailable
from dyknow.navigation.geodesy import distance_m

OCCUPIED: Final = "occupied"
"""The code of the refusal."""
WITHIN_M: Final = 15.0
AIRBORNE_M: Final = 3.0
KNOWN_US: Final = 20_000_000
"""A vehicle that was heard so long ago may still be there."""


def occupied_below(
    gateway: Gateway, units: Iterable[str], own: Fix, home_altitude_m: float | None, now_us: int
) -> Refused | None:
    """The refusal to land from `own`, which names the highest vehicle below it, or None.

    Args:
        gateway: where other units are, as far as this platform's streams know.
        units: the other members.
        own: where the vehicle is.
        home_altitude_m: of its home, above mean sea level; None: every vehicle that is known counts as in the air.
        now_us: federation time.
    """
    below = [
        (height_m, unit, away_m)
        for unit in units
        if unit != gateway.unit and (found := _of(gateway, unit, own, home_altitude_m, now_us)) is not None
        for height_m, away_m in (found,)
    ]
    if not below:
        return None
    height_m, unit, away_m = max(below)
    where = f"{height_m:.0f} m above home" if home_altitude_m is not None else f"at {height_m:.0f} m above the sea"
    return Refused(
        f"{unit} is in the air below, {where}, {away_m:.0f} m away horizontally: landing would go through it; "
        "send one of the two elsewhere first (dyknow delegate goto)",
        OCCUPIED,
    )


def _of(
    gateway: Gateway, unit: str, own: Fix, home_altitude_m: float | None, now_us: int
) -> tuple[float, float] | None:
    """The height of a unit that is in the air below, and how far away it is horizontally, metres."""
    position, altitude = _latest(gateway, "heli-position", unit), _latest(gateway, "heli-altitude", unit)
    if position is None or altitude is None or now_us - position[0] > KNOWN_US:
        return None
    (latitude_deg, longitude_deg), (altitude_m,) = position[1], altitude[1]
    height_m = altitude_m - (home_altitude_m or 0.0)
    away_m = distance_m(own.latitude_deg, own.longitude_deg, latitude_deg, longitude_deg)
    is_airborne = home_altitude_m is None or height_m > AIRBORNE_M
    return (height_m, away_m) if is_airborne and away_m <= WITHIN_M and altitude_m <= own.altitude_m else None


def _latest(gateway: Gateway, label: str, unit: str) -> tuple[int, Value] | None:
    """Valid time and value of the newest sample, or None."""
    try:
        sample = gateway.latest(label, unit)
    except (ValueNotAvailable, UnknownLabel):
        return None
    return None if sample.value is NO_VALUE or NO_VALUE in sample.value else (sample.valid_us, sample.value)
