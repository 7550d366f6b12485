"""Where another unit is, as far as the streams of this platform know."""

from dyknow import NO_VALUE
from dyknow.agents.exchange.gateway import Gateway
from dyknow.agents.places import Fix
from dyknow.model.errors import UnknownLabel, ValueNotAvailable


def fix_of(gateway: Gateway, unit: str) -> Fix | None:
    """Position and, where it is known, velocity of a unit; None where there is no position."""
    try:
        position = gateway.latest("heli-position", unit)
        altitude = gateway.latest("heli-altitude", unit)
    except (ValueNotAvailable, UnknownLabel):
        return None
    if NO_VALUE in (position.value, altitude.value):
        return None
    return Fix(position.valid_us, *position.value, *altitude.value, *_velocity(gateway, unit))


def _velocity(gateway: Gateway, unit: str) -> tuple[float, ...]:
    """North, east, down in m/s, or nothing where it is not known."""
    try:
        value = gateway.latest("heli-velocity", unit).value
    except (ValueNotAvailable, UnknownLabel):
        return ()
    return () if value is NO_VALUE else tuple(value)
